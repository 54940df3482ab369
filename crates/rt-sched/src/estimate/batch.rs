//! Sampled counts, task by task, and what they say of their own error: what estimators that sample are made of.

use super::neighbours::{Own, shrunk};
use crate::sample::{Fraction, RaySampler};
use alloc::vec::Vec;
use core::ops::Range;
use rt_core::{Observation, RayStream, Task, TestCounts, Work};

/// The rays that an estimator has asked for and waits for.
#[derive(Clone, Debug, Default)]
pub struct Asked {
    total: usize,
    tasks: usize,
}

impl Asked {
    /// Chooses `fraction` of each of the `blocks`, which cover the rays of a stream in order. In increasing order.
    pub fn choose(
        &mut self,
        stream: RayStream<'_>,
        blocks: impl Iterator<Item = Task>,
        fraction: Fraction,
    ) -> Vec<u32> {
        let sampler = RaySampler::for_stream(&stream);
        let mut rays = Vec::with_capacity(fraction.of(stream.rays()) as usize + stream.tasks.len());
        blocks.for_each(|block| {
            sampler.sample(block, fraction, stream.seed, &mut rays);
        });
        (self.total, self.tasks) = (rays.len(), stream.tasks.len());
        rays
    }

    /// Whether `seen` answers what was asked; then nothing is asked for any more. Anything else begins a new stream.
    pub fn is_answered(&mut self, stream: RayStream<'_>, seen: Observation<'_>) -> bool {
        let answered = !seen.counts.is_empty()
            && (seen.counts.len(), seen.rays.len(), stream.tasks.len()) == (self.total, self.total, self.tasks);
        if answered {
            *self = Self::default();
        }
        answered
    }
}

/// A stream's samples, in increasing order of their rays.
#[derive(Clone, Copy, Debug)]
pub struct Batch<'a> {
    /// The stream.
    pub stream: RayStream<'a>,
    /// The samples that were walked.
    pub seen: Observation<'a>,
}

impl<'a> Batch<'a> {
    /// Each task with its samples: their rays and counts.
    pub fn tasks(&self) -> impl Iterator<Item = (Task, &'a [u32], &'a [TestCounts])> + use<'a> {
        let Observation { mut rays, mut counts } = self.seen;
        self.stream.tasks.iter().map(move |task| {
            let own = rays.partition_point(|&ray| ray < task.range().end);
            let (own_rays, other_rays) = rays.split_at(own);
            let (own_counts, other_counts) = counts.split_at(own);
            (rays, counts) = (other_rays, other_counts);
            (*task, own_rays, own_counts)
        })
    }

    /// Each task's samples scaled to all its rays, with their standard error.
    ///
    /// Of random samples the means are first shrunk towards those of the tasks beside them; evenly spread ones of
    /// coherent rays know their own tasks too well for that ([`super::Sampled`] has figures).
    pub fn extrapolated(&self) -> Vec<Work> {
        let unlike = Divergence::of(self.seen.counts);
        let work = match RaySampler::for_stream(&self.stream) {
            RaySampler::Strided => self.scaled_up(),
            RaySampler::Random => self.shrunk(),
        };
        let diverges = |((task, _, sample), work): ((Task, _, &[TestCounts]), Work)| {
            work.with_divergence(unlike.scaled_up(sample, task.rays))
        };
        self.tasks().zip(work).map(diverges).collect()
    }

    /// Each task by its own samples.
    fn scaled_up(&self) -> Vec<Work> {
        let mut pool = None;
        let work = self.placed().map(|(task, own, sample)| {
            let work = scaled_up(sample, task.rays);
            if sample.len() >= task.rays as usize {
                return work.with_std_error(0.0);
            }
            let pool = pool.get_or_insert_with(|| Pool::new(self.seen.counts));
            match pool.variance(own, sample, RaySampler::Strided, BORROWED) {
                Some(variance) => work.with_std_error(std_error(variance, sample.len(), task.rays) as f32),
                None => work,
            }
        });
        work.collect()
    }

    /// Each task by its own samples and its neighbours'.
    fn shrunk(&self) -> Vec<Work> {
        let pool = Pool::new(self.seen.counts);
        // Standard errors are of all rays of a task, variances here of the mean of one.
        let of_mean = |variance: f64, task: Task, sample: &[TestCounts]| {
            let error = std_error(variance, sample.len(), task.rays) / f64::from(task.rays.max(1));
            error * error
        };
        let own = self.placed().map(|(task, own, sample)| {
            let (variance, _) = pool.wide(own, sample).filter(|_| !sample.is_empty())?;
            let one = scaled_up(sample, 1);
            let mean = [f64::from(one.boxes()), f64::from(one.triangles())];
            let enough = sample.len() * ENOUGH >= task.rays as usize;
            Some(Own { mean, variance: if enough { 0.0 } else { of_mean(variance, task, sample) } })
        });
        let own: Vec<Option<Own>> = own.collect();
        let work = self.placed().zip(shrunk(&own)).map(|((task, own, sample), believed)| {
            let work = scaled_up(sample, task.rays);
            let walked = sample.len() >= task.rays as usize;
            let (Some(believed), Some((pooled, around)), false) = (believed, pool.wide(own, sample), walked) else {
                return if walked { work.with_std_error(0.0) } else { work };
            };
            let rays = f64::from(task.rays);
            let [boxes, triangles] = believed.mean.map(|mean| (mean * rays) as f32);
            // Of random samples where a few rays are expensive, mean and variance are low together, and an estimate
            // that is too low would claim to be certain (W. Cochran, *Sampling Techniques*, 1977, 2.15): the
            // neighbourhood's is the least that is believed.
            let left = of_mean(pooled.max(around), task, sample) * believed.left;
            Work::new(task.rays as f32, boxes, triangles).with_std_error((rays * libm::sqrt(left)) as f32)
        });
        work.collect()
    }

    /// Each task with the positions of its samples among all, and their counts.
    fn placed(&self) -> impl Iterator<Item = (Task, Range<usize>, &'a [TestCounts])> + use<'a> {
        let mut at = 0;
        self.tasks().map(move |(task, _, sample)| {
            at += sample.len();
            (task, at - sample.len()..at, sample)
        })
    }
}

