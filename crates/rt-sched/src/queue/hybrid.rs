//! Static lists, geometric launches, stealing.

use super::ledger::Ledger;
use super::slots::Slots;
use super::{Pop, TaskQueue};
use crate::Schedule;
use crate::policy::{seconds, total};
use alloc::boxed::Box;
use alloc::vec::Vec;
use core::ops::Range;
use rt_core::{CostModel, TaskId, Work};

/// Share of a device's remaining predicted seconds that its next launch takes, without a unit.
///
/// Launches shrink geometrically, about `log(tasks per device) / log(3/2)` of them. With two launches in flight 5/9 of a
/// list are committed before anything is known; with a half it would be 3/4, and from 0.7 on too little is left to mend
/// bad estimates (simulated: 8 devices, 1,024 tasks, error 30%, excess 0.67, 1.2 and 2.5%; with one launch in flight 0.51,
/// 0.47 and 0.85%). Smaller shares only add launches.
const LAUNCH_SHARE: f64 = 1.0 / 3.0;

/// Share of a task that must lie within a thief's fair share for the thief to take it, without a unit.
///
/// A half would be the nearest whole task, but the victim is also busy with launches that are no longer in its list,
/// so less is fair; and equal devices, whose calibrated speeds differ by a little, must not refuse each other's last
/// task. With a quarter, a device takes the last task of one that is up to three times as fast.
const NEAREST: f64 = 0.25;

/// Hybrid queues: each device works through its own list in shrinking launches, and steals when it runs dry.
///
/// After A. Heirich and J. Arvo, *A Competitive Analysis of Load Balancing Strategies for Parallel Ray Tracing*
/// (1998), who start from a static assignment and correct it while it runs. A launch takes about a third of the device's
/// remaining predicted seconds, but no less than a launch costs. An idle device steals from the one with most
/// predicted seconds left, from the end of its list, where an LPT list has its smallest tasks: as much, in whole
/// tasks, as makes both end together at their predicted speeds. So a slow device never takes the last task of a much
/// faster one. What a lost device leaves behind goes to whoever is idle.
#[derive(Debug)]
pub struct HybridQueue {
    slots: Slots,
    ledger: Ledger,
    /// Predicted seconds of all tasks before each position of the slots, on the device whose list it is in.
    before: Box<[f64]>,
    devices: Box<[Pace]>,
}

/// What a queue needs to know of a device.
#[derive(Debug)]
struct Pace {
    /// Streams per second, if the device ran the whole stream.
    speed: f64,
    /// Seconds per launch.
    launch: f64,
}

impl HybridQueue {
    /// Queues with the lists of `schedule`, which was made for this work and these devices.
    ///
    /// Lists should be sorted dearest task first, as those of [`Lpt`](crate::policy::Lpt) are.
    #[must_use]
    pub fn new(schedule: &Schedule, work: &[Work], devices: &[CostModel]) -> Self {
        let model = |device: usize| devices.get(device).copied().unwrap_or_default();
        let mut sum = 0.0;
        let mut before = Vec::with_capacity(schedule.tasks() + 1);
        before.push(sum);
        for (device, list) in schedule.lists().iter().enumerate() {
            for &task in list {
                sum += work.get(task as usize).map_or(0.0, |w| model(device).seconds(w));
                before.push(sum);
            }
        }
        let sum = total(work);
        let pace = |device| {
            let d = model(device);
            let seconds = seconds(&d.per_part(), &sum);
            Pace { speed: if seconds > 0.0 { 1.0 / seconds } else { 1.0 }, launch: d.per_launch() }
        };
        Self {
            slots: Slots::new(schedule),
            ledger: Ledger::new(schedule.tasks(), schedule.lists().len()),
            before: before.into(),
            devices: (0..schedule.lists().len()).map(pace).collect(),
        }
    }

    /// Predicted seconds of `range`, on the device that it was first dealt to.
    fn seconds(&self, range: &Range<u32>) -> f64 {
        self.before[range.end as usize] - self.before[range.start as usize]
    }

