//! Ray samplers: which rays of a task stand for all of them.

use alloc::vec::Vec;
use core::fmt;
use rt_core::{RayStream, StreamKind, Task, random};

/// Share of a task's rays that is sampled, in `1/4096 ..= 1`, without a unit.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Fraction(f64);

impl Fraction {
    /// The least fraction, 1/4096: one ray of a 64 × 64 task, the largest we expect.
    pub const MIN: Self = Self(1.0 / 4096.0);
    /// 12.5%, the fraction of M. Rincón-Nigro and Z. Deng, *Cost-based Workload Balancing for Ray Tracing on
    /// Multi-GPU Systems* (2013).
    pub const EIGHTH: Self = Self(0.125);
    /// 1/64, the fraction to start with: measured to cost about 1% of a trace on a processor, and near enough to
    /// balance tasks of 1,024 rays.
    pub const SIXTY_FOURTH: Self = Self(1.0 / 64.0);
    /// 1/256: enough to see which tasks are expensive.
    pub const TWO_HUNDRED_FIFTY_SIXTH: Self = Self(1.0 / 256.0);
    /// Every ray.
    pub const ONE: Self = Self(1.0);

    /// The fraction `value`; `None` unless `1/4096 ≤ value ≤ 1`.
    #[must_use]
    pub fn new(value: f64) -> Option<Self> {
        (Self::MIN.0..=Self::ONE.0).contains(&value).then_some(Self(value))
    }

    /// The fraction as a number.
    #[must_use]
    pub const fn value(self) -> f64 {
        self.0
    }

    /// How many of `rays` rays to sample: the nearest whole number, but at least 1 of a task that has rays.
    #[must_use]
    pub fn of(self, rays: u32) -> u32 {
        // At most `rays`, since the fraction is at most 1.
        (libm::round(self.0 * f64::from(rays)) as u32).max(rays.min(1))
    }
}

impl fmt::Display for Fraction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0)
    }
}

/// How sample rays are chosen. Both ways give [`Fraction::of`] distinct rays of each task, in increasing order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RaySampler {
    /// One at random of each of equally long stretches of the stream's order: for coherent rays in Z-curve order, where
    /// it spreads the sample evenly over the task's piece of the screen.
    Strided,
    /// Random without replacement: for incoherent rays, whose order says nothing about their cost.
    Random,
}

/// Keeps the samplers' random numbers apart from those of the ray generators, which use small dimensions.
const DIMENSION: u32 = 0x5a3b_1e00;

impl RaySampler {
    /// The sampler that suits a kind of stream.
    #[must_use]
    pub const fn for_kind(kind: StreamKind) -> Self {
        if kind.is_coherent() { Self::Strided } else { Self::Random }
    }

    /// The sampler that suits a stream.
    #[must_use]
    pub const fn for_stream(stream: &RayStream<'_>) -> Self {
        if stream.is_coherent() { Self::Strided } else { Self::Random }
    }

    /// Appends the sample rays of `task` to `out` and returns their number. Equal arguments choose equal rays.
    pub fn sample(self, task: Task, fraction: Fraction, seed: u32, out: &mut Vec<u32>) -> u32 {
        let count = fraction.of(task.rays);
        match self {
            _ if count == task.rays => out.extend(task.range()),
            Self::Strided => strided(task, count, seed, out),
            Self::Random => random(task, count, seed, out),
        }
        count
    }
}

/// One ray at random of each stretch `⌊(i · rays + start) / count⌋ ..`, where the random start decides which stretches
/// are a ray longer, if any are: then chances are only nearly equal.
///
/// Stratified sampling with one ray a stratum, not systematic sampling (W. Cochran, *Sampling Techniques*, 1977,
/// chapters 5A and 8): equal steps are off by the same part of a step everywhere. Where costs rise across a task that
/// is an error which more samples do not average out and their differences do not show: 95% intervals of 1 in 8 primary
/// rays held in 77 to 92% of the tasks of real scenes.
fn strided(task: Task, count: u32, seed: u32, out: &mut Vec<u32>) {
    // Below `count`, so that the first stretch begins and the last one ends with the task.
    let start = u64::from(random::below(count, seed, task.first, DIMENSION));
    let [rays, n] = [task.rays, count].map(u64::from);
    let border = |i: u64| ((i * rays + start) / n) as u32;
    out.extend((0..n).map(|i| {
        let first = task.first + border(i);
        // Not empty: there are no more samples than rays.
        first + random::below(border(i + 1) - border(i), seed, first, DIMENSION + 1)
    }));
}

