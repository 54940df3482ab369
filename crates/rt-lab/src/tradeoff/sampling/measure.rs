//! The sweep: every setting in turn, round after round.

use super::estimators::{Kind, kinds};
use crate::contenders::{self, Contender, MACHINES};
use crate::subject::Subject;
use crate::time_budget::TimeBudget;
use crate::tradeoff::Setting;
use anyhow::{Context, Result};
use rt_balance::catalogue::ESTIMATORS;
use rt_balance::replay::{Observed, Replay};
use rt_balance::report::{ErrorReport, StreamRun};
use rt_balance::stats::Summary;
use rt_balance::{Scheduling, Stream, clock};
use rt_core::{CostEstimator, Device, DeviceErrorKind, StreamKind, TestCounts};
use rt_sched::metrics;
use rt_sched::sample::Fraction;
use serde::Serialize;
use std::path::Path;
use std::sync::Arc;

/// What is measured of a setting in each round; all are shares without a unit.
pub(super) const METRICS: [&str; 10] = [
    "error vs counts, mean",
    "error vs counts, p95",
    "error vs time, mean",
    "error vs time, p95",
    "overhead",
    "net overhead",
    "excess, 2 devices",
    "excess, 3 devices",
    "excess, 8 devices",
    "excess, 1:2:4",
];
pub(super) const COUNTS: usize = 0;
pub(super) const TIME: usize = 2;
pub(super) const OVERHEAD: usize = 4;
pub(super) const EXCESS: usize = 6;

/// Where [`METRICS`] has the excess on three equal devices.
pub(super) const EXCESS_OF_3: usize = EXCESS + 1;

type Sample = [f64; METRICS.len()];

/// One setting on one stream.
#[derive(Debug, Serialize)]
pub(super) struct Cell {
    pub(super) scene: String,
    pub(super) stream: String,
    /// Rays per task.
    pub(super) task_rays: u32,
    pub(super) tasks: usize,
    /// The estimator; of the settings without one, how the regular tasks were dealt.
    pub(super) estimator: String,
    /// `strided` or `random`; `None` without samples.
    pub(super) sampler: Option<&'static str>,
    /// Share of the rays that was asked for: all samples, or an adaptive estimate's first ones
    /// as a share of the trace; 0 without an estimator.
    pub(super) fraction: f64,
    /// Seed of each round's samples.
    pub(super) seeds: Vec<u32>,
    /// Wall seconds of estimating and planning, of the whole run, and of the plain run it is compared with, per round.
    pub(super) seconds: Vec<[f64; 3]>,
    /// For each metric its value in each round; null where it has none.
    pub(super) samples: Vec<Metric>,
}

/// The values of one of [`METRICS`].
#[derive(Debug, Serialize)]
pub(super) struct Metric {
    pub(super) name: &'static str,
    pub(super) values: Vec<f64>,
    pub(super) summary: Summary,
}

/// What is swept.
pub(super) struct Sweep<'a> {
    setting: &'a Setting<'a>,
    fractions: &'a [f64],
    task_sizes: &'a [u32],
}

/// The paper's eighth, our sixty-fourth, and what lies about them.
const FRACTIONS: [f64; 5] = [1.0 / 8.0, 1.0 / 32.0, 1.0 / 64.0, 1.0 / 128.0, 1.0 / 256.0];
const QUICK_FRACTIONS: [f64; 2] = [1.0 / 8.0, 1.0 / 64.0];
/// Tiles of 8, 16, 32 and 64 pixels.
const TASK_SIZES: [u32; 4] = [64, 256, 1024, 4096];
const QUICK_TASK_SIZES: [u32; 2] = [256, 1024];

/// The fractions and the task sizes that are swept.
const fn swept(quick: bool) -> (&'static [f64], &'static [u32]) {
    if quick { (&QUICK_FRACTIONS, &QUICK_TASK_SIZES) } else { (&FRACTIONS, &TASK_SIZES) }
}

/// How often a round traces the rays of a picture: for each kind of rays and task size every setting and the plain run
/// beside it, and once more each task alone.
pub(super) fn passes(quick: bool) -> f64 {
    let (fractions, task_sizes) = swept(quick);
    let all: Vec<Kind> = kinds().collect();
    2.0 * task_sizes.len() as f64 * (2.0 * tries(&all, fractions).len() as f64 + 1.0)
}

/// Regular tasks: what estimates must beat.
const REGULAR: [Contender; 3] = [contenders::HYBRID, contenders::ROUND_ROBIN, contenders::BLOCKS];

/// A setting as it is run.
struct Try {
    kind: Kind,
    fraction: Fraction,
}

