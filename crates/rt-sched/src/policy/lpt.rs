//! Longest processing time first.

use super::loads::{FEW, Loads, SortedLoads, WinnerTree};
use super::{Policy, mean_model, most_expensive_first, seconds, total};
use crate::Schedule;
use alloc::collections::BTreeMap;
use alloc::vec;
use alloc::vec::Vec;
use rt_core::{CostModel, TaskId, Work};

/// Longest processing time first: the most expensive remaining task goes to the device that would finish it first.
///
/// R. L. Graham, *Bounds on Multiprocessing Timing Anomalies* (1969): at most `4/3 − 1/(3m)` times the best makespan
/// on `m` equal devices. For devices of different cost models, tasks are sorted by their mean seconds over all
/// devices and each goes where it would end first, after its list so far and one launch.
///
/// Ties go to the lowest task, then the device with fewest tasks, then the lowest device, so uniform work over equal
/// devices is dealt round robin. Takes `O(n · (c + log m))` for `n` tasks and `m` devices of which `c` have different
/// cost models.
///
/// Seconds are counted in whole units: sums are exact whatever their order, and scaling all costs by a power of two
/// changes nothing. A unit is about 2⁻⁵⁰ of the total, or 2⁻³¹ of the most expensive task where all devices are equal.
/// Costs that differ by less than 2⁻¹⁹ of the most expensive may count as ties in the order of the tasks.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lpt;

impl Policy for Lpt {
    fn name(&self) -> &'static str {
        "lpt"
    }

    fn schedule(&self, work: &[Work], devices: &[CostModel]) -> Schedule {
        let classes = classes_of(devices);
        match &classes.models[..] {
            [] => Schedule::from_parts(Vec::new(), Vec::new(), work.len()),
            [model] => equal(work, devices.len(), model),
            _ => unequal(work, devices, &classes),
        }
    }
}

/// All devices have one cost model: the cost in the rank is all that is needed, and reading the work again, in sorted
/// order, would miss the cache.
fn equal(work: &[Work], devices: usize, model: &CostModel) -> Schedule {
    let bits = bits_for(devices);
    let empty: Vec<u64> = (0..devices as u64).collect();
    if devices <= FEW {
        deal(work, devices, model, SortedLoads::new(&empty, bits))
    } else {
        deal(work, devices, model, WinnerTree::new(&empty))
    }
}

fn deal<L: Loads>(work: &[Work], devices: usize, model: &CostModel, mut loads: L) -> Schedule {
    let ranking = most_expensive_first(work.iter().map(|w| model.seconds(w)));
    let bits = bits_for(devices);
    let mask = (1 << bits) - 1;
    // An eighth more than the mean, so that few lists grow and little memory is wasted.
    let capacity = work.len() / devices * 9 / 8 + 1;
    let mut lists: Vec<Vec<TaskId>> = (0..devices).map(|_| Vec::with_capacity(capacity)).collect();
    for task in ranking.order {
        // One unit more than the cost, so that tasks that cost nothing are dealt evenly. Cannot wrap below 2³¹ tasks.
        let finish = loads.first().wrapping_add((u64::from(task.share()) + 1) << bits);
        let device = (finish & mask) as usize;
        lists[device].push(task.task());
        loads.replace_first(device, finish);
    }
    let seconds = lists.iter().enumerate().map(|(device, list)| {
        let units = (loads.of(device) >> bits).saturating_sub(list.len() as u64);
        if list.is_empty() { 0.0 } else { model.per_launch() + units as f64 * ranking.unit }
    });
    let seconds = seconds.collect();
    Schedule::from_parts(lists, seconds, work.len())
}

/// How many tasks are priced at once. In sorted order every task's work is a cache miss; misses that do not wait for
/// the decision before them overlap.
const AHEAD: usize = 256;

