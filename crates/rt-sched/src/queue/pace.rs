//! How fast devices are found to be, without a clock.

use super::ledger::Ledger;
use super::overview::Overview;
use super::timed::{Timed, get};
use alloc::boxed::Box;
use rt_core::{CostModel, TaskId, Work};
// Not those of `atomics`, whose every order loom tries: they decide only how many tasks a launch takes, not whose they
// are.
use crate::policy::{speed, total};
use core::sync::atomic::{AtomicU64, AtomicUsize, Ordering::Relaxed, Ordering::SeqCst};

/// Standard deviation of a task's cost about what is known of it, as a share of that: in pictures that we know, where
/// most tasks are said to cost the same, which means that nothing is known.
const UNKNOWN: f64 = 1.0;

/// The same where costs were estimated by someone who does not say how well.
const UNSAID: f64 = 0.25;

/// How many standard deviations the next task may exceed what is known of it, and how many what a device has finished
/// may deviate, before that counts. In pictures the most expensive task is some five times the mean.
const NEXT: f64 = 4.0;
const FINISHED: f64 = 2.0;

/// How much faster another device must be for a device to leave it a task, without a unit: equal devices, whose speeds
/// are found to differ by a little, must not wait for one another.
const FASTER: f64 = 1.5;

/// What launches may cost of what their tasks deviate by, without a unit: they do not mend all of it.
const SPENT: f64 = 1.0 / 8.0;

/// How much longer launches are than what launches are found to cost and what is left, in the geometric mean, without a
/// unit: at 10% of a list two launches, at 1% five, at 0.1% as many as without a price.
const LONGER: f64 = 2.0;

/// Fewest launches of a list that is launched in several.
const FEWEST: f64 = 12.0;

/// Part of the standard deviation that lists have whose tasks are from all over the picture, where nothing is known of
/// those: as in [`crate::uninformed::fixed_excess`].
const SPREAD: f64 = 1.0 / 3.0;

/// By how much a predicted speed may be wrong, as a share of it.
const SPEED_ERROR: f64 = 0.02;

/// How much of what a device has in flight it has probably done, without a unit: half of the older of two launches.
const BEGUN: f64 = 0.25;

/// The unit of [`Pace::done`] and its like: 2⁻⁴⁰ of a stream, so that a billion tasks still count.
const UNIT: f64 = 1.0 / (1_u64 << 40) as f64;

/// Relative error of sums of shares, which are kept as `f32`.
const ROUNDING: f64 = 1e-6;

/// What each device was expected to do, has done and has in flight: how fast it is, and when it will end.
///
/// A queue knows no time. But all devices begin together, so the one that is furthest beside what was predicted of it
/// tells what time it is at least: the seconds that it was predicted to need for what it has finished. Another device
/// that has not come as far as it should, even if all that it has in flight were finished in this moment, is slower
/// than predicted, and then it is as fast as what it finished, and half of what it has in flight, says. As long as
/// nothing contradicts a prediction it is believed: whoever is in the middle of a long launch does not look slow.
///
/// Times are in seconds of the predictions. They may all be wrong by one factor, such as before anything was measured.
#[derive(Debug)]
pub(crate) struct Paces {
    devices: Box<[Pace]>,
    /// For each task its share of the stream.
    shares: Box<[f32]>,
    /// What all shares add up to.
    all: f64,
    overview: Overview,
    /// Predicted streams per second of all devices.
    predicted: f64,
    /// What time it is at least, as the bits of an `f64` ≥ 0, which are in the order of the numbers.
    now: AtomicU64,
    /// Shares of the stream that are finished and in flight, in [`UNIT`]s.
    done: AtomicU64,
    flying: AtomicU64,
    /// Number of calls that may have freed a task.
    events: AtomicU64,
    /// Standard deviation of a task's cost about what is known of it, as a share of that.
    noise: f64,
    /// Whether speeds were measured: not if all have the prices that are assumed before.
    predicts: bool,
}

#[derive(Debug)]
struct Pace {
    /// Predicted streams per second.
    speed: f64,
    /// Seconds that a launch costs beside its tasks.
    launch_s: f64,
    /// Number of launches that it was given, and has finished.
    launches: [AtomicUsize; 2],
    /// Shares of the stream that it has finished and has in flight, in [`UNIT`]s.
    done: AtomicU64,
    flying: AtomicU64,
    /// The speed that it was last found to have.
    found: AtomicU64,
    /// When it was last told to wait, in [`Paces::events`].
    told: AtomicU64,
    timed: Timed,
}

