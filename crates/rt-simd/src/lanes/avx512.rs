//! Lanes in words of AVX-512: sixteen numbers each.
#![expect(unsafe_code, reason = "intrinsics are unsafe where the compiler does not know that the processor has them")]

use super::avx2::Avx2;
use super::{Choice, Doubles8, Floats, Floats8, Floats16, LANES, LINE, Lanes, Level, Part, Sets, Slots, WideLanes};
use core::arch::x86_64::*;
use core::ops::{Add, Div, Mul, Sub};

/// Proof that the processor has AVX-512 with the extensions F, DQ, BW and VL, and AVX2 with FMA, BMI, LZCNT and POPCNT.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Avx512(());

// What words are made of is private, and only a level makes them: who has a word has the proof.
#[derive(Clone, Copy)]
pub(crate) struct F16(__m512);
#[derive(Clone, Copy)]
pub(crate) struct F8(__m256);
#[derive(Clone, Copy)]
pub(crate) struct D8(__m512d);
#[derive(Clone, Copy)]
pub(crate) struct Slots8(__m256i);
#[derive(Clone, Copy)]
pub(crate) struct Chosen(__m512i);
#[derive(Clone, Copy)]
pub(crate) struct Sets8(__m512i);

/// The first eight members of a set.
#[derive(Clone, Copy)]
pub(crate) struct Eight {
    /// Where they are, 32 bits each, those of the first lowest.
    lanes: __m512i,
    set: u16,
}

impl Avx512 {
    /// The proof, if it can be had.
    pub(crate) fn detect() -> Option<Self> {
        let all = Avx2::detect().is_some()
            && is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx512vl");
        all.then_some(Self(()))
    }
}

/// An expression of intrinsics.
macro_rules! avx512 {
    ($($intrinsics:tt)*) => {
        // SAFETY: `Avx512::detect` found the instructions: its proof is an argument of the function around this, or a
        // word that was made with it. Addresses are those of references to arrays as long as what is loaded or stored.
        unsafe { $($intrinsics)* }
    };
}

impl Level for Avx512 {
    type F16 = F16;
    type F8 = F8;
    type D8 = D8;
    type Part = Eight;
    type Choice = Chosen;
    type Sets = Sets8;

    const FEW_ALIKE: u32 = 8;

    #[inline(always)]
    fn splat(self, x: f32) -> F16 {
        F16(avx512!(_mm512_set1_ps(x)))
    }

    #[inline(always)]
    fn splat8(self, x: f32) -> F8 {
        F8(avx512!(_mm256_set1_ps(x)))
    }

    #[inline(always)]
    fn splat_wide(self, x: f64) -> D8 {
        D8(avx512!(_mm512_set1_pd(x)))
    }

    #[inline(always)]
    fn load(self, from: &Lanes) -> F16 {
        F16(avx512!(_mm512_loadu_ps(from.0.as_ptr())))
    }

    #[inline(always)]
    fn load8(self, from: &[f32; 8]) -> F8 {
        F8(avx512!(_mm256_loadu_ps(from.as_ptr())))
    }

    #[inline(always)]
    fn load_wide(self, from: &[f64; 8]) -> D8 {
        D8(avx512!(_mm512_loadu_pd(from.as_ptr())))
    }

    #[inline(always)]
    fn load12(self, from: &[f32; LANES]) -> F16 {
        F16(avx512!(_mm512_maskz_loadu_ps(0xfff, from.as_ptr())))
    }

    #[inline(always)]
    fn part(self, set: u16) -> Eight {
        avx512! {
            let all = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
            let first = _pdep_u32(0xff, set.into()) as u16;
            Eight { lanes: _mm512_maskz_compress_epi32(first, all), set: first }
        }
    }

    #[inline(always)]
    fn choice(self, [_, second, third, fourth]: [u8; 4]) -> Chosen {
        avx512! {
            let choice = _mm512_maskz_set1_epi64(second, 1);
            let choice = _mm512_mask_set1_epi64(choice, third, 2);
            Chosen(_mm512_mask_set1_epi64(choice, fourth, 3))
        }
    }

    #[inline(always)]
    fn no_rays(self) -> Sets8 {
        Sets8(avx512!(_mm512_setzero_si512()))
    }

    #[inline(always)]
    fn fetch(self, bytes: &[u8]) {
        for line in bytes.chunks(LINE) {
            avx512!(_mm_prefetch::<_MM_HINT_T0>(line.as_ptr().cast()));
        }
    }

