//! Fitting a tree for processors to triangles that have moved.

use super::emit::block;
use super::order::from_far_to_near;
use super::{BLOCK, Block, BlockChild, BlockNode, BlockTree};
use crate::collapse::WIDTH;
use crate::parallel::each;
use alloc::sync::Arc;
use alloc::vec::Vec;
use bytemuck::allocation::zeroed_vec;
use rt_core::Scene;

/// Blocks or nodes that a thread fits at a time.
pub(super) const CHUNK: usize = 1 << 10;

impl BlockTree {
    /// The same tree over triangles that have moved: those of a scene that has the tree
    /// ([`Scene::has_tree_of`]) of the one that it was made of. With the feature `parallel` on all cores.
    ///
    /// Children keep their slots, so rays that ask for any hit visit them in the order that was best when the tree was
    /// made; those that ask for the nearest go from near to far, as ever.
    ///
    /// `None` where the scene has other triangles.
    #[must_use]
    pub fn refit(&self, scene: &Scene) -> Option<Self> {
        let slots = match &self.slots {
            Some(slots) => Arc::clone(slots),
            None => slots_of(&self.blocks, scene)?,
        };
        let mut blocks: Vec<Block> = zeroed_vec(self.blocks.len());
        let jobs = blocks.chunks_mut(CHUNK).zip(self.blocks.chunks(CHUNK)).zip(slots.chunks(CHUNK));
        // Triangles that are where they were.
        let found = each(jobs.collect(), |((to, from), slots)| {
            let fit = |((to, from), slots): ((&mut Block, &Block), &[u32; BLOCK])| {
                // A spare lane has the slot of the first one, as `block` would give it.
                let is_there = slots.iter().all(|&slot| (slot as usize) < scene.triangles().len());
                *to = is_there.then(|| block(scene, slots)).filter(|to| to.ids() == from.ids())?;
                Some(1 + to.ids()[1..].iter().filter(|&&id| id != to.id(0)).count())
            };
            to.iter_mut().zip(from).zip(slots).map(fit).sum::<Option<usize>>()
        });
        if found.into_iter().sum::<Option<usize>>() != Some(scene.triangles().len()) {
            return None;
        }

        let nodes = fitted(&self.nodes, &blocks);
        let (bounds, scale_exponent, depth) = (scene.bounds(), scene.scale_exponent(), self.depth);
        Some(Self { nodes, blocks, bounds, scale_exponent, depth, slots: Some(slots) })
    }
}

/// Nodes over blocks that are others than they were: their boxes and orders fit these.
pub(super) fn fitted(from: &[BlockNode], blocks: &[Block]) -> Vec<BlockNode> {
    let mut nodes: Vec<BlockNode> = zeroed_vec(from.len());
    let jobs = nodes.chunks_mut(CHUNK).zip(from.chunks(CHUNK));
    each(jobs.collect(), |(to, from)| {
        to.iter_mut().zip(from).for_each(|(to, from)| *to = with_leaves(from, blocks));
    });
    // A node has many blocks below it, so this is a small part of the work. Children come after their parents.
    for index in (0..nodes.len()).rev() {
        for slot in 0..WIDTH {
            if let BlockChild::Node(child) = BlockChild::of(nodes[index].children[slot]) {
                let held = nodes[child as usize].planes.map(extremes);
                put(&mut nodes[index], slot, held);
            }
        }
    }
    each(nodes.chunks_mut(CHUNK).collect(), |nodes| {
        for node in nodes {
            node.orders = core::array::from_fn(|octant| from_far_to_near(node, octant));
        }
    });
    nodes
}

/// Where the triangles of blocks are in a scene's leaf order; `None` where one is not there.
fn slots_of(blocks: &[Block], scene: &Scene) -> Option<Arc<[[u32; BLOCK]]>> {
    let places = scene.slots();
    let of = |block: &Block| {
        let mut slots = block.ids();
        for slot in &mut slots {
            *slot = places.get(*slot as usize).copied().filter(|&place| place != u32::MAX)?;
        }
        Some(slots)
    };
    blocks.iter().map(of).collect()
}