/// R. Floyd's sampling without replacement (J. Bentley and R. Floyd, *Programming Pearls: A Sample of Brilliance*,
/// 1987), with a bit set, so that the rays come out sorted and near ones are walked together.
fn random(task: Task, count: u32, seed: u32, out: &mut Vec<u32>) {
    let mut chosen = alloc::vec![0_u64; task.rays.div_ceil(64) as usize];
    for last in task.rays - count..task.rays {
        let ray = random::below(last + 1, seed, task.first.wrapping_add(last), DIMENSION);
        let taken = chosen[ray as usize / 64] >> (ray % 64) & 1 == 1;
        let ray = if taken { last } else { ray };
        chosen[ray as usize / 64] |= 1 << (ray % 64);
    }
    for (word, mut bits) in (0_u32..).zip(chosen) {
        while bits != 0 {
            out.push(task.first + word * 64 + bits.trailing_zeros());
            bits &= bits - 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    const SAMPLERS: [RaySampler; 2] = [RaySampler::Strided, RaySampler::Random];

    #[test]
    fn fractions_are_limited() {
        for bad in [0.0, -1.0, 1.0 / 4097.0, 1.000_001, f64::NAN, f64::INFINITY] {
            assert_eq!(Fraction::new(bad), None, "{bad}");
        }
        assert_eq!(Fraction::new(0.125), Some(Fraction::EIGHTH));
    }

    /// Over many seeds every ray is chosen equally often, nearly so where stretches differ in length.
    ///
    /// Mutants: `below(last, …)` in `random`; `start` fixed to 0 in `strided`.
    #[test]
    fn every_ray_has_the_same_chance() {
        let task = Task { first: 1_000, rays: 20 };
        for (sampler, count) in [(SAMPLERS[0], 5), (SAMPLERS[1], 5), (SAMPLERS[0], 7)] {
            let mut times = [0_u32; 20];
            for seed in 0..8_000 {
                let mut rays = Vec::new();
                sampler.sample(task, Fraction::new(f64::from(count) / 20.0).expect("valid"), seed, &mut rays);
                rays.iter().for_each(|ray| times[(ray - 1_000) as usize] += 1);
            }
            // 6 standard deviations of a binomial number, at most 43.
            assert!(times.iter().all(|t| t.abs_diff(400 * count) < 258), "{sampler:?}, {count}: {times:?}");
        }
    }

    /// Mutant: the same place in every stretch.
    #[test]
    fn strided_samples_do_not_repeat_at_equal_steps() {
        let task = Task { first: 0, rays: 1_024 };
        let mut sample = Vec::new();
        RaySampler::Strided.sample(task, Fraction::EIGHTH, 3, &mut sample);
        let mut places = [0; 8];
        sample.iter().for_each(|ray| places[(ray % 8) as usize] += 1);
        // 16 expected, 5 standard deviations of 3.7.
        assert!(places.iter().all(|&n: &i32| (1..35).contains(&n)), "{places:?}");
    }

    proptest! {
        /// Mutants: `Fraction::of` rounding up twice or without `max`; `strided` stepping by `rays / n` in whole
        /// numbers from an unlimited start; `random` without the `taken` test.
        #[test]
        fn samples_are_distinct_inside_the_task_and_as_many_as_asked(
            first in 0_u32..1 << 30, rays in 0_u32..5_000, fraction in 1.0_f64 / 4096.0..=1.0, seed: u32,
        ) {
            let task = Task { first, rays };
            let fraction = Fraction::new(fraction).expect("in range");
            for sampler in SAMPLERS {
                let mut out = alloc::vec![7];
                let count = sampler.sample(task, fraction, seed, &mut out);
                let sample = &out[1..];
                prop_assert_eq!(count as usize, sample.len());
                prop_assert!((f64::from(count) - fraction.value() * f64::from(rays)).abs() <= 1.0);
                prop_assert_eq!(count == 0, rays == 0);
                prop_assert!(sample.iter().all(|ray| task.range().contains(ray)));
                prop_assert_eq!(sample.iter().collect::<BTreeSet<_>>().len(), sample.len());
                prop_assert!(sample.is_sorted());
                let mut again = Vec::new();
                sampler.sample(task, fraction, seed, &mut again);
                prop_assert_eq!(sample, &again[..]);
            }
        }
    }
}
