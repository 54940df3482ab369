//! Static lists, geometric launches, stealing.

use super::ledger::Ledger;
use super::slots::Slots;
use super::{Pop, TaskQueue};
use crate::Schedule;
use crate::policy::{seconds, total};
use alloc::boxed::Box;
use alloc::vec::Vec;
use core::ops::Range;
// Not one of `atomics`, whose every order loom tries: it decides only how many tasks a launch takes, not whose they
// are.
use core::sync::atomic::{AtomicU32, Ordering};
use rt_core::{CostModel, TaskId, Work};

/// Share of a device's remaining predicted seconds that its next launch takes, without a unit.
///
/// Launches shrink geometrically, about `log(tasks per device) / log(3/2)` of them. With two launches in flight 5/9 of
/// a list are committed before anything is known; with a half it would be 3/4, and from 0.7 on too little is left to
/// mend bad estimates (simulated: 8 devices, 1,024 tasks, error 30%, excess 0.67, 1.2 and 2.5%; with one launch in
/// flight 0.51, 0.47 and 0.85%). Smaller shares only add launches.
const LAUNCH_SHARE: f64 = 1.0 / 3.0;

/// Share of the stream that predicted speeds count for beside what devices have finished, and share of its list that a
/// device's first launches take, without a unit.
///
/// Speeds are predicted from few samples or from other streams, and may be wrong by a factor. A device that is a
/// twentieth as fast as was thought would be alone with its first launches at the end. Simulated, 8,192 tasks, one of
/// three devices 5 times slower beside the others than predicted: excess 102% without this, 0.5% with it; 20 times
/// slower: 654 and 4%, and with 1/64 39%. It costs some eight launches more.
const PRIOR: f64 = 1.0 / 256.0;

/// Tasks of equal work that stay together: 128 × 128 pixels of tasks of 1,024 rays. With 4, bounces took 10% longer on
/// a processor.
const NEIGHBOURS: usize = 16;

/// By how much what a device has in flight may exceed what it has finished, in units of that.
const GROWTH: f64 = 0.5;

/// Share of a task that must lie within a thief's fair share for the thief to take it, without a unit.
///
/// A half would be the nearest whole task, but the victim is also busy with launches that are no longer in its list,
/// so less is fair; and equal devices, whose calibrated speeds differ by a little, must not refuse each other's last
/// task. With a quarter, a device takes the last task of one that is up to three times as fast.
const NEAREST: f64 = 0.25;

/// Hybrid queues: each device works through its own list in shrinking launches, and steals when it runs dry.
///
/// After A. Heirich and J. Arvo, *A Competitive Analysis of Load Balancing Strategies for Parallel Ray Tracing* (1998),
/// who start from a static assignment and correct it while it runs. Speeds are predicted first; then what each device
/// has finished tells them, since all began together. A launch takes about a third of the device's list, or of its fair
/// share of all that is left where that is less, begins small and grows with what the device has finished, but is no
/// less than a launch costs. An idle device steals from the one with most predicted seconds left, from the end of its
/// list, where an LPT list has its smallest tasks: as much, in whole tasks, as makes both end together. So a slow
/// device never takes the last task of a much faster one. What a lost device leaves behind goes to whoever is idle.
#[derive(Debug)]
pub struct HybridQueue {
    slots: Slots,
    ledger: Ledger,
    /// Predicted seconds of all tasks before each position of the slots, on the device whose list it is in.
    before: Box<[f64]>,
    /// For each task its share of the stream.
    shares: Box<[f32]>,
    devices: Box<[Pace]>,
}

/// A list in which tasks of equal work come in an order of which every stretch is from all over the picture: nothing is
/// known of them, so a launch of neighbours may be several times as expensive as another, and says nothing of a
/// device's speed.
///
/// Neighbouring tasks stay together by [`NEIGHBOURS`], for the caches; those groups come in the order of the radical
/// inverse of J. van der Corput (1935).
fn spread(list: &[TaskId], work: &[Work]) -> Vec<TaskId> {
    let of = |task: TaskId| work.get(task as usize);
    let mut out = Vec::with_capacity(list.len());
    for alike in list.chunk_by(|&a, &b| of(a) == of(b)) {
        let groups = alike.len().div_ceil(NEIGHBOURS);
        let bits = groups.next_power_of_two().trailing_zeros();
        let reversed = |i: usize| if bits == 0 { i } else { i.reverse_bits() >> (usize::BITS - bits) };
        let places = (0..groups.next_power_of_two()).map(reversed).filter(|&place| place < groups);
        out.extend(places.flat_map(|place| alike.iter().skip(place * NEIGHBOURS).take(NEIGHBOURS)));
    }
    out
}

/// What a queue needs to know of a device.
#[derive(Debug)]
struct Pace {
    /// Streams per second, if the device ran the whole stream.
    speed: f64,
    /// Seconds per launch.
    launch: f64,
    /// Share of the stream that it would do, were all as fast as predicted.
    predicted: f64,
    /// Share of the stream that it has finished, in units of 2⁻³¹.
    done: AtomicU32,
}

