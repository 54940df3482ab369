//! Lanes in plain arrays, for every processor.
//!
//! Loops over lanes become the words of the target: SSE2 on x86-64, NEON on 64-bit ARM.

use super::{Alike, Doubles8, Floats, Floats8, Floats16, Half, LANES, Lanes, Level, Sets, Slots};
use core::array::from_fn;
use core::ops::{Add, Div, Mul, Sub};

/// What every processor has.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Portable;

#[derive(Clone, Copy)]
#[repr(align(64))]
pub(crate) struct F16([f32; LANES]);

#[derive(Clone, Copy)]
#[repr(align(32))]
pub(crate) struct F8([f32; 8]);

#[derive(Clone, Copy)]
#[repr(align(64))]
pub(crate) struct D8([f64; 8]);

impl Level for Portable {
    type F16 = F16;
    type F8 = F8;
    type D8 = D8;
    type Part = Half<Self>;
    type Choice = Alike<Self>;
    type Sets = [u64; 8];

    const FEW_ALIKE: u32 = 0;

    #[inline(always)]
    fn splat(self, x: f32) -> F16 {
        F16([x; LANES])
    }

    #[inline(always)]
    fn splat8(self, x: f32) -> F8 {
        F8([x; 8])
    }

    #[inline(always)]
    fn splat_wide(self, x: f64) -> D8 {
        D8([x; 8])
    }

    #[inline(always)]
    fn load(self, from: &Lanes) -> F16 {
        F16(from.0)
    }

    #[inline(always)]
    fn load8(self, from: &[f32; 8]) -> F8 {
        F8(*from)
    }

    #[inline(always)]
    fn load_wide(self, from: &[f64; 8]) -> D8 {
        D8(*from)
    }

    #[inline(always)]
    fn load12(self, from: &[f32; LANES]) -> F16 {
        F16(from_fn(|i| if i < 12 { from[i] } else { 0.0 }))
    }

    #[inline(always)]
    fn part(self, set: u16) -> Half<Self> {
        Half::with_first(self, set)
    }

    #[inline(always)]
    fn choice(self, [_, second, third, fourth]: [u8; 4]) -> Alike<Self> {
        Alike { level: self, choice: usize::from(second | fourth != 0) + 2 * usize::from(third | fourth != 0) }
    }

    #[inline(always)]
    fn no_rays(self) -> [u64; 8] {
        [0; 8]
    }

    #[inline(always)]
    fn fetch(self, _: &[u8]) {}

    #[inline(always)]
    fn columns(self, rows: &[[f32; 8]; LANES]) -> [F16; 8] {
        from_fn(|column| F16(from_fn(|row| rows[row][column])))
    }
}

/// Bytes that are 0 or 1, as bits.
#[inline(always)]
fn bits(bytes: [u8; 8]) -> u8 {
    // Times the sum of 2^(7k), k = 1 ..= 8, bit 8i comes to bit 56 + i, and no two bits meet.
    (u64::from_le_bytes(bytes).wrapping_mul(0x0102_0408_1020_4080) >> 56) as u8
}

macro_rules! operation {
    ($word:ident, $operation:ident, $method:ident, $sign:tt) => {
        impl $operation for $word {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(from_fn(|i| self.0[i] $sign other.0[i]))
            }
        }
    };
}

macro_rules! floats {
    ($word:ident, $number:ty, $lanes:expr, $set:ty, $gather:expr) => {
        operation!($word, Add, add, +);
        operation!($word, Sub, sub, -);
        operation!($word, Mul, mul, *);
        operation!($word, Div, div, /);

        impl Floats for $word {
            type Set = $set;

            #[inline(always)]
            fn lesser(self, other: Self) -> Self {
                Self(from_fn(|i| if self.0[i] < other.0[i] { self.0[i] } else { other.0[i] }))
            }

            #[inline(always)]
            fn greater(self, other: Self) -> Self {
                Self(from_fn(|i| if self.0[i] > other.0[i] { self.0[i] } else { other.0[i] }))
            }

            #[inline(always)]
            fn abs(self) -> Self {
                Self(self.0.map(<$number>::abs))
            }

            #[inline(always)]
            fn not_above(self, other: Self) -> $set {
                $gather(from_fn(|i| u8::from(self.0[i] <= other.0[i])))
            }

            #[inline(always)]
            fn below(self, other: Self) -> $set {
                $gather(from_fn(|i| u8::from(self.0[i] < other.0[i])))
            }

            #[inline(always)]
            fn or_else(self, set: $set, other: Self) -> Self {
                Self(from_fn(|i| if set >> i & 1 == 1 { self.0[i] } else { other.0[i] }))
            }
        }
    };
}

