//! Z-curve (Morton) order of pixels.
//!
//! Primary rays are numbered along the curve, so that a contiguous range of rays is a compact region of the screen
//! and its rays are coherent.

use alloc::vec::Vec;

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
    let mut order = Vec::with_capacity(width as usize * height as usize);
    let side = u64::from(width.max(height).next_power_of_two());
    visit(0, 0, side, u64::from(width), u64::from(height), &mut order);
    order
}

/// Visits the quadrants of a square in Z order, leaving out those that lie wholly outside the image.
fn visit(x: u64, y: u64, side: u64, width: u64, height: u64, order: &mut Vec<u32>) {
    if x >= width || y >= height {
        return;
    }
    if side == 1 {
        order.push(x as u32 | ((y as u32) << 16));
        return;
    }
    let half = side / 2;
    for (dx, dy) in [(0, 0), (half, 0), (0, half), (half, half)] {
        visit(x + dx, y + dy, half, width, height, order);
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
}
