//! Longest processing time first.

use super::{Policy, dearest_first};
use crate::Schedule;
use alloc::collections::BTreeMap;
use alloc::vec;
use alloc::vec::Vec;
use rt_core::{CostModel, TaskId, Work};

/// Longest processing time first: the dearest remaining task goes to the device that would finish it first.
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
/// changes nothing. A unit is about 2⁻⁵⁰ of the total, or 2⁻³¹ of the dearest task where all devices are equal. Costs
/// that differ by less than 2⁻¹⁹ of the dearest may count as ties in the order of the tasks.
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
    let ranking = dearest_first(work.iter().map(|w| model.seconds(w)));
    let bits = bits_for(devices);
    let mask = (1 << bits) - 1;
    let empty: Vec<u64> = (0..devices as u64).collect();
    let mut tree = WinnerTree::new(&empty);
    // An eighth more than the mean, so that few lists grow and little memory is wasted.
    let capacity = work.len() / devices * 9 / 8 + 1;
    let mut lists: Vec<Vec<TaskId>> = (0..devices).map(|_| Vec::with_capacity(capacity)).collect();
    for task in ranking.order {
        // One unit more than the cost, so that tasks that cost nothing are dealt evenly. Cannot wrap below 2³¹ tasks.
        let finish = tree.first().wrapping_add((u64::from(task.share()) + 1) << bits);
        let device = (finish & mask) as usize;
        lists[device].push(task.task());
        tree.replace(device, finish);
    }
    let seconds = lists.iter().enumerate().map(|(device, list)| {
        let units = (tree.leaf(device) >> bits) - list.len() as u64;
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
    let mut prices = Vec::with_capacity(AHEAD * classes.models.len());
    for tasks in dearest_first(work.iter().map(|w| seconds(&mean, w))).order.chunks(AHEAD) {
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
            trees[class].replace(leaf[device], finish);
        }
    }
    let seconds = lists.iter().enumerate().map(|(device, list)| {
        let packed = trees[classes.of[device]].leaf(leaf[device]);
        let used = (packed >> units.device_bits) - list.len() as u64;
        if list.is_empty() { 0.0 } else { used as f64 / units.per_second }
    });
    let seconds = seconds.collect();
    Schedule::from_parts(lists, seconds, work.len())
}

/// Seconds per ray, box test and triangle test, averaged over `devices`.
pub(crate) fn mean_model(devices: &[CostModel]) -> [f64; 3] {
    let share = 1.0 / devices.len().max(1) as f64;
    let mut mean = [0.0; 3];
    for d in devices {
        for (sum, part) in mean.iter_mut().zip([d.per_ray(), d.per_box(), d.per_triangle()]) {
            *sum += part * share;
        }
    }
    mean
}

/// All rays, box tests and triangle tests of `work`.
pub(crate) fn total(work: &[Work]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for w in work {
        for (sum, part) in sum.iter_mut().zip([w.rays(), w.boxes(), w.triangles()]) {
            *sum += f64::from(part);
        }
    }
    sum
}

