//! How often 95% intervals of estimates hold on real scenes: promise 10, the table of docs/results/robustness.md.
//!
//! `cargo run --release -p rt-lab --bin coverage -- --help`
//!
//! Every ray's tests are counted once; then each estimator is asked again and again, with another seed each time, and
//! answered from these counts. A trial is one task of one estimate: its interval holds its exact number of tests or
//! does not. So neither the machine nor its load matters, but for the last column. Tasks that were walked in full, and
//! are certain, are left out.
//!
//! Columns: samples of a task, on average; trials; share of the trials whose interval holds; the same over trials whose
//! task has rays that differ (an interval around a constant always holds); share of the tasks whose own intervals hold
//! in less than 80% of their trials, which a mean over tasks would hide; half the width of an interval, relative to the
//! task's tests, in the median; mean relative error of a task, after one common scale, and its 95th percentile; by how
//! much all tasks together, and the most expensive tenth of them, are estimated too high in the mean; what the
//! estimator itself computes for one estimate, in milliseconds of one thread's processor time, in the median.
#![forbid(unsafe_code)]

use anyhow::Result;
use clap::Parser;
use rayon::prelude::*;
use rt_balance::catalogue::{Estimator, find};
use rt_balance::stats::median;
use rt_bvh::{Builder, Stack};
use rt_core::{
    CostEstimator, Observation, Precision, Query, Ray, RaySource, RayStream, ReducedWalk, Scene, Step, StreamKind,
    StreamSpec, Task, TestCounts, Walk, Work, tasks_of,
};
use rt_lab::{arguments, estimators};
use rt_report::Provenance;
use rt_report::exit::{self, Exit};
use rt_report::print::Stdout;
use rt_report::usage::usage;
use rt_scene::prepare::{Options as Prepare, prepare};
use rt_scene::streams::{self, PathStream, Wave};
use rt_sched::estimate::interval_95;
use rt_sched::metrics::EstimateErrors;
use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;

/// The least share of its own trials in which a task's intervals should hold: a task below it is one that the mean
/// hides.
const LEAST_OF_A_TASK: f64 = 0.8;

/// Relative rounding of [`Work`]'s single precision, by which an interval of width 0 may miss.
const ROUNDING: f64 = 1e-6;

/// Streams of the same rays that a warm estimator has seen before the one that is judged.
const WARMING: u32 = 2;

/// How often 95% intervals of estimates hold on real scenes.
#[derive(Debug, Parser)]
#[command(after_help = Exit::HELP)]
struct Options {
    /// Built-in scenes (yard, car) or files (OBJ, PLY, STL, glTF)
    #[arg(required = true, value_name = "SCENE")]
    scenes: Vec<PathBuf>,
    /// Size of the picture in pixels
    #[arg(long, value_name = "WxH", default_value = "512x512", value_parser = arguments::size)]
    size: [u32; 2],
    /// Rays of a task
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(1..))]
    task_size: u32,
    /// Estimates by each estimator, each with a seed of its own
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..))]
    trials: u32,
    /// Seed of the samples
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u32,
    /// Shares of the rays that are sampled
    #[arg(long, value_name = "F,...", value_delimiter = ',', default_value = "1/8,1/64")]
    #[arg(value_parser = arguments::fraction)]
    fractions: Vec<f64>,
    /// Only estimators whose name begins with one of these
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    only: Vec<String>,
}

/// An estimator to be tried.
struct Case {
    name: String,
    estimator: Estimator,
    /// What its estimates are to be compared with.
    walk: Walk,
    /// Streams that it sees first.
    warming: u32,
}

/// Rays with the tests of each.
struct Stream {
    kind: StreamKind,
    source: RaySource,
    tasks: Vec<Task>,
    full: Vec<TestCounts>,
    reduced: Vec<TestCounts>,
}

