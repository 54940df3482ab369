//! Writing down the tree that a plan describes, but for the order of children.

use super::{BLOCK, Block, BlockAxis, BlockChild, BlockNode};
use crate::collapse::{Plan, WIDTH};
use alloc::vec;
use alloc::vec::Vec;
use bytemuck::Zeroable;
use rt_core::Scene;

/// Nodes, depth first but that siblings lie together; blocks in the order of the leaves; and the depth. `None` where
/// there are too many blocks.
pub(super) fn emit(scene: &Scene, plan: &Plan) -> Option<(Vec<BlockNode>, Vec<Block>, u32)> {
    let mut nodes = vec![BlockNode::EMPTY];
    let mut blocks = Vec::with_capacity(scene.triangles().len() / 2);
    let mut deepest = 0;
    // Nodes to be written: where, what, and how deep.
    let mut open = vec![(0, plan.root(), 1)];
    let (mut parts, mut slots) = (Vec::with_capacity(WIDTH), Vec::with_capacity(BLOCK));
    while let Some((index, part, depth)) = open.pop() {
        deepest = deepest.max(depth);
        plan.children(scene, part, &mut parts);
        let mut node = BlockNode::EMPTY;
        let first = open.len();
        for (slot, part) in parts.iter().enumerate() {
            slots.clear();
            let bounds = part.gather(scene, &mut slots);
            for axis in 0..3 {
                node.planes[axis][0][slot] = bounds.min[axis];
                node.planes[axis][1][slot] = bounds.max[axis];
            }
            let child = if part.is_node() {
                nodes.push(BlockNode::EMPTY);
                open.push((nodes.len() - 1, *part, depth + 1));
                BlockChild::Node(nodes.len() as u32 - 1)
            } else if blocks.len() < BlockChild::MOST_BLOCKS {
                blocks.push(block(scene, &slots));
                BlockChild::Block { index: blocks.len() as u32 - 1, count: slots.len() as u32 }
            } else {
                return None;
            };
            node.children[slot] = child.word();
        }
        // The first child is written first.
        open[first..].reverse();
        nodes[index] = node;
    }
    Some((nodes, blocks, deepest))
}

/// The block of the triangles at these places of the leaf order, of which there are 1 to 4.
pub(super) fn block(scene: &Scene, slots: &[u32]) -> Block {
    let mut block = Block::zeroed();
    for lane in 0..BLOCK {
        let slot = *slots.get(lane).unwrap_or(&slots[0]) as usize;
        let triangle = &scene.triangles()[slot];
        for (axis, to) in block.axes.iter_mut().enumerate() {
            (to.a[lane], to.b[lane], to.c[lane]) = (triangle.a[axis], triangle.b[axis], triangle.c[axis]);
        }
        block.axes[lane / 2].ids[lane % 2] = scene.primitives().get(slot);
    }
    block.axes.iter_mut().for_each(bound);
    block
}

/// Writes down the least and the greatest of a block's coordinates.
pub(super) fn bound(axis: &mut BlockAxis) {
    let BlockAxis { a, b, c, .. } = *axis;
    let all = || a.into_iter().chain(b).chain(c);
    axis.bounds = [all().fold(f32::MAX, f32::min), all().fold(f32::MIN, f32::max)];
}
