//! Cost estimators: what the tasks of a stream are expected to cost.
//!
//! | estimator | source | what it asks of the devices |
//! |---|---|---|
//! | [`Uniform`] | the paper's regular tasks | nothing: every ray costs the same |
//! | [`Sampled`] "exact" | sampling without replacement; empirical Bayes where rays are incoherent | full traversal of a sample, whose hits are kept |
//! | [`Sampled`] "reduced…" | M. Rincón-Nigro and Z. Deng (2013) | reduced traversal of a sample, whose rays are traced again |
//! | [`History`] | Blender Cycles | nothing, once a stream of the same kind was traced |
//! | [`Auto`] | – | nothing where there is a past; two samples of each task where they win more than they cost |
//!
//! Those that are only tried, since they cost more than they win, are in rt-lab; they are made of [`batch`] and
//! [`price`], as any other can be.
//!
//! Every estimate carries the standard error of its number of tests where that is known; [`interval_95`] makes an
//! interval of it. That is the error against *counts*. How well counts predict time is another question, answered by
//! [`crate::calibrate`].

mod auto;
pub mod batch;
mod history;
mod neighbours;
pub mod price;
mod sampled;
#[cfg(test)]
mod tests;

pub use auto::Auto;
pub use history::History;
pub use sampled::{Sampled, interval_95};

use alloc::vec::Vec;
use rt_core::{CostEstimator, Observation, RayStream, Step, Task, Walk, Work};

/// One box test for each ray, and nothing beside: what a ray takes is then that test's price.
fn uniform(tasks: &[Task]) -> Vec<Work> {
    tasks.iter().map(|task| Work::new(0.0, task.rays as f32, 0.0)).collect()
}

/// Every ray costs the same: the estimate that asks nothing, and what the paper compares with.
///
/// A task's work is a box test for each of its rays, so streams that were traced with it tell how fast devices are.
#[derive(Clone, Copy, Debug, Default)]
pub struct Uniform;

impl CostEstimator for Uniform {
    fn name(&self) -> &'static str {
        "uniform"
    }

    fn walk(&self) -> Option<Walk> {
        None
    }

    fn next(&mut self, stream: RayStream<'_>, _: Observation<'_>) -> Step {
        Step::Done(uniform(stream.tasks))
    }

    fn counts_tests(&self) -> bool {
        false
    }
}
