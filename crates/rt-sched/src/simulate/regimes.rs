//! The queues over the regimes that devices and tasks come in: few tasks and many, equal devices and very unequal ones,
//! costs and speeds known and not.

use super::tests::{estimated, image, models};
use super::*;
use crate::cut::finer;
use crate::estimate::Auto;
use crate::queue::QueueKind;
use crate::queue::QueueMaker;
use crate::uninformed::Regime;
use crate::{bound, metrics};
use alloc::borrow::ToOwned;
use core::iter::repeat_n;
use rt_core::{CostEstimator, CostModel, Observation, RayStream, Step, StreamKind, Task, Work};
use std::eprintln;
use std::string::String;

mod tables;

/// Number of pictures whose excess is averaged.
const PICTURES: u32 = 4;

/// Seconds of the frame, were tasks divisible.
const FRAME_S: f64 = 0.1;

/// What a queue is told before it begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Known {
    /// Neither costs nor speeds.
    Nothing,
    /// Speeds only.
    Speeds,
    /// Speeds, and costs with this relative standard error.
    Costs(f64),
}

/// Seconds of each task on a device of speed 1, such that the divisible ideal is `frame_s`.
fn picture(tasks: u32, speeds: &[f64], frame_s: f64, seed: u32) -> Vec<f64> {
    let costs = image(tasks, 1, seed);
    let scale = frame_s * speeds.iter().sum::<f64>() / costs.iter().sum::<f64>();
    costs.iter().map(|cost| cost * scale).collect()
}

/// Tasks on devices, and what a queue is told of them.
#[derive(Clone, Debug)]
struct Case<'a> {
    queue: &'a str,
    speeds: &'a [f64],
    tasks: u32,
    /// Parts of a task whose costs are told apart by the picture, and parts that each is cut into.
    cells: u32,
    parts: u32,
    known: Known,
    frame_s: f64,
    costs: Simulation,
}

impl<'a> Case<'a> {
    fn new(queue: &'a str, speeds: &'a [f64], tasks: u32, known: Known) -> Self {
        let (cells, parts, costs) = (1, 1, Simulation::default());
        Self { queue, speeds, tasks, cells, parts, known, frame_s: FRAME_S, costs }
    }

    /// Excess over the lower bound of the cells in percent, and launches of a device, with one picture.
    fn run(&self, seed: u32) -> [f64; 2] {
        let Self { queue, speeds, tasks, cells, parts, known, frame_s, costs: ref simulation } = *self;
        let costs = picture(tasks * cells, speeds, frame_s, seed);
        let bound = bound::related(&costs, speeds);
        let costs: Vec<f64> = costs.chunks((cells / parts) as usize).map(|cells| cells.iter().sum()).collect();
        let work = match known {
            Known::Costs(sigma) => estimated(&costs, sigma, seed),
            // All that is known of a task is how many rays it has; what a ray takes is known where speeds are.
            Known::Nothing => vec![Work::new(64.0, 0.0, 0.0); costs.len()],
            Known::Speeds => {
                let mean = costs.iter().sum::<f64>() / costs.len() as f64;
                vec![Work::new(0.0, (mean * 1e9) as f32, 0.0); costs.len()]
            }
        };
        let unknown = known == Known::Nothing;
        let devices = if unknown { vec![CostModel::UNIT; speeds.len()] } else { models(speeds, simulation.launch_s) };
        let queue = super::tests::queue(queue, &work, &devices);
        let run = simulation.run(&*queue, speeds.len(), &|d, task| costs[task as usize] / speeds[d]);
        let excess = metrics::excess(run.makespan_s, bound).expect("positive") * 100.0;
        [excess, run.launches.iter().sum::<usize>() as f64 / speeds.len() as f64]
    }

    /// Means over so many pictures.
    fn mean_of(&self, pictures: u32) -> [f64; 2] {
        let sum = (0..pictures).map(|seed| self.run(seed)).fold([0.0; 2], |[a, b], [c, d]| [a + c, b + d]);
        sum.map(|sum| sum / f64::from(pictures))
    }

