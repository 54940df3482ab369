//! Trees made for reduced walks: stand-ins for what the walk leaves out.

mod plane;
mod stub;

use super::packet;
use super::stack::Stack;
use super::walk::each_in;
use alloc::vec::Vec;
use plane::{LeafPlane, PlaneWalk};
use rt_core::{Child, Hit, Node, Ray, ReducedWalk, Scene, TestCounts};
use stub::{Stub, StubWalk};

/// A tree for [`ReducedWalk::LeafPlane`] or [`ReducedWalk::Truncated`] over one scene. A function of the scene alone.
#[derive(Clone, Debug)]
pub struct ReducedTree {
    /// The scene's nodes, as far as they are walked; a leaf child names its stand-in.
    nodes: Vec<Node>,
    leaves: Leaves,
}

/// What leaf children of a [`ReducedTree`] are.
#[derive(Clone, Debug)]
enum Leaves {
    Planes(Vec<LeafPlane>),
    Stubs(Vec<Stub>),
}

impl ReducedTree {
    /// The tree that `walk` needs; `None` where the scene's own serves.
    #[must_use]
    pub fn for_walk(scene: &Scene, walk: ReducedWalk) -> Option<Self> {
        match walk {
            ReducedWalk::LeafAsHit | ReducedWalk::Unshortened => None,
            ReducedWalk::LeafPlane => Some(Self::with_planes(scene)),
            ReducedWalk::Truncated => Some(Self::truncated(scene)),
        }
    }

    /// Every leaf a plane, in time linear in the scene: 64 bytes a node and 16 a leaf.
    #[must_use]
    pub fn with_planes(scene: &Scene) -> Self {
        let mut nodes = scene.nodes().to_vec();
        let mut planes = Vec::new();
        for node in &mut nodes {
            for side in 0..2 {
                if let Child::Leaf { first, count } = node.child(side) {
                    let triangles = &scene.triangles()[first as usize..][..count as usize];
                    node.child[side] = planes.len() as u32;
                    planes.push(LeafPlane::of(triangles, &node.bounds[side]));
                }
            }
        }
        Self { nodes, leaves: Leaves::Planes(planes) }
    }

    /// The top of the tree over stubs that were calibrated by tracing rays: about 100 kB, and some ten milliseconds.
    #[must_use]
    pub fn truncated(scene: &Scene) -> Self {
        let (nodes, stubs) = stub::calibrated(scene);
        Self { nodes, leaves: Leaves::Stubs(stubs) }
    }

    /// Counts the tests of rays like [`super::count`]. `scene` is the one that the tree was made for.
    pub fn count<R, S>(&self, scene: &Scene, stack: &mut Stack, rays: R, sink: S)
    where
        R: Iterator<Item = (Ray, u32)>,
        S: FnMut(Hit, TestCounts),
    {
        match &self.leaves {
            Leaves::Planes(planes) => {
                each_in::<PlaneWalk<'_>, R, S>(scene, &self.nodes, planes.as_slice(), stack, rays, sink);
            }
            Leaves::Stubs(stubs) => {
                each_in::<StubWalk<'_>, R, S>(scene, &self.nodes, stubs.as_slice(), stack, rays, sink);
            }
        }
    }

    /// [`ReducedTree::count`] in packets of consecutive rays.
    #[inline(always)]
    pub(super) fn count_in_packets<R, S>(&self, scene: &Scene, stack: &mut Stack, rays: R, sink: S)
    where
        R: Iterator<Item = (Ray, u32)>,
        S: FnMut(Hit, TestCounts),
    {
        match &self.leaves {
            Leaves::Planes(planes) => {
                packet::each_in::<PlaneWalk<'_>, R, S>(scene, &self.nodes, planes.as_slice(), stack, rays, sink);
            }
            Leaves::Stubs(stubs) => {
                packet::each_in::<StubWalk<'_>, R, S>(scene, &self.nodes, stubs.as_slice(), stack, rays, sink);
            }
        }
    }
}