/// The unit of [`Pace::done`]: sums of shares that are a little more than 1 together do not overflow.
const UNIT: f64 = 1.0 / (1_u32 << 31) as f64;

impl Pace {
    fn done(&self) -> f64 {
        f64::from(self.done.load(Ordering::Relaxed)) * UNIT
    }

    /// How fast it is beside others, in no unit: what it finished since all began, and a little of what was predicted.
    fn speed_found(&self) -> f64 {
        self.done() + PRIOR * self.predicted
    }
}

impl HybridQueue {
    /// Queues with the lists of `schedule`, which was made for this work and these devices.
    ///
    /// Lists should be sorted most expensive task first, as those of [`Lpt`](crate::policy::Lpt) are.
    #[must_use]
    pub fn new(schedule: &Schedule, work: &[Work], devices: &[CostModel]) -> Self {
        let model = |device: usize| devices.get(device).copied().unwrap_or_default();
        let mut sum = 0.0;
        let mut before = Vec::with_capacity(schedule.tasks() + 1);
        before.push(sum);
        let lists: Vec<Vec<TaskId>> = schedule.lists().iter().map(|list| spread(list, work)).collect();
        for (device, list) in lists.iter().enumerate() {
            for &task in list {
                sum += work.get(task as usize).map_or(0.0, |w| model(device).seconds(w));
                before.push(sum);
            }
        }
        let sum = total(work);
        let pace = |device| {
            let d = model(device);
            let seconds = seconds(&d.per_part(), &sum);
            let speed = if seconds > 0.0 { 1.0 / seconds } else { 1.0 };
            Pace { speed, launch: d.per_launch(), predicted: 0.0, done: AtomicU32::new(0) }
        };
        let mut devices: Vec<Pace> = (0..lists.len()).map(pace).collect();
        let together: f64 = devices.iter().map(|pace| pace.speed).sum();
        devices.iter_mut().for_each(|pace| pace.predicted = pace.speed / together);
        let mut shares = alloc::vec![0.0; schedule.tasks()];
        let owners = lists.iter().zip(&devices).flat_map(|(list, pace)| list.iter().map(move |task| (task, pace)));
        for ((&task, pace), ends) in owners.zip(before.windows(2)) {
            shares[task as usize] = ((ends[1] - ends[0]) * pace.speed) as f32;
        }
        Self {
            slots: Slots::new(&lists),
            ledger: Ledger::new(schedule.tasks(), lists.len()),
            before: before.into(),
            shares: shares.into(),
            devices: devices.into(),
        }
    }

    /// Predicted seconds of `range`, on the device that it was first dealt to.
    fn seconds(&self, range: &Range<u32>) -> f64 {
        self.before[range.end as usize] - self.before[range.start as usize]
    }

    /// Seconds that `device` would need at its predicted speed for its fair share of all that is in lists.
    fn fair(&self, device: usize) -> f64 {
        let (mut left, mut together) = (0.0, 0.0);
        for (i, pace) in self.devices.iter().enumerate() {
            left += self.seconds(&self.slots.range(i)) * pace.speed;
            if !self.ledger.is_retired(i) {
                together += pace.speed_found();
            }
        }
        let pace = &self.devices[device];
        left * pace.speed_found() / (together.max(f64::MIN_POSITIVE) * pace.speed)
    }

    /// Number of tasks that the next launch takes from the front of `range`, which is not empty.
    fn launch_size(&self, device: usize, range: &Range<u32>) -> u32 {
        let (start, end) = (range.start as usize, range.end as usize);
        let base = self.before[start];
        let Pace { speed, launch, predicted, .. } = self.devices[device];
        let most = (GROWTH * self.devices[device].done() + PRIOR * predicted) / speed;
        let share = base + (LAUNCH_SHARE * (self.before[end] - base).min(self.fair(device))).min(most);
        let worthwhile = base + launch;
        let ends = &self.before[start + 1..=end];
        let count = ends.partition_point(|&s| s <= share).max(ends.partition_point(|&s| s < worthwhile) + 1);
        count.min(end - start) as u32
    }

    /// Number of tasks that `thief` may take from the back of `range`, which is reserved for `victim`.
    fn loot(&self, thief: usize, victim: usize, range: &Range<u32>) -> u32 {
        if self.ledger.is_retired(victim) {
            return range.end - range.start;
        }
        let [thief, victim] = [thief, victim].map(|d| self.devices[d].speed_found());
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
        if let Some(pace) = self.devices.get(device) {
            let share: f32 = tasks.iter().filter_map(|&task| self.shares.get(task as usize)).sum();
            // Negative or not a number becomes 0.
            pace.done.fetch_add((f64::from(share) / UNIT) as u32, Ordering::Relaxed);
        }
        self.ledger.finish(device, tasks);
    }

    fn retire(&self, device: usize, unfinished: &[TaskId]) {
        // What is reserved for the device stays in its slot, from where others now steal all of it.
        self.ledger.retire(device, unfinished);
    }

    fn readmit(&self, device: usize) {
        self.ledger.readmit(device);
    }

    fn unfinished_tasks(&self) -> Vec<TaskId> {
        self.ledger.unfinished_tasks()
    }
}
