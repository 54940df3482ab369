//! Static lists, geometric launches, stealing.

use super::ledger::Ledger;
use super::pace::{Found, Paces};
use super::slots::Slots;
use super::{Pop, TaskQueue};
use crate::{Schedule, policy};
use alloc::boxed::Box;
use alloc::vec::Vec;
use core::ops::Range;
use rt_core::{CostModel, TaskId, Work};

/// Share of a device's list that its next launch takes, without a unit, where costs are known and the device has
/// nothing in flight.
///
/// Launches shrink geometrically, about `log(tasks per device) / log(3/2)` of them, with a pause for each hand-over.
/// Smaller shares only add launches, and from 0.5 on too little is left to mend bad estimates (simulated: 8 devices,
/// 1,024 tasks, error 30%, one launch in flight, excess 0.51% with a third, 0.47% with a half and 0.85% with 0.7).
const LAUNCH_SHARE: f64 = 1.0 / 3.0;

/// The same where the device has a launch in flight, so that there is no pause.
///
/// What is in flight is not taken back. Of two launches of a third that is 5/9 of what a device has left: one that then
/// drops to a quarter of its speed is alone with that at the end, a third of the frame. Of two launches of an eighth it
/// is less than a quarter, which the device ends about when the others have done the rest (simulated: 31% above the
/// bound, and 0.6%).
const NEXT_SHARE: f64 = 1.0 / 8.0;

/// Share of the stream that such launches take at least, in a device's fair share of it, but no more than a
/// [`LAUNCH_SHARE`] of the list, without a unit: too little to be missed at the end, enough to hide most hand-overs.
const LEAST_NEXT: f64 = 2.0 * FIRST;

/// The same where costs are not known: one of several launches may be far more expensive than was thought.
const CAUTIOUS_SHARE: f64 = 1.0 / 12.0;

/// Share of the stream that a device's first launches take, in its predicted share, without a unit.
///
/// Speeds are predicted from few samples or from other streams, and may be wrong by a factor. A device that is a
/// twentieth as fast as was thought would be alone with its first launches at the end.
const FIRST: f64 = 1.0 / 256.0;

/// Tasks of equal work that stay together: 128 × 128 pixels of tasks of 1,024 rays. With 4, bounces took 10% longer on
/// a processor.
const NEIGHBOURS: usize = 16;

/// So many launches of a device of which nothing is known are each a task longer than the one before, so that they tell
/// what one costs also where all would else be of one task.
const TRIED: f64 = 2.0;

/// By how much what a device has in flight may exceed what it has finished, in units of that.
const GROWTH: f64 = 0.5;

/// How many devices a thief looks at: with more, a theft takes longer than it gains.
const VICTIMS: usize = 32;

/// Hybrid queues: each device works through its own list in shrinking launches, and steals when it runs dry.
///
/// After A. Heirich and J. Arvo, *A Competitive Analysis of Load Balancing Strategies for Parallel Ray Tracing* (1998),
/// who start from a static assignment and correct it while it runs. Speeds are predicted first, and believed until what
/// devices have finished contradicts them.
///
/// A launch takes a third of the device's list, or of its fair share of all that is left where that is less (an eighth
/// behind another one in flight, a twelfth where costs are not known), begins small and grows with what the device has
/// finished, but is no less than a launch costs. A device with an empty list steals from the one that would end last,
/// from the end of its list, where an LPT list has its smallest tasks: those that it would itself end no later. Where
/// it would overrun the schedule, a device leaves to a faster one what that ends sooner even after all else, and takes
/// no second launch when one lasts until all will be done.
///
/// So with exact costs and speeds a run takes no longer than its schedule says, but for launches: no step puts off the
/// last end. What a lost device leaves behind goes to whoever is idle.
#[derive(Debug)]
pub struct HybridQueue {
    slots: Slots,
    ledger: Ledger,
    paces: Paces,
    /// Share of the stream that is before each position of the slots.
    before: Box<[f64]>,
    /// Share of the stream that the first launches of each device take.
    first: Box<[f64]>,
    /// Seconds until the last device will have ended its list.
    plan: f64,
}

/// A list in which tasks of equal work come in an order of which every stretch is from all over the picture: nothing is
/// known of them, so a launch of neighbours may be several times as expensive as another, and says nothing of a
/// device's speed.
///
/// Neighbouring tasks stay together by [`NEIGHBOURS`], for the caches.
fn spread(list: &[TaskId], work: &[Work]) -> Vec<TaskId> {
    let of = |task: TaskId| work.get(task as usize);
    let mut out = Vec::with_capacity(list.len());
    for alike in list.chunk_by(|&a, &b| of(a) == of(b)) {
        let places = policy::spread(alike.len().div_ceil(NEIGHBOURS));
        out.extend(places.flat_map(|place| alike.iter().skip(place * NEIGHBOURS).take(NEIGHBOURS)));
    }
    out
}

