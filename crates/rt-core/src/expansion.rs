//! Exact sums and products: numbers as unevaluated sums of double-precision ones.
//!
//! After J. R. Shewchuk, *Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates*, Discrete
//! & Computational Geometry 18-3 (1997). An expansion's terms rise in magnitude, none is zero, and their bits do not
//! overlap: so the last one has the sign of the whole. Every operation here is exact as long as no number overflows or
//! is smaller than a normal one; who uses them says why that cannot be. Sums and products are rounded to nearest, to
//! even where that is a draw, which is what the proofs ask for. A fused multiplication would be faster, but the target
//! may have none; Rust never fuses on its own.

use core::cmp::Ordering;

/// A sum of at most `N` numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Expansion<const N: usize> {
    terms: [f64; N],
    length: usize,
}

/// `a + b` rounded, and what rounding left out (D. E. Knuth). Exact.
#[inline]
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}

/// [`two_sum`] for `|a| ≥ |b|` (T. J. Dekker). Exact.
#[inline]
fn fast_two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    (sum, b - (sum - a))
}

/// The upper 26 bits of a number and the rest, which has 26 as well, its sign being one (G. W. Veltkamp). Exact.
#[inline]
fn halves(a: f64) -> (f64, f64) {
    const SPLITTER: f64 = ((1_u64 << 27) + 1) as f64;
    let scaled = SPLITTER * a;
    let high = scaled - (scaled - a);
    (high, a - high)
}

/// `a · b` rounded, and what rounding left out (T. J. Dekker). Exact.
#[inline]
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let product = a * b;
    let ((a_high, a_low), (b_high, b_low)) = (halves(a), halves(b));
    let rest = a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low);
    (product, rest)
}

impl<const N: usize> Expansion<N> {
    const ZERO: Self = Self { terms: [0.0; N], length: 0 };

    #[inline]
    fn push(&mut self, term: f64) {
        if term != 0.0 {
            self.terms[self.length] = term;
            self.length += 1;
        }
    }

    fn terms(&self) -> &[f64] {
        &self.terms[..self.length]
    }

    /// The exact sum.
    pub(crate) fn sum<const A: usize, const B: usize>(a: &Expansion<A>, b: &Expansion<B>) -> Self {
        const { assert!(N >= A + B) };
        let (mut a, mut b) = (a.terms(), b.terms());
        let mut next = || match (a, b) {
            ([x, rest @ ..], [y, ..]) if x.abs() < y.abs() => {
                a = rest;
                Some(*x)
            }
            (_, [y, rest @ ..]) => {
                b = rest;
                Some(*y)
            }
            ([x, rest @ ..], []) => {
                a = rest;
                Some(*x)
            }
            ([], []) => None,
        };
        let mut result = Self::ZERO;
        let mut above = 0.0;
        while let Some(term) = next() {
            let (sum, rest) = two_sum(above, term);
            result.push(rest);
            above = sum;
        }
        result.push(above);
        result
    }

    /// The exact product with one number.
    pub(crate) fn product<const A: usize>(a: &Expansion<A>, factor: f64) -> Self {
        const { assert!(N >= 2 * A) };
        let mut result = Self::ZERO;
        let mut above = 0.0;
        for &term in a.terms() {
            let (high, low) = two_product(term, factor);
            let (sum, rest) = two_sum(above, low);
            result.push(rest);
            let (sum, rest) = fast_two_sum(high, sum);
            result.push(rest);
            above = sum;
        }
        result.push(above);
        result
    }

    /// The number with the other sign.
    pub(crate) fn negated(mut self) -> Self {
        self.terms.iter_mut().for_each(|term| *term = -*term);
        self
    }

    /// How the number compares with zero.
    pub(crate) fn sign(&self) -> Ordering {
        self.terms().last().map_or(Ordering::Equal, |last| if *last > 0.0 { Ordering::Greater } else { Ordering::Less })
    }

    /// The number, off by less than 2⁻⁴⁹ of itself.
    ///
    /// Terms do not even touch, but for powers of two in pairs: each is less than half the next one but one. So summing
    /// from the smallest on, no partial sum is more than a few times the result, and all roundings together are below
    /// 16 · 2⁻⁵³.
    pub(crate) fn estimate(&self) -> f64 {
        self.terms().iter().sum()
    }
}