/// Devices of different cost models.
fn unequal(work: &[Work], devices: &[CostModel], classes: &Classes) -> Schedule {
    let units = Units::new(work, devices);
    let mean = mean_model(devices);
    let mut members = vec![Vec::new(); classes.models.len()];
    let mut leaf = Vec::with_capacity(devices.len());
    for (device, (model, &class)) in devices.iter().zip(&classes.of).enumerate() {
        leaf.push(members[class].len());
        members[class].push(units.of(model.per_launch()) << units.device_bits | device as u64);
    }
    let mut trees: Vec<WinnerTree> = members.iter().map(|m| WinnerTree::new(m)).collect();
    let mut lists = vec![Vec::new(); devices.len()];
    // Beside the units, in which a device that is much faster than another counts coarsely.
    let mut seconds_of = vec![0.0; devices.len()];
    let mut prices = Vec::with_capacity(AHEAD * classes.models.len());
    for tasks in most_expensive_first(work.iter().map(|w| seconds(&mean, &w.parts()))).order.chunks(AHEAD) {
        prices.clear();
        for task in tasks {
            let work = &work[task.task() as usize];
            // One unit more than the cost, as above.
            let price = |model: &CostModel| (units.of(model.seconds(work)) + 1) << units.device_bits;
            prices.extend(classes.models.iter().map(price));
        }
        for (task, prices) in tasks.iter().zip(prices.chunks_exact(trees.len())) {
            let mut class = 0;
            let mut finish = u64::MAX;
            for (candidate, (tree, price)) in trees.iter().zip(prices).enumerate() {
                let end = tree.first() + price;
                (finish, class) = if end < finish { (end, candidate) } else { (finish, class) };
            }
            let device = (finish & ((1 << units.device_bits) - 1)) as usize;
            lists[device].push(task.task());
            trees[class].replace_first(leaf[device], finish);
            seconds_of[device] += devices[device].seconds(&work[task.task() as usize]);
        }
    }
    for (model, (seconds, list)) in devices.iter().zip(seconds_of.iter_mut().zip(&lists)) {
        *seconds += if list.is_empty() { 0.0 } else { model.per_launch() };
    }
    Schedule::from_parts(lists, seconds_of, work.len())
}

/// Devices grouped by equal cost models.
struct Classes {
    models: Vec<CostModel>,
    /// For each device its class.
    of: Vec<usize>,
}

fn classes_of(devices: &[CostModel]) -> Classes {
    let mut known = BTreeMap::new();
    let mut models = Vec::new();
    let of = devices.iter().map(|d| {
        let bits = (d.per_launch().to_bits(), d.per_part().map(f64::to_bits));
        *known.entry(bits).or_insert_with(|| {
            models.push(*d);
            models.len() - 1
        })
    });
    let of = of.collect();
    Classes { models, of }
}

/// Bits that hold the number of any of `devices` devices.
const fn bits_for(devices: usize) -> u32 {
    usize::BITS - devices.saturating_sub(1).leading_zeros()
}

/// Whole units of time, and words that hold a time in units above the number of a device.
struct Units {
    per_second: f64,
    device_bits: u32,
    /// Most units of one task.
    limit: f64,
}

impl Units {
    fn new(work: &[Work], devices: &[CostModel]) -> Self {
        let sum = total(work);
        let all = |d: &CostModel| d.per_launch() + seconds(&d.per_part(), &sum);
        let total = devices.iter().map(all).fold(0.0, f64::max);
        let device_bits = bits_for(devices.len());
        // All tasks on the slowest device fill less than 2^61, with room for the unit that each task costs more.
        let room = 61 - device_bits as i32;
        let most = libm::ldexp(1.0, room);
        if total.is_finite() {
            let (_, exponent) = libm::frexp(total);
            // 2^1000 is far beyond any real unit and keeps products of real seconds finite.
            Self { per_second: libm::ldexp(1.0, (room - exponent).min(1_000)), device_bits, limit: most }
        } else {
            // Seconds beyond the range of f64: every such task weighs the same.
            let tasks_and_launch = work.len() as f64 + 1.0;
            Self { per_second: libm::ldexp(1.0, -1_000), device_bits, limit: most / tasks_and_launch }
        }
    }

    fn of(&self, seconds: f64) -> u64 {
        (seconds * self.per_second).min(self.limit) as u64
    }
}

#[cfg(test)]
mod tests;