impl HybridQueue {
    /// Queues with the lists of `schedule`, which was made for this work and these devices.
    ///
    /// Lists should be sorted most expensive task first, as those of [`Lpt`](crate::policy::Lpt) are.
    #[must_use]
    pub fn new(schedule: &Schedule, work: &[Work], devices: &[CostModel]) -> Self {
        let lists: Vec<Vec<TaskId>> = schedule.lists().iter().map(|list| spread(list, work)).collect();
        let models: Vec<CostModel> = (0..lists.len()).map(|d| devices.get(d).copied().unwrap_or_default()).collect();
        let mut owners = alloc::vec![usize::MAX; schedule.tasks()];
        for (device, list) in lists.iter().enumerate() {
            list.iter().for_each(|&task| owners[task as usize] = device);
        }
        let paces = Paces::new(work, &models, |task| owners.get(task as usize).copied().unwrap_or(usize::MAX));
        let mut sum = 0.0;
        let mut plan = 0.0_f64;
        let mut before = Vec::with_capacity(schedule.tasks() + 1);
        before.push(sum);
        for (device, list) in lists.iter().enumerate() {
            let start = sum;
            for &task in list {
                sum += paces.share(task);
                before.push(sum);
            }
            plan = plan.max((sum - start) / paces.predicted(device));
        }
        let together: f64 = (0..models.len()).map(|device| paces.predicted(device)).sum();
        let first = (0..models.len()).map(|device| FIRST * paces.predicted(device) / together).collect();
        Self {
            slots: Slots::new(&lists),
            ledger: Ledger::new(schedule.tasks(), lists.len()),
            paces,
            before: before.into(),
            first,
            plan,
        }
    }

    /// The share of the stream that is in `range`.
    fn share(&self, range: &Range<u32>) -> f64 {
        self.before[range.end as usize] - self.before[range.start as usize]
    }

    /// A device's fair share of whatever there is.
    fn part(&self, device: usize) -> f64 {
        self.paces.of(device).speed / self.paces.together(&self.ledger).max(f64::MIN_POSITIVE)
    }

    /// A device's fair share of all that is in lists.
    fn fair(&self, device: usize) -> f64 {
        self.paces.open() * self.part(device)
    }

    /// Number of tasks that the next launch takes from the front of `range`, which is not empty.
    fn launch_size(&self, device: usize, range: &Range<u32>) -> u32 {
        let (start, end) = (range.start as usize, range.end as usize);
        let list = self.before[end] - self.before[start];
        let fair = list.min(self.fair(device) / (2.0 * self.paces.range(device) - 1.0));
        let cautious = match (self.paces.are_costs_known(), self.paces.is_busy(device)) {
            (false, _) => CAUTIOUS_SHARE * fair,
            (true, false) => LAUNCH_SHARE * fair,
            (true, true) => (NEXT_SHARE * fair).max((LAUNCH_SHARE * fair).min(LEAST_NEXT * self.part(device))),
        };
        let (own, first, tried) = match self.paces.is_anything_known() {
            true => (list, self.first[device], 0.0),
            // A list that was cut for another speed than the device turns out to have is not its to launch. Launches of
            // several sizes tell what one costs from what its tasks take.
            false => {
                let ended = self.paces.ended(device);
                let grown = self.first[device] + self.paces.mean_share() * ended;
                (fair, grown, if ended <= TRIED { grown.min(fair / 8.0) } else { 0.0 })
            }
        };
        let (launches, worth) = self.paces.launches(device, own);
        let first = first.max(own * libm::exp2(1.0 - launches));
        let share = cautious.max(tried).max(worth * own).min(GROWTH * self.paces.sure(device) + first);
        let count = self.before[start + 1..=end].partition_point(|&s| s <= self.before[start] + share).max(1);
        count.min(end - start) as u32
    }

    /// Number of tasks at the back of `range`, which is reserved for `victim`, that the thief would end no later.
    ///
    /// Beside each task that the thief takes, the victim would have had to do all that is before it. So the thief ends
    /// before the victim would have, and the last end of all is not put off.
    fn loot(&self, thief: Found, victim: Found, range: &Range<u32>) -> u32 {
        let (start, end) = (range.start as usize, range.end as usize);
        let stays = |i: usize| {
            let thief_end = thief.until + thief.launch_s + (self.before[end] - self.before[i]) / thief.speed;
            thief_end > victim.until + victim.launch_s + (self.before[i + 1] - self.before[start]) / victim.speed
        };
        // Both ends of the comparison go one way with `i`.
        let (mut low, mut high) = (start, end);
        while low < high {
            let middle = low.midpoint(high);
            (low, high) = if stays(middle) { (middle + 1, high) } else { (low, middle) };
        }
        (end - low) as u32
    }

