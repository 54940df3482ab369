//! Lanes in words of AVX2: two of eight numbers, or of four in double precision.
#![expect(unsafe_code, reason = "intrinsics are unsafe where the compiler does not know that the processor has them")]

use super::{Choice, Half, LANES, LINE, Lanes, Level};
use core::arch::x86_64::*;

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
#[derive(Clone, Copy)]
pub(crate) struct Chosen(__m256i);
#[derive(Clone, Copy)]
pub(crate) struct Sets8([__m256i; 2]);

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

// Behind the macro, which they use.
mod arithmetic;
mod words;

use super::Floats8 as _;
use arithmetic::signs;

impl Level for Avx2 {
    type F16 = F16;
    type F8 = F8;
    type D8 = D8;
    type Part = Half<Self>;
    type Choice = Chosen;
    type Sets = Sets8;

    const FEW_ALIKE: u32 = 8;

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
    fn part(self, set: u16) -> Half<Self> {
        Half::with_first(self, set)
    }

    #[inline(always)]
    fn choice(self, [_, second, third, fourth]: [u8; 4]) -> Chosen {
        let (lower, upper) = (signs(second | fourth), signs(third | fourth));
        avx2! {
            // The sign comes to bit 0, or to bit 1.
            let lower = _mm256_srli_epi32::<31>(_mm256_castps_si256(lower));
            let upper = _mm256_slli_epi32::<1>(_mm256_srli_epi32::<31>(_mm256_castps_si256(upper)));
            Chosen(_mm256_or_si256(lower, upper))
        }
    }

    #[inline(always)]
    fn no_rays(self) -> Sets8 {
        Sets8(avx2!([_mm256_setzero_si256(); 2]))
    }

    #[inline(always)]
    fn fetch(self, bytes: &[u8]) {
        for line in bytes.chunks(LINE) {
            avx2!(_mm_prefetch::<_MM_HINT_T0>(line.as_ptr().cast()));
        }
    }

    #[inline(always)]
    fn columns(self, rows: &[[f32; 8]; LANES]) -> [F16; 8] {
        let (lower, upper) = rows.split_at(8);
        let ([a, b, c, d], [e, f, g, h]) = (transposed(quarters::<0>(lower)), transposed(quarters::<0>(upper)));
        let ([i, j, k, l], [m, n, o, p]) = (transposed(quarters::<4>(lower)), transposed(quarters::<4>(upper)));
        [F16([a, e]), F16([b, f]), F16([c, g]), F16([d, h]), F16([i, m]), F16([j, n]), F16([k, o]), F16([l, p])]
    }
}

impl Choice for Chosen {
    type Narrow = F8;
    type Wide = D8;

    #[inline(always)]
    fn of(self, from: &[f32; 4]) -> D8 {
        self.pick(avx2!(_mm_loadu_ps(from.as_ptr()))).widen()
    }

    #[inline(always)]
    fn bits_of(self, [a, b, c, d]: [u32; 4]) -> F8 {
        self.pick(avx2!(_mm_castsi128_ps(_mm_setr_epi32(a as i32, b as i32, c as i32, d as i32))))
    }
}

impl Chosen {
    #[inline(always)]
    fn pick(self, from: __m128) -> F8 {
        F8(avx2!(_mm256_permutevar_ps(_mm256_set_m128(from, from), self.0)))
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
