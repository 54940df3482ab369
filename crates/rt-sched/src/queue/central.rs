//! One queue for all devices.

use super::atomics::{AtomicU32, Ordering};
use super::ledger::Ledger;
use super::pace::Paces;
use super::{Pop, TaskQueue};
use crate::Schedule;
use crate::policy::{mean_model, most_expensive_first, seconds};
use alloc::boxed::Box;
use alloc::vec::Vec;
use rt_core::{CostModel, TaskId, Work};

/// A central queue: whoever is free takes the most expensive task that is left, one task per launch.
///
/// Tasks are sorted by decreasing mean seconds over the devices, ties by number, so uniform work comes first in first
/// out. A device leaves to a faster one what that ends sooner even after all else, and takes no second launch when one
/// lasts until all will be done. Balances best where tasks are few, and pays one launch for each.
#[derive(Debug)]
pub struct CentralQueue {
    order: Box<[TaskId]>,
    next: AtomicU32,
    ledger: Ledger,
    paces: Paces,
}

impl CentralQueue {
    /// A queue of all tasks of `work` for `devices`.
    #[must_use]
    pub fn new(work: &[Work], devices: &[CostModel]) -> Self {
        let mean = mean_model(devices);
        let ranking = most_expensive_first(work.iter().map(|w| seconds(&mean, &w.parts())));
        Self::with_order(ranking.order.into_iter().map(|ranked| ranked.task()).collect(), work, devices)
    }

    /// A queue of the tasks of `schedule`, one list after the other, which are those of `work`, for `devices`.
    #[must_use]
    pub fn in_order(schedule: &Schedule, work: &[Work], devices: &[CostModel]) -> Self {
        Self::with_order(schedule.lists().iter().flatten().copied().collect(), work, devices)
    }

    fn with_order(order: Box<[TaskId]>, work: &[Work], devices: &[CostModel]) -> Self {
        let ledger = Ledger::new(order.len(), devices.len());
        Self { next: AtomicU32::new(0), ledger, paces: Paces::new(work, devices, |_| 0), order }
    }

    /// Fills `out` with the next task.
    fn take(&self, out: &mut Vec<TaskId>) {
        // Bounded, so that devices that ask again and again cannot wrap the counter.
        let advance = |next| ((next as usize) < self.order.len()).then(|| next + 1);
        match self.next.fetch_update(Ordering::AcqRel, Ordering::Acquire, advance) {
            Ok(next) => out.push(self.order[next as usize]),
            Err(_) => {
                self.ledger.adopt(|_| 1, out);
            }
        }
    }
}

impl TaskQueue for CentralQueue {
    fn pop(&self, device: usize, out: &mut Vec<TaskId>) -> Pop {
        out.clear();
        if self.ledger.is_retired(device) {
            return Pop::Done;
        }
        let next = self.order.get(self.next.load(Ordering::Acquire) as usize).copied();
        if self.paces.may_take(device, next, 0.0, &self.ledger) {
            self.take(out);
        }
        if out.is_empty() {
            self.paces.wait(device);
            if self.paces.do_all_wait(&self.ledger) {
                self.take(out);
            }
            if out.is_empty() {
                return self.ledger.idle();
            }
        }
        self.paces.launch(device, out);
        self.ledger.hand_out(device, out);
        Pop::Launch
    }

    fn finish(&self, device: usize, tasks: &[TaskId]) {
        self.paces.finish(device, tasks);
        self.ledger.finish(device, tasks);
    }

    fn retire(&self, device: usize, unfinished: &[TaskId]) {
        self.paces.give_up(device, unfinished);
        self.ledger.retire(device, unfinished);
    }

    fn readmit(&self, device: usize) {
        self.ledger.readmit(device);
    }

    fn unfinished_tasks(&self) -> Vec<TaskId> {
        self.ledger.unfinished_tasks()
    }
}
