//! Numbers side by side, a lane each: what kernels compute with, and its three implementations.
//!
//! A [`Level`] makes words of numbers; words compute. There is a level for AVX-512, one for AVX2 and one of plain
//! arrays, which compilers turn into whatever the target has. Kernels are generic over it and inlined into one function
//! a level that is compiled for its instructions (the module `dispatch`).
//!
//! Sums, differences, products and quotients are rounded once each, as IEEE 754 says, to the same bits on every level.
//! Only `mul_sub`, `neg_mul_add` and `mul_add` may round once or twice.

#[cfg(target_arch = "x86_64")]
pub(crate) mod avx2;
#[cfg(target_arch = "x86_64")]
pub(crate) mod avx512;
pub(crate) mod portable;
#[cfg(test)]
mod tests;

use core::ops::{Add, Div, Mul, Sub};

/// Bytes that come into a cache together.
#[cfg(target_arch = "x86_64")]
const LINE: usize = 64;

/// Lanes of a word of single-precision numbers: rays that are set up and tested together.
pub(crate) const LANES: usize = 16;

/// A number for each ray, as memory holds it.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Lanes(pub(crate) [f32; LANES]);

/// A number in double precision for each ray.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct WideLanes(pub(crate) [f64; LANES]);

impl Lanes {
    pub(crate) const ZERO: Self = Self([0.0; LANES]);

    /// The lower or the upper eight.
    #[inline(always)]
    pub(crate) fn half(&self, half: usize) -> &[f32; 8] {
        &self.0.as_chunks().0[half]
    }

    /// The lower or the upper eight.
    #[inline(always)]
    pub(crate) fn half_mut(&mut self, half: usize) -> &mut [f32; 8] {
        &mut self.0.as_chunks_mut().0[half]
    }
}

impl WideLanes {
    pub(crate) const ZERO: Self = Self([0.0; LANES]);

    /// The lower or the upper eight.
    #[inline(always)]
    pub(crate) fn half(&self, half: usize) -> &[f64; 8] {
        &self.0.as_chunks().0[half]
    }

    /// The lower or the upper eight.
    #[inline(always)]
    pub(crate) fn half_mut(&mut self, half: usize) -> &mut [f64; 8] {
        &mut self.0.as_chunks_mut().0[half]
    }
}

/// A set of instructions. Having a value of it proves that the processor has them.
pub(crate) trait Level: Copy {
    /// Sixteen numbers in single precision.
    type F16: Floats16<Half = Self::F8>;
    /// Eight of them.
    type F8: Floats8<Wide = Self::D8>;
    /// Eight numbers in double precision.
    type D8: Doubles8<Narrow = Self::F8>;
    /// Up to eight lanes of sixteen.
    type Part: Part<Narrow = Self::F8, Wide = Self::D8>;
    /// For each of eight lanes, one of four numbers.
    type Choice: Choice<Narrow = Self::F8, Wide = Self::D8>;
    /// For each slot of a node, a set of rays.
    type Sets: Sets;

    /// Most lanes that choose alike for which [`Level::part`] and [`Level::choice`] pay: more are looked at in halves.
    const FEW_ALIKE: u32;

    /// The same number in all lanes.
    fn splat(self, x: f32) -> Self::F16;
    fn splat8(self, x: f32) -> Self::F8;
    fn splat_wide(self, x: f64) -> Self::D8;

    fn load(self, from: &Lanes) -> Self::F16;
    fn load8(self, from: &[f32; 8]) -> Self::F8;
    fn load_wide(self, from: &[f64; 8]) -> Self::D8;

    /// The first twelve of sixteen numbers, and zeros.
    fn load12(self, from: &[f32; LANES]) -> Self::F16;

    /// A part with members of a set, which is not empty: with the first eight, where lanes move cheaply.
    fn part(self, set: u16) -> Self::Part;

    /// For each lane the one of four sets that has it; any for lanes in none.
    fn choice(self, sets: [u8; 4]) -> Self::Choice;

    /// Empty sets.
    fn no_rays(self) -> Self::Sets;

    /// Asks for bytes to be brought into the cache, where the processor can be asked.
    fn fetch(self, bytes: &[u8]);

    /// The columns of a table of sixteen rows.
    fn columns(self, rows: &[[f32; 8]; LANES]) -> [Self::F16; 8];
}

/// Up to eight lanes of sixteen, in order.
pub(crate) trait Part: Copy {
    type Narrow;
    type Wide;

    /// Its numbers.
    fn of(self, from: &Lanes) -> Self::Narrow;
    /// Its numbers.
    fn of_wide(self, from: &WideLanes) -> Self::Wide;
    /// Which of its lanes are members of a set.
    fn members(self, set: u16) -> u8;
    /// The set of these members.
    fn set(self, members: u8) -> u16;
    /// Writes the numbers of these members.
    fn put(self, members: u8, numbers: Self::Narrow, to: &mut Lanes);
}

/// The lower or the upper eight: the part where lanes do not move.
#[derive(Clone, Copy)]
pub(crate) struct Half<L> {
    level: L,
    upper: bool,
}

impl<L: Level> Half<L> {
    #[inline(always)]
    pub(crate) const fn lower(level: L) -> Self {
        Self { level, upper: false }
    }

    #[inline(always)]
    pub(crate) const fn upper(level: L) -> Self {
        Self { level, upper: true }
    }

    /// The one with the first member of a set.
    #[inline(always)]
    const fn with_first(level: L, set: u16) -> Self {
        Self { level, upper: set & 0xff == 0 }
    }
}