/// Box and triangle tests together.
pub fn tests(counts: &TestCounts) -> f64 {
    f64::from(counts.boxes) + f64::from(counts.triangles)
}

/// The work of `rays` rays when the sample stands for all of them.
pub fn scaled_up(sample: &[TestCounts], rays: u32) -> Work {
    let scale = f64::from(rays) / sample.len().max(1) as f64;
    let sum = |of: fn(&TestCounts) -> u32| sample.iter().map(|c| u64::from(of(c))).sum::<u64>() as f64;
    Work::new(rays as f32, (sum(|c| c.boxes) * scale) as f32, (sum(|c| c.triangles) * scale) as f32)
}

/// Divergence of one ray, from how sampled rays differ from those before them.
///
/// Sampled rays lie further apart than a task's own do, so this is more than theirs. The prices that are fitted to it
/// know nothing else, so only its proportion matters.
#[derive(Clone, Copy, Debug)]
pub struct Divergence {
    /// Of all samples: what is believed of a task that has fewer than two.
    mean: f64,
}

impl Divergence {
    /// Of all samples of a stream, in the order of their rays.
    pub fn of(samples: &[TestCounts]) -> Self {
        Self { mean: Self::mean(samples).unwrap_or(0.0) }
    }

    fn mean(samples: &[TestCounts]) -> Option<f64> {
        let steps: u64 = samples.windows(2).map(|pair| u64::from(pair[0].boxes.abs_diff(pair[1].boxes))).sum();
        (samples.len() > 1).then(|| steps as f64 / (samples.len() - 1) as f64)
    }

    /// That of `rays` rays whose sample this is.
    pub fn scaled_up(self, sample: &[TestCounts], rays: u32) -> f32 {
        (Self::mean(sample).unwrap_or(self.mean) * f64::from(rays)) as f32
    }
}

/// Standard error of the total of `rays` rays from a sample of which `samples` were drawn, with the finite population
/// correction (W. Cochran, *Sampling Techniques*, 1977, 2.6).
pub fn std_error(variance: f64, samples: usize, rays: u32) -> f64 {
    let (n, all) = (samples as f64, f64::from(rays));
    if samples == 0 { f64::NAN } else { all * libm::sqrt((1.0 - n / all).max(0.0) * variance / n) }
}

/// Sum of squared deviations of a sample, as many as one less than samples.
fn squares(sample: &[TestCounts], sampler: RaySampler) -> f64 {
    let n = sample.len().max(1) as f64;
    match sampler {
        RaySampler::Random => {
            let mean = sample.iter().map(tests).sum::<f64>() / n;
            sample.iter().map(|c| (tests(c) - mean) * (tests(c) - mean)).sum::<f64>()
        }
        // K. Wolter, 1984, estimator 2: successive differences.
        RaySampler::Strided => {
            let steps = sample.windows(2).map(|pair| tests(&pair[1]) - tests(&pair[0]));
            steps.map(|d| d * d).sum::<f64>() / 2.0
        }
    }
}

