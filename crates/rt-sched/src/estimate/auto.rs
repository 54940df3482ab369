//! The estimator that chooses one.

use super::batch::{Asked, Batch};
use super::field::{Fields, blocks};
use super::history::History;
use super::price::WalkPrices;
use crate::metrics::EstimateErrors;
use crate::sample::Fraction;
use alloc::vec::Vec;
use rt_core::{
    CostEstimator, LaunchRecord, Observation, RayStream, Step, StreamKind, StreamRecord, TaskId, Walk, Work,
};

/// Picks for each stream what has predicted such streams best so far, within a budget. The default.
///
/// * How much to sample follows from the budget and the measured price of a walked ray: at `price` times a traced one,
///   whose hit is kept, the fraction f costs (price − 1) · f of the trace.
/// * One sample serves two estimates: each task's own samples scaled up ([`super::Sampled`]) and the map of costs
///   ([`super::Field`]). From the second stream of a kind there is a third, the measured past ([`super::History`]).
/// * After a stream each of them, used or not, is compared with the measured seconds of its tasks, device by device. The
///   one with the least mean error, over the streams of its kind with later ones counting more, makes the next estimate.
///   Once the past does, nothing is sampled, except in every eighth stream, to see whether that is still right.
/// * Before anything was measured, the map where tasks have fewer than eight samples or rays are incoherent, and
///   their own samples elsewhere.
///
/// Nothing in it depends on which scene is traced.
#[derive(Debug)]
pub struct Auto {
    budget: f64,
    fields: Fields,
    history: History,
    prices: WalkPrices,
    asked: Asked,
    kinds: Vec<Kind>,
    open: Open,
}

/// The candidates, in the order in which ties are decided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Arm {
    #[default]
    Exact,
    Field,
    History,
}

const ARMS: [Arm; 3] = [Arm::Exact, Arm::Field, Arm::History];

/// What is known of a kind of stream.
#[derive(Clone, Debug)]
struct Kind {
    kind: StreamKind,
    /// Mean relative error against measured seconds of each arm.
    errors: [Option<f64>; ARMS.len()],
    streams: u32,
}

/// The stream in hand: what each arm says of it, and what was measured.
#[derive(Clone, Debug, Default)]
struct Open {
    chosen: Arm,
    says: [Option<Vec<Work>>; ARMS.len()],
    measured: Vec<Measured>,
}

/// A task, or a whole launch where only that was timed.
#[derive(Clone, Debug)]
struct Measured {
    device: usize,
    tasks: Vec<TaskId>,
    seconds: f64,
}

/// Share of the trace that sampling may cost: half of what balancing by it should gain, the project's goal.
const BUDGET: f64 = 0.005;

/// A task with fewer samples than this is better served by the map: below it, intervals are not a task's own.
const OWN_SAMPLES: f64 = 8.0;

/// Samples are never fewer than one ray in 256, where estimates are still worth having, nor more than one in 16, beyond
/// which balancing gains nothing measurable.
const FRACTIONS: (f64, f64) = (1.0 / 256.0, 1.0 / 16.0);

/// The past is put to the test in every stream of this number.
const PROBE: u32 = 8;

/// Weight of the newest stream's error.
const NEWEST: f64 = 0.5;

impl Auto {
    /// An estimator that may spend `budget`, a share of the trace.
    #[must_use]
    pub fn new(budget: f64) -> Self {
        Self {
            budget: if budget > 0.0 { budget } else { 0.0 },
            fields: Fields::default(),
            history: History::default(),
            prices: WalkPrices::default(),
            asked: Asked::default(),
            kinds: Vec::new(),
            open: Open::default(),
        }
    }

    /// The share of a stream's rays that the budget allows.
    #[must_use]
    pub fn fraction(&self, kind: StreamKind) -> Fraction {
        let dearer = (self.prices.of(kind) - 1.0).max(f64::MIN_POSITIVE);
        let value = (self.budget / dearer).clamp(FRACTIONS.0, FRACTIONS.1);
        Fraction::new(value).unwrap_or(Fraction::SIXTY_FOURTH)
    }

    fn kind(&mut self, kind: StreamKind) -> &mut Kind {
        let at = self.kinds.iter().position(|known| known.kind == kind).unwrap_or_else(|| {
            self.kinds.push(Kind { kind, errors: [None; ARMS.len()], streams: 0 });
            self.kinds.len() - 1
        });
        &mut self.kinds[at]
    }

