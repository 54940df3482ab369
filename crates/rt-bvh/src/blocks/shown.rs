//! A tree for processors over some of a scene's triangles.

use super::emit::bound;
use super::refit::{CHUNK, fitted};
use super::{BLOCK, Block, BlockChild, BlockNode, BlockTree};
use crate::collapse::WIDTH;
use crate::parallel::each;
use alloc::vec;
use alloc::vec::Vec;
use bytemuck::Zeroable;
use bytemuck::allocation::zeroed_vec;

impl BlockTree {
    /// The tree without the triangles that rays pass by: those whose ids `shows` denies. So kernels need not ask. It
    /// takes time linear in the size of the tree, with the feature `parallel` on all cores, and no more memory.
    ///
    /// Boxes fit what is left, and what holds nothing is gone, but children keep their slots.
    #[must_use]
    pub fn of_shown(&self, shows: impl Fn(u32) -> bool + Sync) -> Self {
        let lanes_of = |blocks: &[Block]| blocks.iter().map(|block| shown_lanes(block, &shows)).collect::<Vec<u8>>();
        let lanes = each(self.blocks.chunks(CHUNK).collect(), lanes_of).concat();
        let mut blocks: Vec<Block> = zeroed_vec(lanes.iter().filter(|&&lanes| lanes != 0).count());
        let (mut open, mut jobs) = (&mut blocks[..], Vec::new());
        for (from, lanes) in self.blocks.chunks(CHUNK).zip(lanes.chunks(CHUNK)) {
            let left = lanes.iter().filter(|&&lanes| lanes != 0).count();
            jobs.extend(open.split_off_mut(..left).map(|to| (to, from, lanes)));
        }
        each(jobs, |(to, from, lanes)| {
            let left = from.iter().zip(lanes).filter(|&(_, &lanes)| lanes != 0);
            to.iter_mut().zip(left).for_each(|(to, (from, &lanes))| *to = with_lanes(from, lanes));
        });

        // Children come after their parents.
        let mut is_left = vec![false; self.nodes.len()];
        for (index, node) in self.nodes.iter().enumerate().rev() {
            is_left[index] = node.children.iter().any(|&child| match BlockChild::of(child) {
                BlockChild::Empty => false,
                BlockChild::Node(child) => is_left[child as usize],
                BlockChild::Block { index, .. } => lanes[index as usize] != 0,
            });
        }
        // There always is a root.
        is_left[0] = true;
        let node_places = numbers(is_left.iter().copied());
        let block_places = numbers(lanes.iter().map(|&lanes| lanes != 0));
        let child = |child: BlockChild| match child {
            BlockChild::Node(child) if is_left[child as usize] => BlockChild::Node(node_places[child as usize]),
            BlockChild::Block { index, .. } if lanes[index as usize] != 0 => {
                let (index, count) = (block_places[index as usize], lanes[index as usize].count_ones());
                BlockChild::Block { index, count }
            }
            _ => BlockChild::Empty,
        };
        let left = self.nodes.iter().zip(&is_left).filter(|&(_, &is_left)| is_left);
        let nodes: Vec<BlockNode> = left.map(|(node, _)| with_children(node, child)).collect();
        let nodes = fitted(&nodes, &blocks);
        let &Self { bounds, scale_exponent, depth, .. } = self;
        Self { nodes, blocks, bounds, scale_exponent, depth, slots: None }
    }
}

/// The lanes of a block with a triangle that is shown, a bit each; spare ones, which have the first one's, not.
fn shown_lanes(block: &Block, shows: &impl Fn(u32) -> bool) -> u8 {
    let ids = block.ids();
    let is_shown = |&lane: &usize| (lane == 0 || ids[lane] != ids[0]) && shows(ids[lane]);
    (0..BLOCK).filter(is_shown).fold(0, |lanes, lane| lanes | 1 << lane)
}