impl<L: Level> Part for Half<L> {
    type Narrow = L::F8;
    type Wide = L::D8;

    #[inline(always)]
    fn of(self, from: &Lanes) -> L::F8 {
        self.level.load8(from.half(self.upper.into()))
    }

    #[inline(always)]
    fn of_wide(self, from: &WideLanes) -> L::D8 {
        self.level.load_wide(from.half(self.upper.into()))
    }

    #[inline(always)]
    fn members(self, set: u16) -> u8 {
        (set >> (8 * u32::from(self.upper))) as u8
    }

    #[inline(always)]
    fn set(self, members: u8) -> u16 {
        u16::from(members) << (8 * u32::from(self.upper))
    }

    #[inline(always)]
    fn put(self, members: u8, numbers: L::F8, to: &mut Lanes) {
        let to = to.half_mut(self.upper.into());
        numbers.or_else(members, self.level.load8(to)).store(to);
    }
}

/// For each of eight lanes, one of four.
pub(crate) trait Choice: Copy {
    type Narrow;
    type Wide;

    /// The chosen numbers.
    fn of(self, from: &[f32; 4]) -> Self::Wide;
    /// The chosen words of bits, which are only moved.
    fn bits_of(self, from: [u32; 4]) -> Self::Narrow;
}

/// The same for all lanes.
#[derive(Clone, Copy)]
pub(crate) struct Alike<L> {
    pub(crate) level: L,
    /// Below 4.
    pub(crate) choice: usize,
}

impl<L: Level> Choice for Alike<L> {
    type Narrow = L::F8;
    type Wide = L::D8;

    #[inline(always)]
    fn of(self, from: &[f32; 4]) -> L::D8 {
        self.level.splat_wide(from[self.choice & 3].into())
    }

    #[inline(always)]
    fn bits_of(self, from: [u32; 4]) -> L::F8 {
        self.level.splat8(f32::from_bits(from[self.choice & 3]))
    }
}

/// What all words can do.
pub(crate) trait Floats:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// A bit for each lane.
    type Set;

    /// The lesser of each two numbers; neither is NaN where it matters.
    fn lesser(self, other: Self) -> Self;
    /// The greater of each two.
    fn greater(self, other: Self) -> Self;
    fn abs(self) -> Self;
    /// Where this is less, or equal; not where either is NaN.
    fn not_above(self, other: Self) -> Self::Set;
    /// Where this is less.
    fn below(self, other: Self) -> Self::Set;
    /// This where the set has a bit, the other number elsewhere.
    fn or_else(self, set: Self::Set, other: Self) -> Self;
}

pub(crate) trait Floats16: Floats<Set = u16> {
    type Half;

    fn store(self, to: &mut Lanes);
    /// The lower or the upper eight.
    fn half(self, half: usize) -> Self::Half;
    /// `self · b − c`, rounded once or twice.
    fn mul_sub(self, b: Self, c: Self) -> Self;
    /// `c − self · b`, rounded once or twice.
    fn neg_mul_add(self, b: Self, c: Self) -> Self;
    /// Of this magnitude, which is not negative, and of the other's sign.
    fn with_sign_of(self, other: Self) -> Self;
    /// The greatest power of two that is not above the magnitude, for normal numbers.
    fn power_below(self) -> Self;
    /// One over powers of two of which both are normal numbers.
    fn reciprocal_of_power(self) -> Self;
    /// The least of all lanes.
    fn least(self) -> f32;
    /// The greatest of all lanes.
    fn greatest(self) -> f32;
    /// Groups of four lanes, in the order 2, 0, 1, 3.
    fn groups_cab(self) -> Self;
    /// Groups of four lanes, in the order 1, 2, 0, 3.
    fn groups_bca(self) -> Self;
    /// Writes the rows of a table of four columns. Bits are only moved, whatever they mean.
    fn store_rows(columns: [Self; 4], to: &mut [[f32; 4]; LANES]);
}

pub(crate) trait Floats8: Floats<Set = u8> {
    type Wide;
    /// Slots of a node in an order.
    type Slots: Slots;

    fn store(self, to: &mut [f32; 8]);
    /// `self · b − c`, rounded once or twice.
    fn mul_sub(self, b: Self, c: Self) -> Self;
    /// Where the bits are the same.
    fn same_bits(self, other: Self) -> u8;
    /// Where the bits are a lesser number, without a sign.
    fn lesser_bits(self, other: Self) -> u8;
    fn widen(self) -> Self::Wide;
    /// The slots in which `self ≤ far`, in the order of three bits each from the lowest up, and their number.
    fn not_above_in_order(self, far: Self, order: u32) -> (Self::Slots, usize);
    /// The numbers of these slots; behind them, anything.
    fn pick(self, slots: Self::Slots) -> Self;
}

/// Numbers of slots, each below 8.
pub(crate) trait Slots: Copy {
    fn store(self, to: &mut [u32; 8]);
    /// The words of these slots; behind them, anything.
    fn pick(self, words: &[u32; 8], to: &mut [u32; 8]);
}

/// For each slot of a node, a set of the rays of a packet, a bit each.
pub(crate) trait Sets: Copy {
    /// The same with some rays in some slots, of which there is a bit for each.
    fn with(self, slots: u8, rays: u64) -> Self;
    fn store(self, to: &mut [u64; 8]);
}

pub(crate) trait Doubles8: Floats<Set = u8> {
    type Narrow;

    fn store(self, to: &mut [f64; 8]);
    /// `self · b + c`, rounded once or twice.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// Rounded to single precision.
    fn narrow(self) -> Self::Narrow;
}
