//! The estimator that decides whether estimating pays.

use super::batch::{Asked, Batch};
use super::history::{Pasts, Recalled};
use super::price::WalkPrices;
use super::{Uniform, uniform};
use crate::sample::Fraction;
use crate::uninformed::fixed_excess;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use rt_core::{CostEstimator, CountsToken, LaunchRecord, Observation, RayStream, Step, StreamRecord, Walk, Work};

/// Takes what is known for nothing, and pays for an estimate only where that wins more than it costs. The default.
///
/// * **There is a past.** The measured seconds of the last stream of the kind and part tell what its tasks cost: off
///   by 2 to 4% while a camera turns by up to a degree from one to the next. Every stream leaves such a past, also one
///   that was traced without an estimate.
/// * **There is none, and samples win more than they cost**: what the stream is expected to lose if nothing is known
///   ([`RayStream::uninformed_excess`]: much where tasks are few, lists are static, or launches so expensive that the
///   queue makes few of them), less what it loses by estimates that are as wrong as those of two samples of each task.
///   Then these are walked.
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

/// Standard deviation of what two samples of a task say of its seconds, as a share of them, where rays are coherent and
/// elsewhere: what counts err by against time, and what samples do against counts (docs/results/estimation.md).
const ERROR: [f64; 2] = [0.2, 0.35];

/// Samples of a task: an eighth of the price of one ray in 64, and nearly as good for balancing.
const SAMPLES: f64 = 2.0;

/// Share of what an estimate is expected to win that it may cost: that is known within a factor of 2 or so.
const STAKE: f64 = 0.7;

/// What was decided of a stream, and the numbers that decided.
#[derive(Clone, Copy, Debug, Default)]
struct Decision {
    choice: Choice,
    devices: u32,
    tasks_a_device: f64,
    /// As in [`RayStream`].
    moves: bool,
    /// Likewise.
    has_walks: bool,
    loss: f64,
    /// What is lost with the samples, beside their price.
    left: f64,
    /// The share of the rays that the samples would be: [`SAMPLES`] of each task, or more where that is less than
    /// samplers take. Of tasks of so many rays they cost little, and two would tell nothing.
    fraction: f64,
    /// What they would cost, as a share of the trace.
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
        let tasks = stream.tasks.len() as f64;
        let two = SAMPLES * tasks / f64::from(stream.rays().max(1));
        let error = ERROR[usize::from(!stream.is_coherent())];
        let fraction = two.clamp(Fraction::MIN.value(), Fraction::ONE.value());
        let mut decision = Self {
            choice: Choice::Past,
            devices: stream.devices,
            tasks_a_device: tasks / f64::from(stream.devices.max(1)),
            moves: stream.moves,
            has_walks: stream.has_walks,
            loss: stream.uninformed_excess,
            left: error * fixed_excess(stream.tasks.len(), stream.devices as usize),
            fraction,
            price: fraction * prices.of(&stream).of_sample(stream.devices),
        };
        if !has_past {
            let pays = stream.has_walks && decision.price < STAKE * decision.gain();
            decision.choice = if pays { Choice::Samples } else { Choice::Nothing };
        }
        decision
    }

    /// What samples are expected to win, their price left out: nothing where chance makes as much of tasks of which
    /// nothing is known as the samples' errors do.
    fn gain(&self) -> f64 {
        self.loss - self.left
    }
}

impl Auto {
    fn begin(&mut self, stream: RayStream<'_>) -> Step {
        let past = self.pasts.recall(stream);
        self.open = Decision::of(stream, past.is_some(), &self.prices);
        if let Some(Recalled { work, counts }) = past {
            return self.done(stream, work, counts);
        }
        let fraction = Fraction::new(self.open.fraction).filter(|_| self.open.choice == Choice::Samples);
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
        let Decision { choice, devices, tasks_a_device, moves, has_walks, loss, left, fraction, price } = self.open;
        let [loss, left, fraction, price] = [loss, left, fraction, price].map(|share| 100.0 * share);
        let queue = if moves { "" } else { ", which nobody moves later," };
        let unknown = format!(
            "knowing nothing of {tasks_a_device:.0} tasks a device{queue} is expected to cost {loss:.2}% of the time"
        );
        let samples = format!("samples of {fraction:.2}% of the rays");
        Some(match choice {
            Choice::Past => "the last such stream tells what tasks take, for nothing".into(),
            Choice::Nothing if devices < 2 => "there is one device, which does all of it: nothing to balance".into(),
            Choice::Nothing if !has_walks => "no device counts tests, so there are no samples to be had".into(),
            Choice::Samples => format!("{unknown}; {samples} cost {price:.2}% and leave {left:.2}%"),
            Choice::Nothing => {
                format!("{unknown}; {samples} would cost {price:.2}% and leave {left:.2}%: that does not pay")
            }
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

    fn needs_samples(&self) -> bool {
        false
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
