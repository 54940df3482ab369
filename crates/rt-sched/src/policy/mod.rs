//! Policies: how the tasks of a stream are dealt to devices before anything runs.

mod loads;
mod lpt;
mod permuted;
mod price;
mod rank;

pub use lpt::Lpt;
pub use permuted::PermutedRegions;
pub(crate) use permuted::spread;
pub(crate) use price::{mean_model, seconds, speed, total};
pub(crate) use rank::most_expensive_first;

use crate::Schedule;
use crate::schedule::list_seconds;
use alloc::vec::Vec;
use core::fmt::Debug;
use rt_core::{CostModel, TaskId, Work};

/// Deals tasks to devices.
///
/// Total and deterministic: work and cost models are valid by construction, so there is a schedule for every input,
/// and always the same one. With no devices it has no lists and places no task.
pub trait Policy: Debug + Send + Sync {
    /// Short name for reports, such as `"lpt"`.
    fn name(&self) -> &'static str;

    /// Deals every task of `work` to one of `devices`.
    fn schedule(&self, work: &[Work], devices: &[CostModel]) -> Schedule;
}

/// Contiguous blocks of equal task count, in stream order: what needs no estimate and no thought.
///
/// Cost is spatially correlated, so a device may get all of the expensive part; it ignores speeds, too.
#[derive(Clone, Copy, Debug, Default)]
pub struct Block;

impl Policy for Block {
    fn name(&self) -> &'static str {
        "block"
    }

    fn schedule(&self, work: &[Work], devices: &[CostModel]) -> Schedule {
        let (n, m) = (work.len(), devices.len());
        let lists = (0..m).map(|d| (n * d / m..n * (d + 1) / m).map(|task| task as TaskId).collect());
        dealt(lists.collect(), work, devices)
    }
}

/// Task `i` to device `i mod m`: fine interleaving, the honest rival of every estimate where tasks are many and
/// devices equal. Ignores speeds.
#[derive(Clone, Copy, Debug, Default)]
pub struct RoundRobin;

impl Policy for RoundRobin {
    fn name(&self) -> &'static str {
        "round-robin"
    }

    fn schedule(&self, work: &[Work], devices: &[CostModel]) -> Schedule {
        let m = devices.len();
        let lists = (0..m).map(|d| (d..work.len()).step_by(m).map(|task| task as TaskId).collect());
        dealt(lists.collect(), work, devices)
    }
}

fn dealt(lists: Vec<Vec<TaskId>>, work: &[Work], devices: &[CostModel]) -> Schedule {
    let seconds = lists.iter().zip(devices).map(|(list, model)| list_seconds(list, work, model)).collect();
    Schedule::from_parts(lists, seconds, work.len())
}
