//! Lanes in words of AVX2: two of eight numbers, or of four in double precision.
#![expect(unsafe_code, reason = "intrinsics are unsafe where the compiler does not know that the processor has them")]

use super::{Doubles8, Floats, Floats8, Floats16, LANES, Lanes, Level, Slots};
use core::arch::x86_64::*;
use core::ops::{Add, Div, Mul, Sub};

/// Proof that the processor has AVX2 with FMA, BMI, LZCNT and POPCNT.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Avx2(());

// What words are made of is private, and only a level makes them: who has a word has the proof.
#[derive(Clone, Copy)]
pub(crate) struct F16([__m256; 2]);
#[derive(Clone, Copy)]
pub(crate) struct F8(__m256);
#[derive(Clone, Copy)]
pub(crate) struct D8([__m256d; 2]);
#[derive(Clone, Copy)]
pub(crate) struct Slots8(__m256i);

impl Avx2 {
    /// The proof, if it can be had.
    pub(crate) fn detect() -> Option<Self> {
        let all = is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("lzcnt")
            && is_x86_feature_detected!("popcnt");
        all.then_some(Self(()))
    }
}

/// An expression of intrinsics.
macro_rules! avx2 {
    ($($intrinsics:tt)*) => {
        // SAFETY: `Avx2::detect` found the instructions: its proof is an argument of the function around this, or a
        // word that was made with it. Addresses are those of references to arrays as long as what is loaded or stored.
        unsafe { $($intrinsics)* }
    };
}

impl Level for Avx2 {
    type F16 = F16;
    type F8 = F8;
    type D8 = D8;

    #[inline(always)]
    fn splat(self, x: f32) -> F16 {
        F16(avx2!([_mm256_set1_ps(x); 2]))
    }

    #[inline(always)]
    fn splat8(self, x: f32) -> F8 {
        F8(avx2!(_mm256_set1_ps(x)))
    }

    #[inline(always)]
    fn splat_wide(self, x: f64) -> D8 {
        D8(avx2!([_mm256_set1_pd(x); 2]))
    }

    #[inline(always)]
    fn load(self, from: &Lanes) -> F16 {
        F16(avx2!([_mm256_loadu_ps(from.half(0).as_ptr()), _mm256_loadu_ps(from.half(1).as_ptr())]))
    }

    #[inline(always)]
    fn load8(self, from: &[f32; 8]) -> F8 {
        F8(avx2!(_mm256_loadu_ps(from.as_ptr())))
    }

    #[inline(always)]
    fn load_wide(self, from: &[f64; 8]) -> D8 {
        let (halves, _) = from.as_chunks::<4>();
        D8(avx2!([_mm256_loadu_pd(halves[0].as_ptr()), _mm256_loadu_pd(halves[1].as_ptr())]))
    }

    #[inline(always)]
    fn load12(self, from: &[f32; LANES]) -> F16 {
        let (quarters, _) = from.as_chunks::<4>();
        F16(avx2!([
            _mm256_set_m128(_mm_loadu_ps(quarters[1].as_ptr()), _mm_loadu_ps(quarters[0].as_ptr())),
            _mm256_zextps128_ps256(_mm_loadu_ps(quarters[2].as_ptr())),
        ]))
    }

    #[inline(always)]
    fn columns(self, rows: &[[f32; 8]; LANES]) -> [F16; 8] {
        let (lower, upper) = rows.split_at(8);
        let ([a, b, c, d], [e, f, g, h]) = (transposed(quarters::<0>(lower)), transposed(quarters::<0>(upper)));
        let ([i, j, k, l], [m, n, o, p]) = (transposed(quarters::<4>(lower)), transposed(quarters::<4>(upper)));
        [F16([a, e]), F16([b, f]), F16([c, g]), F16([d, h]), F16([i, m]), F16([j, n]), F16([k, o]), F16([l, p])]
    }
}

/// Word j holds four numbers, from the given place on, of the rows j and 4 + j of eight.
#[inline(always)]
fn quarters<const FROM: usize>(rows: &[[f32; 8]]) -> [__m256; 4] {
    let at = |row: usize| rows[row].as_ptr().wrapping_add(FROM);
    macro_rules! word {
        ($j:expr) => {
            // SAFETY: as in `avx2!`, since only a level calls this; four numbers from place 0 or 4 of a row of eight.
            unsafe { _mm256_set_m128(_mm_loadu_ps(at(4 + $j)), _mm_loadu_ps(at($j))) }
        };
    }
    [word!(0), word!(1), word!(2), word!(3)]
}