impl Pace {
    /// Seconds that its launches cost beside their tasks: those that it was given, and those that it has finished.
    fn in_launches_s(&self) -> [f64; 2] {
        let ended = self.launches[1].load(Relaxed);
        // Whoever finishes a launch in parts has not begun more of them.
        [self.launches[0].load(Relaxed).max(ended), ended].map(|launches| launches as f64 * self.launch_s)
    }
}

/// How many launches a share of the stream is worth to each of so many devices, whose costs deviate by `deviation` and
/// whose speed may by `doubt`, where a launch costs `price`, all as shares of the stream. What is to be mended is by
/// how much the latest list of all is late: some √(2 ln m) deviations, as in [`crate::uninformed::fixed_excess`].
fn mending(devices: usize, deviation: f64, doubt: f64, price: f64) -> f64 {
    SPENT * (libm::sqrt(2.0 * libm::log(devices as f64)).max(1.0) * deviation + doubt) / price
}

/// Whether a list of so many tasks of which nothing is known is launched in several, where a launch costs `price` of
/// it.
pub(crate) fn does_mend(tasks: f64, devices: usize, price: f64) -> bool {
    mending(devices, SPREAD * UNKNOWN / libm::sqrt(tasks), SPEED_ERROR, price) >= FEWEST.min(tasks)
}

/// What is to be thought of a device at some moment.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Found {
    /// Streams per second.
    pub(crate) speed: f64,
    /// When it will end what it has in flight, in seconds.
    pub(crate) until: f64,
    /// Seconds that a launch costs it beside its tasks.
    pub(crate) launch_s: f64,
}

fn share(units: &AtomicU64) -> f64 {
    units.load(Relaxed) as f64 * UNIT
}

/// How little is known of costs: as [`Paces::noise`].
fn noise(work: &[Work]) -> f64 {
    let errors = work.iter().try_fold(0.0, |sum, work| Some(sum + f64::from(work.std_error()?)));
    let tests: f64 = work.iter().map(|work| f64::from(work.tests())).sum();
    if let Some(noise) = errors.map(|errors| errors / tests).filter(|noise| noise.is_finite()) {
        return noise.min(UNKNOWN);
    }
    let alike = work.windows(2).filter(|pair| pair[0] == pair[1]).count();
    if 2 * alike > work.len() { UNKNOWN } else { UNSAID }
}

/// Subtracts as much as there is.
fn lower(units: &AtomicU64, by: u64) -> u64 {
    let taken = units.fetch_update(Relaxed, Relaxed, |was| Some(was.saturating_sub(by)));
    taken.map_or(0, |was| was.min(by))
}

impl Paces {
    /// Devices of these prices, all at rest, and what each task is of all `work`, on the device `owner(task)`.
    pub(crate) fn new(work: &[Work], models: &[CostModel], owner: impl Fn(TaskId) -> usize) -> Self {
        let sum = total(work);
        let pace = |model: &CostModel| {
            let speed = speed(model, &sum);
            let [done, flying, told] = [0; 3].map(AtomicU64::new);
            let found = AtomicU64::new(speed.to_bits());
            let launches = [0; 2].map(AtomicUsize::new);
            let (launch_s, timed) = (model.per_launch(), Timed::default());
            Pace { speed, launch_s, launches, done, flying, found, told, timed }
        };
        let devices: Box<[Pace]> = models.iter().map(pace).collect();
        let share = |(task, work): (TaskId, &Work)| {
            let owner = owner(task);
            let share = models.get(owner).map_or(0.0, |model| model.seconds(work) * devices[owner].speed);
            if share.is_finite() { share as f32 } else { 0.0 }
        };
        let shares: Box<[f32]> = (0..).zip(work).map(share).collect();
        let all = shares.iter().map(|&share| f64::from(share)).sum();
        let [now, done, flying, events] = [0, 0, 0, 1].map(AtomicU64::new);
        let predicts = models.iter().any(|model| *model != CostModel::UNIT);
        let predicted = devices.iter().map(|pace| pace.speed).sum();
        Self {
            devices,
            overview: Overview::default(),
            predicted,
            shares,
            all,
            now,
            done,
            flying,
            events,
            noise: noise(work),
            predicts,
        }
    }

