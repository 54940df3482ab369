//! Costs from as many samples as they are worth.

use super::growing;
use rt_core::{CostEstimator, Observation, RayStream, Step, StreamRecord, TestCounts, Walk, Work};
use rt_sched::estimate::batch::{Batch, Pool, std_error, tests};
use rt_sched::estimate::price::{Price, WalkPrices};
use rt_sched::sample::{Fraction, RaySampler};

/// Samples exact counts where their error is largest, and stops when more samples cost more than they gain.
///
/// A small first sample gives each task's variance. Then J. Neyman's optimum allocation (*On the Two Different Aspects
/// of the Representative Method*, 1934) says how a larger sample should be spread: in proportion to a task's rays times
/// their standard deviation, which is where intervals are widest. How large it should be follows from a model of what
/// it is for:
///
/// * A static schedule over m devices is off by the errors of the tasks on the device that is late: the largest of m
///   sums, each of variance V/m for a total variance V of all tasks' estimates. For normal errors that is about
///   √(2 ln m) · √(V/m) (H. Cramér, *Mathematical Methods of Statistics*, 1946, 28.6).
/// * With Neyman's allocation of n samples V = S²/n, S the sum of rays times standard deviation over the tasks.
/// * A walked ray's hit is kept, so it costs what it is more expensive than a traced one: (price − 1) rays, shared by m
///   devices. The price is measured.
///
/// The sum is least for n = (√(2 ln m / m) · S / 2p)^⅔, p the tests that a sample costs on each device. With one device
/// there is nothing to balance and the first sample is the last. A queue that steals gains less; it has no better
/// model, but no gain is believed beyond what the stream would lose without any estimate.
///
/// Price: the walks; two to three hand-overs to the devices instead of one.
#[derive(Clone, Debug)]
pub(crate) struct Adaptive {
    first: Fraction,
    prices: WalkPrices,
    open: Option<Open>,
}

/// A stream being sampled.
#[derive(Clone, Debug, Default)]
struct Open {
    /// How much of each task's order was asked for.
    taken: Vec<u32>,
    rays: Vec<u32>,
    counts: Vec<TestCounts>,
    /// Samples that are waited for.
    asked: usize,
    rounds: u32,
}

/// Rounds of sampling after the first: the first allocation is from a rough variance, the second mends it.
const MORE_ROUNDS: u32 = 2;

/// What a round costs beside its rays, in rays of one device: some 10 µs of handing over.
const ROUND: f64 = 50.0;

impl Adaptive {
    /// An estimator whose first sample is `first` of the rays.
    pub(crate) fn new(first: Fraction) -> Self {
        Self { first, prices: WalkPrices::default(), open: None }
    }

    fn begin(&mut self, stream: RayStream<'_>) -> Step {
        let taken: Vec<u32> = stream.tasks.iter().map(|task| self.first.of(task.rays)).collect();
        let open = self.open.insert(Open::default());
        let rays = open.take(stream, taken);
        if rays.is_empty() {
            return Step::Done(vec![Work::default(); stream.tasks.len()]);
        }
        Step::Sample { rays, walk: Walk::Full }
    }
}

impl Default for Adaptive {
    /// Begins with one ray in 256.
    fn default() -> Self {
        Self::new(Fraction::TWO_HUNDRED_FIFTY_SIXTH)
    }
}

impl Open {
    /// The rays by which the samples grow to `wanted` of each task.
    fn take(&mut self, stream: RayStream<'_>, wanted: Vec<u32>) -> Vec<u32> {
        let sampler = RaySampler::for_stream(&stream);
        self.taken.resize(wanted.len(), 0);
        let mut rays = Vec::new();
        for ((task, old), new) in stream.tasks.iter().zip(&self.taken).zip(&wanted) {
            let first = rays.len();
            let more = new.saturating_sub(*old) as usize;
            rays.extend(growing::order(sampler, *task, stream.seed).skip(*old as usize).take(more));
            // Along the stream's order, where neighbours are walked with neighbours.
            rays[first..].sort_unstable();
        }
        self.taken = self.taken.iter().zip(&wanted).map(|(old, new)| *old.max(new)).collect();
        self.asked = rays.len();
        rays
    }

