//! Sorting tasks by cost.

use alloc::vec;
use alloc::vec::Vec;

/// A task's cost and number in one word, such that smaller words are more expensive tasks, ties the lower number.
///
/// The cost is in 32-bit fixed point. An error of 2⁻³² of the most expensive task is far below what any estimate knows,
/// and fixed point spreads tasks evenly over the sort's buckets where floating point would crowd them into a few
/// exponents.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Ranked(u64);

impl Ranked {
    const fn new(share: u32, task: u32) -> Self {
        Self(((!share as u64) << 32) | task as u64)
    }

    pub(crate) const fn task(self) -> u32 {
        self.0 as u32
    }

    /// Cost in units of [`Ranking::unit`].
    pub(crate) const fn share(self) -> u32 {
        !((self.0 >> 32) as u32)
    }
}

/// Tasks in order of decreasing cost, ties by increasing number.
#[derive(Debug)]
pub(crate) struct Ranking {
    pub(crate) order: Vec<Ranked>,
    /// What [`Ranked::share`] counts: a power of two, at least the most expensive cost divided by 2³².
    pub(crate) unit: f64,
}

/// Bits per pass and number of passes: 1,024 buckets fill as many cache lines, which is near what a core's first-level
/// cache holds (2,048 took three times as long), and two passes see 20 bits.
const DIGIT: u32 = 10;
const PASSES: usize = 2;
const BUCKETS: usize = 1 << DIGIT;

/// Below this many tasks, clearing histograms costs more than a comparison sort.
const SMALL: usize = 512;

/// Ranks tasks `0..costs.len()`. Costs must be ≥ 0; those that differ by less than 2⁻¹⁹ of the most expensive may count
/// as ties.
///
/// A radix sort from the least significant digit, in which a digit that all tasks share is skipped: uniform work is
/// never moved.
pub(crate) fn most_expensive_first(costs: impl Iterator<Item = f64> + Clone) -> Ranking {
    let highest = costs.clone().fold(0.0, |most, cost| if cost > most { cost } else { most });
    // A power of two, so that whole multiples of a unit stay exact. Costs beyond f64 count as `u32::MAX` units; the
    // cast takes what is not a number for 0.
    let (_, exponent) = libm::frexp(if highest.is_finite() { highest } else { f64::MAX });
    let scale = libm::ldexp(1.0, (32 - exponent).min(1_000));
    let ranked = (0..).zip(costs).map(|(task, cost)| Ranked::new((cost * scale + 0.5) as u32, task));
    let order = sort(ranked.collect());
    Ranking { order, unit: 1.0 / scale }
}

fn sort(mut from: Vec<Ranked>) -> Vec<Ranked> {
    let low = u64::BITS - DIGIT * PASSES as u32;
    let digit = |ranked: Ranked, pass: usize| (ranked.0 >> (low + DIGIT * pass as u32)) as usize & (BUCKETS - 1);
    if from.len() < SMALL {
        from.sort_unstable_by_key(|ranked| (ranked.0 >> low, ranked.task()));
        return from;
    }
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
        /// Mutants: `PASSES` of 1; `Ranked::new` without the `!`; a pass that fills buckets from the back.
        #[test]
        fn sorts_like_a_stable_comparison_sort(
            costs in prop::collection::vec(prop_oneof![0_u32..1 << 20, Just(0), Just(7)], 1..2_000)
        ) {
            // Steps of 2⁻²⁰ of the most expensive, so that every difference counts.
            let mut costs: Vec<f64> = costs.into_iter().map(f64::from).collect();
            costs[0] = 1_048_575.0;
            let mut expected: Vec<u32> = (0..costs.len() as u32).collect();
            expected.sort_by(|&a, &b| costs[b as usize].total_cmp(&costs[a as usize]));
            let Ranking { order, unit } = most_expensive_first(costs.iter().copied());
            prop_assert!(order.iter().all(|r| (f64::from(r.share()) * unit - costs[r.task() as usize]).abs() < 1e-3));
            let order: Vec<u32> = order.into_iter().map(Ranked::task).collect();
            prop_assert_eq!(order, expected);
        }
    }
}