    /// Takes a share of the tasks of the device that would end last, among some of those that have any; if it `must`,
    /// of all devices, and at least one task. The thief has a share of the stream more to do than it has in flight.
    fn steal(&self, thief: usize, more: f64, must: bool) -> Option<Range<u32>> {
        let mut own = self.paces.of(thief);
        own.until += more / own.speed;
        loop {
            let mut best: Option<(f64, usize, Range<u32>, u32)> = None;
            let mut look = |victim: usize| {
                let range = self.slots.range(victim);
                if range.is_empty() {
                    return self.slots.note_empty(victim);
                }
                let lost = self.ledger.is_retired(victim);
                let found = self.paces.of(victim);
                let end = if lost { f64::INFINITY } else { found.until + self.share(&range) / found.speed };
                if best.as_ref().is_some_and(|(latest, ..)| end <= *latest) {
                    return;
                }
                let count = if lost { range.end - range.start } else { self.loot(own, found, &range) };
                let count = count.max(u32::from(must));
                if count > 0 {
                    best = Some((end, victim, range, count));
                }
            };
            if must {
                (0..self.slots.len()).for_each(&mut look);
            } else {
                self.slots.filled(thief).take(VICTIMS).for_each(&mut look);
            }
            let (_, victim, range, count) = best?;
            if let Some(taken) = self.slots.take_back(victim, &range, count) {
                return Some(taken);
            }
            // The victim or another thief was faster: look again.
        }
    }

    /// Claims the positions of the next launch from another device's range, beside `more` that it will take.
    fn claim(&self, device: usize, more: f64, must: bool) -> Range<u32> {
        let Some(stolen) = self.steal(device, more, must) else { return 0..0 };
        let cut = stolen.start + self.launch_size(device, &stolen);
        // The rest becomes the device's own, where others can steal it in turn. If another thread has just refilled
        // this device, all of it is launched.
        if cut < stolen.end && self.slots.refill(device, &(cut..stolen.end)) { stolen.start..cut } else { stolen }
    }

    /// Fills `out` with the tasks of the next launch.
    fn take(&self, device: usize, must: bool, out: &mut Vec<TaskId>) {
        let own = self.slots.take_front(device, |range| self.launch_size(device, &range));
        out.extend_from_slice(self.slots.tasks(own));
        // Orphans are counted, not priced: half of an equal share, as S. Flynn Hummel, E. Schonberg and L. Flynn,
        // *Factoring* (1992) deal iterations of unknown cost.
        if !out.is_empty() || self.ledger.adopt(|orphans| orphans.div_ceil(2 * self.ledger.alive().max(1)), out) {
            return;
        }
        // From one device after the other, until what was stolen is worth a launch.
        let mut more = 0.0;
        loop {
            let stolen = self.claim(device, more, must && out.is_empty());
            more += self.share(&stolen);
            out.extend_from_slice(self.slots.tasks(stolen.clone()));
            let enough = more >= self.paces.price(device).min(self.fair(device));
            if stolen.is_empty() || enough || !self.slots.range(device).is_empty() {
                return;
            }
        }
    }
}

impl TaskQueue for HybridQueue {
    fn pop(&self, device: usize, out: &mut Vec<TaskId>) -> Pop {
        out.clear();
        if self.ledger.is_retired(device) {
            return Pop::Done;
        }
        let next = self.slots.tasks(self.slots.range(device)).first().copied();
        if self.paces.may_take(device, next, self.plan, &self.ledger) {
            self.take(device, false, out);
        }
        if out.is_empty() {
            self.paces.wait(device);
            if self.paces.do_all_wait(&self.ledger) {
                self.take(device, true, out);
            }
            if out.is_empty() {
                return self.ledger.idle();
            }
        }
        self.paces.launch(device, out);
        self.ledger.hand_out(device, out);
        Pop::Launch
    }

    fn took(&self, device: usize, tasks: &[TaskId], seconds: f64) {
        self.paces.took(device, tasks, seconds);
    }

    fn finish(&self, device: usize, tasks: &[TaskId]) {
        self.paces.finish(device, tasks);
        self.ledger.finish(device, tasks);
    }

    fn retire(&self, device: usize, unfinished: &[TaskId]) {
        self.paces.give_up(device, unfinished);
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
