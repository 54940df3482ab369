//! Children of a wide node, put in slots and their boxes on the node's grid.

use super::{LEAST_EXPONENT, NODE, WideNode};
use crate::collapse::WIDTH;
use crate::scale::pow2;
use alloc::vec::Vec;
use core::cmp::Ordering;
use glam::Vec3;
use rt_core::Aabb;

/// A child of a wide node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub bounds: Aabb,
    /// Number of triangles of a leaf; 0 for a node.
    pub triangles: u32,
}

/// The slot of each child: near that corner of the node whose number it has, where bit k of a number says that the
/// corner is on the upper side of axis k.
///
/// A ray visits slots in an order that depends on the signs of its direction alone, and so roughly from front to back.
/// Ylitie et al. (2017) solve an assignment problem; we take the best pair of child and slot again and again.
pub(super) fn places(entries: &[Entry]) -> Vec<u8> {
    let middle = |bounds: &Aabb| bounds.min * 0.5 + bounds.max * 0.5;
    let whole = entries.iter().fold(Aabb::EMPTY, |all, entry| all.union(entry.bounds));
    let centre = if entries.is_empty() { Vec3::ZERO } else { middle(&whole) };
    let corner = |slot: u8| {
        let sign = |axis: u8| if slot >> axis & 1 == 1 { 1.0 } else { -1.0 };
        Vec3::new(sign(0), sign(1), sign(2))
    };
    let mut places: Vec<Option<u8>> = entries.iter().map(|_| None).collect();
    let mut taken = [false; WIDTH];
    for _ in entries {
        let mut best: Option<(f32, usize, u8)> = None;
        for (child, entry) in entries.iter().enumerate().filter(|(child, _)| places[*child].is_none()) {
            let offset = middle(&entry.bounds) - centre;
            for slot in (0..WIDTH as u8).filter(|&slot| !taken[slot as usize]) {
                let nearness = offset.dot(corner(slot));
                if best.is_none_or(|(most, ..)| nearness > most) {
                    best = Some((nearness, child, slot));
                }
            }
        }
        if let Some((_, child, slot)) = best {
            places[child] = Some(slot);
            taken[slot as usize] = true;
        }
    }
    places.into_iter().flatten().collect()
}

/// The node with these children in these slots.
pub(super) fn encode(entries: &[Entry], places: &[u8], first_node: u32, first_triangle: u32) -> WideNode {
    let mut node = WideNode { first_node, first_triangle, ..WideNode::EMPTY };
    let mut boxes = [None; WIDTH];
    for (entry, &slot) in entries.iter().zip(places) {
        boxes[slot as usize] = Some(entry.bounds);
    }
    put_on_grid(&mut node, &boxes);
    let mut triangles = 0;
    for (entry, &slot) in entries.iter().zip(places) {
        let ones = (1_u8 << entry.triangles) - 1;
        node.meta[slot as usize] = if entry.triangles == 0 {
            node.inner |= 1 << slot;
            1 << 5 | (NODE + slot)
        } else {
            (ones << 5) | triangles
        };
        triangles += entry.triangles as u8;
    }
    node
}

/// Makes a node's grid for the boxes in its slots, and puts them on it.
pub(super) fn put_on_grid(node: &mut WideNode, boxes: &[Option<Aabb>; WIDTH]) {
    let there = || (0..WIDTH).filter_map(|slot| Some((slot, boxes[slot]?)));
    let whole = there().fold(Aabb::EMPTY, |all, (_, bounds)| all.union(bounds));
    if whole.is_empty() {
        return;
    }
    for axis in 0..3 {
        let origin = whole.min[axis];
        let exponent = exponent_for(origin, whole.max[axis]);
        node.origin[axis] = origin.to_bits();
        node.exponents[axis] = (exponent + 127) as u8;
        for (slot, bounds) in there() {
            let [low, high] = steps(origin, exponent, [bounds.min[axis], bounds.max[axis]]);
            (node.low[axis][slot], node.high[axis][slot]) = (low, high);
        }
    }
}

/// Compares `x − origin` with `steps`, exactly.
///
/// The difference is the sum of its rounded value and a rest (D. Knuth's two-sum), and rounding is monotone: so the
/// rest only matters where the rounded value is a draw.
pub(super) fn compare(x: f32, origin: f32, steps: f64) -> Ordering {
    let (x, minus) = (f64::from(x), -f64::from(origin));
    let sum = x + minus;
    let part = sum - x;
    let rest = (x - (sum - part)) + (minus - part);
    let order = |a: f64, b: f64| a.partial_cmp(&b).unwrap_or(Ordering::Equal);
    order(sum, steps).then(order(rest, 0.0))
}

/// The least exponent of a grid from `origin` on whose 255th step is not below `max`.
fn exponent_for(origin: f32, max: f32) -> i32 {
    let extent = f64::from(max) - f64::from(origin);
    // Of the extent, by its bits: 255 · 2^(e − 8) is just below 2^e, so one of the next two suffices.
    let exponent = (extent.to_bits() >> 52) as i32 - 1023;
    let mut exponent = (exponent - 7).max(LEAST_EXPONENT);
    while compare(max, origin, 255.0 * pow2(exponent)) == Ordering::Greater {
        exponent += 1;
    }
    exponent
}

/// The last step not above the lower bound, and the first not below the upper one.
fn steps(origin: f32, exponent: i32, [min, max]: [f32; 2]) -> [u8; 2] {
    let step = pow2(exponent);
    // Right but for the rounding of the difference.
    let near = |x: f32| ((f64::from(x) - f64::from(origin)) * pow2(-exponent)).clamp(0.0, 255.0) as u8;
    let mut low = near(min);
    if compare(min, origin, f64::from(low) * step) == Ordering::Less {
        low = low.saturating_sub(1);
    }
    let mut high = near(max);
    if compare(max, origin, f64::from(high) * step) == Ordering::Greater {
        high = high.saturating_add(1);
    }
    [low, high]
}