    /// Adds an answer, keeping rays in order.
    fn add(&mut self, seen: Observation<'_>) {
        let old = self.rays.iter().copied().zip(self.counts.iter().copied());
        let new = seen.rays.iter().copied().zip(seen.counts.iter().copied());
        let mut all: Vec<(u32, TestCounts)> = old.chain(new).collect();
        all.sort_unstable_by_key(|(ray, _)| *ray);
        (self.rays, self.counts) = all.into_iter().unzip();
        self.rounds += 1;
    }

    fn batch<'a>(&'a self, stream: RayStream<'a>) -> Batch<'a> {
        Batch { stream, seen: Observation { rays: &self.rays, counts: &self.counts } }
    }

    /// How many samples of each task there should be; `None` when those there are suffice.
    fn wanted(&self, stream: RayStream<'_>, price: Price) -> Option<Vec<u32>> {
        let devices = f64::from(stream.devices.max(1));
        let sampler = RaySampler::for_stream(&stream);
        let pool = Pool::new(&self.counts);
        let mut at = 0;
        // Rays times standard deviation; and the variance of the estimates as they are.
        let mut spread = Vec::with_capacity(stream.tasks.len());
        let mut variance = 0.0;
        for (task, _, sample) in self.batch(stream).tasks() {
            let own = at..at + sample.len();
            at = own.end;
            let of_ray = pool.variance(own, sample, sampler, BORROWED)?;
            let all = f64::from(task.rays);
            spread.push(all * of_ray.sqrt());
            let error = std_error(of_ray, sample.len(), task.rays);
            variance += if task.rays > 0 { error * error } else { 0.0 };
        }
        let sum: f64 = spread.iter().sum();
        let n = self.counts.len() as f64;
        let of_ray = self.counts.iter().map(tests).sum::<f64>() / n;
        let late = (2.0 * devices.ln() / devices).sqrt();
        let sample_cost = price.beyond() * of_ray / devices;
        let best = (late * sum / (2.0 * sample_cost)).powi(2).cbrt();
        // Nobody can gain more than what a schedule without any estimate loses.
        let most = stream.uninformed_excess * of_ray * f64::from(stream.rays()) / devices;
        let gain = (late * (variance.sqrt() - sum / best.sqrt())).min(most);
        let cost = (best - n) * sample_cost + ROUND * of_ray;
        if best <= n || gain <= cost || gain.is_nan() {
            return None;
        }
        let share = |(task, spread): (&rt_core::Task, &f64)| ((best * spread / sum) as u32).min(task.rays);
        Some(stream.tasks.iter().zip(&spread).map(share).collect())
    }
}

/// How many deviations of its own a task's neighbourhood counts for when samples are allocated: few, since the question
/// is how tasks differ.
const BORROWED: f64 = 1.0;

impl CostEstimator for Adaptive {
    fn name(&self) -> &'static str {
        "adaptive"
    }

    fn next(&mut self, stream: RayStream<'_>, seen: Observation<'_>) -> Step {
        let answers = |open: &Open| {
            !seen.counts.is_empty()
                && (seen.counts.len(), seen.rays.len()) == (open.asked, open.asked)
                && open.taken.len() == stream.tasks.len()
        };
        let Some(mut open) = self.open.take().filter(answers) else { return self.begin(stream) };
        open.add(seen);
        if open.rounds <= MORE_ROUNDS
            && let Some(wanted) = open.wanted(stream, self.prices.of(&stream))
        {
            let rays = open.take(stream, wanted);
            if !rays.is_empty() {
                self.open = Some(open);
                return Step::Sample { rays, walk: Walk::Full };
            }
        }
        Step::Done(open.batch(stream).extrapolated())
    }

    fn finish(&mut self, record: &StreamRecord<'_>) {
        self.prices.learn(record);
    }
}