    #[inline(always)]
    fn columns(self, rows: &[[f32; 8]; LANES]) -> [F16; 8] {
        let (a, b) = (quarters::<0>(rows), quarters::<4>(rows));
        let ([c0, c1, c2, c3], [c4, c5, c6, c7]) = (transposed(a), transposed(b));
        [F16(c0), F16(c1), F16(c2), F16(c3), F16(c4), F16(c5), F16(c6), F16(c7)]
    }
}

impl Part for Eight {
    type Narrow = F8;
    type Wide = D8;

    #[inline(always)]
    fn of(self, from: &Lanes) -> F8 {
        avx512! {
            let picked = _mm512_permutexvar_ps(self.lanes, _mm512_loadu_ps(from.0.as_ptr()));
            F8(_mm512_castps512_ps256(picked))
        }
    }

    #[inline(always)]
    fn of_wide(self, from: &WideLanes) -> D8 {
        avx512! {
            let lanes = _mm512_cvtepi32_epi64(_mm512_castsi512_si256(self.lanes));
            let (lower, upper) = (from.half(0).as_ptr(), from.half(1).as_ptr());
            D8(_mm512_permutex2var_pd(_mm512_loadu_pd(lower), lanes, _mm512_loadu_pd(upper)))
        }
    }

    #[inline(always)]
    fn members(self, set: u16) -> u8 {
        avx512!(_pext_u32(set.into(), self.set.into()) as u8)
    }

    #[inline(always)]
    fn set(self, members: u8) -> u16 {
        avx512!(_pdep_u32(members.into(), self.set.into()) as u16)
    }

    #[inline(always)]
    fn put(self, members: u8, numbers: F8, to: &mut Lanes) {
        let members = self.set(members);
        avx512! {
            let spread = _mm512_maskz_expand_ps(self.set, _mm512_castps256_ps512(numbers.0));
            _mm512_mask_storeu_ps(to.0.as_mut_ptr(), members, spread);
        }
    }
}

impl Choice for Chosen {
    type Narrow = F8;
    type Wide = D8;

    #[inline(always)]
    fn of(self, from: &[f32; 4]) -> D8 {
        avx512! {
            let four = _mm512_castpd256_pd512(_mm256_cvtps_pd(_mm_loadu_ps(from.as_ptr())));
            D8(_mm512_permutexvar_pd(self.0, four))
        }
    }

    #[inline(always)]
    fn bits_of(self, [a, b, c, d]: [u32; 4]) -> F8 {
        avx512! {
            let four = _mm256_castsi128_si256(_mm_setr_epi32(a as i32, b as i32, c as i32, d as i32));
            F8(_mm256_castsi256_ps(_mm256_permutexvar_epi32(_mm512_cvtepi64_epi32(self.0), four)))
        }
    }
}

/// Word j holds four numbers, from the given place on, of the rows j, 4 + j, 8 + j and 12 + j.
#[inline(always)]
fn quarters<const FROM: usize>(rows: &[[f32; 8]; LANES]) -> [__m512; 4] {
    let at = |row: usize| rows[row].as_ptr().wrapping_add(FROM);
    macro_rules! word {
        ($j:expr) => {{
            // SAFETY: as in `avx512!`, since only a level calls this; four numbers from place 0 or 4 of a row of eight.
            unsafe {
                let word = _mm512_castps128_ps512(_mm_loadu_ps(at($j)));
                let word = _mm512_insertf32x4::<1>(word, _mm_loadu_ps(at(4 + $j)));
                let word = _mm512_insertf32x4::<2>(word, _mm_loadu_ps(at(8 + $j)));
                _mm512_insertf32x4::<3>(word, _mm_loadu_ps(at(12 + $j)))
            }
        }};
    }
    [word!(0), word!(1), word!(2), word!(3)]
}

/// Four by four numbers transposed within each quarter of the words.
#[inline(always)]
fn transposed([a, b, c, d]: [__m512; 4]) -> [__m512; 4] {
    avx512! {
        let (ab, cd) = (_mm512_unpacklo_ps(a, b), _mm512_unpacklo_ps(c, d));
        let (ef, gh) = (_mm512_unpackhi_ps(a, b), _mm512_unpackhi_ps(c, d));
        [
            _mm512_shuffle_ps::<0x44>(ab, cd),
            _mm512_shuffle_ps::<0xee>(ab, cd),
            _mm512_shuffle_ps::<0x44>(ef, gh),
            _mm512_shuffle_ps::<0xee>(ef, gh),
        ]
    }
}

