//! What is each word's own: parts, orders of lanes, other widths.

use super::super::{Doubles8, Floats8, Floats16, LANES, Lanes, Sets, Slots};
use super::arithmetic::{less_equal, set8};
use super::{D8, F8, F16, Sets8, Slots8, transposed};
use core::arch::x86_64::*;

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
    fn same_bits(self, other: Self) -> u8 {
        let same = avx2!(_mm256_cmpeq_epi32(_mm256_castps_si256(self.0), _mm256_castps_si256(other.0)));
        set8(avx2!(_mm256_castsi256_ps(same)))
    }

    #[inline(always)]
    fn lesser_bits(self, other: Self) -> u8 {
        set8(avx2! {
            // With the highest bit turned round the order of signed numbers is that of unsigned ones.
            let turn = _mm256_set1_epi32(i32::MIN);
            let (a, b) = (_mm256_castps_si256(self.0), _mm256_castps_si256(other.0));
            _mm256_castsi256_ps(_mm256_cmpgt_epi32(_mm256_xor_si256(b, turn), _mm256_xor_si256(a, turn)))
        })
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

impl Sets for Sets8 {
    #[inline(always)]
    fn with(self, slots: u8, rays: u64) -> Self {
        let [lower, upper] = self.0;
        avx2! {
            let (slots, rays) = (_mm256_set1_epi64x(slots.into()), _mm256_set1_epi64x(rays as i64));
            let (first, last) = (_mm256_setr_epi64x(1, 2, 4, 8), _mm256_setr_epi64x(16, 32, 64, 128));
            let first = _mm256_cmpeq_epi64(_mm256_and_si256(slots, first), first);
            let last = _mm256_cmpeq_epi64(_mm256_and_si256(slots, last), last);
            Self([
                _mm256_or_si256(lower, _mm256_and_si256(first, rays)),
                _mm256_or_si256(upper, _mm256_and_si256(last, rays)),
            ])
        }
    }

    #[inline(always)]
    fn store(self, to: &mut [u64; 8]) {
        let (halves, _) = to.as_chunks_mut::<4>();
        avx2! {
            _mm256_storeu_si256(halves[0].as_mut_ptr().cast(), self.0[0]);
            _mm256_storeu_si256(halves[1].as_mut_ptr().cast(), self.0[1]);
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
    fn mul_add(self, b: Self, c: Self) -> Self {
        let ([a, d], [b, e], [c, f]) = (self.0, b.0, c.0);
        Self(avx2!([_mm256_fmadd_pd(a, b, c), _mm256_fmadd_pd(d, e, f)]))
    }

    #[inline(always)]
    fn narrow(self) -> F8 {
        let halves = avx2!([_mm256_cvtpd_ps(self.0[0]), _mm256_cvtpd_ps(self.0[1])]);
        F8(avx2!(_mm256_set_m128(halves[1], halves[0])))
    }
}
