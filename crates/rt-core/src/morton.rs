//! Z-curve (Morton) order of pixels.
//!
//! Primary rays are numbered along the curve, so that a contiguous range of rays is a compact region of the screen
//! and its rays are coherent.

use alloc::vec::Vec;
use core::ops::Range;

/// Interleaves the low 16 bits of `x` (even positions) and `y` (odd positions).
#[must_use]
pub const fn encode(x: u32, y: u32) -> u32 {
    spread(x) | (spread(y) << 1)
}

/// Inverse of [`encode`].
#[must_use]
pub const fn decode(code: u32) -> (u32, u32) {
    (gather(code), gather(code >> 1))
}

/// All pixels of a `width × height` image in Z-curve order, each packed as `x | y << 16`.
///
/// Codes outside the image are skipped, so any size works. `width` and `height` are at most 65,536.
#[must_use]
pub fn pixel_order(width: u32, height: u32) -> Vec<u32> {
    pixels_in(width, height, 0..u64::MAX)
}

/// A part of [`pixel_order`], made without what comes before or behind it; a range beyond the last pixel is cut.
#[must_use]
pub fn pixels_in(width: u32, height: u32, range: Range<u64>) -> Vec<u32> {
    let [width, height] = [width, height].map(u64::from);
    let end = range.end.min(width * height);
    let left = end.saturating_sub(range.start);
    let mut part = Part { width, height, skip: range.start, left, order: Vec::with_capacity(left as usize) };
    part.visit(0, 0, width.max(height).next_power_of_two());
    part.order
}

/// What of the order is still to be left out, and then to be taken.
struct Part {
    width: u64,
    height: u64,
    skip: u64,
    left: u64,
    order: Vec<u32>,
}

impl Part {
    /// Visits the quadrants of a square in Z order, leaving out those that lie wholly outside the image or the part.
    fn visit(&mut self, x: u64, y: u64, side: u64) {
        if x >= self.width || y >= self.height || self.left == 0 {
            return;
        }
        let inside = side.min(self.width - x) * side.min(self.height - y);
        if inside <= self.skip {
            self.skip -= inside;
            return;
        }
        if side == 1 {
            self.order.push(x as u32 | ((y as u32) << 16));
            self.left -= 1;
            return;
        }
        let half = side / 2;
        for (dx, dy) in [(0, 0), (half, 0), (0, half), (half, half)] {
            self.visit(x + dx, y + dy, half);
        }
    }
}

const fn spread(v: u32) -> u32 {
    let v = v & 0xffff;
    let v = (v | (v << 8)) & 0x00ff_00ff;
    let v = (v | (v << 4)) & 0x0f0f_0f0f;
    let v = (v | (v << 2)) & 0x3333_3333;
    (v | (v << 1)) & 0x5555_5555
}

const fn gather(v: u32) -> u32 {
    let v = v & 0x5555_5555;
    let v = (v | (v >> 1)) & 0x3333_3333;
    let v = (v | (v >> 2)) & 0x0f0f_0f0f;
    let v = (v | (v >> 4)) & 0x00ff_00ff;
    (v | (v >> 8)) & 0xffff
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_round_trip() {
        for (x, y) in [(0, 0), (1, 0), (0, 1), (12_345, 54_321), (65_535, 65_535)] {
            assert_eq!(decode(encode(x, y)), (x, y));
        }
    }

    #[test]
    fn order_is_the_sorted_code_of_every_pixel_once() {
        for (width, height) in [(1, 1), (7, 3), (16, 16), (33, 70)] {
            let order = pixel_order(width, height);
            let mut expected: Vec<u32> = (0..height).flat_map(|y| (0..width).map(move |x| x | (y << 16))).collect();
            expected.sort_by_key(|p| encode(p & 0xffff, p >> 16));
            assert_eq!(order, expected);
        }
        assert!(pixel_order(0, 5).is_empty());
    }

    // Fails when a skipped square's pixels outside the image are counted.
    #[test]
    fn parts_are_those_of_the_whole_order() {
        let whole = pixel_order(33, 70);
        for (start, end) in [(0, 0), (0, 7), (5, 1000), (1023, 1025), (2000, 2310), (2309, 9999), (2310, 2311), (7, 3)]
        {
            let [from, to] = [start, end].map(|n| whole.len().min(n));
            assert_eq!(pixels_in(33, 70, start as u64..end as u64), whole[from..to.max(from)], "{start}..{end}");
        }
        // The last pixels of the largest image, of which there is no room for all.
        assert_eq!(pixels_in(1 << 16, 1 << 16, (1 << 32) - 2..u64::MAX), [0xffff_fffe, 0xffff_ffff]);
    }
}