    /// Whether costs are known.
    pub(crate) const fn are_costs_known(&self) -> bool {
        self.noise < UNKNOWN
    }

    /// Whether costs or speeds are known.
    pub(crate) const fn is_anything_known(&self) -> bool {
        self.predicts || self.are_costs_known()
    }

    /// What a task is of the whole stream.
    pub(crate) fn share(&self, task: TaskId) -> f64 {
        self.shares.get(task as usize).map_or(0.0, |&share| share.into())
    }

    /// The mean of [`Paces::share`].
    pub(crate) fn mean_share(&self) -> f64 {
        self.all / self.shares.len().max(1) as f64
    }

    fn units(&self, tasks: &[TaskId]) -> u64 {
        tasks.iter().map(|&task| (self.share(task) / UNIT) as u64).sum()
    }

    /// Standard deviation of a share of the stream about what was estimated: of independent errors of about as many
    /// tasks as make it up.
    fn std_deviation(&self, share: f64) -> f64 {
        self.noise * libm::sqrt(share * self.mean_share())
    }

    /// By how much a share of the stream may deviate from what was estimated.
    fn deviation(&self, share: f64) -> f64 {
        FINISHED * self.std_deviation(share)
    }

    /// Into how many launches a device should divide a share of the stream, and which part of it the first of them
    /// should be.
    ///
    /// What is launched is not moved any more, so one more launch pays where what its tasks deviate by, together, is
    /// worth more than it costs. Launches shrink geometrically to where the rest deviates by less than one costs. With
    /// few of them the last is so long that it mends nothing: then there is one.
    pub(crate) fn launches(&self, device: usize, share: f64) -> (f64, f64) {
        let price = self.price(device);
        if price <= 0.0 {
            return (f64::INFINITY, 0.0);
        }
        let spread = if self.are_costs_known() { 1.0 } else { SPREAD };
        if !self.is_anything_known() {
            // Found, not known: the longer launches are, the less they cost together, and the less is left to be mended
            // if that was wrong. This is in between, and harmless where a little was taken for the price of nothing.
            // A slow device's tasks are what all may wait for: it takes no more of them for its launches.
            if FASTER * self.of(device).speed < self.overview.fastest_other(device) {
                return (f64::INFINITY, 0.0);
            }
            let part = (LONGER * libm::sqrt(price / share)).min(1.0);
            return (1.0 / part, part);
        }
        let doubt = if self.noise > 0.0 { SPEED_ERROR } else { 0.0 };
        let launches = |share| mending(self.devices.len(), spread * self.std_deviation(share), doubt * share, price);
        // Decided by all that the device will do, not by what is left, or the rest would be launched in one.
        let whole = share.max(self.all * self.of(device).speed / self.overview.speed());
        if launches(whole) < FEWEST.min(whole / self.mean_share()) {
            return (1.0, 1.0);
        }
        let launches = launches(share).max(1.0);
        let rest = (price / self.noise) * (price / self.noise) / (self.mean_share() * share);
        // Nothing is smaller than a task.
        let rest = rest.max(self.mean_share() / share).min(1.0);
        (launches, 1.0 - libm::pow(rest, 1.0 / launches))
    }

    /// What a launch costs a device beside its tasks, as a share of the stream that it could do meanwhile: as
    /// predicted, or where nothing was, as launches were found to take. (Where costs were estimated, tasks that were
    /// taken for too cheap look like short launches that take long.)
    pub(crate) fn price(&self, device: usize) -> f64 {
        let pace = &self.devices[device];
        if self.is_anything_known() {
            return pace.launch_s * pace.speed;
        }
        // Less than a task is not told from chance.
        Some(pace.timed.price(self.noise)).filter(|price| *price >= self.mean_share()).unwrap_or(0.0)
    }

    /// Says for how long a device was busy with a launch.
    pub(crate) fn took(&self, device: usize, tasks: &[TaskId], seconds: f64) {
        let share: f64 = tasks.iter().map(|&task| self.share(task)).sum();
        if let Some(pace) = self.devices.get(device)
            && share > 0.0
            && seconds > 0.0
        {
            pace.timed.add(share, seconds);
        }
    }