    /// Number of tasks that the next launch takes from the front of `range`, which is not empty.
    fn launch_size(&self, device: usize, range: &Range<u32>) -> u32 {
        let (start, end) = (range.start as usize, range.end as usize);
        let base = self.before[start];
        let share = base + LAUNCH_SHARE * (self.before[end] - base);
        let worthwhile = base + self.devices[device].launch;
        let ends = &self.before[start + 1..=end];
        let count = ends.partition_point(|&s| s <= share).max(ends.partition_point(|&s| s < worthwhile) + 1);
        count.min(end - start) as u32
    }

    /// Number of tasks that `thief` may take from the back of `range`, which is reserved for `victim`.
    fn loot(&self, thief: usize, victim: usize, range: &Range<u32>) -> u32 {
        if self.ledger.is_retired(victim) {
            return range.end - range.start;
        }
        let [thief, victim] = [thief, victim].map(|d| self.devices[d].speed);
        let fair = self.seconds(range) * thief / (thief + victim);
        let (start, end) = (range.start as usize, range.end as usize);
        let all = self.before[end];
        let whole = start + self.before[start..end].partition_point(|&s| all - s > fair);
        let more = whole > start && {
            let next = self.before[whole] - self.before[whole - 1];
            all - self.before[whole] + NEAREST * next <= fair
        };
        (end - whole) as u32 + u32::from(more)
    }

    /// Takes a share of the tasks of the device that has most left.
    fn steal(&self, thief: usize) -> Option<Range<u32>> {
        loop {
            let mut best: Option<(f64, usize, Range<u32>, u32)> = None;
            for victim in 0..self.slots.len() {
                let range = self.slots.range(victim);
                let seconds = self.seconds(&range);
                if range.is_empty() || best.as_ref().is_some_and(|(most, ..)| seconds <= *most) {
                    continue;
                }
                let count = self.loot(thief, victim, &range);
                if count > 0 {
                    best = Some((seconds, victim, range, count));
                }
            }
            let (_, victim, range, count) = best?;
            if let Some(taken) = self.slots.take_back(victim, &range, count) {
                return Some(taken);
            }
            // The victim or another thief was faster: look again.
        }
    }

    /// Claims the positions of the next launch, from the device's own range or another's.
    fn claim(&self, device: usize) -> Range<u32> {
        let Some(stolen) = self.steal(device) else { return 0..0 };
        let cut = stolen.start + self.launch_size(device, &stolen);
        // The rest becomes the device's own, where others can steal it in turn. If another thread has just refilled
        // this device, all of it is launched.
        if cut < stolen.end && self.slots.refill(device, &(cut..stolen.end)) { stolen.start..cut } else { stolen }
    }
}

impl TaskQueue for HybridQueue {
    fn pop(&self, device: usize, out: &mut Vec<TaskId>) -> Pop {
        out.clear();
        if self.ledger.is_retired(device) {
            return Pop::Done;
        }
        let own = self.slots.take_front(device, |range| self.launch_size(device, &range));
        out.extend_from_slice(self.slots.tasks(own));
        // Orphans are counted, not priced: half of an equal share, as S. Flynn Hummel, E. Schonberg and L. Flynn,
        // *Factoring* (1992) deal iterations of unknown cost.
        if out.is_empty() && !self.ledger.adopt(|orphans| orphans.div_ceil(2 * self.ledger.alive().max(1)), out) {
            out.extend_from_slice(self.slots.tasks(self.claim(device)));
            if out.is_empty() {
                return self.ledger.idle();
            }
        }
        self.ledger.hand_out(device, out);
        Pop::Launch
    }

    fn finish(&self, device: usize, tasks: &[TaskId]) {
        self.ledger.finish(device, tasks);
    }

    fn retire(&self, device: usize, unfinished: &[TaskId]) {
        // What is reserved for the device stays in its slot, from where others now steal all of it.
        self.ledger.retire(device, unfinished);
    }

    fn unfinished_tasks(&self) -> Vec<TaskId> {
        self.ledger.unfinished_tasks()
    }
}