/// What all three words have: `$blend(k, a, b)` is b where k has a bit.
macro_rules! floats {
    ($word:ident, $set:ty, $add:ident, $sub:ident, $mul:ident, $div:ident, $min:ident, $max:ident, $abs:ident, $compare:ident, $blend:ident) => {
        floats!($word, Add, add, $add);
        floats!($word, Sub, sub, $sub);
        floats!($word, Mul, mul, $mul);
        floats!($word, Div, div, $div);

        impl Floats for $word {
            type Set = $set;

            #[inline(always)]
            fn lesser(self, other: Self) -> Self {
                Self(avx512!($min(self.0, other.0)))
            }

            #[inline(always)]
            fn greater(self, other: Self) -> Self {
                Self(avx512!($max(self.0, other.0)))
            }

            #[inline(always)]
            fn abs(self) -> Self {
                Self($abs(self.0))
            }

            #[inline(always)]
            fn not_above(self, other: Self) -> $set {
                avx512!($compare::<_CMP_LE_OQ>(self.0, other.0))
            }

            #[inline(always)]
            fn below(self, other: Self) -> $set {
                avx512!($compare::<_CMP_LT_OQ>(self.0, other.0))
            }

            #[inline(always)]
            fn or_else(self, set: $set, other: Self) -> Self {
                Self(avx512!($blend(set, other.0, self.0)))
            }
        }
    };
    ($word:ident, $operation:ident, $method:ident, $intrinsic:ident) => {
        impl $operation for $word {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(avx512!($intrinsic(self.0, other.0)))
            }
        }
    };
}

floats!(
    F16,
    u16,
    _mm512_add_ps,
    _mm512_sub_ps,
    _mm512_mul_ps,
    _mm512_div_ps,
    _mm512_min_ps,
    _mm512_max_ps,
    abs16,
    _mm512_cmp_ps_mask,
    _mm512_mask_blend_ps
);
floats!(
    F8,
    u8,
    _mm256_add_ps,
    _mm256_sub_ps,
    _mm256_mul_ps,
    _mm256_div_ps,
    _mm256_min_ps,
    _mm256_max_ps,
    abs8,
    _mm256_cmp_ps_mask,
    _mm256_mask_blend_ps
);
floats!(
    D8,
    u8,
    _mm512_add_pd,
    _mm512_sub_pd,
    _mm512_mul_pd,
    _mm512_div_pd,
    _mm512_min_pd,
    _mm512_max_pd,
    abs_wide,
    _mm512_cmp_pd_mask,
    _mm512_mask_blend_pd
);

#[inline(always)]
fn abs16(x: __m512) -> __m512 {
    avx512!(_mm512_abs_ps(x))
}

#[inline(always)]
fn abs_wide(x: __m512d) -> __m512d {
    avx512!(_mm512_abs_pd(x))
}

#[inline(always)]
fn abs8(x: __m256) -> __m256 {
    avx512!(_mm256_andnot_ps(_mm256_set1_ps(-0.0), x))
}

impl Floats16 for F16 {
    type Half = F8;

    #[inline(always)]
    fn store(self, to: &mut Lanes) {
        avx512!(_mm512_storeu_ps(to.0.as_mut_ptr(), self.0));
    }

    #[inline(always)]
    fn half(self, half: usize) -> F8 {
        F8(avx512!(match half {
            0 => _mm512_castps512_ps256(self.0),
            _ => _mm512_extractf32x8_ps::<1>(self.0),
        }))
    }

    #[inline(always)]
    fn mul_sub(self, b: Self, c: Self) -> Self {
        Self(avx512!(_mm512_fmsub_ps(self.0, b.0, c.0)))
    }

    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        Self(avx512!(_mm512_fnmadd_ps(self.0, b.0, c.0)))
    }

    #[inline(always)]
    fn with_sign_of(self, other: Self) -> Self {
        Self(avx512!(_mm512_or_ps(self.0, _mm512_and_ps(other.0, _mm512_set1_ps(-0.0)))))
    }

    #[inline(always)]
    fn power_below(self) -> Self {
        Self(avx512!(_mm512_and_ps(self.0, _mm512_set1_ps(f32::INFINITY))))
    }

    #[inline(always)]
    fn reciprocal_of_power(self) -> Self {
        Self(avx512!(_mm512_castsi512_ps(_mm512_sub_epi32(
            _mm512_set1_epi32(0x7f00_0000),
            _mm512_castps_si512(self.0)
        ))))
    }

    #[inline(always)]
    fn least(self) -> f32 {
        avx512!(_mm512_reduce_min_ps(self.0))
    }

    #[inline(always)]
    fn greatest(self) -> f32 {
        avx512!(_mm512_reduce_max_ps(self.0))
    }

    #[inline(always)]
    fn groups_cab(self) -> Self {
        Self(avx512!(_mm512_shuffle_f32x4::<0b11_01_00_10>(self.0, self.0)))
    }

    #[inline(always)]
    fn groups_bca(self) -> Self {
        Self(avx512!(_mm512_shuffle_f32x4::<0b11_00_10_01>(self.0, self.0)))
    }

    #[inline(always)]
    fn store_rows(columns: [Self; 4], to: &mut [[f32; 4]; LANES]) {
        let [a, b, c, d] = columns;
        let words = transposed([a.0, b.0, c.0, d.0]);
        for (j, word) in words.into_iter().enumerate() {
            avx512! {
                _mm_storeu_ps(to[j].as_mut_ptr(), _mm512_castps512_ps128(word));
                _mm_storeu_ps(to[4 + j].as_mut_ptr(), _mm512_extractf32x4_ps::<1>(word));
                _mm_storeu_ps(to[8 + j].as_mut_ptr(), _mm512_extractf32x4_ps::<2>(word));
                _mm_storeu_ps(to[12 + j].as_mut_ptr(), _mm512_extractf32x4_ps::<3>(word));
            }
        }
    }
}

