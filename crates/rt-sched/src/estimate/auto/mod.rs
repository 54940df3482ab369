//! The estimator that chooses one.

mod trial;

use super::batch::{Asked, Batch};
use super::field::{Fields, blocks};
use super::history::History;
use super::price::{Debt, Reader, WalkPrices};
use super::uniform;
use crate::sample::Fraction;
use alloc::vec::Vec;
use rt_core::{CostEstimator, LaunchRecord, Observation, RayStream, Step, StreamKind, StreamRecord, Walk, Work};
use trial::{Part, Trial};

/// Picks for each stream what has predicted such streams best so far, within a budget, or nothing where nothing pays.
/// The default.
///
/// * **What may be spent.** An estimate may cost the budget, a share of the trace, or half of what the stream is
///   expected to lose without one ([`RayStream::uninformed_excess`]), whichever is less. Costs are device seconds: of
///   walks, beyond what tracing the same rays would have taken since their hits are kept; and all of the host's work,
///   for which every device waits. What a stream cost beyond its budget is a debt, and later streams have so much less
///   until it is paid: in the long run no more than the budget is spent. Only where there is no past to go by, and
///   devices may differ, is the least sample of one ray in 1,024 made in spite of debts.
/// * **How many samples that is** follows from measured prices of a walked ray and of what the host does with it.
///   Where it is less than four a task, and little can be lost, none are made and every ray counts the same
///   ([`super::Uniform`]): many small tasks on few equal devices, where a queue that steals has little to lose.
/// * **Whom to believe.** From the second stream of a kind and part there is its measured past ([`super::History`]),
///   for nothing. Otherwise samples are walked, and each task's are scaled up ([`super::Sampled`]); or they are made
///   into a map of costs ([`super::Field`]) where some tasks have none, and where rays are incoherent and a trial has
///   found it better.
/// * **Trials.** In the second stream of a kind, and in every eighth after it, all three are compared with the measured
///   seconds of tasks, device by device; where there is a debt to pay first, later. One sample serves all of them.
///   Where the past predicts the stream meanwhile, only a quarter of the tasks is sampled; a map that is not used is
///   made of a quarter. The one with the least mean error, over those trials with later ones counting more, makes the
///   next estimates.
///
/// Nothing in it depends on which scene is traced.
#[derive(Debug)]
pub struct Auto {
    budget: f64,
    debt: Debt,
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
    /// Streams from now to the next trial.
    until_trial: u32,
    /// Device seconds of a traced ray, in the last stream.
    ray_s: Option<f64>,
    /// Whether devices time every task; otherwise only whole launches.
    per_task: bool,
}

/// The stream in hand: what each arm says of it, and what was measured.
#[derive(Clone, Debug, Default)]
struct Open {
    chosen: Arm,
    /// Who read the samples.
    reader: Reader,
    trial: Trial,
    /// Whether the past predicts the stream, and samples are for the trial only.
    by_past: bool,
}

/// Share of the trace that sampling may cost: half of what balancing by it should gain, the project's goal.
const BUDGET: f64 = 0.005;

/// An estimate from fewer samples a task, in the mean, is off by a third or more: not worth making where little can be
/// gained.
const LEAST_SAMPLES: f64 = 4.0;

/// Share of what can be gained that an estimate may cost: it will not gain all of it.
const STAKE: f64 = 0.5;

/// Samples are never fewer than one ray in 1,024, which is one for each task of the default size, nor more than one in
/// 16, beyond which balancing gains nothing measurable.
const FRACTIONS: (f64, f64) = (1.0 / 1024.0, 1.0 / 16.0);

/// Streams of a kind from one trial to the next.
const TRIALS: u32 = 8;

/// Weight of the newest trial's error.
const NEWEST: f64 = 0.5;

impl Kind {
    fn new(kind: StreamKind) -> Self {
        Self { kind, errors: [None; ARMS.len()], until_trial: 1, ray_s: None, per_task: false }
    }
}

impl Auto {
    /// The usual budget, as a share of the trace.
    pub const BUDGET: f64 = BUDGET;

    /// An estimator that may spend `budget`, a share of the trace.
    #[must_use]
    pub fn new(budget: f64) -> Self {
        Self {
            budget: if budget > 0.0 { budget } else { 0.0 },
            debt: Debt::default(),
            fields: Fields::default(),
            history: History::default(),
            prices: WalkPrices::default(),
            asked: Asked::default(),
            kinds: Vec::new(),
            open: Open::default(),
        }
    }

