//! Counter-based random numbers: a number is a hash of who asks for it, never the state of a generator.
//!
//! Any device, thread or node computes the same number for the same (seed, index, dimension), in any order; a GPU
//! needs only 32-bit integer operations. The mixing function is `pcg3d` of M. Jarzynski and M. Olano, *Hash
//! Functions for GPU Rendering*, JCGT 9-3 (2020).

/// Three independent-looking words from three words.
#[must_use]
#[inline(always)]
pub const fn pcg3d(mut v: [u32; 3]) -> [u32; 3] {
    const A: u32 = 1_664_525;
    const C: u32 = 1_013_904_223;
    v = [
        v[0].wrapping_mul(A).wrapping_add(C),
        v[1].wrapping_mul(A).wrapping_add(C),
        v[2].wrapping_mul(A).wrapping_add(C),
    ];
    v[0] = v[0].wrapping_add(v[1].wrapping_mul(v[2]));
    v[1] = v[1].wrapping_add(v[2].wrapping_mul(v[0]));
    v[2] = v[2].wrapping_add(v[0].wrapping_mul(v[1]));
    v = [v[0] ^ (v[0] >> 16), v[1] ^ (v[1] >> 16), v[2] ^ (v[2] >> 16)];
    v[0] = v[0].wrapping_add(v[1].wrapping_mul(v[2]));
    v[1] = v[1].wrapping_add(v[2].wrapping_mul(v[0]));
    v[2] = v[2].wrapping_add(v[0].wrapping_mul(v[1]));
    v
}

/// A uniform number in `[0, 1)` from the upper 24 bits of a word; exact in single precision.
#[must_use]
#[inline(always)]
pub fn unit(word: u32) -> f32 {
    (word >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Two uniform numbers in `[0, 1)` for `(seed, index, dimension)`.
#[must_use]
pub fn pair(seed: u32, index: u32, dimension: u32) -> [f32; 2] {
    let [a, b, _] = pcg3d([seed, index, dimension]);
    [unit(a), unit(b)]
}

/// Sample `sample` of a low-discrepancy set in `[0, 1)²` that is private to `(seed, index)`.
///
/// M. Roberts's R2 sequence (2018) in 32-bit fixed point, shifted by a hash (Cranley and Patterson 1976): the points
/// of one pixel or one bounce fill the square evenly, and no two pixels share their pattern.
#[must_use]
#[inline(always)]
pub fn spread_pair(seed: u32, index: u32, dimension: u32, sample: u32) -> [f32; 2] {
    // 2³² / g and 2³² / g², g the real root of x³ = x + 1.
    const STEP: [u32; 2] = [0xc13f_a9a9, 0x91e1_0da5];
    let [a, b, _] = pcg3d([seed, index, dimension]);
    [unit(a.wrapping_add(sample.wrapping_mul(STEP[0]))), unit(b.wrapping_add(sample.wrapping_mul(STEP[1])))]
}

/// A whole number in `0..bound` for `(seed, index, dimension)`, by multiply and shift; its bias is below
/// `bound / 2³²`. `bound` of 0 gives 0.
#[must_use]
pub const fn below(bound: u32, seed: u32, index: u32, dimension: u32) -> u32 {
    let [a, _, _] = pcg3d([seed, index, dimension]);
    ((a as u64 * bound as u64) >> 32) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_reproducible_in_range_and_even() {
        assert_eq!(pair(1, 2, 3), pair(1, 2, 3));
        assert_ne!(pair(1, 2, 3), pair(1, 2, 4));
        let mut cells = [0_u32; 16];
        for i in 0..64_000 {
            let [x, y] = pair(7, i, 0);
            assert!((0.0..1.0).contains(&x) && (0.0..1.0).contains(&y));
            cells[(x * 4.0) as usize * 4 + (y * 4.0) as usize] += 1;
            assert!(below(10, 7, i, 1) < 10);
        }
        // 4000 expected in each cell; 6 standard deviations.
        assert!(cells.iter().all(|&n| n.abs_diff(4000) < 380), "{cells:?}");
    }
}
