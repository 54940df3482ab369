//! What all words compute alike.

use super::super::Floats;
use super::{D8, F8, F16};
use core::arch::x86_64::*;
use core::ops::{Add, Div, Mul, Sub};

/// A word of eight numbers whose signs are the bits of a set.
#[inline(always)]
pub(super) fn signs(set: u8) -> __m256 {
    avx2! {
        // Each lane's bit comes to the top.
        let places = _mm256_setr_epi32(31, 30, 29, 28, 27, 26, 25, 24);
        _mm256_castsi256_ps(_mm256_sllv_epi32(_mm256_set1_epi32(i32::from(set)), places))
    }
}

/// A word of four numbers whose signs are the lowest bits of a set.
#[inline(always)]
fn signs4(set: u8) -> __m256d {
    avx2! {
        let places = _mm256_setr_epi64x(63, 62, 61, 60);
        _mm256_castsi256_pd(_mm256_sllv_epi64(_mm256_set1_epi64x(i64::from(set)), places))
    }
}

#[inline(always)]
pub(super) fn set8(signs: __m256) -> u8 {
    avx2!(_mm256_movemask_ps(signs) as u8)
}

#[inline(always)]
fn set16(signs: [__m256; 2]) -> u16 {
    u16::from(set8(signs[0])) | u16::from(set8(signs[1])) << 8
}

#[inline(always)]
fn set_wide(signs: [__m256d; 2]) -> u8 {
    avx2!((_mm256_movemask_pd(signs[0]) | _mm256_movemask_pd(signs[1]) << 4) as u8)
}

/// A function of two arguments, applied to one register each or to two.
macro_rules! apply {
    (one, $function:path, $a:expr, $b:expr) => {
        $function($a, $b)
    };
    (two, $function:path, $a:expr, $b:expr) => {
        [$function($a[0], $b[0]), $function($a[1], $b[1])]
    };
}

/// What all three words have.
macro_rules! floats {
    (
        $word:ident, $registers:ident, $set:ty, $gather:ident,
        $add:ident, $sub:ident, $mul:ident, $div:ident, $min:ident, $max:ident, $less_equal:ident, $less:ident,
        $abs:ident, $blend:ident
    ) => {
        floats!($word, $registers, Add, add, $add);
        floats!($word, $registers, Sub, sub, $sub);
        floats!($word, $registers, Mul, mul, $mul);
        floats!($word, $registers, Div, div, $div);

        impl Floats for $word {
            type Set = $set;

            #[inline(always)]
            fn lesser(self, other: Self) -> Self {
                Self(avx2!(apply!($registers, $min, self.0, other.0)))
            }

            #[inline(always)]
            fn greater(self, other: Self) -> Self {
                Self(avx2!(apply!($registers, $max, self.0, other.0)))
            }

            #[inline(always)]
            fn abs(self) -> Self {
                Self($abs(self.0))
            }

            #[inline(always)]
            fn not_above(self, other: Self) -> $set {
                $gather(apply!($registers, $less_equal, self.0, other.0))
            }

            #[inline(always)]
            fn below(self, other: Self) -> $set {
                $gather(apply!($registers, $less, self.0, other.0))
            }

            #[inline(always)]
            fn or_else(self, set: $set, other: Self) -> Self {
                Self($blend(set, self.0, other.0))
            }
        }
    };
    ($word:ident, $registers:ident, $operation:ident, $method:ident, $intrinsic:ident) => {
        impl $operation for $word {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(avx2!(apply!($registers, $intrinsic, self.0, other.0)))
            }
        }
    };
}

floats!(
    F16,
    two,
    u16,
    set16,
    _mm256_add_ps,
    _mm256_sub_ps,
    _mm256_mul_ps,
    _mm256_div_ps,
    _mm256_min_ps,
    _mm256_max_ps,
    less_equal,
    less,
    abs16,
    chosen16
);
floats!(
    F8,
    one,
    u8,
    set8,
    _mm256_add_ps,
    _mm256_sub_ps,
    _mm256_mul_ps,
    _mm256_div_ps,
    _mm256_min_ps,
    _mm256_max_ps,
    less_equal,
    less,
    abs8,
    chosen8
);
floats!(
    D8,
    two,
    u8,
    set_wide,
    _mm256_add_pd,
    _mm256_sub_pd,
    _mm256_mul_pd,
    _mm256_div_pd,
    _mm256_min_pd,
    _mm256_max_pd,
    less_equal_wide,
    less_wide,
    abs_wide,
    chosen_wide
);

#[inline(always)]
pub(super) fn less_equal(a: __m256, b: __m256) -> __m256 {
    avx2!(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b))
}

#[inline(always)]
fn less(a: __m256, b: __m256) -> __m256 {
    avx2!(_mm256_cmp_ps::<_CMP_LT_OQ>(a, b))
}

#[inline(always)]
fn less_equal_wide(a: __m256d, b: __m256d) -> __m256d {
    avx2!(_mm256_cmp_pd::<_CMP_LE_OQ>(a, b))
}

#[inline(always)]
fn less_wide(a: __m256d, b: __m256d) -> __m256d {
    avx2!(_mm256_cmp_pd::<_CMP_LT_OQ>(a, b))
}

#[inline(always)]
fn abs8(a: __m256) -> __m256 {
    avx2!(_mm256_andnot_ps(_mm256_set1_ps(-0.0), a))
}

#[inline(always)]
fn abs16([a, b]: [__m256; 2]) -> [__m256; 2] {
    [abs8(a), abs8(b)]
}

#[inline(always)]
fn abs_wide([a, b]: [__m256d; 2]) -> [__m256d; 2] {
    avx2!([_mm256_andnot_pd(_mm256_set1_pd(-0.0), a), _mm256_andnot_pd(_mm256_set1_pd(-0.0), b)])
}

/// a where the set has a bit.
#[inline(always)]
fn chosen8(set: u8, a: __m256, b: __m256) -> __m256 {
    avx2!(_mm256_blendv_ps(b, a, signs(set)))
}

#[inline(always)]
fn chosen16(set: u16, a: [__m256; 2], b: [__m256; 2]) -> [__m256; 2] {
    [chosen8(set as u8, a[0], b[0]), chosen8((set >> 8) as u8, a[1], b[1])]
}

#[inline(always)]
fn chosen_wide(set: u8, a: [__m256d; 2], b: [__m256d; 2]) -> [__m256d; 2] {
    avx2!([_mm256_blendv_pd(b[0], a[0], signs4(set)), _mm256_blendv_pd(b[1], a[1], signs4(set >> 4))])
}