/// What the trials of one estimator showed.
#[derive(Clone, Default)]
struct Outcome {
    /// Trials of each task, and those whose interval holds.
    trials: Vec<[u32; 2]>,
    samples: u64,
    /// Half the interval over the task's tests.
    widths: Vec<f32>,
    /// Mean error against exact counts, and its 95th percentile, of each estimate.
    errors: Vec<[f64; 2]>,
    /// By how much all tasks together, and the most expensive tenth of them, were estimated too high, of each estimate.
    biases: Vec<[f64; 2]>,
    /// Thread seconds of each estimate.
    host_s: Vec<f64>,
}

fn main() -> ExitCode {
    exit::main(|| run(&Options::parse()))
}

fn run(options: &Options) -> Result<()> {
    let cases = cases(options)?;
    // No device: rays are counted by the library.
    let provenance = Provenance::now(options.seed, [format!("{} threads", rayon::current_num_threads())]);
    writeln!(Stdout, "{provenance}")?;
    writeln!(
        Stdout,
        "| scene | rays | estimator | samples of a task | trials | hold % | where rays differ % | tasks below 80% | \
         ± % | error % | p95 % | bias % | of the most expensive tenth % | host ms |"
    )?;
    writeln!(Stdout, "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|")?;
    for name in &options.scenes {
        let scene = prepare(name, &Prepare::new(Builder::default()), &mut rt_scene::obj::unwatched)?;
        let built = &scene.built.scene;
        let paths = scene.paths(&scene.view(), options.size, 1)?;
        let primary = paths.primary(&Wave::whole(options.size)?);
        let hits = streams::trace(built, &primary.source, primary.spec(Precision::Robust));
        let [_, diffuse] = paths.follow(&primary, &hits);
        for PathStream { source, kind, .. } in [primary, diffuse] {
            let stream = Stream::new(built, kind, source, options.task_size);
            for case in &cases {
                let outcome = (0..options.trials)
                    .into_par_iter()
                    .map(|trial| case.trial(&stream, options.seed.wrapping_add(trial * (WARMING + 1))))
                    .reduce(Outcome::default, Outcome::plus);
                print(&scene.name, &stream, case, outcome)?;
            }
        }
    }
    Ok(())
}

/// Every estimator with errors of its own.
fn cases(options: &Options) -> Result<Vec<Case>> {
    let case = |suffix: &str, estimator: Estimator, warming| {
        let walk = estimator.make().walk().unwrap_or(Walk::Full);
        Case { name: format!("{}{suffix}", estimator.label()), estimator, walk, warming }
    };
    let mut cases = Vec::new();
    for &fraction in &options.fractions {
        let of = |name| find(estimators::all(), name).and_then(|entry| entry.with(fraction));
        cases.extend(["exact", "reduced", "field"].into_iter().filter_map(of).map(|chosen| case("", chosen, 0)));
        cases.extend(of("field").map(|chosen| case(", warm,", chosen, WARMING)));
    }
    let usual = |name| find(estimators::all(), name).map(|entry| case("", entry.usual(), 0));
    cases.extend(["adaptive", "auto"].into_iter().filter_map(usual));
    let asked = |case: &Case| options.only.is_empty() || options.only.iter().any(|only| case.name.starts_with(only));
    let known: Vec<String> = cases.iter().map(|case: &Case| case.name.clone()).collect();
    let cases: Vec<Case> = cases.into_iter().filter(asked).collect();
    if cases.is_empty() {
        return Err(usage(format!("--only {}: there are {}", options.only.join(","), known.join("; "))).into());
    }
    Ok(cases)
}

