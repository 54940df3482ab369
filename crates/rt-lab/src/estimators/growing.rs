//! Samples that grow: orders of a task's rays of which every beginning is a sample.

use rt_core::{Task, random};
use rt_sched::sample::RaySampler;

/// Keeps these random numbers apart from those of the ray generators, which use small dimensions.
const DIMENSION: u32 = 0x5a3b_1e00;

/// All rays of `task` in an order of which every beginning is a sample, and of which every beginning is the same
/// for equal arguments: for samples that grow.
///
/// Strided: the radical inverse of J. van der Corput (1935) with its digits scrambled (A. Owen, *Randomly Permuted
/// (t,m,s)-Nets and (t,s)-Sequences*, 1995), so that the first 2ᵏ rays lie one in each of 2ᵏ stretches, each at its
/// own place there. Random: a keyed permutation (M. Luby and C. Rackoff, *How to Construct Pseudorandom
/// Permutations*, 1988: four Feistel rounds), cut down to the task's rays.
pub(super) fn order(sampler: RaySampler, task: Task, seed: u32) -> impl Iterator<Item = u32> {
    let rays = u64::from(task.rays);
    let half = (64 - rays.saturating_sub(1).leading_zeros()).div_ceil(2).max(1);
    let bits = 2 * half;
    let domain = if task.rays == 0 { 0 } else { 1_u64 << bits };
    // Not of stretches: one across the task's two ends would have rays of both.
    let start = match sampler {
        RaySampler::Strided => 0,
        RaySampler::Random => u64::from(random::below(task.rays, seed, task.first, DIMENSION)),
    };
    let key = [seed, task.first];
    let place = move |i: u64| match sampler {
        RaySampler::Strided => scrambled(i as u32, key).reverse_bits() as u64 >> (32 - bits),
        RaySampler::Random => permuted(i, half, key),
    };
    (0..domain)
        .map(place)
        .filter(move |&place| place < rays)
        .map(move |place| task.first + ((place + start) % rays) as u32)
}

/// Numbers of which each bit is flipped or not as the bits below it say: Owen's scrambling of reversed digits, by the
/// hash of S. Laine and T. Karras, *Stratified Sampling for Stochastic Transparency* (2011). A permutation of the
/// numbers below any power of two, once the bits above are dropped.
fn scrambled(i: u32, key: [u32; 2]) -> u32 {
    let [mix, ..] = random::pcg3d([key[0], key[1], DIMENSION]);
    let mut x = i.wrapping_add(mix);
    for even in [0x6c50_b47c_u32, 0xb82f_1e52, 0xc7af_e638, 0x8d22_f6e6] {
        x ^= x.wrapping_mul(even);
    }
    x
}

/// A permutation of `0 .. 4^half`, another for each key.
fn permuted(i: u64, half: u32, key: [u32; 2]) -> u64 {
    let mask = (1_u64 << half) - 1;
    let (mut left, mut right) = ((i >> half) as u32, (i & mask) as u32);
    for round in 0..4 {
        let [hash, ..] = random::pcg3d([right, key[0] ^ DIMENSION.rotate_left(round), key[1]]);
        (left, right) = (right, left ^ (hash & mask as u32));
    }
    u64::from(left) << half | u64::from(right)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    /// Mutant: the same place in every stretch.
    #[test]
    fn strided_orders_do_not_repeat_at_equal_steps() {
        let mut places = [0; 8];
        let task = Task { first: 0, rays: 1_024 };
        order(RaySampler::Strided, task, 3).take(128).for_each(|ray| places[(ray % 8) as usize] += 1);
        // 16 expected, 5 standard deviations of 3.7.
        assert!(places.iter().all(|&n: &i32| (1..35).contains(&n)), "{places:?}");
    }

    proptest! {
        /// Mutants: `permuted` with unequal halves; `order` without its filter; a start that is not reduced.
        #[test]
        fn orders_name_every_ray_once_and_spread_evenly(first in 0_u32..1 << 30, rays in 0_u32..3_000, seed: u32) {
            let task = Task { first, rays };
            for sampler in [RaySampler::Strided, RaySampler::Random] {
                let order: Vec<u32> = order(sampler, task, seed).collect();
                prop_assert_eq!(order.iter().copied().collect::<BTreeSet<_>>(), task.range().collect());
                prop_assert_eq!(order.len(), rays as usize);
                // No quarter of the task has more than its share of a quarter of the rays, by 6 standard deviations of
                // a random choice.
                let some = &order[..rays as usize / 4];
                for quarter in 0..4 {
                    let (low, high) = (first + rays / 4 * quarter, first + rays / 4 * (quarter + 1));
                    let inside = some.iter().filter(|ray| (low..high).contains(ray)).count() as f64;
                    let expected = some.len() as f64 / 4.0;
                    prop_assert!((inside - expected).abs() <= 6.0 * expected.sqrt() + 2.0, "{:?} {}", sampler, inside);
                }
            }
        }
    }
}
