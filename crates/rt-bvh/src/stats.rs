//! What a tree is like: its shape, and what a ray is expected to pay for it.

use crate::parallel::each;
use crate::scale::{exponent, pow2};
use rt_core::{Aabb, Child, Node, Scene, Triangle};

/// Cost of visiting a node: two box tests, each at the price of a triangle test. Between 1 and 2 the trees trace
/// equally fast; 2 makes them smaller.
pub(crate) const NODE_COST: f32 = 2.0;
/// Cost of a triangle test: the unit.
pub(crate) const TRIANGLE_COST: f32 = 1.0;

/// Figures that describe the tree of a [`Scene`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TreeStats {
    /// Expected cost of a ray that crosses the scene's box and hits nothing, by the surface area heuristic of J.
    /// Goldsmith and J. Salmon, *Automatic Creation of Object Hierarchies for Ray Tracing* (1987): 1 for each box
    /// test (two for each node visited) and 1 for each triangle test. No unit; lower is better.
    pub sah_cost: f32,
    /// Most inner nodes on a path from the root.
    pub depth: u32,
    /// Number of inner nodes.
    pub nodes: u32,
    /// Number of leaves.
    pub leaves: u32,
    /// Triangles in the largest leaf.
    pub largest_leaf: u32,
    /// Triangles in a leaf on average; 0 without leaves.
    pub mean_leaf: f32,
    /// Bytes of nodes, triangles and ids per triangle; 0 without triangles.
    pub bytes_per_triangle: f32,
}

/// Areas of boxes relative to each other, of whatever size their scene: none overflows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Areas {
    shrink: f32,
}

impl Areas {
    /// For boxes in a scene. They are shrunk by a power of two where coordinates are above 1.
    pub(crate) fn of(scene: &Scene) -> Self {
        let bounds = scene.bounds();
        let largest = if bounds.is_empty() { 0.0 } else { bounds.min.abs().max(bounds.max.abs()).max_element() };
        Self { shrink: pow2(-exponent(largest).max(0)) as f32 }
    }

    /// [`Aabb::half_area`], shrunk.
    pub(crate) fn half(self, bounds: &Aabb) -> f32 {
        Aabb { min: bounds.min * self.shrink, max: bounds.max * self.shrink }.half_area()
    }

    /// A triangle's area, shrunk likewise.
    pub(crate) fn of_triangle(self, triangle: &Triangle) -> f32 {
        let [a, b, c] = triangle.vertices().map(|vertex| vertex * self.shrink);
        0.5 * (b - a).cross(c - a).length()
    }
}

/// Nodes that a thread looks at, at a time. Fixed, so that sums do not depend on threads.
const CHUNK: usize = 1 << 13;

/// What the children of some nodes are like.
#[derive(Clone, Copy, Default)]
struct Children {
    /// What visits to them cost, each times its surface. The sum is of many small terms, hence double precision.
    cost: f64,
    leaves: u32,
    largest_leaf: u32,
}

impl Children {
    fn of(nodes: &[Node], areas: Areas) -> Self {
        let mut children = Self::default();
        for node in nodes {
            for side in 0..2 {
                let area = f64::from(areas.half(&node.bounds[side]));
                match node.child(side) {
                    Child::Absent => {}
                    Child::Inner(_) => children.cost += area * f64::from(NODE_COST),
                    Child::Leaf { count, .. } => {
                        children.cost += area * f64::from(TRIANGLE_COST) * f64::from(count);
                        children.leaves += 1;
                        children.largest_leaf = children.largest_leaf.max(count);
                    }
                }
            }
        }
        children
    }
}

impl TreeStats {
    /// Describes `scene`, in time linear in its size; with the feature `parallel` on all cores.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let areas = Areas::of(scene);
        let root_area = f64::from(areas.half(&scene.bounds()));
        let mut stats = Self { depth: scene.depth(), nodes: scene.nodes().len() as u32, ..Self::default() };
        // The root is visited by every ray.
        let mut cost = f64::from(NODE_COST) * root_area;
        for children in each(scene.nodes().chunks(CHUNK).collect(), |nodes| Children::of(nodes, areas)) {
            cost += children.cost;
            stats.leaves += children.leaves;
            stats.largest_leaf = stats.largest_leaf.max(children.largest_leaf);
        }
        let triangles = scene.triangles().len() as f64;
        if root_area > 0.0 {
            stats.sah_cost = (cost / root_area) as f32;
        }
        if stats.leaves > 0 {
            stats.mean_leaf = (triangles / f64::from(stats.leaves)) as f32;
            stats.bytes_per_triangle = (scene.bytes() as f64 / triangles) as f32;
        }
        stats
    }
}
