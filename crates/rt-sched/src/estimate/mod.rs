//! Cost estimators: what the tasks of a stream are expected to cost.
//!
//! | estimator | what it asks of the devices |
//! |---|---|
//! | [`Uniform`] | nothing: every ray costs the same |
//! | [`Sampled`] "exact" | full traversal of a sample, whose hits are kept |
//! | [`Sampled`] "reduced" | reduced traversal of a sample, as in the paper |
//! | [`History`] | nothing, once a stream of the same kind was traced |

mod history;
mod sampled;
#[cfg(test)]
mod tests;

pub use history::History;
pub use sampled::{Sampled, interval_95};

use rt_core::{CostEstimator, Observation, RayStream, Step, Work};

/// Every ray costs the same: the estimate that asks nothing, and what the paper compares with.
///
/// A task's work is its rays, with one box test each so that every cost model prices it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Uniform;

impl CostEstimator for Uniform {
    fn name(&self) -> &'static str {
        "uniform"
    }

    fn next(&mut self, stream: RayStream<'_>, _: Observation<'_>) -> Step {
        let work = stream.tasks.iter().map(|task| Work::new(task.rays as f32, task.rays as f32, 0.0));
        Step::Done(work.collect())
    }

    fn counts_tests(&self) -> bool {
        false
    }
}