    /// The share of a stream's rays to sample where there is no past to go by; `None` where no estimate pays.
    #[must_use]
    pub fn fraction(&self, stream: RayStream<'_>) -> Option<Fraction> {
        self.fraction_within(self.allowed(stream), stream)
    }

    /// The same where `allowed`, a share of the trace, may be spent.
    fn fraction_within(&self, allowed: f64, stream: RayStream<'_>) -> Option<Fraction> {
        let price = self.prices.of(&stream).of_sample(stream.devices, self.sampling_arm(stream).reader());
        let worth = STAKE * stream.uninformed_excess / price;
        let of_task = f64::from(stream.rays()) / stream.tasks.len().max(1) as f64;
        if worth * of_task < LEAST_SAMPLES {
            return None;
        }
        Fraction::new(worth.min(allowed / price).clamp(FRACTIONS.0, FRACTIONS.1))
    }

    /// The share of a part's rays to sample for a trial only; `None` where debts leave so little that it would have to
    /// be less than half of what estimates are made from, and would tell nothing of those.
    fn trial_fraction(&self, stream: RayStream<'_>, part: &Part) -> Option<Fraction> {
        let usual = self.fraction_within(self.budget, stream)?.value();
        let reader = if stream.source.is_some() && !stream.is_coherent() { Reader::Map } else { Reader::Tasks };
        let price = self.prices.of(&stream).of_sample(stream.devices, reader);
        let own = (self.allowed(stream) / (price * part.share_of(stream))).min(usual);
        if 2.0 * own < usual { None } else { Fraction::new(own.max(FRACTIONS.0)) }
    }

    /// What may be spent on a stream, as a share of its trace.
    fn allowed(&self, stream: RayStream<'_>) -> f64 {
        let ray_s = self.known(stream.kind).and_then(|known| known.ray_s);
        (self.budget - ray_s.map_or(0.0, |ray_s| self.debt.share_of(ray_s * f64::from(stream.rays())))).max(0.0)
    }

    fn known(&self, kind: StreamKind) -> Option<&Kind> {
        self.kinds.iter().find(|known| known.kind == kind)
    }

    fn kind(&mut self, kind: StreamKind) -> &mut Kind {
        let at = self.kinds.iter().position(|known| known.kind == kind).unwrap_or_else(|| {
            self.kinds.push(Kind::new(kind));
            self.kinds.len() - 1
        });
        &mut self.kinds[at]
    }

    fn error(&self, kind: StreamKind, arm: Arm) -> Option<f64> {
        self.known(kind)?.errors.get(arm as usize).copied().flatten()
    }

    /// The better of the two that need samples; before both are known their own, which cost the host a tenth of a new
    /// map and know as much.
    fn sampling_arm(&self, stream: RayStream<'_>) -> Arm {
        let [own, map] = [Arm::Exact, Arm::Field].map(|arm| self.error(stream.kind, arm));
        let map_is_better = match (own, map) {
            (Some(own), Some(map)) => map < own,
            _ => false,
        };
        if stream.source.is_some() && !stream.is_coherent() && map_is_better { Arm::Field } else { Arm::Exact }
    }

    /// Whether the past is to be believed: until it was found worse than samples are.
    fn believes_the_past(&self, stream: RayStream<'_>) -> bool {
        let known = [Arm::Exact, Arm::Field].into_iter().filter_map(|arm| self.error(stream.kind, arm));
        let best = known.reduce(f64::min);
        !matches!((self.error(stream.kind, Arm::History), best), (Some(past), Some(best)) if best < past)
    }

