//! In which order rays visit the children of a node.
//!
//! Rays that ask for the nearest hit go from near to far. Those that ask for any end with the first hit, so they go
//! first where they are most likely to end for what it costs, whichever way they go; after J.-H. Nah and D. Manocha,
//! *SATO: Surface Area Traversal Order for Shadow Ray Tracing* (2014), which compares the surfaces of triangles alone.

use super::{BLOCK, Block, BlockChild, BlockNode, COSTS};
use crate::collapse::WIDTH;
use crate::stats::Areas;
use alloc::vec;
use glam::Vec3;
use rt_core::Aabb;

/// What becomes of a ray that asks for any hit once it has entered a box.
#[derive(Clone, Copy, Debug)]
struct Visit {
    /// The chance that it ends there.
    ends: f32,
    /// What it costs until it ends or has seen all.
    cost: f32,
}

/// Puts the children of every node in the order in which rays that ask for any hit put them on a stack: those to be
/// visited last come first. Then writes down the orders for the nearest hit.
pub(super) fn arrange(nodes: &mut [BlockNode], blocks: &[Block], areas: Areas) {
    let mut visits = vec![Visit { ends: 0.0, cost: 0.0 }; nodes.len()];
    // Children come after their parents.
    for index in (0..nodes.len()).rev() {
        let node = &nodes[index];
        let all = (0..WIDTH).fold(Aabb::EMPTY, |all, slot| all.union(node.bounds(slot)));
        // By slot, how likely a ray that enters the node enters the child, and what becomes of it then.
        let mut children = [None; WIDTH];
        for (slot, child) in children.iter_mut().enumerate() {
            let half = areas.half(&node.bounds(slot));
            *child = match BlockChild::of(node.children[slot]) {
                BlockChild::Empty => None,
                BlockChild::Node(child) => Some(visits[child as usize]),
                BlockChild::Block { index, count } => Some(leaf(&blocks[index as usize], count, half, areas)),
            }
            .map(|visit| (ratio(half, areas.half(&all)), visit));
        }
        let gain = |slot: u8| children[slot as usize].map_or(f32::INFINITY, |(_, visit)| visit.ends / visit.cost);
        let mut slots: [u8; WIDTH] = core::array::from_fn(|slot| slot as u8);
        slots.sort_by(|&a, &b| gain(a).total_cmp(&gain(b)));
        // From the first visited on.
        let (mut goes_on, mut cost) = (1.0, COSTS.node);
        for (enters, visit) in slots.iter().rev().filter_map(|&slot| children[slot as usize]) {
            cost += goes_on * enters * visit.cost;
            goes_on *= 1.0 - enters * visit.ends;
        }
        visits[index] = Visit { ends: 1.0 - goes_on, cost };
        nodes[index] = arranged(node, slots);
    }
}

/// A block of so many triangles in a box of such an area, halved.
fn leaf(block: &Block, count: u32, half: f32, areas: Areas) -> Visit {
    // A line that meets a convex body meets a surface in it 2 · (area of the surface) / (area of the body) times on
    // average, by M. W. Crofton's formula.
    let surface: f32 = (0..(count as usize).min(BLOCK)).map(|lane| areas.of_triangle(&block.triangle(lane))).sum();
    Visit { ends: ratio(surface, half), cost: (COSTS.leaf)(count) }
}

/// At most 1, and 1 where both vanish.
fn ratio(part: f32, whole: f32) -> f32 {
    if part < whole { part / whole } else { 1.0 }
}

/// The node with its children in another order.
fn arranged(node: &BlockNode, slots: [u8; WIDTH]) -> BlockNode {
    let mut to = BlockNode::EMPTY;
    for (slot, &from) in slots.iter().enumerate() {
        let from = from as usize;
        to.children[slot] = node.children[from];
        for axis in 0..3 {
            for side in 0..2 {
                to.planes[axis][side][slot] = node.planes[axis][side][from];
            }
        }
    }
    to.orders = core::array::from_fn(|octant| from_far_to_near(&to, octant));
    to
}

/// An order of the slots, as [`BlockNode::orders`] has it: by the middle of each box along the octant's diagonal. Empty
/// slots come first.
pub(super) fn from_far_to_near(node: &BlockNode, octant: usize) -> u32 {
    let sign = |axis: usize| if octant >> axis & 1 == 1 { -0.5 } else { 0.5 };
    let diagonal = Vec3::new(sign(0), sign(1), sign(2));
    let keys: [f32; WIDTH] = core::array::from_fn(|slot| match BlockChild::of(node.children[slot]) {
        BlockChild::Empty => f32::INFINITY,
        _ => (node.bounds(slot).min * 0.5 + node.bounds(slot).max * 0.5).dot(diagonal),
    });
    let mut slots: [u8; WIDTH] = core::array::from_fn(|slot| slot as u8);
    slots.sort_by(|&a, &b| keys[b as usize].total_cmp(&keys[a as usize]));
    slots.iter().enumerate().fold(0, |order, (place, &slot)| order | u32::from(slot) << (3 * place))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BlockTree, BuildOptions, Mesh, build};
    use alloc::vec::Vec;

    /// Mutants: the order is turned round; the order is by surface alone, or by likelihood alone; boxes stay where they
    /// were (`BlockTree::check` finds that).
    #[test]
    fn rays_that_end_with_any_hit_go_first_where_they_are_likely_to_end_soon() {
        // Grass, scattered over a room below a ceiling.
        let blade = |i: u32| {
            let at = Vec3::new((i * 37 % 101) as f32, 0.0, (i * 61 % 103) as f32);
            [at, at + Vec3::new(0.1, 0.0, 0.0), at + Vec3::new(0.0, 1.0 + (i % 7) as f32, 0.0)]
        };
        let ceiling = [Vec3::new(0.0, 50.0, 0.0), Vec3::new(200.0, 50.0, 0.0), Vec3::new(0.0, 50.0, 200.0)];
        let positions: Vec<Vec3> = (0..400).flat_map(blade).chain(ceiling).collect();
        let indices: Vec<_> = (0..401).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let scene =
            build(Mesh { positions: &positions, indices: &indices }, &BuildOptions::default()).expect("valid").scene;
        let tree = BlockTree::new(&scene).expect("few blocks");
        tree.check(&scene).expect("sound");
        let root = &tree.nodes()[0];
        let children = root.children().iter().map(|&word| BlockChild::of(word));
        let first = children.rev().find(|&child| child != BlockChild::Empty);
        let Some(BlockChild::Block { index, count: 1 }) = first else {
            panic!("the ceiling has a leaf of its own, which comes first: {first:?}")
        };
        assert_eq!(tree.blocks()[index as usize].id(0), 400);
        // Nearest hits: up from below the grass comes first, down from above the ceiling.
        for octant in 0..8 {
            let last_pushed = root.orders()[octant] >> 21 & 7;
            let is_ceiling =
                BlockChild::of(root.children()[last_pushed as usize]) == BlockChild::Block { index, count: 1 };
            assert!(!is_ceiling || octant & 2 == 2, "octant {octant}");
        }
    }
}
