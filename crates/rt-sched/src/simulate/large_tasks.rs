//! Streams whose caller cut them into a few large tasks: the default must not lose by what it is given.

use super::regimes::{told, turns};
use super::tests::{image, models};
use super::*;
use crate::cut::finer;
use crate::estimate::Auto;
use crate::policy::{Lpt, Policy};
use crate::queue::HybridQueue;
use crate::test_support::estimate;
use proptest::prelude::*;
use rt_core::{CostModel, StreamKind, Task, TestCounts, Work, tasks_of};
use std::eprintln;

/// Rays whose costs are alike: fewer than a task has.
const CELL: u32 = 256;

/// Box tests of a ray in the mean.
const TESTS: f64 = 100.0;

/// Seconds of the stream on all devices together, were it divisible.
const FRAME_S: f64 = 0.1;

/// A stream, of which the costs of its cells are known.
struct Picture {
    /// Tests of a ray of each cell.
    cells: Vec<f64>,
}

impl Picture {
    fn new(cells: u32, seed: u32) -> Self {
        let cells = image(cells, 1, seed);
        let mean = cells.iter().sum::<f64>() / cells.len() as f64;
        Self { cells: cells.iter().map(|cost| (cost / mean * TESTS).round()).collect() }
    }

    fn rays(&self) -> u32 {
        self.cells.len() as u32 * CELL
    }

    fn counts(&self, ray: u32) -> TestCounts {
        TestCounts { boxes: self.cells[(ray / CELL) as usize] as u32, triangles: 0 }
    }

    fn tests(&self, task: Task) -> f64 {
        let cost = |cell: u32| {
            let rays = ((cell + 1) * CELL).min(task.range().end) - (cell * CELL).max(task.first);
            f64::from(rays) * self.cells[cell as usize]
        };
        (task.first / CELL..task.range().end.div_ceil(CELL)).map(cost).sum()
    }

    /// Seconds of each task on a device of speed 1.
    fn seconds(&self, tasks: &[Task], speeds: &[f64]) -> Vec<f64> {
        let test_s = FRAME_S * speeds.iter().sum::<f64>() / self.tests(Task { first: 0, rays: self.rays() });
        tasks.iter().map(|&task| self.tests(task) * test_s).collect()
    }

    /// What the default expects of tasks, its counts being those of the rays it asks for.
    fn estimated(&self, tasks: &[Task], speeds: &[f64], are_speeds_known: bool) -> Vec<Work> {
        let are_alike = speeds.windows(2).all(|pair| pair[0] == pair[1]);
        let stream = told(StreamKind::Primary, tasks, speeds.len(), are_speeds_known, are_alike);
        estimate(&mut Auto::default(), stream, &|ray| self.counts(ray)).0
    }

    /// Seconds that the default takes for the stream in these tasks.
    fn default(&self, tasks: &[Task], speeds: &[f64], are_speeds_known: bool) -> f64 {
        let work = self.estimated(tasks, speeds, are_speeds_known);
        let devices = if are_speeds_known { models(speeds, 0.0) } else { vec![CostModel::UNIT; speeds.len()] };
        let queue = HybridQueue::new(&Lpt.schedule(&work, &devices), &work, &devices);
        let task_s = self.seconds(tasks, speeds);
        Simulation::default().run(&queue, speeds.len(), &|d, task| task_s[task as usize] / speeds[d]).makespan_s
    }
}

/// Seconds that the fastest device would take for all.
fn alone_s(speeds: &[f64]) -> f64 {
    FRAME_S * speeds.iter().sum::<f64>() / speeds.iter().copied().fold(0.0, f64::max)
}

/// Makespans over the divisible ideal of the default as the tasks were given, and cut, and of the fastest device alone:
/// means over pictures.
fn over_ideal(speeds: &[f64], each: u32, are_speeds_known: bool) -> [f64; 3] {
    const PICTURES: u32 = 6;
    let one = |seed| {
        let picture = Picture::new(4096, seed);
        let given = tasks_of(picture.rays(), picture.rays().div_ceil(each * speeds.len() as u32));
        let cut = finer(&given, speeds.len()).expect("tasks that are too large");
        let [given, cut] = [given, cut].map(|tasks| picture.default(&tasks, speeds, are_speeds_known));
        [given, cut, alone_s(speeds)].map(|seconds| seconds / FRAME_S)
    };
    let sums = (0..PICTURES).map(one).fold([0.0; 3], |sums, new| core::array::from_fn(|i| sums[i] + new[i]));
    sums.map(|sum| sum / f64::from(PICTURES))
}

/// Streams of few tasks that are large: cut, they end within 1.5% of the divisible ideal, whether speeds are known or
/// not. `--nocapture` prints the table of docs/results/scheduling.md.
///
/// Mutants: `finer` that cuts nothing; that cuts into [`DEFAULT_TASK_SIZE`](crate::cut::DEFAULT_TASK_SIZE) rays times
/// the number of devices.
#[test]
fn few_large_tasks_are_cut() {
    eprintln!("| devices | n/m | fastest alone | as given: speeds known | unknown | cut: speeds known | unknown |");
    eprintln!("|---|---|---|---|---|---|---|");
    for (name, speeds) in [
        ("1:0.2", vec![1.0, 0.2]),
        ("1:2:4", turns(&[1.0, 2.0, 4.0], 3)),
        ("1:50:50", turns(&[1.0, 50.0, 50.0], 3)),
        ("2 equal", turns(&[1.0], 2)),
        ("8 equal", turns(&[1.0], 8)),
    ] {
        for each in [2, 4, 8, 16, 32] {
            let [known, unknown] = [true, false].map(|known| over_ideal(&speeds, each, known));
            let excess = [known[2], known[0], unknown[0], known[1], unknown[1]].map(|over| 100.0 * (over - 1.0));
            let [alone, .., cut_known, cut_unknown] = excess;
            let row: alloc::string::String = excess.iter().map(|x| std::format!(" {x:.1} |")).collect();
            eprintln!("| {name} | {each} |{row}");
            assert!(cut_known.max(cut_unknown) <= 1.5, "{name}, {each}: {excess:?}");
            assert!(cut_known.max(cut_unknown) < alone, "{name}, {each}: {excess:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// A device that is added makes nothing slower, but for the launches: with any speeds that are known, however large
    /// the tasks are that the caller cut, the default takes no longer than its fastest device would alone. Of a device
    /// of which nothing is known the first tasks may be cheap, and it seem fast: up to a third longer
    /// (docs/results/scheduling.md).
    ///
    /// Mutants: `finer` that cuts nothing; that leaves tasks of a 64th of a device's share: twice as long; `PLENTY` of
    /// 8.
    #[test]
    fn no_device_makes_the_others_slower(
        speeds in prop::collection::vec(0.02_f64..1.0, 1..6), tasks in 1_u32..200, seed in 0_u32..1000, known: bool,
    ) {
        let speeds: Vec<f64> = core::iter::once(1.0).chain(speeds).collect();
        let picture = Picture::new(4096, seed);
        let given = tasks_of(picture.rays(), picture.rays().div_ceil(tasks));
        let cut = finer(&given, speeds.len()).unwrap_or(given);
        let (alone, together) = (alone_s(&speeds), picture.default(&cut, &speeds, known));
        let most = if known { 1.001 } else { 1.35 };
        prop_assert!(together <= alone * most, "{} of {}", together, alone);
    }
}
