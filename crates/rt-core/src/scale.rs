//! Powers of two by their bits: exact, and the same on every platform.

use glam::Vec3;

/// 2^exponent in double precision, for −1022 ≤ exponent ≤ 1023; all that single-precision inputs can ask for.
#[must_use]
pub const fn pow2(exponent: i32) -> f64 {
    f64::from_bits(((exponent + 1023) as u64) << 52)
}

/// The `e` with 2^(e−1) ≤ |x| < 2^e; 0 for zero. `x` is finite.
#[must_use]
pub const fn exponent(x: f32) -> i32 {
    let bits = x.to_bits() & 0x7fff_ffff;
    match bits >> 23 {
        0 if bits == 0 => 0,
        // A subnormal number is `bits · 2^−149`.
        0 => 32 - bits.leading_zeros() as i32 - 149,
        _ => usual_exponent(x),
    }
}

/// [`exponent`] of numbers that are neither zero nor subnormal.
#[inline(always)]
pub(crate) const fn usual_exponent(x: f32) -> i32 {
    (x.to_bits() >> 23 & 0xff) as i32 - 126
}

/// 2^exponent for −126 ≤ exponent ≤ 127.
#[inline(always)]
pub(crate) const fn usual_power(exponent: i32) -> f32 {
    f32::from_bits(((exponent + 127) as u32) << 23)
}

/// The `e` for which `x` is an odd multiple of 2^e. `x` is finite and not zero.
#[must_use]
pub const fn lowest_bit(x: f32) -> i32 {
    let fraction = x.to_bits() & 0x7f_ffff;
    match x.to_bits() >> 23 & 0xff {
        0 => fraction.trailing_zeros() as i32 - 149,
        biased => (fraction | 0x80_0000).trailing_zeros() as i32 + biased as i32 - 150,
    }
}

/// `v · factor`, rounded once: exact for a power of two unless the result is subnormal or overflows.
#[must_use]
pub fn scaled(v: Vec3, factor: f64) -> Vec3 {
    (v.as_dvec3() * factor).as_vec3()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponents_bracket_every_magnitude() {
        for x in [1.0, 1.5, 0.5, 0.99, f32::MAX, f32::MIN_POSITIVE, 1e-40, f32::from_bits(1), -3.0] {
            let e = exponent(x);
            let magnitude = f64::from(x.abs());
            assert!(pow2(e - 1) <= magnitude && magnitude < pow2(e), "{x}: {e}");
            let odd = f64::from(x) / pow2(lowest_bit(x));
            assert_eq!(odd.abs() % 2.0, 1.0, "{x}");
        }
        assert_eq!((exponent(0.0), pow2(0), pow2(-3)), (0, 1.0, 0.125));
    }
}