floats!(F16, f32, LANES, u16, |bytes: [u8; 16]| {
    let (halves, _) = bytes.as_chunks::<8>();
    u16::from(bits(halves[0])) | u16::from(bits(halves[1])) << 8
});
floats!(F8, f32, 8, u8, bits);
floats!(D8, f64, 8, u8, bits);

impl Floats16 for F16 {
    type Half = F8;

    #[inline(always)]
    fn store(self, to: &mut Lanes) {
        to.0 = self.0;
    }

    #[inline(always)]
    fn half(self, half: usize) -> F8 {
        F8(self.0.as_chunks().0[half])
    }

    #[inline(always)]
    fn mul_sub(self, b: Self, c: Self) -> Self {
        self * b - c
    }

    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        c - self * b
    }

    #[inline(always)]
    fn with_sign_of(self, other: Self) -> Self {
        Self(from_fn(|i| self.0[i].copysign(other.0[i])))
    }

    #[inline(always)]
    fn power_below(self) -> Self {
        Self(self.0.map(|x| f32::from_bits(x.to_bits() & 0x7f80_0000)))
    }

    #[inline(always)]
    fn reciprocal_of_power(self) -> Self {
        Self(self.0.map(|x| f32::from_bits(0x7f00_0000_u32.wrapping_sub(x.to_bits()))))
    }

    #[inline(always)]
    fn least(self) -> f32 {
        self.0.into_iter().fold(f32::INFINITY, |a, b| if b < a { b } else { a })
    }

    #[inline(always)]
    fn greatest(self) -> f32 {
        self.0.into_iter().fold(f32::NEG_INFINITY, |a, b| if b > a { b } else { a })
    }

    #[inline(always)]
    fn groups_cab(self) -> Self {
        Self(from_fn(|i| self.0[[8, 0, 4, 12][i / 4] + i % 4]))
    }

    #[inline(always)]
    fn groups_bca(self) -> Self {
        Self(from_fn(|i| self.0[[4, 8, 0, 12][i / 4] + i % 4]))
    }

    #[inline(always)]
    fn store_rows(columns: [Self; 4], to: &mut [[f32; 4]; LANES]) {
        *to = from_fn(|row| from_fn(|column| columns[column].0[row]));
    }
}

impl Floats8 for F8 {
    type Wide = D8;
    type Slots = [u32; 8];

    #[inline(always)]
    fn store(self, to: &mut [f32; 8]) {
        *to = self.0;
    }

    #[inline(always)]
    fn mul_sub(self, b: Self, c: Self) -> Self {
        self * b - c
    }

    #[inline(always)]
    fn same_bits(self, other: Self) -> u8 {
        bits(from_fn(|i| u8::from(self.0[i].to_bits() == other.0[i].to_bits())))
    }

    #[inline(always)]
    fn lesser_bits(self, other: Self) -> u8 {
        bits(from_fn(|i| u8::from(self.0[i].to_bits() < other.0[i].to_bits())))
    }

    #[inline(always)]
    fn widen(self) -> D8 {
        D8(self.0.map(f64::from))
    }

    #[inline(always)]
    fn not_above_in_order(self, far: Self, order: u32) -> ([u32; 8], usize) {
        let mut slots = [0; 8];
        let mut count = 0;
        for place in 0..8 {
            let slot = order >> (3 * place) & 7;
            // At most one is written for each place.
            slots[count & 7] = slot;
            count += usize::from(self.0[slot as usize] <= far.0[slot as usize]);
        }
        (slots, count)
    }

    #[inline(always)]
    fn pick(self, slots: [u32; 8]) -> Self {
        Self(slots.map(|slot| self.0[slot as usize & 7]))
    }
}

impl Slots for [u32; 8] {
    #[inline(always)]
    fn store(self, to: &mut [u32; 8]) {
        *to = self;
    }

    #[inline(always)]
    fn pick(self, words: &[u32; 8], to: &mut [u32; 8]) {
        *to = self.map(|slot| words[slot as usize & 7]);
    }
}

impl Sets for [u64; 8] {
    #[inline(always)]
    fn with(self, slots: u8, rays: u64) -> Self {
        from_fn(|slot| self[slot] | rays & u64::from(slots >> slot & 1).wrapping_neg())
    }

    #[inline(always)]
    fn store(self, to: &mut [u64; 8]) {
        *to = self;
    }
}

impl Doubles8 for D8 {
    type Narrow = F8;

    #[inline(always)]
    fn store(self, to: &mut [f64; 8]) {
        *to = self.0;
    }

    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        self * b + c
    }

    #[inline(always)]
    fn narrow(self) -> F8 {
        F8(self.0.map(|x| x as f32))
    }
}