impl Floats8 for F8 {
    type Wide = D8;
    type Slots = Slots8;

    #[inline(always)]
    fn store(self, to: &mut [f32; 8]) {
        avx512!(_mm256_storeu_ps(to.as_mut_ptr(), self.0));
    }

    #[inline(always)]
    fn mul_sub(self, b: Self, c: Self) -> Self {
        Self(avx512!(_mm256_fmsub_ps(self.0, b.0, c.0)))
    }

    #[inline(always)]
    fn same_bits(self, other: Self) -> u8 {
        avx512!(_mm256_cmpeq_epi32_mask(_mm256_castps_si256(self.0), _mm256_castps_si256(other.0)))
    }

    #[inline(always)]
    fn lesser_bits(self, other: Self) -> u8 {
        avx512!(_mm256_cmplt_epu32_mask(_mm256_castps_si256(self.0), _mm256_castps_si256(other.0)))
    }

    #[inline(always)]
    fn widen(self) -> D8 {
        D8(avx512!(_mm512_cvtps_pd(self.0)))
    }

    #[inline(always)]
    fn not_above_in_order(self, far: Self, order: u32) -> (Slots8, usize) {
        avx512! {
            let places = _mm256_setr_epi32(0, 3, 6, 9, 12, 15, 18, 21);
            // Bits above the lowest three do not count.
            let slots = _mm256_srlv_epi32(_mm256_set1_epi32(order as i32), places);
            let (near, far) = (_mm256_permutexvar_ps(slots, self.0), _mm256_permutexvar_ps(slots, far.0));
            let set = _mm256_cmp_ps_mask::<_CMP_LE_OQ>(near, far);
            (Slots8(_mm256_maskz_compress_epi32(set, slots)), set.count_ones() as usize)
        }
    }

    #[inline(always)]
    fn pick(self, slots: Slots8) -> Self {
        Self(avx512!(_mm256_permutexvar_ps(slots.0, self.0)))
    }
}

impl Slots for Slots8 {
    #[inline(always)]
    fn store(self, to: &mut [u32; 8]) {
        avx512!(_mm256_storeu_si256(to.as_mut_ptr().cast(), _mm256_and_si256(self.0, _mm256_set1_epi32(7))));
    }

    #[inline(always)]
    fn pick(self, words: &[u32; 8], to: &mut [u32; 8]) {
        avx512! {
            let picked = _mm256_permutexvar_epi32(self.0, _mm256_loadu_si256(words.as_ptr().cast()));
            _mm256_storeu_si256(to.as_mut_ptr().cast(), picked);
        }
    }
}

impl Sets for Sets8 {
    #[inline(always)]
    fn with(self, slots: u8, rays: u64) -> Self {
        Self(avx512!(_mm512_mask_or_epi64(self.0, slots, self.0, _mm512_set1_epi64(rays as i64))))
    }

    #[inline(always)]
    fn store(self, to: &mut [u64; 8]) {
        avx512!(_mm512_storeu_si512(to.as_mut_ptr().cast(), self.0));
    }
}

impl Doubles8 for D8 {
    type Narrow = F8;

    #[inline(always)]
    fn store(self, to: &mut [f64; 8]) {
        avx512!(_mm512_storeu_pd(to.as_mut_ptr(), self.0));
    }

    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self(avx512!(_mm512_fmadd_pd(self.0, b.0, c.0)))
    }

    #[inline(always)]
    fn narrow(self) -> F8 {
        F8(avx512!(_mm512_cvtpd_ps(self.0)))
    }
}