/// Four by four numbers transposed within each half of the words.
#[inline(always)]
fn transposed([a, b, c, d]: [__m256; 4]) -> [__m256; 4] {
    avx2! {
        let (ab, cd) = (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d));
        let (ef, gh) = (_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d));
        [
            _mm256_shuffle_ps::<0x44>(ab, cd),
            _mm256_shuffle_ps::<0xee>(ab, cd),
            _mm256_shuffle_ps::<0x44>(ef, gh),
            _mm256_shuffle_ps::<0xee>(ef, gh),
        ]
    }
}

/// A word of eight numbers whose signs are the bits of a set.
#[inline(always)]
fn signs(set: u8) -> __m256 {
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
fn set8(signs: __m256) -> u8 {
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
fn less_equal(a: __m256, b: __m256) -> __m256 {
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

impl Floats16 for F16 {
    type Half = F8;

    #[inline(always)]
    fn store(self, to: &mut Lanes) {
        avx2! {
            _mm256_storeu_ps(to.half_mut(0).as_mut_ptr(), self.0[0]);
            _mm256_storeu_ps(to.half_mut(1).as_mut_ptr(), self.0[1]);
        }
    }

    #[inline(always)]
    fn half(self, half: usize) -> F8 {
        F8(self.0[half])
    }

    #[inline(always)]
    fn mul_sub(self, b: Self, c: Self) -> Self {
        let ([a, d], [b, e], [c, f]) = (self.0, b.0, c.0);
        Self(avx2!([_mm256_fmsub_ps(a, b, c), _mm256_fmsub_ps(d, e, f)]))
    }

    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        let ([a, d], [b, e], [c, f]) = (self.0, b.0, c.0);
        Self(avx2!([_mm256_fnmadd_ps(a, b, c), _mm256_fnmadd_ps(d, e, f)]))
    }

    #[inline(always)]
    fn with_sign_of(self, other: Self) -> Self {
        let ([a, b], [c, d]) = (self.0, other.0);
        avx2! {
            let sign = _mm256_set1_ps(-0.0);
            Self([_mm256_or_ps(a, _mm256_and_ps(c, sign)), _mm256_or_ps(b, _mm256_and_ps(d, sign))])
        }
    }

    #[inline(always)]
    fn power_below(self) -> Self {
        let [a, b] = self.0;
        avx2! {
            let exponent = _mm256_set1_ps(f32::INFINITY);
            Self([_mm256_and_ps(a, exponent), _mm256_and_ps(b, exponent)])
        }
    }

    #[inline(always)]
    fn reciprocal_of_power(self) -> Self {
        let [a, b] = self.0;
        avx2! {
            let one_squared = _mm256_set1_epi32(0x7f00_0000);
            Self([
                _mm256_castsi256_ps(_mm256_sub_epi32(one_squared, _mm256_castps_si256(a))),
                _mm256_castsi256_ps(_mm256_sub_epi32(one_squared, _mm256_castps_si256(b))),
            ])
        }
    }

    #[inline(always)]
    fn least(self) -> f32 {
        avx2! {
            let eight = _mm256_min_ps(self.0[0], self.0[1]);
            let four = _mm_min_ps(_mm256_castps256_ps128(eight), _mm256_extractf128_ps::<1>(eight));
            let two = _mm_min_ps(four, _mm_movehl_ps(four, four));
            _mm_cvtss_f32(_mm_min_ss(two, _mm_shuffle_ps::<1>(two, two)))
        }
    }

    #[inline(always)]
    fn greatest(self) -> f32 {
        avx2! {
            let eight = _mm256_max_ps(self.0[0], self.0[1]);
            let four = _mm_max_ps(_mm256_castps256_ps128(eight), _mm256_extractf128_ps::<1>(eight));
            let two = _mm_max_ps(four, _mm_movehl_ps(four, four));
            _mm_cvtss_f32(_mm_max_ss(two, _mm_shuffle_ps::<1>(two, two)))
        }
    }

    // Groups 0 and 1 are in the first register, 2 and 3 in the second: a nibble picks each half of a result.
    #[inline(always)]
    fn groups_cab(self) -> Self {
        let [a, b] = self.0;
        Self(avx2!([_mm256_permute2f128_ps::<0x02>(a, b), _mm256_permute2f128_ps::<0x31>(a, b)]))
    }

    #[inline(always)]
    fn groups_bca(self) -> Self {
        let [a, b] = self.0;
        Self(avx2!([_mm256_permute2f128_ps::<0x21>(a, b), _mm256_permute2f128_ps::<0x30>(a, b)]))
    }

    #[inline(always)]
    fn store_rows(columns: [Self; 4], to: &mut [[f32; 4]; LANES]) {
        let [a, b, c, d] = columns;
        for half in 0..2 {
            let words = transposed([a.0[half], b.0[half], c.0[half], d.0[half]]);
            for (j, word) in words.into_iter().enumerate() {
                avx2! {
                    _mm_storeu_ps(to[8 * half + j].as_mut_ptr(), _mm256_castps256_ps128(word));
                    _mm_storeu_ps(to[8 * half + 4 + j].as_mut_ptr(), _mm256_extractf128_ps::<1>(word));
                }
            }
        }
    }
}

/// For each set of eight places, its members in order, three bits each.
static MEMBERS: [u32; 256] = {
    let mut table = [0; 256];
    let mut set = 0;
    while set < 256 {
        let (mut place, mut count) = (0, 0);
        while place < 8 {
            if set >> place & 1 == 1 {
                table[set] |= (place as u32) << (3 * count);
                count += 1;
            }
            place += 1;
        }
        set += 1;
    }
    table
};

/// Eight numbers of three bits each; what is above the lowest three bits of a lane does not count.
#[inline(always)]
fn spread(packed: u32) -> __m256i {
    avx2!(_mm256_srlv_epi32(_mm256_set1_epi32(packed as i32), _mm256_setr_epi32(0, 3, 6, 9, 12, 15, 18, 21)))
}

impl Floats8 for F8 {
    type Wide = D8;
    type Slots = Slots8;

    #[inline(always)]
    fn store(self, to: &mut [f32; 8]) {
        avx2!(_mm256_storeu_ps(to.as_mut_ptr(), self.0));
    }

    #[inline(always)]
    fn mul_sub(self, b: Self, c: Self) -> Self {
        Self(avx2!(_mm256_fmsub_ps(self.0, b.0, c.0)))
    }

    #[inline(always)]
    fn same_bits(self, bits: u32) -> u8 {
        let same = avx2!(_mm256_cmpeq_epi32(_mm256_castps_si256(self.0), _mm256_set1_epi32(bits as i32)));
        set8(avx2!(_mm256_castsi256_ps(same)))
    }

    #[inline(always)]
    fn widen(self) -> D8 {
        let halves = avx2!([_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0)]);
        D8(avx2!([_mm256_cvtps_pd(halves[0]), _mm256_cvtps_pd(halves[1])]))
    }

    #[inline(always)]
    fn not_above_in_order(self, far: Self, order: u32) -> (Slots8, usize) {
        let slots = spread(order);
        let (near, far) = avx2!((_mm256_permutevar8x32_ps(self.0, slots), _mm256_permutevar8x32_ps(far.0, slots)));
        let set = set8(less_equal(near, far));
        let members = spread(MEMBERS[usize::from(set)]);
        (Slots8(avx2!(_mm256_permutevar8x32_epi32(slots, members))), set.count_ones() as usize)
    }

    #[inline(always)]
    fn pick(self, slots: Slots8) -> Self {
        Self(avx2!(_mm256_permutevar8x32_ps(self.0, slots.0)))
    }
}

impl Slots for Slots8 {
    #[inline(always)]
    fn store(self, to: &mut [u32; 8]) {
        avx2!(_mm256_storeu_si256(to.as_mut_ptr().cast(), _mm256_and_si256(self.0, _mm256_set1_epi32(7))));
    }

    #[inline(always)]
    fn pick(self, words: &[u32; 8], to: &mut [u32; 8]) {
        avx2! {
            let picked = _mm256_permutevar8x32_epi32(_mm256_loadu_si256(words.as_ptr().cast()), self.0);
            _mm256_storeu_si256(to.as_mut_ptr().cast(), picked);
        }
    }
}

impl Doubles8 for D8 {
    type Narrow = F8;

    #[inline(always)]
    fn store(self, to: &mut [f64; 8]) {
        let (halves, _) = to.as_chunks_mut::<4>();
        avx2! {
            _mm256_storeu_pd(halves[0].as_mut_ptr(), self.0[0]);
            _mm256_storeu_pd(halves[1].as_mut_ptr(), self.0[1]);
        }
    }

    #[inline(always)]
    fn narrow(self) -> F8 {
        let halves = avx2!([_mm256_cvtpd_ps(self.0[0]), _mm256_cvtpd_ps(self.0[1])]);
        F8(avx2!(_mm256_set_m128(halves[1], halves[0])))
    }
}
