//! Operations that every device can do to the bit: sums, products and whole numbers, no quotient and no root.

/// A number as the sum of two, `high` the nearer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sum {
    pub high: f32,
    pub low: f32,
}

/// `a + b`, exactly.
///
/// D. E. Knuth, *The Art of Computer Programming*, volume 2, section 4.2.2 (1969).
#[inline]
pub(super) fn two_sum(a: f32, b: f32) -> Sum {
    let high = a + b;
    let t = high - a;
    Sum { high, low: (a - (high - t)) + (b - t) }
}

/// `a · b`, exactly where the low part is not denormal: in double precision, which holds the product, where devices take
/// T. J. Dekker's way (1971) to the same two numbers.
#[inline]
pub(super) fn two_product(a: f32, b: f32) -> Sum {
    let exact = f64::from(a) * f64::from(b);
    let high = exact as f32;
    Sum { high, low: (exact - f64::from(high)) as f32 }
}

/// One over the root of a positive number, to 3 · 2⁻²⁴ of it.
///
/// A first guess by the number's bits (C. Lomont, *Fast Inverse Square Root*, 2003), off by 0.0018, and Newton's step three
/// times: 5 · 10⁻⁶, 3 · 10⁻¹¹, and what rounding leaves.
#[inline]
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
            let (sum, product) = (two_sum(a, b), two_product(a, b));
            assert_eq!(f64::from(sum.high) + f64::from(sum.low), f64::from(a) + f64::from(b));
            assert_eq!(f64::from(product.high) + f64::from(product.low), f64::from(a) * f64::from(b));
            assert_eq!((sum.high, product.high), (a + b, a * b));
        }
    }
}
