//! The lanes of a packet: numbers in them, and sets of them.
//!
//! Plain loops over lanes, which compilers turn into whatever SIMD words the function's target has.

/// Rays in a packet: two words of AVX, four of SSE or NEON.
pub(super) const LANES: usize = 16;

/// A number for each lane.
pub(super) type Numbers = [f32; LANES];

/// A set of lanes, a bit each.
pub(super) type Lanes = u32;

/// The lanes in which `a ≤ b`.
#[inline(always)]
pub(super) fn not_above(a: &Numbers, b: &Numbers) -> Lanes {
    let mut set = [0; LANES];
    for i in 0..LANES {
        set[i] = u8::from(a[i] <= b[i]);
    }
    gathered(&set)
}

/// The lanes whose byte is 1; the others' are 0.
#[inline(always)]
pub(super) fn gathered(bytes: &[u8; LANES]) -> Lanes {
    // Times the sum of 2^(7k), k = 1 ..= 8, bit 8i of a word of eight bytes comes to bit 56 + i, and no two bits meet.
    const GATHER: u64 = 0x0102_0408_1020_4080;
    let (words, _) = bytes.as_chunks::<8>();
    words.iter().enumerate().fold(0, |lanes, (i, word)| {
        let eight = u64::from_le_bytes(*word).wrapping_mul(GATHER) >> 56;
        lanes | (eight as Lanes) << (8 * i)
    })
}

/// Counts one more in each lane of a set.
#[inline(always)]
pub(super) fn count(counts: &mut [u32; LANES], set: Lanes) {
    for (i, count) in counts.iter_mut().enumerate() {
        *count += set >> i & 1;
    }
}

/// The lanes of a set, in order.
#[inline(always)]
pub(super) fn each(mut set: Lanes) -> impl Iterator<Item = usize> {
    core::iter::from_fn(move || {
        let lane = set.trailing_zeros();
        // Takes the lowest bit away; nothing can be taken from 0.
        set &= set.checked_sub(1)?;
        Some(lane as usize)
    })
}

/// The lesser number; one instruction, unlike `f32::min`, which must care for NaN.
#[inline(always)]
pub(super) fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The greater number.
#[inline(always)]
pub(super) fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_and_bytes_say_the_same() {
        for set in 0..1 << LANES {
            let bytes = core::array::from_fn(|i| (set >> i & 1) as u8);
            assert_eq!(gathered(&bytes), set);
            assert!(each(set).eq((0..LANES).filter(|i| set >> i & 1 == 1)));
            let mut counts = [7; LANES];
            count(&mut counts, set);
            assert_eq!(counts, bytes.map(|b| 7 + u32::from(b)));
        }
    }
}