impl<'a> Sweep<'a> {
    pub(super) fn new(setting: &'a Setting<'a>) -> Self {
        let (fractions, task_sizes) = swept(setting.args.quick);
        Self { setting, fractions, task_sizes }
    }

    /// All settings on one scene, and the names of estimators for which the device has no walk.
    pub(super) fn measure(&self, scene: &Path, time: &TimeBudget<'_>) -> Result<(Vec<Cell>, Vec<String>)> {
        let mut subject = Subject::open(self.setting.lab, scene, self.setting.devices)?;
        let streams = subject.streams(self.setting.size, self.setting.args.seed)?;
        let (offered, missing) = offered(self.setting.devices, &subject, &streams)?;
        let tries = tries(&offered, self.fractions);
        let steps = streams.len() * self.task_sizes.len() * tries.len();
        let time = time.clone().with_steps(steps, self.setting.repeat + 1);
        let mut cells = Vec::new();
        for stream in streams.iter().filter(|stream| !stream.source.is_empty()) {
            for &size in self.task_sizes {
                let cut = stream.clone().with_task_size(size);
                cells.push(self.cells(subject.name(), &cut, size, &tries));
            }
        }
        // Rounds are outermost, so that a machine whose speed drifts slows all settings alike.
        for round in time.rounds(self.setting.repeat) {
            let mut cells = cells.iter_mut();
            for stream in streams.iter().filter(|stream| !stream.source.is_empty()) {
                for &size in self.task_sizes {
                    let seed = self.setting.args.seed.wrapping_add(round);
                    let stream = Stream { seed, ..stream.clone().with_task_size(size) };
                    let measured = self.round(&mut subject, &stream, &tries, round as usize, &time)?;
                    let Some(cells) = cells.next() else { break };
                    if round > 0 {
                        cells.iter_mut().zip(measured).for_each(|(cell, sample)| cell.push(seed, sample));
                    }
                }
            }
        }
        let mut cells: Vec<Cell> = cells.into_iter().flatten().collect();
        for metric in cells.iter_mut().flat_map(|cell| &mut cell.samples) {
            metric.summary = Summary::new(&metric.values);
        }
        Ok((cells, missing))
    }

    fn cells(&self, scene: &str, stream: &Stream, task_rays: u32, tries: &[Try]) -> Vec<Cell> {
        let cell = |estimator, sampler, fraction| Cell {
            scene: scene.to_owned(),
            stream: stream.kind.to_string(),
            task_rays,
            tasks: stream.tasks.len(),
            estimator,
            sampler,
            fraction,
            seeds: Vec::new(),
            seconds: Vec::new(),
            samples: METRICS
                .map(|name| Metric { name, values: Vec::new(), summary: Summary::new(&[]) })
                .into_iter()
                .collect(),
        };
        let regular = REGULAR.iter().map(|regular| cell(format!("none, {}", regular.name), None, 0.0));
        let tried =
            tries.iter().map(|t| cell(t.kind.name(), Some(t.kind.sampler_name(stream.kind)), t.fraction.value()));
        regular.chain(tried).collect()
    }

    /// One round on one stream: the regular settings, then every try, each beside a plain run.
    fn round(
        &self,
        subject: &mut Subject<'_>,
        stream: &Stream,
        tries: &[Try],
        round: usize,
        time: &TimeBudget<'_>,
    ) -> Result<Vec<([f64; 3], Sample)>> {
        let reference = subject.reference(stream)?;
        let task_s = reference.seconds.first().context("the device failed")?;
        let mut samples = vec![([f64::NAN; 3], [f64::NAN; METRICS.len()]); REGULAR.len() + tries.len()];
        // Every round begins with another one, so that none is always first.
        for step in 0..tries.len() {
            let index = (round + step) % tries.len();
            let Try { kind, fraction } = &tries[index];
            let plain = run(subject, stream, contenders::uninformed())?;
            let mut tried = run(subject, stream, kind.estimator(*fraction, stream.kind))?;
            reference.judge(&mut tried);
            samples[REGULAR.len() + index] = (seconds(&tried, &plain), sample(&tried, &plain, task_s));
            if step == 0 {
                let launch_s = Observed::of(&plain).launch_s;
                for (slot, excess) in samples.iter_mut().zip(regular(stream, task_s, launch_s)) {
                    slot.1[EXCESS..].copy_from_slice(&excess);
                }
            }
            time.step();
        }
        Ok(samples)
    }
}

