//! The estimator that decides whether estimating pays.

use super::batch::{Asked, Batch};
use super::history::{Pasts, Recalled};
use super::price::WalkPrices;
use super::{Uniform, uniform};
use crate::sample::Fraction;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use rt_core::{CostEstimator, CountsToken, LaunchRecord, Observation, RayStream, Step, StreamRecord, Walk, Work};

/// Takes what is known for nothing, and pays for an estimate only where that wins more than it costs. The default.
///
/// * **There is a past.** The measured seconds of the last stream of the kind and part tell what its tasks cost: off
///   by 2 to 4% while a camera turns by up to a degree from one to the next. Every stream leaves such a past, also one
///   that was traced without an estimate.
/// * **There is none, and the queue cannot mend what it does not know**: fewer than 32 tasks a device, static
///   lists, or launches so expensive that the queue makes few of them ([`RayStream::moves`]). Then two samples of each
///   task are walked, if they cost less than half of what is expected to be lost without
///   ([`RayStream::uninformed_excess`]).
/// * **Otherwise** every ray counts the same ([`Uniform`]): the queue finds out while it runs.
///
/// [`CostEstimator::reason`] says which of these it was, with its numbers.
#[derive(Debug, Default)]
pub struct Auto {
    pasts: Pasts,
    prices: WalkPrices,
    asked: Asked,
    open: Decision,
    counts: Option<CountsToken>,
}

/// Up to so many tasks a device an estimate is worth 3 to 20% of the frame, and above twice as many nothing
/// (docs/results/scheduling.md).
const FEW: f64 = 32.0;

/// Samples of a task: an eighth of the price of one ray in 64, and nearly as good for balancing.
const SAMPLES: f64 = 2.0;

/// Share of what is lost without an estimate that one may cost: it will not win all of it.
const STAKE: f64 = 0.5;

/// What was decided of a stream, and the numbers that decided.
#[derive(Clone, Copy, Debug, Default)]
struct Decision {
    choice: Choice,
    tasks_a_device: f64,
    /// As in [`RayStream`].
    moves: bool,
    loss: f64,
    /// What the samples would cost, as a share of the trace.
    price: f64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Choice {
    #[default]
    Nothing,
    Samples,
    Past,
}

impl Decision {
    fn of(stream: RayStream<'_>, has_past: bool, prices: &WalkPrices) -> Self {
        let (tasks, rays) = (stream.tasks.len() as f64, f64::from(stream.rays()));
        let mut decision = Self {
            choice: Choice::Past,
            tasks_a_device: tasks / f64::from(stream.devices.max(1)),
            moves: stream.moves,
            loss: stream.uninformed_excess,
            price: SAMPLES * tasks / rays.max(1.0) * prices.of(&stream).of_sample(stream.devices),
        };
        if !has_past {
            let pays = decision.needs_costs() && decision.price < STAKE * decision.loss;
            decision.choice = if pays { Choice::Samples } else { Choice::Nothing };
        }
        decision
    }

    /// Whether the queue cannot mend what it does not know; or all is to be lost, by which a caller asks for an
    /// estimate.
    fn needs_costs(&self) -> bool {
        self.tasks_a_device < FEW || !self.moves || self.loss >= 1.0
    }
}

impl Auto {
    fn begin(&mut self, stream: RayStream<'_>) -> Step {
        let past = self.pasts.recall(stream);
        self.open = Decision::of(stream, past.is_some(), &self.prices);
        if let Some(Recalled { work, counts }) = past {
            return self.done(stream, work, counts);
        }
        let fraction = SAMPLES * stream.tasks.len() as f64 / f64::from(stream.rays().max(1));
        // Of tasks of many rays more than two are taken: they cost little there, and two would tell nothing.
        let fraction = Fraction::new(fraction.clamp(Fraction::MIN.value(), Fraction::ONE.value()));
        let fraction = fraction.filter(|_| self.open.choice == Choice::Samples);
        let rays = fraction.map(|fraction| self.asked.choose(stream, stream.tasks.iter().copied(), fraction));
        match rays {
            Some(rays) if !rays.is_empty() => Step::Sample { rays, walk: Walk::Full },
            _ => {
                self.open.choice = Choice::Nothing;
                self.done(stream, uniform(stream.tasks), Uniform.counts())
            }
        }
    }

    fn done(&mut self, stream: RayStream<'_>, work: Vec<Work>, counts: CountsToken) -> Step {
        self.counts = Some(counts);
        self.pasts.remember(stream, &work, counts);
        Step::Done(work)
    }
}

impl CostEstimator for Auto {
    fn name(&self) -> &'static str {
        "auto"
    }

    fn chosen(&self) -> &'static str {
        match self.open.choice {
            Choice::Nothing => "uniform",
            Choice::Samples => "exact",
            Choice::Past => "history",
        }
    }

    fn reason(&self) -> Option<String> {
        let Decision { choice, tasks_a_device, moves, loss, price } = self.open;
        let [loss, price] = [loss, price].map(|share| 100.0 * share);
        let queue = if moves { "" } else { ", which are not moved later," };
        let tasks = format!("{tasks_a_device:.0} tasks a device{queue}");
        Some(match choice {
            Choice::Past => "the last such stream tells what tasks take, for nothing".into(),
            Choice::Samples => {
                format!(
                    "{tasks} are expected to lose {loss:.2}% if nothing is known; two samples of each cost {price:.2}%"
                )
            }
            Choice::Nothing if self.open.needs_costs() => format!(
                "two samples of each task would cost {price:.2}%, more than half of the {loss:.2}% that {tasks} are \
                 expected to lose if nothing is known"
            ),
            Choice::Nothing => format!("{tasks} are so many that the queue balances them while it runs"),
        })
    }

    fn counts(&self) -> CountsToken {
        self.counts.unwrap_or_else(|| CountsToken::of::<Self>(0))
    }

    fn next(&mut self, stream: RayStream<'_>, seen: Observation<'_>) -> Step {
        if self.asked.is_answered(stream, seen) {
            let work = Batch { stream, seen }.extrapolated();
            return self.done(stream, work, CountsToken::of::<Self>(0));
        }
        self.begin(stream)
    }

    fn counts_tests(&self) -> bool {
        self.open.choice != Choice::Nothing
    }

    fn learn(&mut self, launch: &LaunchRecord<'_>) {
        self.pasts.learn(launch);
    }

    fn finish(&mut self, record: &StreamRecord<'_>) {
        self.pasts.finish(record.stream);
        self.prices.learn(record);
    }
}
