//! Static distributed queues.

use super::ledger::Ledger;
use super::slots::Slots;
use super::{Pop, TaskQueue};
use crate::Schedule;
use alloc::vec::Vec;
use rt_core::TaskId;

/// Static distributed queues: each device gets its whole list in one launch.
///
/// Nothing moves while devices run: fewest launches, and no remedy when the estimate was wrong. The list of a lost
/// device is dealt among the others as they run out: each takes an equal share of what is then left.
#[derive(Debug)]
pub struct StaticQueue {
    slots: Slots,
    ledger: Ledger,
}

impl StaticQueue {
    /// Queues with the lists of `schedule`.
    #[must_use]
    pub fn new(schedule: &Schedule) -> Self {
        Self { slots: Slots::new(schedule.lists()), ledger: Ledger::new(schedule.tasks(), schedule.lists().len()) }
    }
}

impl TaskQueue for StaticQueue {
    fn pop(&self, device: usize, out: &mut Vec<TaskId>) -> Pop {
        out.clear();
        if self.ledger.is_retired(device) {
            return Pop::Done;
        }
        let all = self.slots.take_front(device, |range| range.end - range.start);
        out.extend_from_slice(self.slots.tasks(all));
        if out.is_empty() && !self.ledger.adopt(|orphans| orphans.div_ceil(self.ledger.alive().max(1)), out) {
            return self.ledger.idle();
        }
        self.ledger.hand_out(device, out);
        Pop::Launch
    }

    fn finish(&self, device: usize, tasks: &[TaskId]) {
        self.ledger.finish(device, tasks);
    }

    fn retire(&self, device: usize, unfinished: &[TaskId]) {
        self.ledger.retire(device, unfinished);
        if device < self.slots.len() {
            let all = self.slots.take_front(device, |range| range.end - range.start);
            for &task in self.slots.tasks(all) {
                self.ledger.orphan(task);
            }
        }
    }

    fn readmit(&self, device: usize) {
        self.ledger.readmit(device);
    }

    fn unfinished_tasks(&self) -> Vec<TaskId> {
        self.ledger.unfinished_tasks()
    }
}
