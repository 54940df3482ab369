//! Costs from the counts of sampled rays.

use crate::sample::{Fraction, RaySampler};
use alloc::vec::Vec;
use rt_core::{CostEstimator, Observation, RayStream, Step, TestCounts, Walk, Work};

/// Walks a fraction of each task's rays and scales their counts to all of them.
///
/// After M. Rincón-Nigro and Z. Deng (2013), who walk 12.5% of the rays by a reduced traversal. With [`Walk::Full`]
/// the counts are exact and the hits of the sampled rays are kept, so sampling costs little on a processor where the
/// triangles are cheap.
///
/// The standard error of a task's tests is that of its sample: for random samples that of simple random sampling
/// without replacement (W. Cochran, *Sampling Techniques*, 1977, 2.6), for strided ones from successive differences
/// (K. Wolter, *An Investigation of Some Estimators of Variance for Systematic Sampling*, 1984, estimator 2), both
/// with the finite population correction. A single ray of several says nothing of its error: there is none then.
#[derive(Clone, Debug)]
pub struct Sampled {
    walk: Walk,
    fraction: Fraction,
    /// Number of samples of each task of the stream in hand; empty between streams.
    counts: Vec<u32>,
    /// Number of samples of the whole stream in hand.
    total: usize,
}

impl Sampled {
    /// An estimator that walks `fraction` of the rays by `walk`.
    #[must_use]
    pub const fn new(walk: Walk, fraction: Fraction) -> Self {
        Self { walk, fraction, counts: Vec::new(), total: 0 }
    }

    /// Chooses the rays of a new stream.
    fn ask(&mut self, stream: RayStream<'_>) -> Step {
        let sampler = RaySampler::for_kind(stream.kind);
        let mut rays = Vec::with_capacity(self.fraction.of(stream.rays()) as usize + stream.tasks.len());
        self.counts.clear();
        self.counts
            .extend(stream.tasks.iter().map(|&task| sampler.sample(task, self.fraction, stream.seed, &mut rays)));
        self.total = rays.len();
        if rays.is_empty() {
            self.counts.clear();
            return Step::Done(stream.tasks.iter().map(|_| Work::default()).collect());
        }
        Step::Sample { rays, walk: self.walk }
    }
}

impl Default for Sampled {
    /// Exact counts of one ray in 64.
    fn default() -> Self {
        Self::new(Walk::Full, Fraction::SIXTY_FOURTH)
    }
}

impl CostEstimator for Sampled {
    fn name(&self) -> &'static str {
        match self.walk {
            Walk::Full => "exact",
            Walk::Reduced(_) => "reduced",
        }
    }

    fn next(&mut self, stream: RayStream<'_>, seen: Observation<'_>) -> Step {
        // Anything but the answer to what was asked begins a new stream.
        if seen.counts.is_empty() || seen.counts.len() != self.total || self.counts.len() != stream.tasks.len() {
            return self.ask(stream);
        }
        let sampler = RaySampler::for_kind(stream.kind);
        let mut rest = seen.counts;
        let work = stream.tasks.iter().zip(self.counts.drain(..)).map(|(task, count)| {
            let (sample, others) = rest.split_at(count as usize);
            rest = others;
            extrapolate(sample, task.rays, sampler)
        });
        Step::Done(work.collect())
    }
}

/// Expected work of `rays` rays from the counts of some of them.
fn extrapolate(sample: &[TestCounts], rays: u32, sampler: RaySampler) -> Work {
    if sample.is_empty() {
        return Work::default();
    }
    let n = sample.len() as f64;
    let all = f64::from(rays);
    let boxes: u64 = sample.iter().map(|c| u64::from(c.boxes)).sum();
    let triangles: u64 = sample.iter().map(|c| u64::from(c.triangles)).sum();
    let scale = all / n;
    let work = Work::new(rays as f32, (boxes as f64 * scale) as f32, (triangles as f64 * scale) as f32);
    if sample.len() >= rays as usize {
        return work.with_std_error(0.0);
    }
    if sample.len() < 2 {
        return work;
    }
    let tests = |c: &TestCounts| f64::from(c.boxes) + f64::from(c.triangles);
    let variance = match sampler {
        RaySampler::Random => {
            let mean = (boxes + triangles) as f64 / n;
            sample.iter().map(|c| (tests(c) - mean) * (tests(c) - mean)).sum::<f64>() / (n - 1.0)
        }
        RaySampler::Strided => {
            let steps = sample.windows(2).map(|pair| tests(&pair[1]) - tests(&pair[0]));
            steps.map(|d| d * d).sum::<f64>() / (2.0 * (n - 1.0))
        }
    };
    work.with_std_error((all * libm::sqrt((1.0 - n / all) * variance / n)) as f32)
}

/// Fewest samples from which an interval is given. Counts are skewed, and below this the interval would not hold what
/// it says.
const LEAST_SAMPLES: u32 = 8;

/// Half the width of the 95% confidence interval of a task's tests, in tests, from its standard error and number of
/// samples; `None` below 8 samples unless every ray was walked.
///
/// The standard error times the quantile of Student's t distribution with `samples − 1` degrees of freedom, by the
/// expansion of M. Abramowitz and I. Stegun, *Handbook of Mathematical Functions* (1964), 26.7.5, which is within 10⁻³
/// here.
#[must_use]
pub fn interval_95(work: &Work, samples: u32) -> Option<f64> {
    let error = f64::from(work.std_error()?);
    if error == 0.0 {
        return Some(0.0);
    }
    if samples < LEAST_SAMPLES {
        return None;
    }
    let z = 1.959_964;
    let freedom = f64::from(samples - 1);
    let [z2, z4] = [z * z, z * z * z * z];
    let first = (z2 + 1.0) / 4.0;
    let second = (5.0 * z4 + 16.0 * z2 + 3.0) / 96.0;
    let third = (3.0 * z4 * z2 + 19.0 * z4 + 17.0 * z2 - 15.0) / 384.0;
    Some(error * z * (1.0 + (first + (second + third / freedom) / freedom) / freedom))
}