    /// By how much what a device has finished may deviate from its prediction without contradicting it.
    fn doubt(&self, share: f64) -> f64 {
        if self.predicts { self.deviation(share) } else { 0.0 }
    }

    /// The predicted speed of a device, in streams per second.
    pub(crate) fn predicted(&self, device: usize) -> f64 {
        self.devices[device].speed
    }

    /// What time it is, in seconds.
    fn now(&self) -> f64 {
        let least = get(&self.now);
        if self.noise == 0.0 || !self.predicts {
            return least;
        }
        let done = share(&self.done);
        // Of long launches, which are more than all that is done, no more than of such.
        let come = done + BEGUN * share(&self.flying).min(done);
        least.max(come / self.predicted)
    }

    /// The share of the stream that is not finished.
    pub(crate) fn unfinished(&self) -> f64 {
        (self.all - share(&self.done)).max(0.0)
    }

    /// The share of the stream that nobody has begun.
    pub(crate) fn open(&self) -> f64 {
        (self.unfinished() - share(&self.flying)).max(0.0)
    }

    /// Number of launches that a device has finished.
    pub(crate) fn ended(&self, device: usize) -> f64 {
        self.devices[device].launches[1].load(Relaxed) as f64
    }

    /// Whether a device has anything in flight.
    pub(crate) fn is_busy(&self, device: usize) -> bool {
        self.devices[device].flying.load(Relaxed) > 0
    }

    /// The share of the stream that a device has finished at least, if it was given the cheapest of tasks.
    pub(crate) fn sure(&self, device: usize) -> f64 {
        let done = share(&self.devices[device].done);
        (done - self.deviation(done)).max(0.0)
    }

    /// What is to be thought of a device.
    pub(crate) fn of(&self, device: usize) -> Found {
        let pace = &self.devices[device];
        let (now, done, flying) = (self.now(), share(&pace.done), share(&pace.flying));
        let [begun_s, ended_s] = pace.in_launches_s();
        let expected = |share: f64| begun_s + share / pace.speed;
        let slow = expected(done + flying + self.doubt(done + flying)) < now * (1.0 - ROUNDING);
        if flying == 0.0 {
            let speed = if slow { get(&pace.found) } else { pace.speed };
            return Found { speed, until: now, launch_s: pace.launch_s };
        }
        let come = done + BEGUN * flying;
        let speed = if slow { pace.speed.min(come / (now - ended_s).max(0.0)) } else { pace.speed };
        let left = flying / speed + (begun_s - ended_s);
        let until = expected(done + flying);
        let until = match self.noise {
            0.0 if !slow => until.max(now),
            _ => until.clamp(now + 0.5 * left, now + left),
        };
        Found { speed, until, launch_s: pace.launch_s }
    }

    /// By how much a speed that was found may be too low or too high, as a factor: tasks that follow each other are
    /// alike, so that a device may have had cheap ones only.
    pub(crate) fn range(&self, device: usize) -> f64 {
        let pace = &self.devices[device];
        let done = share(&pace.done) + BEGUN * share(&pace.flying);
        1.0 + self.deviation(done) / done.max(f64::MIN_POSITIVE)
    }

    /// The speed of all devices that are not lost, in streams per second.
    pub(crate) fn together(&self, ledger: &Ledger) -> f64 {
        let count = self.devices.len();
        let living = (0..count).filter(|&device| !ledger.is_retired(device));
        self.overview.look(count, living.map(|device| (device, self.of(device).speed)));
        self.overview.speed()
    }