    /// The arm with the least error among those that have an estimate.
    fn best(&mut self, stream: RayStream<'_>, samples: usize) -> Arm {
        let per_task = samples as f64 / stream.tasks.len().max(1) as f64;
        let assumed = if stream.kind.is_coherent() && per_task >= OWN_SAMPLES { Arm::Exact } else { Arm::Field };
        let has: [bool; ARMS.len()] = core::array::from_fn(|i| self.open.says[i].is_some());
        let errors = self.kind(stream.kind).errors;
        let known =
            ARMS.into_iter().filter(|&arm| has[arm as usize]).filter_map(|arm| Some((arm, errors[arm as usize]?)));
        let best = known.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(arm, _)| arm);
        best.unwrap_or(if has[assumed as usize] { assumed } else { Arm::Exact })
    }

    /// Ends the estimation with the best arm's estimate.
    fn done(&mut self, stream: RayStream<'_>, samples: usize) -> Step {
        self.open.chosen = self.best(stream, samples);
        let work = self.open.says[self.open.chosen as usize].clone();
        let work = work.unwrap_or_else(|| stream.tasks.iter().map(|_| Work::default()).collect());
        self.history.remember(stream, &work);
        Step::Done(work)
    }
}

impl Default for Auto {
    /// Half a percent of the trace.
    fn default() -> Self {
        Self::new(BUDGET)
    }
}

impl CostEstimator for Auto {
    fn name(&self) -> &'static str {
        "auto"
    }

    fn chosen(&self) -> &'static str {
        match self.open.chosen {
            Arm::Exact => "exact",
            Arm::Field => "field",
            Arm::History => "history",
        }
    }

    fn next(&mut self, stream: RayStream<'_>, seen: Observation<'_>) -> Step {
        if self.asked.is_answered(stream, seen) {
            let batch = Batch { stream, seen };
            self.open.says[Arm::Field as usize] = stream.source.is_some().then(|| self.fields.estimate(&batch));
            // Where some tasks have no sample, their own samples say nothing.
            let sampled = batch.tasks().all(|(task, rays, _)| task.rays == 0 || !rays.is_empty());
            self.open.says[Arm::Exact as usize] = sampled.then(|| batch.extrapolated());
            return self.done(stream, seen.counts.len());
        }
        self.open = Open::default();
        self.open.says[Arm::History as usize] = self.history.recall(stream);
        let known = self.kind(stream.kind);
        known.streams += 1;
        let (errors, probe) = (known.errors, known.streams.is_multiple_of(PROBE));
        let past = errors[Arm::History as usize];
        let is_best = past.is_some_and(|past| errors.iter().flatten().all(|error| past <= *error));
        if self.open.says[Arm::History as usize].is_some() && is_best && !probe {
            return self.done(stream, 0);
        }
        let fraction = self.fraction(stream.kind);
        let rays = self.asked.choose(stream, blocks(stream, fraction).into_iter(), fraction);
        if rays.is_empty() { self.done(stream, 0) } else { Step::Sample { rays, walk: Walk::Full } }
    }

    fn learn(&mut self, launch: &LaunchRecord<'_>) {
        self.history.learn(launch);
        let device = launch.device;
        if launch.per_task {
            let one = |o: &rt_core::TaskOutcome| Measured { device, tasks: [o.task].into(), seconds: o.measured_s };
            self.open.measured.extend(launch.outcomes.iter().map(one));
        } else {
            let tasks = launch.outcomes.iter().map(|o| o.task).collect();
            let seconds = launch.outcomes.iter().map(|o| o.measured_s).sum();
            self.open.measured.push(Measured { device, tasks, seconds });
        }
    }

    fn finish(&mut self, record: &StreamRecord<'_>) {
        self.prices.learn(record);
        let open = core::mem::take(&mut self.open);
        let known = self.kind(record.stream.kind);
        for (error, says) in known.errors.iter_mut().zip(&open.says) {
            let Some(new) = says.as_ref().and_then(|work| mean_error(work, &open.measured)) else { continue };
            *error = Some(error.map_or(new, |old| old + NEWEST * (new - old)));
        }
        self.open.chosen = open.chosen;
    }
}

/// Mean relative error of an estimate against measured seconds, with one scale for each device.
fn mean_error(work: &[Work], measured: &[Measured]) -> Option<f64> {
    let devices = measured.iter().map(|m| m.device + 1).max()?;
    let tests = |m: &Measured| -> f64 {
        m.tasks.iter().filter_map(|&task| work.get(task as usize)).map(|w| f64::from(w.tests())).sum()
    };
    let (mut sum, mut weight) = (0.0, 0.0);
    for device in 0..devices {
        let own = || measured.iter().filter(|m| m.device == device);
        let (estimated, truth): (Vec<f64>, Vec<f64>) = own().map(|m| (tests(m), m.seconds)).unzip();
        // The scale is fitted to the same tasks: with one there is no error left.
        if let Some(errors) = EstimateErrors::new(&estimated, &truth).filter(|errors| errors.tasks > 1) {
            sum += errors.mean_relative * errors.tasks as f64;
            weight += errors.tasks as f64;
        }
    }
    (weight > 0.0).then(|| sum / weight)
}