    /// Means over [`PICTURES`].
    fn mean(&self) -> [f64; 2] {
        self.mean_of(PICTURES)
    }
}

/// Mean excess over the lower bound, in percent.
pub(super) fn excess(name: &str, speeds: &[f64], tasks: u32, known: Known) -> f64 {
    Case::new(name, speeds, tasks, known).mean()[0]
}

/// The same where every launch costs `launch_s` on the device, which is known with the speeds, and the mean number of
/// launches of a device.
fn launching(name: &str, speeds: &[f64], tasks: u32, known: Known, frame_s: f64, launch_s: f64) -> [f64; 2] {
    let costs = Simulation { launch_s, ..Simulation::default() };
    Case { frame_s, costs, ..Case::new(name, speeds, tasks, known) }.mean()
}

/// One device for each of `m / speeds.len()` turns of `speeds`.
pub(super) fn turns(speeds: &[f64], m: usize) -> Vec<f64> {
    speeds.iter().copied().cycle().take(m).collect()
}

/// Processor cores beside one graphics card.
pub(super) fn cores_and_card() -> Vec<f64> {
    repeat_n(1.0, 16).chain([500.0]).collect()
}

/// Bounds in percent, some twice what is found; before the rules of [`crate::queue::HybridQueue`] that keep a slow
/// device from holding all others up, these were, row by row, 2.8, 13, 0.6, 72, 3.1, 12 and 7.9%.
///
/// Mutants: `may_take` that always allows; `caution` of 1 in it; `of` that always believes the prediction.
#[test]
fn slow_devices_hold_nobody_up() {
    let [mixed, cores] = [turns(&[1.0, 50.0, 50.0], 3), cores_and_card()];
    for (speeds, tasks, known, limit) in [
        (&mixed, 3072, Known::Speeds, 0.5),
        (&mixed, 3072, Known::Nothing, 0.5),
        (&mixed, 8192, Known::Nothing, 0.3),
        (&mixed, 3072, Known::Costs(0.1), 0.2),
        (&cores, 9000, Known::Nothing, 6.0),
        (&cores, 9000, Known::Costs(0.1), 2.0),
        (&cores, 9000, Known::Speeds, 2.0),
        (&turns(&[1.0, 2.0, 4.0], 63), 63 * 16, Known::Costs(0.1), 7.0),
    ] {
        let found = excess("hybrid", speeds, tasks, known);
        assert!(found <= limit, "{} devices, {tasks} tasks, {known:?}: {found}%", speeds.len());
    }
    // The card alone would take this much longer than all together.
    let alone = 100.0 * 16.0 / 500.0;
    let beside = excess("hybrid", &cores, 9000, Known::Costs(0.1));
    assert!(beside < alone, "with the cores {beside}%, without {alone}%");
}

/// Launches that cost time on the device, from nothing to a tenth of the frame: then as few are the best, and the queue
/// is as good as the schedule that it begins with.
///
/// Mutants: `launches` that always says `(f64::INFINITY, 0.0)`; one without `FEWEST`; `of`
/// without the seconds of launches; `loot` without what launches cost; `now`
/// that takes a quarter of launches of whole lists for done.
#[test]
fn launches_are_worth_their_price() {
    for speeds in [turns(&[1.0], 3), turns(&[1.0], 8), turns(&[1.0, 2.0, 4.0], 3)] {
        let shares = [0.0, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1];
        for (each, share) in [16, 128, 1024].into_iter().flat_map(|each| shares.map(|share| (each, share))) {
            let tasks = each * speeds.len() as u32;
            let of = |queue, known| launching(queue, &speeds, tasks, known, FRAME_S, share * FRAME_S)[0];
            for known in [Known::Costs(0.1), Known::Costs(0.3)] {
                let [fixed, hybrid] = ["lpt", "hybrid"].map(|queue| of(queue, known));
                // With 16 tasks a device chance makes more of a difference, over four pictures.
                let room = if each == 16 { 0.7 } else { 0.5 };
                assert!(hybrid <= fixed + room, "{speeds:?}, {each}, {share}, {known:?}: {hybrid} {fixed}");
            }
        }
    }
}

