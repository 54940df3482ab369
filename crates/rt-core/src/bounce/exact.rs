//! Operations that every device can do to the bit: sums, products and whole numbers, no quotient and no root.
//!
//! All are inlined, so that compilers see the whole of what makes a ray and can make several side by side.

use glam::Vec3;

/// Three numbers, each as the sum of two, `high` the nearer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sums {
    pub high: Vec3,
    pub low: Vec3,
}

/// `a + b`, exactly.
///
/// D. E. Knuth, *The Art of Computer Programming*, volume 2, section 4.2.2 (1969).
#[inline(always)]
pub(super) fn two_sum(a: Vec3, b: Vec3) -> Sums {
    let high = a + b;
    let t = high - a;
    Sums { high, low: (a - (high - t)) + (b - t) }
}

/// `a · b`, exactly where nothing in it is denormal or overflows.
///
/// T. J. Dekker, *A Floating-Point Technique for Extending the Available Precision* (1971).
#[inline(always)]
pub(super) fn two_product(a: Vec3, b: Vec3) -> Sums {
    let high = a * b;
    let ([x, y], [z, w]) = (halves(a), halves(b));
    Sums { high, low: (((x * z - high) + x * w) + y * z) + y * w }
}

/// Halves of 12 bits each: their products are exact.
#[inline(always)]
fn halves(a: Vec3) -> [Vec3; 2] {
    let c = a * 4097.0;
    let high = c - (c - a);
    [high, a - high]
}

/// One over the root of a positive number, to 3 · 2⁻²⁴ of it.
///
/// A first guess by the number's bits (C. Lomont, *Fast Inverse Square Root*, 2003), off by 0.0018, and Newton's step
/// three times: 5 · 10⁻⁶, 3 · 10⁻¹¹, and what rounding leaves.
#[inline(always)]
pub(super) fn rsqrt(x: f32) -> f32 {
    let half = 0.5 * x;
    let mut y = f32::from_bits(0x5f37_59df - (x.to_bits() >> 1));
    for _ in 0..3 {
        y *= 1.5 - (half * y) * y;
    }
    y
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random;

    #[test]
    fn roots_are_right_to_three_half_steps() {
        for i in 0..100_000 {
            let [a, b, _] = random::pcg3d([i, 5, 0]);
            // From 2⁻⁵⁰ to 2⁵⁰.
            let x = f32::from_bits((127 - 50 + a % 100) << 23 | b >> 9);
            let error = f64::from(rsqrt(x)) * libm::sqrt(f64::from(x)) - 1.0;
            assert!(error.abs() < 3.0 / 16_777_216.0, "{x:e}: {error:e}");
        }
    }

    #[test]
    fn nothing_is_left_out() {
        for i in 0..10_000 {
            let [a, b, c] = random::pcg3d([i, 6, 0]);
            let number = |bits: u32, e: u32| f32::from_bits(bits & 0x807f_ffff | (107 + e % 30) << 23);
            let (a, b) = (number(a, c), number(b, c >> 8));
            let [x, y] = [a, b].map(Vec3::splat);
            let (sum, product) = (two_sum(x, y), two_product(x, y));
            let exact = |sums: Sums| f64::from(sums.high.y) + f64::from(sums.low.y);
            assert_eq!(exact(sum), f64::from(a) + f64::from(b));
            assert_eq!(exact(product), f64::from(a) * f64::from(b));
            assert_eq!((sum.high.y, product.high.y), (a + b, a * b));
        }
    }
}