/// Estimators whose walk every device has, and the names of the others: graphics cards lack walks that need tables.
fn offered(devices: &[Arc<dyn Device>], subject: &Subject<'_>, streams: &[Stream]) -> Result<(Vec<Kind>, Vec<String>)> {
    let Some(stream) = streams.iter().find(|stream| !stream.source.is_empty()) else {
        return Ok((kinds().collect(), Vec::new()));
    };
    let scene = Arc::new(subject.scene().clone());
    let mut missing = Vec::new();
    for device in devices {
        let mut tracer = device.tracer(Arc::clone(&scene), clock)?;
        tracer.load_rays(stream.source.clone(), stream.spec)?;
        for kind in kinds() {
            let Some(walk) = kind.walk() else { continue };
            match tracer.walk(&[0], walk, &mut [TestCounts::default()], None) {
                Err(error) if error.kind() == DeviceErrorKind::Unsupported => missing.push(kind.name()),
                // Anything else is told where it is measured.
                _ => {}
            }
        }
    }
    Ok((kinds().filter(|kind| !missing.contains(&kind.name())).collect(), missing))
}

/// Every estimator with every fraction, and walks of all rays where they are wanted.
fn tries(kinds: &[Kind], fractions: &[f64]) -> Vec<Try> {
    let mut tries = Vec::new();
    for &kind in kinds {
        let every = kind.every_ray().then_some(1.0);
        let fractions = every.into_iter().chain(fractions.iter().copied()).filter_map(Fraction::new);
        tries.extend(fractions.map(|fraction| Try { kind, fraction }));
    }
    tries
}

fn run(subject: &mut Subject<'_>, stream: &Stream, estimator: Box<dyn CostEstimator>) -> Result<StreamRun> {
    // One device has nothing to gain; the virtual ones do.
    subject.trace(stream, &mut Scheduling { estimator, uninformed_excess: Some(1.0), ..Scheduling::default() })
}

fn seconds(tried: &StreamRun, plain: &StreamRun) -> [f64; 3] {
    [tried.report.estimate.seconds, tried.report.makespan_s, plain.report.makespan_s]
}

/// Excess of the settings of [`REGULAR`] on each of [`MACHINES`].
fn regular(stream: &Stream, task_s: &[f64], launch_s: f64) -> [[f64; MACHINES.len()]; REGULAR.len()] {
    let rays: Vec<u32> = stream.tasks.iter().map(|task| task.rays).collect();
    REGULAR.map(|regular| {
        let scheduling = regular.scheduling(&ESTIMATORS[0].usual());
        MACHINES.map(|(_, speeds)| {
            let replay = Replay { speeds, task_s, launch_s, hand_over_s: 0.0 };
            metrics::excess(replay.regular(&scheduling, &rays).makespan_s, replay.lower_bound()).unwrap_or(f64::NAN)
        })
    })
}

/// The metrics of one run that was judged. The plain run traces every ray on the same device, right before it.
fn sample(tried: &StreamRun, plain: &StreamRun, task_s: &[f64]) -> Sample {
    let [estimate_s, makespan_s, plain_s] = seconds(tried, plain);
    let both = |errors: Option<ErrorReport>| errors.map_or([f64::NAN; 2], |errors| [errors.mean, errors.p95]);
    let seen = Observed::of(tried);
    let excess = MACHINES.map(|(_, speeds)| {
        let replay = Replay { speeds, task_s, launch_s: seen.launch_s, hand_over_s: 0.0 };
        let (run, estimate_s) = replay.cost_initialised(&Scheduling::default(), &seen);
        metrics::excess(estimate_s + run.makespan_s, replay.lower_bound()).unwrap_or(f64::NAN)
    });
    let estimate = &tried.report.estimate;
    let ([counts, counts_p95], [time, time_p95]) = (both(estimate.errors_counts), both(estimate.errors_time));
    let [two, three, eight, unequal] = excess;
    let overhead = estimate_s / plain_s;
    let net = makespan_s / plain_s - 1.0;
    [counts, counts_p95, time, time_p95, overhead, net, two, three, eight, unequal]
}

impl Cell {
    fn push(&mut self, seed: u32, (seconds, sample): ([f64; 3], Sample)) {
        self.seeds.push(seed);
        self.seconds.push(seconds);
        self.samples.iter_mut().zip(sample).for_each(|(metric, value)| metric.values.push(value));
    }

    /// The median of one of [`METRICS`].
    pub(super) fn median(&self, metric: usize) -> f64 {
        self.samples[metric].summary.median
    }

    /// Whether the rays are coherent.
    pub(super) fn is_primary(&self) -> bool {
        self.stream == StreamKind::Primary.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mutant: a machine whose excess stands under another's name.
    #[test]
    fn every_machine_has_its_metric() {
        assert_eq!(METRICS.len(), EXCESS + MACHINES.len());
        for (metric, (name, _)) in METRICS[EXCESS..].iter().zip(MACHINES) {
            assert_eq!(*metric, format!("excess, {name}"));
        }
    }
}