/// What launches cost is found out where nothing is known, and is not made up where they cost nothing. Before,
/// launches of a tenth of a frame were 73 a device, and the frame took eight times as long; with 64 tasks a device, of
/// which each was a launch, 7.4 times.
///
/// Mutants: `Timed::price` that is always 0; `TRIED` of 0.
#[test]
fn expensive_launches_are_found_out() {
    let all = [(turns(&[1.0], 8), [2.0, 45.0, 180.0]), (turns(&[1.0, 2.0, 4.0], 3), [2.0, 80.0, 190.0])];
    for (speeds, most) in all {
        let of = |each: u32, share| {
            let tasks = each * speeds.len() as u32;
            launching("hybrid", &speeds, tasks, Known::Nothing, FRAME_S, share * FRAME_S)
        };
        for (share, most) in [0.0, 0.02, 0.1].into_iter().zip(most) {
            let [excess, launches] = of(256, share);
            assert!(excess <= most, "{speeds:?}, {share}: {excess}%");
            assert!((share == 0.0) == (launches > 45.0), "{speeds:?}, {share}: {launches} launches");
        }
        let [excess, launches] = of(64, 0.1);
        assert!(excess <= 200.0 && launches < 20.0, "{speeds:?}, few tasks: {excess}%, {launches} launches");
    }
}

/// Samples of a first stream, two of each task: the standard error of a task's cost (docs/results/estimation.md).
const SAMPLES: Known = Known::Costs(0.2);

/// What the last stream tells of the next, for nothing.
const PAST: Known = Known::Costs(0.04);

/// What a first stream can be dealt by, and what later ones can.
const FIRST: [(&str, Known); 6] = [
    ("hybrid", Known::Nothing),
    ("hybrid", SAMPLES),
    ("round robin", Known::Nothing),
    ("central", Known::Nothing),
    ("lpt", SAMPLES),
    ("central", SAMPLES),
];
const LATER: [(&str, Known); 4] = [("hybrid", PAST), ("lpt", PAST), ("central", PAST), ("permuted", Known::Speeds)];

/// Rays of a task before it is cut.
const RAYS: u32 = 1024;

/// What two samples of a task of so many primary rays cost, as a share of the trace: a sampled one takes as long as
/// seven (docs/results/sampling.md), and is not traced again.
fn price(rays: u32) -> f64 {
    2.0 * 6.0 / f64::from(rays)
}

/// A stream as the default estimator is told of it.
pub(super) fn told(
    kind: StreamKind,
    tasks: &[Task],
    devices: usize,
    are_speeds_known: bool,
    are_alike: bool,
) -> RayStream<'_> {
    let queue: &dyn QueueMaker = &QueueKind::default();
    let regime = Regime { tasks: tasks.len(), devices, are_speeds_known, are_alike, launch: 0.0 };
    RayStream {
        devices: devices as u32,
        uninformed_excess: queue.uninformed_excess(&regime),
        moves: queue.moves(&regime),
        ..RayStream::new(kind, tasks)
    }
}

/// Whether the default walks samples of such a stream where it is the first.
fn does_sample(kind: StreamKind, tasks: &[Task], devices: usize, are_alike: bool) -> bool {
    let stream = told(kind, tasks, devices, false, are_alike);
    matches!(Auto::default().next(stream, Observation::default()), Step::Sample { .. })
}