    /// Begins a stream.
    fn begin(&mut self, stream: RayStream<'_>) -> Step {
        let past = self.history.recall(stream);
        self.open = Open { by_past: past.is_some() && self.believes_the_past(stream), ..Open::default() };
        self.open.trial.says[Arm::History as usize] = past;
        let known = self.kind(stream.kind);
        let (due, per_task) = (known.until_trial == 0, known.per_task);
        known.until_trial = known.until_trial.saturating_sub(1);
        let by_past = self.open.by_past;
        let fraction = if due || !by_past { self.fraction(stream) } else { None };
        let part = fraction.filter(|_| due).map(|fraction| Part::of(stream, fraction, per_task));
        let fraction = match &part {
            Some(part) if by_past => self.trial_fraction(stream, part),
            _ => fraction,
        };
        let Some(fraction) = fraction else {
            return if by_past { self.done(stream, Arm::History) } else { self.uniform(stream) };
        };
        let blocks = match &part {
            Some(part) if by_past && part.is_less_than(stream) => part.tasks.clone(),
            _ => blocks(stream, fraction),
        };
        if part.is_some() {
            self.kind(stream.kind).until_trial = TRIALS - 1;
        }
        self.open.trial.part = part;
        let rays = self.asked.choose(stream, blocks.into_iter(), fraction);
        if rays.is_empty() { self.uniform(stream) } else { Step::Sample { rays, walk: Walk::Full } }
    }

    /// Reads the samples.
    fn read(&mut self, stream: RayStream<'_>, seen: Observation<'_>) -> Step {
        let part = self.open.trial.part.as_ref();
        let by_past = self.open.by_past;
        let tasks = part.filter(|_| by_past).map_or(stream.tasks, |part| &part.tasks);
        let batch = Batch { stream: RayStream { tasks, ..stream }, seen };
        let reaches_all = batch.reaches_all();
        let arm = match self.sampling_arm(stream) {
            _ if by_past => Arm::History,
            // Where some tasks have no sample, their own samples say nothing.
            Arm::Exact if !reaches_all && stream.source.is_some() => Arm::Field,
            arm => arm,
        };
        let all = |work: Vec<Work>| match part {
            Some(part) => part.spread(work, stream),
            None => work,
        };
        let own = (arm == Arm::Exact || (part.is_some() && reaches_all)).then(|| all(batch.extrapolated()));
        // Of coherent rays the map knows no more than their tasks' own samples.
        let differs = stream.source.is_some() && !(stream.is_coherent() && reaches_all);
        let map = match part {
            _ if arm == Arm::Field => Some(self.fields.estimate(&batch)),
            Some(part) if differs => {
                let (rays, counts) = part.of_samples(seen);
                let seen = Observation { rays: &rays, counts: &counts };
                Some(all(self.fields.estimate(&Batch { stream: RayStream { tasks: &part.tasks, ..stream }, seen })))
            }
            _ => None,
        };
        self.open.reader = if map.is_some() { Reader::Map } else { Reader::Tasks };
        self.open.trial.says[Arm::Exact as usize] = own;
        self.open.trial.says[Arm::Field as usize] = map;
        self.done(stream, arm)
    }

    /// Ends the estimation without one.
    fn uniform(&mut self, stream: RayStream<'_>) -> Step {
        self.open.chosen = Arm::Uniform;
        Step::Done(uniform(stream.tasks))
    }

    /// Ends the estimation with an arm's estimate.
    fn done(&mut self, stream: RayStream<'_>, arm: Arm) -> Step {
        self.open.chosen = arm;
        let work = self.open.trial.says[arm as usize].clone();
        let work = work.unwrap_or_else(|| stream.tasks.iter().map(|_| Work::default()).collect());
        self.history.remember(stream, &work);
        Step::Done(work)
    }
}

impl Arm {
    /// Who reads the samples for it.
    const fn reader(self) -> Reader {
        match self {
            Self::Field => Reader::Map,
            Self::Exact | Self::History | Self::Uniform => Reader::Tasks,
        }
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
        if self.asked.is_answered(stream, seen) { self.read(stream, seen) } else { self.begin(stream) }
    }

    /// Where every ray counts the same, prices learn nothing.
    fn counts_tests(&self) -> bool {
        self.open.chosen != Arm::Uniform
    }

    fn learn(&mut self, launch: &LaunchRecord<'_>) {
        self.history.learn(launch);
        self.kind(launch.stream.kind).per_task = launch.per_task;
        self.open.trial.measure(launch);
    }

    fn finish(&mut self, record: &StreamRecord<'_>) {
        let trial = core::mem::take(&mut self.open.trial);
        self.prices.learn(record, self.open.reader);
        self.debt.settle(record, self.budget);
        let known = self.kind(record.stream.kind);
        known.ray_s = record.ray_s().or(known.ray_s);
        for (error, new) in known.errors.iter_mut().zip(trial.errors()) {
            let Some(new) = new else { continue };
            *error = Some(error.map_or(new, |old| old + NEWEST * (new - old)));
        }
    }
}
