//! One queue for all devices.

use super::atomics::{AtomicU32, Ordering};
use super::ledger::Ledger;
use super::{Pop, TaskQueue};
use crate::Schedule;
use crate::policy::{mean_model, most_expensive_first, seconds};
use alloc::boxed::Box;
use alloc::vec::Vec;
use rt_core::{CostModel, TaskId, Work};

/// A central queue: whoever is free takes the most expensive task that is left, one task per launch.
///
/// Tasks are sorted by decreasing mean seconds over the devices, ties by number, so uniform work comes first in first
/// out. Balances best where tasks are few, and pays one launch for each.
#[derive(Debug)]
pub struct CentralQueue {
    order: Box<[TaskId]>,
    next: AtomicU32,
    ledger: Ledger,
}

impl CentralQueue {
    /// A queue of all tasks of `work` for `devices`.
    #[must_use]
    pub fn new(work: &[Work], devices: &[CostModel]) -> Self {
        let mean = mean_model(devices);
        let ranking = most_expensive_first(work.iter().map(|w| seconds(&mean, &w.parts())));
        Self::with_order(ranking.order.into_iter().map(|ranked| ranked.task()).collect(), devices.len())
    }

    /// A queue of the tasks of `schedule`, one list after the other, for so many `devices`.
    #[must_use]
    pub fn in_order(schedule: &Schedule, devices: usize) -> Self {
        Self::with_order(schedule.lists().iter().flatten().copied().collect(), devices)
    }

    fn with_order(order: Box<[TaskId]>, devices: usize) -> Self {
        Self { next: AtomicU32::new(0), ledger: Ledger::new(order.len(), devices), order }
    }
}

impl TaskQueue for CentralQueue {
    fn pop(&self, device: usize, out: &mut Vec<TaskId>) -> Pop {
        out.clear();
        if self.ledger.is_retired(device) {
            return Pop::Done;
        }
        // Bounded, so that devices that ask again and again cannot wrap the counter.
        let advance = |next| ((next as usize) < self.order.len()).then(|| next + 1);
        match self.next.fetch_update(Ordering::AcqRel, Ordering::Acquire, advance) {
            Ok(next) => out.push(self.order[next as usize]),
            Err(_) => {
                if !self.ledger.adopt(|_| 1, out) {
                    return self.ledger.idle();
                }
            }
        }
        self.ledger.hand_out(device, out);
        Pop::Launch
    }

    fn finish(&self, device: usize, tasks: &[TaskId]) {
        self.ledger.finish(device, tasks);
    }

    fn retire(&self, device: usize, unfinished: &[TaskId]) {
        self.ledger.retire(device, unfinished);
    }

    fn readmit(&self, device: usize) {
        self.ledger.readmit(device);
    }

    fn unfinished_tasks(&self) -> Vec<TaskId> {
        self.ledger.unfinished_tasks()
    }
}