/// What samples borrow from their neighbourhood: the variance of a ray from successive differences of samples around
/// them in the stream's order.
///
/// A sample that met no rare expensive ray claims to be certain, and few samples know nothing of their variance; their
/// neighbours' differences, counted as `BORROWED` more, mend both. Differences between tasks count as if they lay
/// within one, which errs on the safe side.
#[derive(Clone, Debug)]
pub struct Pool {
    /// Sums of squared differences before each sample; the first is of none.
    sums: Vec<f64>,
}

/// A task of which one ray in so many is sampled is known well enough, and is not shrunk: intervals would hold in 92%
/// of the tasks where half of the rays are sampled.
const ENOUGH: usize = 4;

/// Fewest samples that a pool looks at around a task: its own neighbours, and enough for a variance.
const WINDOW: usize = 32;

/// Of random samples, how many times a task's own number a pool looks at for standard errors. Measured on the scenes of
/// docs/results/robustness.md: with 1 in 64 diffuse rays sampled, the pooled variance alone holds in 84% of the yard's
/// tasks without this, in 91% with 4 and in 94% with 8.
const WIDER: usize = 8;

/// Random samples of a task that are too few to say how wide the neighbourhood should be count as so many.
const LEAST_RANDOM: usize = 16;

/// Fewest differences that make a variance.
const LEAST_WINDOW: usize = 8;

/// How many deviations the neighbourhood counts for in standard errors, beside a task's own.
const BORROWED: f64 = 8.0;

/// Degrees of freedom of a pooled variance: successive differences overlap, so 32 of them are worth some two thirds.
const POOLED_FREEDOM: f64 = 21.0;

/// Degrees of freedom of [`Pool::variance`] for so many samples, and the least of `Pool::wide` (F. Satterthwaite, *An
/// Approximate Distribution of Estimates of Variance Components*, 1946).
pub fn freedom(samples: u32) -> f64 {
    let own = f64::from(samples.saturating_sub(1));
    let all = own + BORROWED;
    all * all / (own + BORROWED * BORROWED / POOLED_FREEDOM)
}

impl Pool {
    /// Of all samples of a stream, in the order of their rays.
    pub fn new(counts: &[TestCounts]) -> Self {
        let mut sum = 0.0;
        let mut last = counts.first();
        let step = |next| {
            let difference = last.replace(next).map_or(0.0, |last| tests(next) - tests(last));
            sum += difference * difference;
            sum
        };
        Self { sums: counts.iter().map(step).collect() }
    }

    /// Variance of the tests of one ray of the task whose samples are `own` of all; `None` where the whole stream has
    /// too few. The neighbourhood counts for `borrowed` deviations, more than none.
    pub fn variance(
        &self,
        own: Range<usize>,
        sample: &[TestCounts],
        sampler: RaySampler,
        borrowed: f64,
    ) -> Option<f64> {
        Some(pooled(sample, sampler, self.around(own, WINDOW)?, borrowed))
    }

    /// For random samples: the variance of the tests of one ray, by the task and a neighbourhood that is wider and
    /// counts for as much as it does; and by that neighbourhood alone.
    fn wide(&self, own: Range<usize>, sample: &[TestCounts]) -> Option<(f64, f64)> {
        let around = self.around(own, WIDER * sample.len().max(LEAST_RANDOM))?;
        Some((pooled(sample, RaySampler::Random, around, BORROWED.max(sample.len() as f64)), around))
    }

    /// Variance from `window` successive differences around a task, or as many as there are.
    fn around(&self, own: Range<usize>, window: usize) -> Option<f64> {
        let count = self.sums.len();
        if count <= LEAST_WINDOW {
            return None;
        }
        let window = window.min(count - 1);
        let middle = (own.start + own.end) / 2;
        let first = middle.saturating_sub(window / 2).min(count - 1 - window);
        Some((self.sums[first + window] - self.sums[first]) / (2.0 * window as f64))
    }
}

/// A sample's own deviations, and `borrowed` more of the variance `around` it.
fn pooled(sample: &[TestCounts], sampler: RaySampler, around: f64, borrowed: f64) -> f64 {
    let deviations = sample.len().saturating_sub(1) as f64;
    (squares(sample, sampler) + borrowed * around) / (deviations + borrowed)
}