impl Stream {
    fn new(scene: &Scene, kind: StreamKind, source: RaySource, task_size: u32) -> Self {
        let rays: Vec<(Ray, u32)> = (0..source.len()).map(|i| source.ray(i)).collect();
        let spec = StreamSpec::new(Query::Closest, Precision::Robust, true);
        let count = |walk: Walk| -> Vec<TestCounts> {
            let of_some = |rays: &[(Ray, u32)]| {
                let (mut stack, mut counts) = (Stack::for_scene(scene), Vec::with_capacity(rays.len()));
                let rays = rays.iter().copied();
                match walk {
                    Walk::Full => rt_bvh::trace(scene, &mut stack, spec, rays, |_, c| counts.push(c)),
                    walk => rt_bvh::count(scene, &mut stack, walk, Precision::Robust, rays, |_, c| counts.push(c)),
                }
                counts
            };
            rays.par_chunks(4096).flat_map_iter(of_some).collect()
        };
        let (full, reduced) = (count(Walk::Full), count(Walk::Reduced(ReducedWalk::LeafAsHit)));
        Self { kind, tasks: tasks_of(source.len(), task_size), source, full, reduced }
    }

    fn counts(&self, walk: Walk) -> &[TestCounts] {
        if walk == Walk::Full { &self.full } else { &self.reduced }
    }

    /// Tests of each ray of a task.
    fn tests(&self, task: &Task, walk: Walk) -> impl Iterator<Item = u64> {
        let counts = &self.counts(walk)[task.first as usize..(task.first + task.rays) as usize];
        counts.iter().map(|c| u64::from(c.boxes) + u64::from(c.triangles))
    }

    fn differs(&self, task: &Task, walk: Walk) -> bool {
        let mut tests = self.tests(task, walk);
        let first = tests.next();
        tests.any(|other| Some(other) != first)
    }
}

impl Case {
    /// One estimate of every task, judged.
    fn trial(&self, stream: &Stream, seed: u32) -> Outcome {
        let mut estimator = self.estimator.make();
        for earlier in 0..self.warming {
            self.estimate(&mut *estimator, stream, seed + earlier);
        }
        let (work, samples, host_s) = self.estimate(&mut *estimator, stream, seed + self.warming);
        let truths: Vec<f64> =
            stream.tasks.iter().map(|task| stream.tests(task, self.walk).sum::<u64>() as f64).collect();
        let estimated: Vec<f64> = work.iter().map(|w| f64::from(w.tests())).collect();
        let mut outcome = Outcome {
            samples: samples.iter().copied().map(u64::from).sum(),
            errors: EstimateErrors::new(&estimated, &truths).map(|e| [e.mean_relative, e.p95]).into_iter().collect(),
            biases: vec![biases(&estimated, &truths)],
            host_s: vec![host_s],
            ..Outcome::default()
        };
        for (((task, work), &n), &truth) in stream.tasks.iter().zip(&work).zip(&samples).zip(&truths) {
            let mut seen = [0; 2];
            if let Some(half) = interval_95(work, n).filter(|_| n < task.rays) {
                let off = (f64::from(work.tests()) - truth).abs();
                seen = [1, u32::from(off <= half + ROUNDING * truth)];
                outcome.widths.push((half / truth.max(1.0)) as f32);
            }
            outcome.trials.push(seen);
        }
        outcome
    }

    /// What a driver does, with the counts that are known already. Returns work and number of samples of each task, and
    /// thread seconds of the estimator's own work.
    fn estimate(&self, estimator: &mut dyn CostEstimator, stream: &Stream, seed: u32) -> (Vec<Work>, Vec<u32>, f64) {
        let Stream { kind, source, tasks, .. } = stream;
        let asked = RayStream { seed, source: Some(source), devices: 2, moves: false, ..RayStream::new(*kind, tasks) };
        let mut samples = vec![0; tasks.len()];
        let (mut rays, mut counts) = (Vec::new(), Vec::new());
        let mut host_s = 0.0;
        loop {
            let begin = thread_s();
            let step = estimator.next(asked, Observation { rays: &rays, counts: &counts });
            host_s += thread_s() - begin;
            match step {
                Step::Done(work) => return (work, samples, host_s),
                Step::Sample { rays: wanted, walk } => {
                    counts = wanted.iter().map(|&ray| stream.counts(walk)[ray as usize]).collect();
                    for &ray in &wanted {
                        samples[tasks.partition_point(|task| task.range().end <= ray)] += 1;
                    }
                    rays = wanted;
                }
            }
        }
    }
}