/// The block with the triangles of some lanes alone, of which there is one at least.
fn with_lanes(block: &Block, lanes: u8) -> Block {
    let (ids, first) = (block.ids(), lanes.trailing_zeros() as usize % BLOCK);
    let mut left = (0..BLOCK).filter(|&lane| lanes >> lane & 1 == 1);
    let from: [usize; BLOCK] = core::array::from_fn(|_| left.next().unwrap_or(first));
    let mut to = Block::zeroed();
    for (lane, &from) in from.iter().enumerate() {
        to.axes[lane / 2].ids[lane % 2] = ids[from];
    }
    for (to, axis) in to.axes.iter_mut().zip(&block.axes) {
        (to.a, to.b, to.c) = (from.map(|lane| axis.a[lane]), from.map(|lane| axis.b[lane]), from.map(|l| axis.c[l]));
        bound(to);
    }
    to
}

/// The node with other children, each in its slot.
fn with_children(node: &BlockNode, child: impl Fn(BlockChild) -> BlockChild) -> BlockNode {
    let mut to = BlockNode::EMPTY;
    for slot in 0..WIDTH {
        to.children[slot] = child(BlockChild::of(node.children[slot])).word();
    }
    to
}

/// By place, how many are left of those before.
fn numbers(left: impl Iterator<Item = bool>) -> Vec<u32> {
    let number = |before: &mut u32, is_left: bool| {
        let own = *before;
        *before += u32::from(is_left);
        Some(own)
    };
    left.scan(0, number).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BuildOptions, Mesh, build};
    use alloc::sync::Arc;
    use glam::Vec3;
    use rt_core::Scene;

    /// A sheet of triangles with a wave through it.
    fn sheet(side: u32) -> Arc<Scene> {
        let point = |i: u32| {
            let (x, y) = ((i % side) as f32, (i / side) as f32);
            Vec3::new(x, y, libm::sinf(0.3 * x + 0.2 * y))
        };
        let corners = (0..side * side).filter(|i| i % side < side - 1 && i / side < side - 1);
        let faces: Vec<_> = corners.flat_map(|i| [[i, i + 1, i + side], [i + 1, i + side + 1, i + side]]).collect();
        let positions: Vec<Vec3> = (0..side * side).map(point).collect();
        build(Mesh { positions: &positions, indices: &faces }, &BuildOptions::default()).expect("a sheet").scene
    }

    /// Mutants: a hidden triangle that stays in its lane, or in a spare one; one that is shown lost; children of a node
    /// that is gone; boxes that stay as large as they were; an empty tree without a root.
    #[test]
    fn a_tree_of_what_is_shown_holds_that_and_nothing_else() {
        for side in [2, 3, 60] {
            let scene = sheet(side);
            let tree = BlockTree::new(&scene).expect("few blocks");
            let all = tree.of_shown(|_| true);
            assert_eq!((all.nodes(), all.blocks()), (tree.nodes(), tree.blocks()));
            let shown: [fn(u32) -> bool; 6] =
                [|id| id % 2 == 0, |id| id % 7 == 3, |id| id < 50, |id| id == 1, |id| id != 0, |_| false];
            for shows in shown {
                let some = tree.of_shown(shows);
                some.check_shown(&scene, shows).expect("sound");
                assert!(some.nodes().len() <= tree.nodes().len() && some.blocks().len() <= tree.blocks().len());
                let held = (0..scene.triangles().len()).filter(|&slot| shows(scene.primitives().get(slot)));
                let fit = held.fold(rt_core::Aabb::EMPTY, |all, slot| all.union(scene.triangles()[slot].bounds()));
                let root = (0..WIDTH).fold(rt_core::Aabb::EMPTY, |all, slot| all.union(some.nodes()[0].bounds(slot)));
                assert_eq!(root, fit);
                // What is left of it is shown too.
                let same = some.of_shown(shows);
                assert_eq!((same.nodes(), same.blocks()), (some.nodes(), some.blocks()));
            }
            assert_eq!((tree.of_shown(|_| false).nodes().len(), tree.of_shown(|_| false).blocks().len()), (1, 0));
            assert!(tree.of_shown(|id| id != 0).refit(&scene).is_none(), "it has not all triangles of the scene");
        }
    }
}