impl Expansion<2> {
    /// `a − b`, exact.
    pub(crate) fn difference(a: f64, b: f64) -> Self {
        Self::of_pair(two_sum(a, -b))
    }

    /// A rounded number and what rounding left out.
    fn of_pair((rounded, rest): (f64, f64)) -> Self {
        let mut result = Self::ZERO;
        result.push(rest);
        result.push(rounded);
        result
    }
}

/// A vector of exact numbers.
pub(crate) type Vector<const N: usize> = [Expansion<N>; 3];

/// `a − b`, exact.
pub(crate) fn difference(a: glam::DVec3, b: glam::DVec3) -> Vector<2> {
    core::array::from_fn(|i| Expansion::difference(a[i], b[i]))
}

/// The cross product of two differences, exact.
pub(crate) fn cross(a: &Vector<2>, b: &Vector<2>) -> Vector<16> {
    core::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        Expansion::sum(&multiplied(&a[j], &b[k]), &multiplied(&a[k], &b[j]).negated())
    })
}

/// The scalar product with a vector of plain numbers, exact.
pub(crate) fn dot(a: &Vector<16>, b: glam::DVec3) -> Expansion<96> {
    let [x, y, z]: Vector<32> = core::array::from_fn(|i| Expansion::product(&a[i], b[i]));
    Expansion::sum(&Expansion::<64>::sum(&x, &y), &z)
}

/// The sign of `(a × b) · c`, exact. Differences of numbers of like magnitudes are plain numbers, and then it has a
/// quarter of the terms.
pub(crate) fn volume_sign(a: &Vector<2>, b: &Vector<2>, c: glam::DVec3) -> Ordering {
    let (Some(p), Some(q)) = (plain(a), plain(b)) else { return dot(&cross(a, b), c).sign() };
    let [x, y, z]: Vector<8> = core::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let [left, right] = [two_product(p[j], q[k]), two_product(-p[k], q[j])].map(Expansion::of_pair);
        Expansion::product(&Expansion::<4>::sum(&left, &right), c[i])
    });
    Expansion::<24>::sum(&Expansion::<16>::sum(&x, &y), &z).sign()
}

/// The numbers, if each is one of double precision.
fn plain(a: &Vector<2>) -> Option<[f64; 3]> {
    if a.iter().any(|x| x.length > 1) {
        return None;
    }
    Some(a.each_ref().map(|x| x.terms().first().copied().unwrap_or(0.0)))
}

/// The scalar product with a difference, exact.
pub(crate) fn dot_difference(a: &Vector<16>, b: &Vector<2>) -> Expansion<192> {
    let [x, y, z]: Vector<64> = core::array::from_fn(|i| {
        let [low, high]: [Expansion<32>; 2] = factors(&b[i]).map(|factor| Expansion::product(&a[i], factor));
        Expansion::sum(&low, &high)
    });
    Expansion::sum(&Expansion::<128>::sum(&x, &y), &z)
}

fn multiplied(a: &Expansion<2>, b: &Expansion<2>) -> Expansion<8> {
    let [low, high]: [Expansion<4>; 2] = factors(b).map(|factor| Expansion::product(a, factor));
    Expansion::sum(&low, &high)
}