    /// Whether a device should take anything now, of which the next task would be `next`. A schedule that is to be kept
    /// has every device end by `plan` seconds.
    ///
    /// It should not where it has enough in flight until all will be done, and where a faster device would end the next
    /// task sooner, even after all else.
    pub(crate) fn may_take(&self, device: usize, next: Option<TaskId>, plan: f64, ledger: &Ledger) -> bool {
        let now = self.now();
        let (own, together) = (self.of(device), self.together(ledger));
        let (others, fastest) = (together - own.speed, self.overview.fastest_other(device));
        // Nobody else is there.
        if others <= 0.0 || fastest <= 0.0 {
            return true;
        }
        let caution = 1.0 + NEXT * self.noise;
        let left = self.unfinished();
        let end = plan.max(now + left / together) * (1.0 + ROUNDING);
        if self.devices[device].flying.load(Relaxed) > 0 && now + caution * (own.until - now) >= end {
            return false;
        }
        let next = caution * next.map_or(self.mean_share(), |task| self.share(task));
        let [begun_s, _] = self.devices[device].in_launches_s();
        let keeps_plan = own.until - begun_s + next / own.speed <= plan * (1.0 + ROUNDING);
        keeps_plan
            || fastest <= FASTER * own.speed * self.range(device)
            || caution * (own.until - now) + next / own.speed <= left / others + next / fastest
    }

    /// Whether nothing is in flight, and every device was told to wait: then the one that asks must take what there is,
    /// or nothing will ever free a task.
    pub(crate) fn do_all_wait(&self, ledger: &Ledger) -> bool {
        // The order of all, so that of two devices that are told at once one sees the other.
        let events = self.events.load(SeqCst);
        let waits = |(device, pace): (usize, &Pace)| ledger.is_retired(device) || pace.told.load(SeqCst) == events;
        self.flying.load(SeqCst) == 0 && self.devices.iter().enumerate().all(waits)
    }

    /// Says that a device is told to wait.
    pub(crate) fn wait(&self, device: usize) {
        let Some(pace) = self.devices.get(device) else { return };
        pace.told.store(self.events.load(SeqCst), SeqCst);
    }

    /// Says that a device was given a launch.
    pub(crate) fn launch(&self, device: usize, tasks: &[TaskId]) {
        let Some(pace) = self.devices.get(device) else { return };
        let units = self.units(tasks);
        pace.launches[0].fetch_add(1, Relaxed);
        pace.flying.fetch_add(units, Relaxed);
        self.flying.fetch_add(units, Relaxed);
    }

    /// Says that a device has finished what it had in flight of `tasks`.
    pub(crate) fn finish(&self, device: usize, tasks: &[TaskId]) {
        let Some(pace) = self.devices.get(device) else { return };
        let units = self.give_up(device, tasks);
        pace.launches[1].fetch_add(1, Relaxed);
        pace.done.fetch_add(units, Relaxed);
        self.done.fetch_add(units, Relaxed);
        let done = share(&pace.done);
        let [_, ended_s] = pace.in_launches_s();
        let least = (done - self.doubt(done)).max(0.0);
        self.now.fetch_max((ended_s + least / pace.speed).to_bits(), Relaxed);
        let seconds = get(&self.now) - ended_s;
        let found = if seconds > 0.0 { pace.speed.min(done / seconds) } else { pace.speed };
        pace.found.store(found.to_bits(), Relaxed);
    }

    /// Says that a device will not finish what it has in flight of `tasks`; returns how much that was, in [`UNIT`]s.
    pub(crate) fn give_up(&self, device: usize, tasks: &[TaskId]) -> u64 {
        self.events.fetch_add(1, SeqCst);
        let Some(pace) = self.devices.get(device) else { return 0 };
        let units = lower(&pace.flying, self.units(tasks));
        lower(&self.flying, units);
        units
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;

    /// Mutants: `expected` without what launches cost; `now` without it.
    #[test]
    fn what_launches_cost_makes_no_device_slow() {
        let work = [Work::new(0.0, 1e8, 0.0).with_std_error(0.0); 20];
        let priced = CostModel::new(1.0, 1e-9, 1e-9, 1e-9).expect("a model");
        let paces = Paces::new(&work, &[priced; 2], |task| task as usize % 2);
        // One launch after the other, of a second and a tenth, while the other device is in one of two seconds.
        let own: [TaskId; 10] = core::array::from_fn(|i| 2 * i as TaskId + 1);
        paces.launch(1, &own);
        paces.launch(0, &[0]);
        paces.finish(0, &[0]);
        assert_eq!(paces.of(1).speed, paces.predicted(1), "1.1 s have passed, it needs 2");
        for task in [2, 4] {
            paces.launch(0, &[task]);
            paces.finish(0, &[task]);
        }
        assert!(paces.of(1).speed < paces.predicted(1), "3.3 s have passed");
    }
}
