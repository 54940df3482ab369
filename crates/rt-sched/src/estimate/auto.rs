//! The estimator that chooses one.

use super::batch::{Asked, Batch};
use super::field::{Fields, blocks};
use super::history::History;
use super::price::WalkPrices;
use super::uniform;
use crate::calibrate::cross_predicted;
use crate::metrics::EstimateErrors;
use crate::sample::Fraction;
use alloc::vec::Vec;
use rt_core::{
    CostEstimator, LaunchRecord, Observation, RayStream, Step, StreamKind, StreamRecord, TaskId, Walk, Work,
};

/// Picks for each stream what has predicted such streams best so far, within a budget, or nothing where nothing pays. The
/// default.
///
/// * What an estimate may cost is the budget, or half of what the stream is expected to lose without one
///   ([`RayStream::blind_excess`]), whichever is less. At the measured price of a walked ray, `price` times a traced one
///   whose hit is kept, the fraction f costs (price − 1) · f of the trace, beside what the host does.
/// * Where that allows no more than a few samples a task, none are made and every ray counts the same
///   ([`super::Uniform`]): many small tasks on few equal devices, where a queue that steals has little to lose.
/// * Otherwise each task's own samples are scaled up ([`super::Sampled`]), or make a map of costs ([`super::Field`]). From
///   the second stream of a kind there is also the measured past ([`super::History`]), for nothing.
/// * In the second stream of a kind, and in every eighth after it, all of them are made and, used or not, compared with the
///   measured seconds of its tasks, device by device. The one with the least mean error, over those streams with later
///   ones counting more, makes the next estimates.
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
    Uniform,
}

/// Those that know something.
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
    /// Whether every arm is asked, to be compared.
    probe: bool,
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

/// An estimate from fewer samples a task, in the mean, is off by a third or more: not worth making where little can be
/// gained.
const LEAST_SAMPLES: f64 = 4.0;

/// Share of what can be gained that an estimate may cost: it will not gain all of it.
const STAKE: f64 = 0.5;

/// Samples are never fewer than one ray in 1,024, which is one for each task of the default size, nor more than one in 16,
/// beyond which balancing gains nothing measurable.
const FRACTIONS: (f64, f64) = (1.0 / 1024.0, 1.0 / 16.0);

/// Of so many streams of a kind the second puts every arm to the test.
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

    /// The share of a stream's rays to sample; `None` where no estimate pays.
    #[must_use]
    pub fn fraction(&self, stream: RayStream<'_>) -> Option<Fraction> {
        let price = self.prices.of(stream.kind);
        let worth = price.fraction_for(STAKE * stream.blind_excess);
        let of_task = f64::from(stream.rays()) / stream.tasks.len().max(1) as f64;
        if worth * of_task < LEAST_SAMPLES {
            return None;
        }
        Fraction::new(worth.min(price.fraction_for(self.budget)).clamp(FRACTIONS.0, FRACTIONS.1))
    }

    fn kind(&mut self, kind: StreamKind) -> &mut Kind {
        let at = self.kinds.iter().position(|known| known.kind == kind).unwrap_or_else(|| {
            self.kinds.push(Kind { kind, errors: [None; ARMS.len()], streams: 0 });
            self.kinds.len() - 1
        });
        &mut self.kinds[at]
    }

    /// The arm with the least error; before any is known, one that suits `samples` of a stream.
    fn best(&mut self, stream: RayStream<'_>, samples: usize) -> Arm {
        let per_task = samples as f64 / stream.tasks.len().max(1) as f64;
        let own = stream.source.is_none() || (stream.kind.is_coherent() && per_task >= OWN_SAMPLES);
        let assumed = if own { Arm::Exact } else { Arm::Field };
        let errors = self.kind(stream.kind).errors;
        let has_past = self.open.says[Arm::History as usize].is_some();
        let able = |arm: &Arm| match arm {
            Arm::Field => stream.source.is_some(),
            Arm::History => has_past,
            Arm::Exact | Arm::Uniform => true,
        };
        let known = ARMS.into_iter().filter(able).filter_map(|arm| Some((arm, errors[arm as usize]?)));
        known.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(assumed, |(arm, _)| arm)
    }

    /// Ends the estimation without one.
    fn uniform(&mut self, stream: RayStream<'_>) -> Step {
        self.open.chosen = Arm::Uniform;
        Step::Done(uniform(stream.tasks))
    }

    /// Ends the estimation with an arm's estimate.
    fn done(&mut self, stream: RayStream<'_>, arm: Arm) -> Step {
        self.open.chosen = arm;
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
            Arm::Uniform => "uniform",
        }
    }

    fn next(&mut self, stream: RayStream<'_>, seen: Observation<'_>) -> Step {
        if self.asked.is_answered(stream, seen) {
            let batch = Batch { stream, seen };
            let mut arm = self.best(stream, seen.counts.len());
            // Where some tasks have no sample, their own samples say nothing.
            let sampled = batch.tasks().all(|(task, rays, _)| task.rays == 0 || !rays.is_empty());
            if arm == Arm::Exact && !sampled && stream.source.is_some() {
                arm = Arm::Field;
            }
            if stream.source.is_some() && (self.open.probe || arm == Arm::Field) {
                self.open.says[Arm::Field as usize] = Some(self.fields.estimate(&batch));
            }
            if sampled && (self.open.probe || arm == Arm::Exact) {
                self.open.says[Arm::Exact as usize] = Some(batch.extrapolated());
            }
            return self.done(stream, arm);
        }
        self.open = Open::default();
        self.open.says[Arm::History as usize] = self.history.recall(stream);
        let known = self.kind(stream.kind);
        known.streams += 1;
        self.open.probe = known.streams % PROBE == 2;
        if !self.open.probe && self.best(stream, 0) == Arm::History {
            return self.done(stream, Arm::History);
        }
        let Some(fraction) = self.fraction(stream) else { return self.uniform(stream) };
        let rays = self.asked.choose(stream, blocks(stream, fraction).into_iter(), fraction);
        if rays.is_empty() { self.uniform(stream) } else { Step::Sample { rays, walk: Walk::Full } }
    }

    /// Where every ray counts the same, prices learn nothing.
    fn counts_tests(&self) -> bool {
        self.open.chosen != Arm::Uniform
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

/// Mean relative error of an estimate against measured seconds, by prices fitted on the other half of what each device
/// traced.
fn mean_error(work: &[Work], measured: &[Measured]) -> Option<f64> {
    let devices = measured.iter().map(|m| m.device + 1).max()?;
    let of = |m: &Measured| -> Work {
        m.tasks.iter().filter_map(|&task| work.get(task as usize)).fold(Work::default(), |sum, own| sum.plus(own))
    };
    let (mut sum, mut weight) = (0.0, 0.0);
    for device in 0..devices {
        let own = || measured.iter().filter(|m| m.device == device);
        let (estimated, truth): (Vec<Work>, Vec<f64>) = own().map(|m| (of(m), m.seconds)).unzip();
        // The scale is fitted to the same tasks: with one there is no error left.
        let errors = EstimateErrors::new(&cross_predicted(&estimated, &truth), &truth);
        if let Some(errors) = errors.filter(|errors| errors.tasks > 1) {
            sum += errors.mean_relative * errors.tasks as f64;
            weight += errors.tasks as f64;
        }
    }
    (weight > 0.0).then(|| sum / weight)
}