/// Both terms, zeros where there are none.
fn factors(a: &Expansion<2>) -> [f64; 2] {
    let term = |i: usize| a.terms().get(i).copied().unwrap_or(0.0);
    [term(0), term(1)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random;
    use dashu_int::IBig;

    /// Binary logarithm of the least unit of the numbers below.
    const UNIT: i32 = -280;

    /// Exponents of the highest and of the lowest bit that is set.
    fn ends(x: f64) -> [i32; 2] {
        let exponent = (x.to_bits() >> 52 & 0x7ff) as i32 - 1023;
        [exponent, exponent - 52 + x.to_bits().trailing_zeros().min(52) as i32]
    }

    /// `x · 2^(−3 · UNIT)`.
    fn whole(x: f64) -> IBig {
        if x == 0.0 {
            return IBig::ZERO;
        }
        let [_, lowest] = ends(x);
        let mantissa = (x.to_bits() & 0xf_ffff_ffff_ffff) | 0x10_0000_0000_0000;
        let odd = IBig::from(mantissa >> mantissa.trailing_zeros());
        let value = odd << (lowest - 3 * UNIT) as usize;
        if x < 0.0 { -value } else { value }
    }

    fn exact<const N: usize>(a: &Expansion<N>) -> IBig {
        for pair in a.terms().windows(2) {
            assert!(ends(pair[0])[0] < ends(pair[1])[1], "{pair:?} overlap");
        }
        a.terms().iter().map(|&term| whole(term)).sum()
    }

    /// Numbers that cancel, that are equal, of few bits and of all magnitudes that the tests of triangles meet.
    fn number(seed: u32, index: u32) -> f64 {
        let [bits, kind, size] = random::pcg3d([seed, index, 0]);
        let fraction = f64::from(f32::from_bits(0x3f80_0000 | bits >> 9)) * if bits & 1 == 0 { 1.0 } else { -1.0 };
        match kind % 5 {
            0 => f64::from(size % 5) - 2.0,
            1 => fraction,
            2 => fraction * crate::scale::pow2((size % 250) as i32 - 250),
            3 => fraction + 1.0,
            _ => f64::from((size % 64) as i32 - 32) / 64.0,
        }
    }

    fn point(seed: u32, index: u32) -> glam::DVec3 {
        glam::DVec3::from([0, 1, 2].map(|axis| number(seed, 3 * index + axis)))
    }

    // Fails when a term is lost, when a rest has the wrong sign, and when terms are merged out of order.
    #[test]
    fn sums_and_products_are_those_of_whole_numbers() {
        let unit = |times: i32| IBig::from(1) << ((3 - times) * -UNIT) as usize;
        for seed in 0..20_000 {
            let [o, a, b, c, d] = [0, 1, 2, 3, 4].map(|i| point(seed, i));
            let [p, q, r] = [a, b, c].map(|x| difference(x, o));
            let as_whole = |v: glam::DVec3| v.to_array().map(|x| whole(x) / unit(1));
            let minus = |x: &[IBig; 3], y: &[IBig; 3]| [0, 1, 2].map(|i| &x[i] - &y[i]);
            let ([o, a, b, c], d_whole) = ([o, a, b, c].map(as_whole), as_whole(d));
            let [a, b, c] = [a, b, c].map(|x| minus(&x, &o));
            let normal = [(1, 2), (2, 0), (0, 1)].map(|(j, k)| &a[j] * &b[k] - &a[k] * &b[j]);
            let inner = |y: &[IBig; 3]| &normal[0] * &y[0] + &normal[1] * &y[1] + &normal[2] * &y[2];
            let got = cross(&p, &q);
            for (got, right) in got.iter().zip(&normal) {
                assert_eq!(exact(got), right * unit(2), "{seed}");
            }
            let volume = dot(&got, d);
            assert_eq!(exact(&volume), inner(&d_whole) * unit(3), "{seed}");
            assert_eq!(exact(&dot_difference(&got, &r)), inner(&c) * unit(3), "{seed}");
            assert_eq!(volume.sign(), inner(&d_whole).cmp(&IBig::ZERO));
            assert_eq!(volume_sign(&p, &q, d), volume.sign(), "{seed}");
            // The estimate, compared in whole numbers too.
            let error = whole(volume.estimate()) - exact(&volume);
            let magnitude = |x: IBig| if x < IBig::ZERO { -x } else { x };
            assert!(magnitude(error) << 49 <= magnitude(exact(&volume)), "{seed}: {volume:?}");
        }
    }

    #[test]
    fn nothing_is_the_sum_of_no_terms() {
        let zero = Expansion::difference(0.1, 0.1);
        assert_eq!((zero.sign(), zero.estimate(), zero.terms().len()), (Ordering::Equal, 0.0, 0));
        let third = Expansion::difference(1.0, 1e-30);
        assert_eq!((third.sign(), third.negated().sign()), (Ordering::Greater, Ordering::Less));
        assert_eq!(third.terms(), [-1e-30, 1.0]);
    }
}
