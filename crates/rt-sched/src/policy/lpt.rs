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
/// Ties go to the lowest task, then the lowest device, so uniform work over equal devices is dealt round robin. Takes
/// `O(n · (c + log m))` for `n` tasks and `m` devices of which `c` have different cost models.
///
/// Seconds are counted in whole units of about 2⁻⁵⁰ of the total, a power of two of a second: sums are exact, their
/// order does not matter, and scaling all costs by a power of two changes nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lpt;

impl Policy for Lpt {
    fn name(&self) -> &'static str {
        "lpt"
    }

    fn schedule(&self, work: &[Work], devices: &[CostModel]) -> Schedule {
        let classes = classes_of(devices);
        let [model] = &classes.models[..] else {
            return if devices.is_empty() {
                Schedule::from_parts(Vec::new(), Vec::new(), work.len())
            } else {
                unequal(work, devices, classes)
            };
        };
        let units = Units::new(work, devices);
        let mut plan = Plan::new(devices, &classes, &units, work.len());
        let ranked = dearest_first(work.iter().map(|w| (model.seconds(w) * units.per_second) as f32));
        for task in ranked {
            // The rank holds the cost to single precision, as the work does; reading it again would miss the cache.
            let finish = plan.trees[0].first() + units.pack(f64::from(task.cost()));
            plan.place(task.task(), 0, finish);
        }
        plan.into_schedule(&units, work.len())
    }
}

/// The general case: devices of different cost models.
fn unequal(work: &[Work], devices: &[CostModel], classes: Classes) -> Schedule {
    let units = Units::new(work, devices);
    let mut plan = Plan::new(devices, &classes, &units, work.len());
    let mean = mean_model(devices);
    let ranked = dearest_first(work.iter().map(|w| (seconds(&mean, w) * units.per_second) as f32));
    for task in ranked {
        let task = task.task();
        let candidates = plan.trees.iter().zip(&classes.models).enumerate();
        let finish = candidates.map(|(class, (tree, model))| {
            (tree.first() + units.pack(model.seconds(&work[task as usize]) * units.per_second), class)
        });
        if let Some((finish, class)) = finish.min() {
            plan.place(task, class, finish);
        }
    }
    plan.into_schedule(&units, work.len())
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

/// Whole units of time, and words that hold a time in units above the number of a device.
struct Units {
    per_second: f64,
    device_bits: u32,
    /// Most units of one task.
    limit: f64,
}

impl Units {
    fn new(work: &[Work], devices: &[CostModel]) -> Self {
        let mut sum = [0.0; 3];
        for w in work {
            for (sum, part) in sum.iter_mut().zip([w.rays(), w.boxes(), w.triangles()]) {
                *sum += f64::from(part);
            }
        }
        let all =
            |d: &CostModel| d.per_launch() + d.per_ray() * sum[0] + d.per_box() * sum[1] + d.per_triangle() * sum[2];
        let total = devices.iter().map(all).fold(0.0, f64::max);
        let device_bits = usize::BITS - devices.len().saturating_sub(1).leading_zeros();
        // All tasks on the slowest device fill less than 2^61, with room for the unit that each task costs more.
        let room = 61 - device_bits as i32;
        let most = libm::ldexp(1.0, room);
        if total.is_finite() {
            let (_, exponent) = libm::frexp(total);
            // 2^1000 is far beyond any real unit and keeps products of real seconds finite.
            Self { per_second: libm::ldexp(1.0, (room - exponent).min(1_000)), device_bits, limit: most }
        } else {
            // Seconds beyond the range of f64: every such task weighs the same.
            Self { per_second: libm::ldexp(1.0, -1_000), device_bits, limit: most / work.len().max(1) as f64 }
        }
    }

    /// A task's units, ready to be added to a packed word. One unit more than the cost, so that tasks that cost
    /// nothing are dealt evenly.
    fn pack(&self, units: f64) -> u64 {
        (units.min(self.limit) as u64 + 1) << self.device_bits
    }
}

/// The lists so far, and for each class a tree of its devices' packed loads.
struct Plan {
    trees: Vec<WinnerTree>,
    lists: Vec<Vec<TaskId>>,
    /// For each device its leaf in its class's tree.
    leaf: Vec<usize>,
    /// For each device the packed time it ends at, as in its leaf.
    load: Vec<u64>,
    mask: u64,
}

impl Plan {
    fn new(devices: &[CostModel], classes: &Classes, units: &Units, tasks: usize) -> Self {
        // An eighth more than the mean: lists of equal devices then never grow, and little memory is wasted.
        let capacity = if classes.models.len() == 1 { tasks / devices.len() * 9 / 8 + 1 } else { 0 };
        let mut members = vec![Vec::new(); classes.models.len()];
        let mut leaf = Vec::with_capacity(devices.len());
        let mut load = Vec::with_capacity(devices.len());
        for (device, (model, &class)) in devices.iter().zip(&classes.of).enumerate() {
            let launch = (model.per_launch() * units.per_second).min(units.limit) as u64;
            let packed = (launch << units.device_bits) | device as u64;
            leaf.push(members[class].len());
            load.push(packed);
            members[class].push(packed);
        }
        Self {
            trees: members.iter().map(|m| WinnerTree::new(m)).collect(),
            lists: devices.iter().map(|_| Vec::with_capacity(capacity)).collect(),
            leaf,
            load,
            mask: (1 << units.device_bits) - 1,
        }
    }

    /// Gives `task` to the device that `finish` names, the first of `class`.
    fn place(&mut self, task: TaskId, class: usize, finish: u64) {
        let device = (finish & self.mask) as usize;
        self.lists[device].push(task);
        self.load[device] = finish;
        self.trees[class].replace(self.leaf[device], finish);
    }

    fn into_schedule(self, units: &Units, tasks: usize) -> Schedule {
        let seconds = self.load.iter().zip(&self.lists).map(|(load, list)| {
            let used = (load >> units.device_bits) - list.len() as u64;
            if list.is_empty() { 0.0 } else { used as f64 / units.per_second }
        });
        let seconds = seconds.collect();
        Schedule::from_parts(self.lists, seconds, tasks)
    }
}

/// The least of a set of words that change one at a time: a complete binary tree of minima (D. Knuth, *The Art of
/// Computer Programming* 3, 5.4.1, "tree of winners"). The siblings on a leaf's way up do not depend on one another,
/// so a change costs one minimum per level and no branch.
struct WinnerTree {
    /// Node `i` has children `2i` and `2i + 1`; node 1 is the root; leaves fill the upper half.
    nodes: Vec<u64>,
}

impl WinnerTree {
    fn new(words: &[u64]) -> Self {
        let width = words.len().next_power_of_two();
        let mut nodes = vec![u64::MAX; 2 * width];
        nodes[width..width + words.len()].copy_from_slice(words);
        for i in (1..width).rev() {
            nodes[i] = nodes[2 * i].min(nodes[2 * i + 1]);
        }
        Self { nodes }
    }

    fn first(&self) -> u64 {
        self.nodes[1]
    }

    fn replace(&mut self, leaf: usize, word: u64) {
        let mut i = self.nodes.len() / 2 + leaf;
        let mut least = word;
        self.nodes[i] = least;
        while i > 1 {
            least = least.min(self.nodes[i ^ 1]);
            i /= 2;
            self.nodes[i] = least;
        }
    }
}
