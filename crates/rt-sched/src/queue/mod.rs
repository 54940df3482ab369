//! Task queues: which tasks a device gets in its next launch.
//!
//! The paper's finding sits in one signature: [`TaskQueue::pop`] says how many tasks a launch gets. Static
//! distributed queues hand over a whole list at once, a central queue one task, hybrid queues a geometric share.
//!
//! # What every queue guarantees
//! Under any interleaving of calls from any threads:
//! * a task is in at most one launch that was popped and neither finished nor given up: exactly once, if no device is
//!   lost;
//! * a task is finished at most once, and only by the device that holds it: a late `finish` of a lost device whose
//!   tasks went to others is ignored;
//! * [`Pop::Done`] is said to a device that is not retired only when every task is finished, and all that was
//!   written before those `finish` calls is then visible;
//! * no call blocks or spins: a call that finds its word changed by another starts over, so some call always gets
//!   through (lock-free). No call panics; devices and tasks that do not exist are ignored or told `Done`.
//!
//! Queues own no thread and no clock; a caller that has one tells what launches took. What a caller owes them: every
//! task of a launch is in the end named in `finish` or in `retire`, and a device told [`Pop::Wait`] asks again after
//! the next `finish` or `retire` of any device.
//! The driver of rt-balance calls from one thread; others may call from one for each device.

mod atomics;
mod central;
mod fixed;
mod hybrid;
#[cfg(all(test, loom))]
mod interleavings;
mod ledger;
mod maker;
mod overview;
mod pace;
mod slots;
#[cfg(all(test, not(loom)))]
mod tests;
mod timed;

pub use central::CentralQueue;
pub use fixed::StaticQueue;
pub use hybrid::HybridQueue;
pub use maker::{Dealt, Needs, QueueKind, QueueMaker};

use alloc::vec::Vec;
use core::fmt::Debug;
use rt_core::TaskId;

/// What a device should do next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pop {
    /// Launch the tasks that were handed out; there is at least one.
    Launch,
    /// Nothing to launch now, but other devices still hold unfinished tasks: ask again after the next
    /// [`TaskQueue::finish`] or [`TaskQueue::retire`], which may free some.
    Wait,
    /// Stop: every task is finished, or this device is retired.
    Done,
}

/// Hands out the tasks of one stream, launch by launch.
pub trait TaskQueue: Debug + Send + Sync {
    /// Replaces the contents of `out` by the tasks of the device's next launch, in the order to be run; empty unless
    /// the answer is [`Pop::Launch`]. May be called while earlier launches of the device still run.
    fn pop(&self, device: usize, out: &mut Vec<TaskId>) -> Pop;

    /// Says that the hits of `tasks`, popped by `device`, are on the host.
    fn finish(&self, device: usize, tasks: &[TaskId]);

    /// Says, before [`TaskQueue::finish`], for how many seconds `device` was busy with the launch of `tasks`: its tasks
    /// and what the launch costs the device beside them, not what the host does meanwhile.
    ///
    /// A queue that leaves this out learns from the order of events alone.
    fn took(&self, device: usize, tasks: &[TaskId], seconds: f64) {
        let _ = (device, tasks, seconds);
    }

    /// Says that `device` is lost, or so late that it may be, and will perhaps finish none of `unfinished`.
    ///
    /// Those tasks, and all that was still reserved for the device, go to the others; popped tasks that are not named
    /// stay with it and can still be finished. From now on the device is told [`Pop::Done`]. May be called again,
    /// with tasks of a `pop` that overlapped the first call.
    fn retire(&self, device: usize, unfinished: &[TaskId]);

    /// Says that a retired device is back: it was late, not lost. What it had in flight may have been handed out again;
    /// from now on it may pop again.
    ///
    /// A queue that leaves this out gives the device nothing more, which costs speed and no result.
    fn readmit(&self, device: usize) {
        let _ = device;
    }

    /// Tasks that are not finished, in increasing order: after all devices were told [`Pop::Done`], what a run whose
    /// devices were all lost has left over.
    fn unfinished_tasks(&self) -> Vec<TaskId>;
}