impl Outcome {
    fn plus(mut self, mut other: Self) -> Self {
        if self.trials.is_empty() {
            return other;
        }
        for (own, more) in self.trials.iter_mut().zip(&other.trials) {
            *own = [own[0] + more[0], own[1] + more[1]];
        }
        self.samples += other.samples;
        self.widths.append(&mut other.widths);
        self.errors.append(&mut other.errors);
        self.biases.append(&mut other.biases);
        self.host_s.append(&mut other.host_s);
        self
    }
}

/// By how much all tasks together, and the most expensive tenth of them, are estimated too high.
fn biases(estimated: &[f64], truths: &[f64]) -> [f64; 2] {
    let mut tasks: Vec<(f64, f64)> = estimated.iter().copied().zip(truths.iter().copied()).collect();
    tasks.sort_unstable_by(|a, b| b.1.total_cmp(&a.1));
    [tasks.len(), tasks.len().div_ceil(10)].map(|count| {
        let [estimated, truth] = tasks[..count].iter().fold([0.0; 2], |[a, b], (e, t)| [a + e, b + t]);
        estimated / truth - 1.0
    })
}

/// A number; a dash where nothing was tried.
fn known(value: f64) -> String {
    if value.is_finite() { format!("{value:.1}") } else { "–".to_owned() }
}

fn print(scene: &str, stream: &Stream, case: &Case, mut outcome: Outcome) -> io::Result<()> {
    let percent = |[trials, hold]: [u64; 2]| known(100.0 * hold as f64 / trials as f64);
    let differs: Vec<bool> = stream.tasks.iter().map(|task| stream.differs(task, case.walk)).collect();
    let sum = |wanted: &dyn Fn(usize) -> bool| {
        let some = outcome.trials.iter().enumerate().filter(|(i, _)| wanted(*i));
        some.fold([0_u64; 2], |[n, h], (_, &[trials, hold])| [n + u64::from(trials), h + u64::from(hold)])
    };
    let (all, differing) = (sum(&|_| true), sum(&|i| differs[i]));
    let poor = |[trials, hold]: &&[u32; 2]| f64::from(*hold) < LEAST_OF_A_TASK * f64::from(*trials);
    let (poor, tasks) = (outcome.trials.iter().filter(poor).count(), outcome.trials.len());
    let estimates = outcome.samples as f64 / tasks as f64;
    outcome.widths.sort_unstable_by(f32::total_cmp);
    let width = outcome.widths.get(outcome.widths.len() / 2).copied().unwrap_or(f32::NAN);
    let mean = |of: &[[f64; 2]], part: usize| of.iter().map(|e| e[part]).sum::<f64>() / of.len().max(1) as f64;
    // Of each task in each trial, certain ones included.
    let runs = (outcome.trials.iter().map(|[trials, _]| *trials).max().unwrap_or(0)).max(1);
    writeln!(
        Stdout,
        "| {scene} | {} | {} | {:.1} | {} | {} | {} | {poor} of {tasks} | {} | {:.2} | {:.1} | {:+.1} | {:+.1} | {:.2} |",
        stream.kind,
        case.name,
        estimates / f64::from(runs),
        all[0],
        percent(all),
        percent(differing),
        known(f64::from(100.0 * width)),
        100.0 * mean(&outcome.errors, 0),
        100.0 * mean(&outcome.errors, 1),
        100.0 * mean(&outcome.biases, 0),
        100.0 * mean(&outcome.biases, 1),
        1e3 * median(&outcome.host_s)
    )
}

/// Processor seconds of this thread.
#[cfg(unix)]
fn thread_s() -> f64 {
    let t = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    t.tv_sec as f64 + 1e-9 * t.tv_nsec as f64
}

/// The wall's time, where the system does not tell.
#[cfg(not(unix))]
fn thread_s() -> f64 {
    std::time::UNIX_EPOCH.elapsed().map_or(f64::NAN, |t| t.as_secs_f64())
}
