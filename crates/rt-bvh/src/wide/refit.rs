//! Fitting a wide tree to triangles that have moved.

use super::emit::arrange;
use super::encode::put_on_grid;
use super::{Slot, WideNode, WideTree};
use crate::collapse::{WIDTH, bounds};
use crate::parallel::each;
use alloc::vec;
use alloc::vec::Vec;
use rt_core::{Aabb, Scene};

/// Nodes that a thread fits at a time.
const CHUNK: usize = 1 << 10;

/// A wide tree without its triangles.
#[derive(Clone, Debug)]
pub struct WideShape {
    pub(super) nodes: Vec<WideNode>,
    pub(super) slots: Vec<u32>,
    pub(super) depth: u32,
}

impl WideShape {
    /// As [`WideTree::nodes`].
    #[must_use]
    pub fn nodes(&self) -> &[WideNode] {
        &self.nodes
    }

    /// As [`WideTree::slots`].
    #[must_use]
    pub fn slots(&self) -> &[u32] {
        &self.slots
    }

    /// The same tree over triangles that have moved: those of a scene that has the tree ([`Scene::has_tree_of`]) of the
    /// one that it was made of. Children keep their slots, and boxes get new grids. With the feature `parallel` on all
    /// cores, but for checking the scene in the tree's order.
    ///
    /// # Panics
    /// When the scene has another tree.
    #[must_use]
    pub fn refit(&self, given: &Scene) -> WideTree {
        let scene = arrange(given, &self.slots);
        let triangles = scene.triangles();
        // By slot, the boxes of leaves; then, from the last node to the first, those of nodes.
        let leaves = |node: &WideNode| -> [Option<Aabb>; WIDTH] {
            core::array::from_fn(|slot| match node.slot(slot) {
                Some(Slot::Leaf { first, count }) => Some(bounds(&triangles[first as usize..][..count as usize])),
                _ => None,
            })
        };
        let mut boxes = vec![[None; WIDTH]; self.nodes.len()];
        let jobs = boxes.chunks_mut(CHUNK).zip(self.nodes.chunks(CHUNK));
        each(jobs.collect(), |(boxes, nodes)| {
            boxes.iter_mut().zip(nodes).for_each(|(boxes, node)| *boxes = leaves(node));
        });
        // Children come after their parents.
        for (index, node) in self.nodes.iter().enumerate().rev() {
            for slot in 0..WIDTH {
                if let Some(Slot::Node(child)) = node.slot(slot) {
                    let below = boxes[child as usize].iter().flatten();
                    boxes[index][slot] = Some(below.fold(Aabb::EMPTY, |all, own| all.union(*own)));
                }
            }
        }
        let mut nodes = self.nodes.clone();
        let jobs = nodes.chunks_mut(CHUNK).zip(boxes.chunks(CHUNK));
        each(jobs.collect(), |(nodes, boxes)| {
            nodes.iter_mut().zip(boxes).for_each(|(node, boxes)| put_on_grid(node, boxes));
        });
        WideTree { nodes, scene, slots: self.slots.clone(), depth: self.depth }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BuildOptions, Mesh, build, refit};
    use glam::Vec3;

    /// Mutants: planes left on the old grid, or not moved; boxes of nodes made before those of what is below; triangles
    /// in the given scene's order.
    #[test]
    fn a_fitted_wide_tree_is_sound() {
        const SIDE: u32 = 60;
        let sheet = |height: f32| -> Vec<Vec3> {
            let point = |i: u32| {
                let (x, y) = ((i % SIDE) as f32, (i / SIDE) as f32);
                Vec3::new(x, y, height * libm::sinf(0.4 * x + 0.1 * y))
            };
            (0..SIDE * SIDE).map(point).collect()
        };
        let corners = (0..SIDE * SIDE).filter(|i| i % SIDE < SIDE - 1 && i / SIDE < SIDE - 1);
        let faces: Vec<[u32; 3]> =
            corners.flat_map(|i| [[i, i + 1, i + SIDE], [i + 1, i + SIDE + 1, i + SIDE]]).collect();
        let options = BuildOptions::default();
        let scene = build(Mesh { positions: &sheet(0.1), indices: &faces }, &options).expect("a sheet").scene;
        let tree = WideTree::new(&scene);
        let shape = tree.clone().into_shape();
        let still = shape.refit(&scene);
        assert_eq!((still.nodes(), still.slots()), (tree.nodes(), tree.slots()));
        for height in [0.3, -5.0, 70.0] {
            let moved = sheet(height);
            let mesh = Mesh { positions: &moved, indices: &faces };
            let scene = refit(&scene, mesh, &options).expect("a sheet").expect("the same triangles");
            let fitted = shape.refit(&scene);
            fitted.check().expect("sound");
            assert!(fitted.nodes() != tree.nodes() && fitted.slots() == tree.slots());
            // The triangle in each place is the one that was there, moved.
            for (place, &slot) in fitted.slots().iter().enumerate() {
                assert_eq!(fitted.scene().triangles()[place], scene.triangles()[slot as usize]);
            }
        }
    }
}
