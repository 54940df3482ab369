//! Sorting tasks by cost.

use alloc::vec;
use alloc::vec::Vec;

/// A task's cost and number in one word, such that smaller words are dearer tasks, ties the lower number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Ranked(u64);

impl Ranked {
    /// `cost` must be ≥ 0: the bits of such a float sort like the float.
    fn new(cost: f32, task: u32) -> Self {
        Self((u64::from(!cost.to_bits()) << 32) | u64::from(task))
    }

    pub(crate) const fn task(self) -> u32 {
        self.0 as u32
    }

    pub(crate) fn cost(self) -> f32 {
        f32::from_bits(!((self.0 >> 32) as u32))
    }
}

/// Bits per pass: three passes cover the 32 bits of the cost, and a histogram of 2,048 words stays in the first-level
/// cache.
const DIGIT: u32 = 11;
const BUCKETS: usize = 1 << DIGIT;
const PASSES: usize = 3;

/// Below this many tasks, clearing histograms costs more than a comparison sort.
const SMALL: usize = 512;

/// Task numbers `0..costs.len()` in order of decreasing cost, ties by increasing number. Costs must be ≥ 0.
///
/// A radix sort from the least significant digit, in which a digit that all tasks share is skipped: uniform work is
/// never moved.
pub(crate) fn dearest_first(costs: impl ExactSizeIterator<Item = f32>) -> Vec<Ranked> {
    let mut from: Vec<Ranked> = (0..).zip(costs).map(|(task, cost)| Ranked::new(cost, task)).collect();
    if from.len() < SMALL {
        from.sort_unstable();
        return from;
    }
    let digit = |ranked: Ranked, pass: usize| (ranked.0 >> (32 + DIGIT * pass as u32)) as usize & (BUCKETS - 1);
    let mut histograms = vec![[0_u32; BUCKETS]; PASSES];
    for &ranked in &from {
        for (pass, histogram) in histograms.iter_mut().enumerate() {
            histogram[digit(ranked, pass)] += 1;
        }
    }
    let mut to = from.clone();
    for (pass, histogram) in histograms.iter_mut().enumerate() {
        if histogram[digit(from[0], pass)] as usize == from.len() {
            continue;
        }
        let mut next = 0;
        for count in histogram.iter_mut() {
            next += core::mem::replace(count, next);
        }
        for &ranked in &from {
            let place = &mut histogram[digit(ranked, pass)];
            to[*place as usize] = ranked;
            *place += 1;
        }
        core::mem::swap(&mut from, &mut to);
    }
    from
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Mutants: `PASSES` of 2; `Ranked::new` without the `!`; a pass that fills buckets from the back.
        #[test]
        fn sorts_like_a_stable_comparison_sort(
            costs in prop::collection::vec(prop_oneof![0.0_f32..1e9, Just(0.0), Just(7.0), Just(f32::MAX)], 0..2_000)
        ) {
            let mut expected: Vec<u32> = (0..costs.len() as u32).collect();
            expected.sort_by(|&a, &b| costs[b as usize].total_cmp(&costs[a as usize]));
            let ranked = dearest_first(costs.iter().copied());
            prop_assert!(ranked.iter().all(|r| r.cost() == costs[r.task() as usize]));
            let order: Vec<u32> = ranked.into_iter().map(Ranked::task).collect();
            prop_assert_eq!(order, expected);
        }
    }
}