/// The default's excess beside that of the best strategy, and which that is: of a first stream, and of later ones.
fn default_and_best(speeds: &[f64], tasks: u32, launch_share: f64, pictures: u32) -> [(f64, f64, String); 2] {
    let given = rt_core::tasks_of(tasks * RAYS, RAYS);
    let cut = finer(&given, speeds.len()).unwrap_or(given);
    let cells = cut.len() as u32 / tasks;
    let of = |(queue, known): (&'static str, Known), parts| {
        let costs = Simulation { launch_s: launch_share * FRAME_S, ..Simulation::default() };
        let case = Case { costs, cells, parts, ..Case::new(queue, speeds, tasks, known) };
        let price = if known == SAMPLES { price(RAYS / parts) } else { 0.0 };
        let costs = if matches!(known, Known::Costs(_)) { ", costs" } else { "" };
        let grain = if parts > 1 { ", cut" } else { "" };
        (100.0 * price + case.mean_of(pictures)[0], std::format!("{queue}{costs}{grain}"))
    };
    let are_alike = speeds.windows(2).all(|pair| pair[0] == pair[1]);
    let samples = does_sample(StreamKind::Primary, &cut, speeds.len(), are_alike);
    [(&FIRST[..], usize::from(samples)), (&LATER[..], 0)].map(|(strategies, default)| {
        let found = strategies.iter().map(|&strategy| of(strategy, cells));
        let mut found: Vec<(f64, String)> = found.collect();
        let (default, _) = found[default];
        if cells > 1 {
            found.extend(strategies.iter().map(|&strategy| of(strategy, 1)));
        }
        let (best, name) = found.iter().min_by(|a, b| a.0.total_cmp(&b.0)).expect("some");
        (default, *best, name.clone())
    })
}

/// What two samples of each task gain: of 256 rays, the smallest that there are, on equal devices. Means over pictures
/// of the excess with nothing known and with samples, what these cost included, for primary and for other rays; and
/// whether the default makes them.
fn with_and_without_samples(devices: usize, each: u32) -> [(f64, f64, bool); 2] {
    const RAYS: u32 = 256;
    let (speeds, tasks) = (turns(&[1.0], devices), each * devices as u32);
    let mean = |known| Case::new("hybrid", &speeds, tasks, known).mean_of(12)[0];
    let nothing = mean(Known::Nothing);
    // What 1 ray in 128 costs, beside the rays that are not traced again and for the host (docs/results/sampling.md),
    // and the errors of two samples.
    [(StreamKind::Primary, 0.2, [6.0, 0.5]), (StreamKind::Custom, 0.3, [1.2, 0.1])].map(|(kind, error, [ray, host])| {
        let price = 100.0 * 2.0 * (ray + host * devices as f64) / f64::from(RAYS);
        let cut = rt_core::tasks_of(tasks * RAYS, RAYS);
        let samples = does_sample(kind, &cut, devices, true);
        (nothing, price + mean(Known::Costs(error)), samples)
    })
}

/// The default samples where that gains something, and nowhere where it loses much. `--nocapture` prints the table of
/// docs/results/scheduling.md.
///
/// Mutants: `left` of no error; `STAKE` of 3; prices of 3 and 1.5, as assumed before.
#[test]
fn two_samples_pay_where_they_are_made() {
    eprintln!("| devices | n/m | nothing known | samples, primary | samples, others |");
    eprintln!("|---|---|---|---|---|");
    for devices in [2, 8, 64] {
        for each in [2, 4, 8, 16, 32, 64] {
            let found = with_and_without_samples(devices, each);
            let show = |&(_, with, made): &(f64, f64, bool)| {
                if made { std::format!("**{with:.1}**") } else { std::format!("{with:.1}") }
            };
            let [primary, others] = found.each_ref().map(show);
            eprintln!("| {devices} | {each} | {:.1} | {primary} | {others} |", found[0].0);
            for (nothing, with, made) in found {
                let [chosen, best] = [if made { with } else { nothing }, with.min(nothing)];
                let room = if devices == 64 { 4.5 } else { 2.1 };
                assert!(chosen <= best + room, "{devices}, {each}: {found:?}");
            }
        }
    }
}

/// First streams of few rays on devices that may differ are sampled, which tells how fast those are.
///
/// Mutant: `unlike_excess` left out: 22, 320 and 684%.
#[test]
fn few_rays_tell_how_fast_unlike_devices_are() {
    for (speeds, most) in
        [(turns(&[1.0, 2.0, 4.0], 3), 12.0), (turns(&[1.0, 50.0, 50.0], 3), 10.0), (cores_and_card(), 10.0)]
    {
        let [(first, ..), _] = default_and_best(&speeds, 2 * speeds.len() as u32, 0.0, PICTURES);
        assert!(first <= most, "{} devices: {first}%", speeds.len());
    }
}
