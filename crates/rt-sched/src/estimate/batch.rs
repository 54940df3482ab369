//! Sampled counts, task by task, and what they say of their own error.

use crate::sample::{Fraction, RaySampler};
use alloc::vec::Vec;
use rt_core::{Observation, RayStream, Task, TestCounts, Work};

/// The rays that an estimator has asked for and waits for.
#[derive(Clone, Debug, Default)]
pub(super) struct Asked {
    total: usize,
    tasks: usize,
}

impl Asked {
    /// Chooses `fraction` of each of the `blocks`, which cover the rays of a stream in order. In increasing order.
    pub(super) fn choose(
        &mut self,
        stream: RayStream<'_>,
        blocks: impl Iterator<Item = Task>,
        fraction: Fraction,
    ) -> Vec<u32> {
        let sampler = RaySampler::for_kind(stream.kind);
        let mut rays = Vec::with_capacity(fraction.of(stream.rays()) as usize + stream.tasks.len());
        blocks.for_each(|block| {
            sampler.sample(block, fraction, stream.seed, &mut rays);
        });
        (self.total, self.tasks) = (rays.len(), stream.tasks.len());
        rays
    }

    /// Whether `seen` answers what was asked; then nothing is asked for any more. Anything else begins a new stream.
    pub(super) fn is_answered(&mut self, stream: RayStream<'_>, seen: Observation<'_>) -> bool {
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
pub(super) struct Batch<'a> {
    pub(super) stream: RayStream<'a>,
    pub(super) seen: Observation<'a>,
}

impl<'a> Batch<'a> {
    /// Each task with its samples: their rays and counts.
    pub(super) fn tasks(&self) -> impl Iterator<Item = (Task, &'a [u32], &'a [TestCounts])> + use<'a> {
        let Observation { mut rays, mut counts } = self.seen;
        self.stream.tasks.iter().map(move |task| {
            let own = rays.iter().take_while(|&&ray| ray < task.range().end).count();
            let (own_rays, other_rays) = rays.split_at(own);
            let (own_counts, other_counts) = counts.split_at(own);
            (rays, counts) = (other_rays, other_counts);
            (*task, own_rays, own_counts)
        })
    }

    /// Each task's samples scaled to all its rays, with their standard error.
    pub(super) fn extrapolated(&self) -> Vec<Work> {
        let sampler = RaySampler::for_kind(self.stream.kind);
        let pool = Pool::new(self.seen.counts);
        let mut at = 0;
        let work = self.tasks().map(|(task, _, sample)| {
            let own = at..at + sample.len();
            at = own.end;
            let work = scaled_up(sample, task.rays);
            let few = sample.len() < super::LEAST_SAMPLES as usize;
            match if few { pool.around(own) } else { variance_of_ray(sample, sampler) } {
                _ if sample.len() >= task.rays as usize => work.with_std_error(0.0),
                Some(variance) => work.with_std_error(std_error(variance, sample.len(), task.rays) as f32),
                None => work,
            }
        });
        work.collect()
    }
}

/// Box and triangle tests together.
pub(super) fn tests(counts: &TestCounts) -> f64 {
    f64::from(counts.boxes) + f64::from(counts.triangles)
}

/// The work of `rays` rays when the sample stands for all of them.
pub(super) fn scaled_up(sample: &[TestCounts], rays: u32) -> Work {
    let scale = f64::from(rays) / sample.len().max(1) as f64;
    let sum = |of: fn(&TestCounts) -> u32| sample.iter().map(|c| u64::from(of(c))).sum::<u64>() as f64;
    Work::new(rays as f32, (sum(|c| c.boxes) * scale) as f32, (sum(|c| c.triangles) * scale) as f32)
}

/// Standard error of the total of `rays` rays from a sample of which `samples` were drawn, with the finite population
/// correction (W. Cochran, *Sampling Techniques*, 1977, 2.6).
pub(super) fn std_error(variance: f64, samples: usize, rays: u32) -> f64 {
    let (n, all) = (samples as f64, f64::from(rays));
    if samples == 0 { f64::NAN } else { all * libm::sqrt((1.0 - n / all).max(0.0) * variance / n) }
}

/// Variance of the tests of one ray of a task from its sample; `None` below two.
pub(super) fn variance_of_ray(sample: &[TestCounts], sampler: RaySampler) -> Option<f64> {
    if sample.len() < 2 {
        return None;
    }
    let n = sample.len() as f64;
    Some(match sampler {
        RaySampler::Random => {
            let mean = sample.iter().map(tests).sum::<f64>() / n;
            sample.iter().map(|c| (tests(c) - mean) * (tests(c) - mean)).sum::<f64>() / (n - 1.0)
        }
        RaySampler::Strided => {
            let steps = sample.windows(2).map(|pair| tests(&pair[1]) - tests(&pair[0]));
            steps.map(|d| d * d).sum::<f64>() / (2.0 * (n - 1.0))
        }
    })
}

/// What few samples borrow: the variance of a ray from successive differences of samples around it in the stream's
/// order (K. Wolter, *An Investigation of Some Estimators of Variance for Systematic Sampling*, 1984, estimator 2).
/// Differences between tasks are counted as if they lay within one, which errs on the safe side.
#[derive(Clone, Debug)]
pub(super) struct Pool {
    /// Sums of squared differences before each sample; the first is of none.
    sums: Vec<f64>,
}

/// Samples a pool looks at around a task.
const WINDOW: usize = 32;

/// Degrees of freedom of a pooled variance: successive differences overlap, so 32 of them are worth some two thirds.
pub(super) const POOLED_FREEDOM: u32 = 21;

impl Pool {
    pub(super) fn new(counts: &[TestCounts]) -> Self {
        let mut sum = 0.0;
        let mut last = counts.first();
        let step = |next| {
            let difference = last.replace(next).map_or(0.0, |last| tests(next) - tests(last));
            sum += difference * difference;
            sum
        };
        Self { sums: counts.iter().map(step).collect() }
    }

    /// The variance around the samples `own`; `None` where the whole stream has fewer than a window.
    pub(super) fn around(&self, own: core::ops::Range<usize>) -> Option<f64> {
        let count = self.sums.len();
        if count <= WINDOW {
            return None;
        }
        let middle = (own.start + own.end) / 2;
        let first = middle.saturating_sub(WINDOW / 2).min(count - 1 - WINDOW);
        Some((self.sums[first + WINDOW] - self.sums[first]) / (2.0 * WINDOW as f64))
    }
}