/// The node with the boxes of its leaves as they are now.
fn with_leaves(node: &BlockNode, blocks: &[Block]) -> BlockNode {
    let mut fitted = *node;
    for slot in 0..WIDTH {
        if let BlockChild::Block { index, .. } = BlockChild::of(node.children[slot]) {
            put(&mut fitted, slot, blocks[index as usize].axes.map(|axis| axis.bounds));
        }
    }
    fitted
}

/// The least and the greatest of an axis's planes. Those of empty slots are neither.
fn extremes([low, high]: [[f32; WIDTH]; 2]) -> [f32; 2] {
    [low.into_iter().fold(f32::MAX, f32::min), high.into_iter().fold(f32::MIN, f32::max)]
}

fn put(node: &mut BlockNode, slot: usize, planes: [[f32; 2]; 3]) {
    for (axis, [low, high]) in planes.into_iter().enumerate() {
        (node.planes[axis][0][slot], node.planes[axis][1][slot]) = (low, high);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BuildOptions, Mesh, build, refit};
    use glam::Vec3;

    /// Triangles in a sheet with a wave through it.
    fn sheet(height: f32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        const SIDE: u32 = 80;
        let point = |i: u32| {
            let (x, y) = ((i % SIDE) as f32, (i / SIDE) as f32);
            Vec3::new(x, y, height * libm::sinf(0.3 * x + 0.2 * y))
        };
        let corners = (0..SIDE * SIDE).filter(|i| i % SIDE < SIDE - 1 && i / SIDE < SIDE - 1);
        let faces = corners.flat_map(|i| [[i, i + 1, i + SIDE], [i + 1, i + SIDE + 1, i + SIDE]]).collect();
        ((0..SIDE * SIDE).map(point).collect(), faces)
    }

    /// Mutants: planes or triangles that stay where they were; boxes of inner nodes fitted before what is below them;
    /// orders of the tree that was; a tree taken for that of any scene.
    #[test]
    fn a_fitted_tree_is_sound_and_fits_other_triangles_not_at_all() {
        let options = BuildOptions::default();
        let (flat, faces) = sheet(0.0);
        let scene = build(Mesh { positions: &flat, indices: &faces }, &options).expect("a sheet").scene;
        let tree = BlockTree::new(&scene).expect("few blocks");
        let still = tree.refit(&scene).expect("its own scene");
        assert_eq!((still.nodes(), still.blocks()), (tree.nodes(), tree.blocks()));
        let mut last = still;
        for height in [0.5, -3.0, 40.0] {
            let (moved, _) = sheet(height);
            let mesh = Mesh { positions: &moved, indices: &faces };
            let scene = refit(&scene, mesh, &options).expect("a sheet").expect("the same triangles");
            last = last.refit(&scene).expect("the same triangles");
            assert!(last.check(&scene).expect("sound") > 1000);
            assert!(last.nodes() != tree.nodes());
            // Boxes are tight: none is larger than that of a tree made of the scene.
            assert_eq!(last.bounds(), BlockTree::new(&scene).expect("few blocks").bounds());
            let root = last.nodes()[0].planes().map(extremes);
            assert_eq!(root, [0, 1, 2].map(|axis| [scene.bounds().min[axis], scene.bounds().max[axis]]));
            for node in last.nodes() {
                assert_eq!(*node.orders(), core::array::from_fn(|octant| from_far_to_near(node, octant)));
            }
        }
        let fewer = build(Mesh { positions: &flat, indices: &faces[1..] }, &options).expect("a sheet").scene;
        assert!(tree.refit(&fewer).is_none() && last.refit(&fewer).is_none());
        let mut more = faces;
        more.push([0, 1, 85]);
        let more = build(Mesh { positions: &flat, indices: &more }, &options).expect("a sheet").scene;
        assert!(tree.refit(&more).is_none() && last.refit(&more).is_none());
    }
}