/// Expected seconds of `work` for [`mean_model`].
pub(crate) fn seconds(model: &[f64; 3], work: &Work) -> f64 {
    model[0] * f64::from(work.rays()) + model[1] * f64::from(work.boxes()) + model[2] * f64::from(work.triangles())
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
        let bits = [d.per_launch(), d.per_ray(), d.per_box(), d.per_triangle()].map(f64::to_bits);
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
        let all =
            |d: &CostModel| d.per_launch() + d.per_ray() * sum[0] + d.per_box() * sum[1] + d.per_triangle() * sum[2];
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

/// The least of a set of words that change one at a time: a complete tree of minima (D. Knuth, *The Art of Computer
/// Programming* 3, 5.4.1, "tree of winners"), four children to a node.
///
/// The siblings on a leaf's way up do not depend on one another, so a change costs a chain of one minimum per level,
/// without a branch; four children halve the levels of two.
struct WinnerTree {
    /// The leaves, then each level's minima, the root last; absent words are `u64::MAX`.
    nodes: Vec<u64>,
    /// Number of leaves, a power of four.
    width: usize,
}

impl WinnerTree {
    fn new(words: &[u64]) -> Self {
        let mut width = 1;
        while width < words.len() {
            width *= 4;
        }
        let mut nodes = words.to_vec();
        nodes.resize(width, u64::MAX);
        let mut level = 0..width;
        while level.len() > 1 {
            let minima: Vec<u64> =
                nodes[level.clone()].chunks(4).map(|c| c.iter().copied().fold(u64::MAX, u64::min)).collect();
            level = level.end..level.end + minima.len();
            nodes.extend(minima);
        }
        Self { nodes, width }
    }

    fn first(&self) -> u64 {
        self.nodes[self.nodes.len() - 1]
    }

    fn leaf(&self, leaf: usize) -> u64 {
        self.nodes[leaf]
    }

    #[inline]
    fn replace(&mut self, leaf: usize, word: u64) {
        let (mut start, mut width, mut at, mut least) = (0, self.width, leaf, word);
        while width > 1 {
            self.nodes[start + at] = least;
            let others = [1, 2, 3].map(|sibling| self.nodes[start + (at ^ sibling)]);
            least = least.min(others[0].min(others[1]).min(others[2]));
            start += width;
            width /= 4;
            at /= 4;
        }
        self.nodes[start] = least;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn works(costs: &[f32]) -> Vec<Work> {
        costs.iter().map(|&c| Work::new(0.0, c, 0.0)).collect()
    }

    /// Devices of the given seconds per box test.
    fn models(per_box: &[f64]) -> Vec<CostModel> {
        per_box.iter().map(|&s| CostModel::new(0.0, 0.0, s, s).expect("valid")).collect()
    }

    /// Least makespan over all ways to deal the costs to `m` equal devices.
    fn best_makespan(costs: &[f64], loads: &mut [f64]) -> f64 {
        let Some((&cost, rest)) = costs.split_first() else { return loads.iter().copied().fold(0.0, f64::max) };
        let mut best = f64::INFINITY;
        for device in 0..loads.len() {
            loads[device] += cost;
            best = best.min(best_makespan(rest, loads));
            loads[device] -= cost;
            // Devices without a task are alike.
            if loads[device] == 0.0 {
                break;
            }
        }
        best
    }

    /// The plain algorithm: sort, then look at every device for every task.
    fn naive(work: &[Work], devices: &[CostModel]) -> Vec<Vec<TaskId>> {
        let mean = mean_model(devices);
        let mut order: Vec<usize> = (0..work.len()).collect();
        order.sort_by(|&a, &b| seconds(&mean, &work[b]).total_cmp(&seconds(&mean, &work[a])));
        let mut lists = vec![Vec::new(); devices.len()];
        let mut ends: Vec<f64> = devices.iter().map(CostModel::per_launch).collect();
        for task in order {
            let end = |d: usize| ends[d] + devices[d].seconds(&work[task]);
            let first = (0..devices.len())
                .min_by(|&a, &b| end(a).total_cmp(&end(b)).then(lists[a].len().cmp(&lists[b].len())))
                .expect("a device");
            ends[first] = end(first);
            lists[first].push(task as TaskId);
        }
        lists
    }

    #[test]
    fn uniform_work_is_dealt_round_robin() {
        let devices = [CostModel::UNIT; 3];
        for cost in [0.0, 1.0, 3.3e20] {
            let schedule = Lpt.schedule(&works(&[cost; 8]), &devices);
            assert_eq!(schedule.lists(), [vec![0, 3, 6], vec![1, 4, 7], vec![2, 5]], "{cost}");
        }
    }

    #[test]
    fn extremes_do_not_panic() {
        assert_eq!(Lpt.schedule(&works(&[1.0]), &[]).lists().len(), 0);
        assert_eq!(Lpt.schedule(&[], &[CostModel::UNIT; 2]).seconds(), [0.0, 0.0]);
        let dear = [CostModel::new(f64::MAX, 1.0, f64::MAX, f64::MAX).expect("valid"), CostModel::UNIT];
        for devices in [&dear[..], &dear[..1], &[dear[0]; 3]] {
            for cost in [f32::MAX, f32::from_bits(1), 0.0] {
                let schedule = Lpt.schedule(&works(&[cost; 5]), devices);
                assert_eq!(schedule.lists().iter().map(Vec::len).sum::<usize>(), 5);
            }
        }
        let cheap = [CostModel::new(0.0, 0.0, f64::from_bits(1), 0.0).expect("valid"); 2];
        assert_eq!(Lpt.schedule(&works(&[1.0; 4]), &cheap).lists(), [vec![0, 2], vec![1, 3]]);
    }

    #[test]
    fn a_launch_is_paid_before_the_first_task() {
        let devices =
            [CostModel::new(10.0, 1.0, 1.0, 1.0).expect("valid"), CostModel::new(0.0, 2.0, 2.0, 2.0).expect("valid")];
        let schedule = Lpt.schedule(&works(&[4.0, 1.0]), &devices);
        assert_eq!(schedule.lists(), [vec![], vec![0, 1]]);
        assert_eq!(schedule.seconds(), [0.0, 10.0]);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        /// R. L. Graham's bound. Mutants: `dearest_first` in increasing order; `WinnerTree::replace` that does not
        /// write the root.
        #[test]
        fn is_within_grahams_bound_of_the_optimum(costs in prop::collection::vec(0_u32..100, 1..9), m in 1_usize..4) {
            let exact: Vec<f64> = costs.iter().map(|&c| f64::from(c)).collect();
            let work = works(&costs.iter().map(|&c| c as f32).collect::<Vec<_>>());
            let schedule = Lpt.schedule(&work, &models(&vec![1.0; m]));
            let best = best_makespan(&exact, &mut vec![0.0; m]);
            let graham = 4.0 / 3.0 - 1.0 / (3.0 * m as f64);
            prop_assert!(schedule.makespan() <= best * graham * (1.0 + 1e-9), "{} > {best}", schedule.makespan());
        }

        /// Mutants: `WinnerTree::replace` with `max`, or with two siblings.
        #[test]
        fn loads_of_equal_devices_differ_by_one_task_at_most(
            costs in prop::collection::vec(0.0_f32..1e3, 1..800), m in 1_usize..20,
        ) {
            let schedule = Lpt.schedule(&works(&costs), &models(&vec![1e-9; m]));
            let least = schedule.seconds().iter().copied().fold(f64::INFINITY, f64::min);
            let dearest = f64::from(costs.iter().copied().fold(0.0, f32::max)) * 1e-9;
            prop_assert!(schedule.makespan() - least <= dearest * (1.0 + 1e-6));
        }

        /// Whole costs and power-of-two speeds, so that the plain algorithm's sums are exact and ties agree.
        ///
        /// Mutants: `end < finish` reversed, or `end` without the price; `Classes` that puts all in one class;
        /// launches left out of `members`.
        #[test]
        fn agrees_with_the_plain_algorithm(
            costs in prop::collection::vec(0_u16..2_000, 0..700),
            speeds in prop::collection::vec((0_i32..4, 0_u16..3), 1..10),
        ) {
            let work = works(&costs.iter().map(|&c| f32::from(c) + 1.0).collect::<Vec<_>>());
            let devices: Vec<CostModel> = speeds.iter().map(|&(exponent, launch)| {
                let price = libm::ldexp(1.0, -exponent);
                CostModel::new(f64::from(launch) * 64.0, 0.0, price, 0.0).expect("valid")
            }).collect();
            let schedule = Lpt.schedule(&work, &devices);
            prop_assert_eq!(schedule.lists(), &naive(&work, &devices)[..]);
            let checked = Schedule::new(schedule.lists().to_vec(), &work, &devices).expect("each task once");
            for (a, b) in schedule.seconds().iter().zip(checked.seconds()) {
                prop_assert!((a - b).abs() <= 1e-6 * schedule.makespan(), "{a} {b}");
            }
        }

        /// Mutants: `Units` with a fixed scale; a rank whose scale is 1.
        #[test]
        fn scaling_by_a_power_of_two_changes_nothing(
            costs in prop::collection::vec(0.0_f32..1e4, 0..700), prices in prop::collection::vec(0.5_f64..4.0, 1..9),
            equal: bool, exponent in -300_i32..300,
        ) {
            let factor = libm::ldexp(1.0, exponent);
            let prices = if equal { vec![prices[0]; prices.len()] } else { prices };
            let scaled: Vec<f64> = prices.iter().map(|p| p * factor).collect();
            let work = works(&costs);
            let [a, b] = [models(&prices), models(&scaled)].map(|devices| Lpt.schedule(&work, &devices));
            prop_assert_eq!(a.lists(), b.lists());
            prop_assert!(a.seconds().iter().zip(b.seconds()).all(|(a, b)| a * factor == *b));
        }
    }
}
