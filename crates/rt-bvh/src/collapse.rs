//! Which nodes of the two-wide tree become children of the same node of an eight-wide layout.
//!
//! The dynamic programme of H. Ylitie, T. Karras and S. Laine, *Efficient Incoherent Ray Traversal on GPUs Through
//! Compressed Wide BVHs* (HPG 2017, section 3.1): for each subtree and each number of roots from 1 to 7, the least
//! cost, by the surface area heuristic, of a forest of at most so many wide nodes and leaves that holds it.

use crate::stats::Areas;
use alloc::vec;
use alloc::vec::Vec;
use rt_core::{Aabb, Child, Scene, Triangle};

/// Children of a wide node.
pub(crate) const WIDTH: usize = 8;

/// Most roots of a forest that is asked for: one child of the wide node is left for the other side.
const ROOTS: usize = WIDTH - 1;

/// What visits cost in a layout. Only their ratios matter.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Costs {
    /// Of a wide node.
    pub node: f32,
    /// Of a leaf, by the number of its triangles.
    pub leaf: fn(u32) -> f32,
    /// Most triangles in a leaf.
    pub largest_leaf: u32,
}

/// The least cost of a subtree as a forest, and how to get it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Forest {
    /// Cost by number of roots allowed, less one.
    cost: [f32; ROOTS],
    /// For each number of roots, less one, how many of them the first child's forest may have; 0: one root less does as
    /// well. Means nothing for one root.
    first: [u8; ROOTS],
    /// With a single root: how many of a wide node's eight children the first child's forest may be; 0: a leaf.
    node: u8,
}

impl Forest {
    /// Nothing: what an absent child of the root costs.
    const NOTHING: Self = Self { cost: [0.0; ROOTS], first: [0; ROOTS], node: 0 };
}

/// The choices for a whole scene.
#[derive(Debug)]
pub(crate) struct Plan {
    costs: Costs,
    /// For both sides of each two-wide node.
    forests: Vec<[Forest; 2]>,
    /// Children of the root's eight that the first side may be.
    root: u8,
}

/// A part of the two-wide tree that is to be a child of a wide node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Part {
    /// Both children of a two-wide node, the first of them in at most so many roots of eight.
    Node {
        /// Index in the two-wide tree.
        index: u32,
        /// Roots for the first child.
        first: u8,
    },
    /// A range of a two-wide leaf's triangles, too large to be a leaf.
    Range {
        /// First triangle.
        first: u32,
        /// Number of triangles.
        count: u32,
    },
    /// Triangles of a two-wide leaf, no more than a leaf may have.
    Leaf {
        /// First triangle.
        first: u32,
        /// Number of triangles.
        count: u32,
    },
    /// A two-wide node with no more triangles below it than a leaf may have, which become one.
    Merged {
        /// Index in the two-wide tree.
        index: u32,
    },
}

impl Part {
    /// Whether it becomes a node, not a leaf.
    pub(crate) const fn is_node(&self) -> bool {
        matches!(self, Self::Node { .. } | Self::Range { .. })
    }

    /// Its box; lists the triangles, if it is a leaf.
    pub(crate) fn gather(&self, scene: &Scene, slots: &mut Vec<u32>) -> Aabb {
        let range = |first: u32, count: u32| bounds(&scene.triangles()[first as usize..][..count as usize]);
        match *self {
            Self::Node { index, .. } => {
                let [a, b] = scene.nodes()[index as usize].bounds;
                a.union(b)
            }
            Self::Range { first, count } => range(first, count),
            Self::Leaf { first, count } => {
                slots.extend(first..first + count);
                range(first, count)
            }
            Self::Merged { index } => {
                let node = &scene.nodes()[index as usize];
                (0..2).fold(Aabb::EMPTY, |all, side| match node.child(side) {
                    Child::Absent => all,
                    Child::Inner(index) => all.union(Self::Merged { index }.gather(scene, slots)),
                    Child::Leaf { first, count } => all.union(Self::Leaf { first, count }.gather(scene, slots)),
                })
            }
        }
    }
}

impl Plan {
    /// The best choices under such costs.
    pub(crate) fn of(scene: &Scene, costs: Costs) -> Self {
        let nodes = scene.nodes();
        let areas = Areas::of(scene);
        let mut forests = vec![[Forest::NOTHING; 2]; nodes.len()];
        // Triangles below a node, as far as it matters: saturating.
        let mut below = vec![0_u32; nodes.len()];
        // Children come after their parents.
        for (index, node) in nodes.iter().enumerate().rev() {
            for side in 0..2 {
                let (forest, triangles) = match node.child(side) {
                    Child::Absent => (Forest::NOTHING, 0),
                    Child::Leaf { first, count } => (leaf(scene, costs, areas, first, count), count),
                    Child::Inner(child) => {
                        let triangles = below[child as usize];
                        let forest = inner(&forests[child as usize], costs, areas.half(&node.bounds[side]), triangles);
                        (forest, triangles)
                    }
                };
                forests[index][side] = forest;
                below[index] = below[index].saturating_add(triangles);
            }
        }
        let root = share(&forests[0], WIDTH).0;
        Self { costs, forests, root }
    }

    /// The root, which is no part of anything.
    pub(crate) const fn root(&self) -> Part {
        Part::Node { index: 0, first: self.root }
    }

    /// What a node's children are, from its first triangle to its last.
    pub(crate) fn children(&self, scene: &Scene, part: Part, to: &mut Vec<Part>) {
        to.clear();
        match part {
            Part::Node { index, first } => {
                self.take(scene, index, 0, first, to);
                self.take(scene, index, 1, WIDTH as u8 - first, to);
            }
            Part::Range { first, count } => to.extend(self.costs.divide(first, count)),
            Part::Leaf { .. } | Part::Merged { .. } => {}
        }
    }

    /// Takes apart a child of a two-wide node that may have so many roots, from its first triangle to its last.
    fn take(&self, scene: &Scene, node: u32, side: usize, roots: u8, to: &mut Vec<Part>) {
        let forest = &self.forests[node as usize][side];
        match scene.nodes()[node as usize].child(side) {
            Child::Absent => {}
            Child::Leaf { first, count } if count <= self.costs.largest_leaf => to.push(Part::Leaf { first, count }),
            Child::Leaf { first, count } if self.costs.pieces(count) <= u32::from(roots) => {
                to.extend(self.costs.split(first, count));
            }
            Child::Leaf { first, count } => to.push(Part::Range { first, count }),
            Child::Inner(index) => {
                let mut roots = roots as usize;
                while roots > 1 && forest.first[roots - 1] == 0 {
                    roots -= 1;
                }
                if roots > 1 {
                    let first = forest.first[roots - 1];
                    self.take(scene, index, 0, first, to);
                    self.take(scene, index, 1, roots as u8 - first, to);
                } else if forest.node == 0 {
                    to.push(Part::Merged { index });
                } else {
                    to.push(Part::Node { index, first: forest.node });
                }
            }
        }
    }
}

impl Costs {
    /// Leaves that a two-wide leaf falls into.
    const fn pieces(self, count: u32) -> u32 {
        count.div_ceil(self.largest_leaf)
    }

    /// Leaves of about equal size.
    fn split(self, first: u32, count: u32) -> impl Iterator<Item = Part> {
        cut(first, count, self.pieces(count)).map(|(first, count)| Part::Leaf { first, count })
    }

    /// The children of a wide node that holds nothing but `count` triangles from `first` on. Either all are leaves or
    /// none is, so that the triangles stay in order.
    fn divide(self, first: u32, count: u32) -> impl Iterator<Item = Part> {
        let pieces = self.pieces(count);
        let small = pieces <= WIDTH as u32;
        let parts = if small { pieces } else { (count / (self.largest_leaf + 1)).min(WIDTH as u32) };
        cut(first, count, parts).map(move |(first, count)| match small {
            true => Part::Leaf { first, count },
            false => Part::Range { first, count },
        })
    }
}

/// Cuts a range into `parts` whose sizes differ by at most one.
fn cut(first: u32, count: u32, parts: u32) -> impl Iterator<Item = (u32, u32)> {
    (0..parts).map(move |part| {
        let at = |part: u32| (u64::from(count) * u64::from(part) / u64::from(parts)) as u32;
        (first + at(part), at(part + 1) - at(part))
    })
}

/// The box of triangles in leaf order.
pub(crate) fn bounds(triangles: &[Triangle]) -> Aabb {
    triangles.iter().fold(Aabb::EMPTY, |all, triangle| all.union(triangle.bounds()))
}

/// The forests of a two-wide leaf.
fn leaf(scene: &Scene, costs: Costs, areas: Areas, first: u32, count: u32) -> Forest {
    let range = |first: u32, count: u32| areas.half(&bounds(&scene.triangles()[first as usize..][..count as usize]));
    let tests = |(first, count): (u32, u32)| range(first, count) * (costs.leaf)(count);
    let pieces = costs.pieces(count);
    let leaves =
        if pieces as usize <= WIDTH { cut(first, count, pieces).map(tests).sum() } else { tests((first, count)) };
    // A leaf of many triangles needs a wide node of its own unless it may have many roots.
    let node = if pieces > 1 { costs.node * range(first, count) } else { 0.0 };
    let cost = core::array::from_fn(|i| if i + 1 < pieces as usize { node + leaves } else { leaves });
    Forest { cost, ..Forest::NOTHING }
}

/// The forests of a two-wide node, given those of its children, its surface and the number of its triangles.
fn inner(children: &[Forest; 2], costs: Costs, area: f32, triangles: u32) -> Forest {
    let (whole, cost) = share(children, WIDTH);
    let as_node = cost + costs.node * area;
    let as_leaf = if triangles <= costs.largest_leaf { area * (costs.leaf)(triangles) } else { f32::INFINITY };
    let mut forest = Forest::NOTHING;
    (forest.node, forest.cost[0]) = if as_leaf <= as_node { (0, as_leaf) } else { (whole, as_node) };
    for roots in 2..=ROOTS {
        let (first, cost) = share(children, roots);
        let less = forest.cost[roots - 2];
        (forest.first[roots - 1], forest.cost[roots - 1]) = if cost < less { (first, cost) } else { (0, less) };
    }
    forest
}

/// How many of `roots` roots the first child should have, and the cost.
fn share(children: &[Forest; 2], roots: usize) -> (u8, f32) {
    let mut best = (1, f32::INFINITY);
    for first in roots.saturating_sub(ROOTS).max(1)..=(roots - 1).min(ROOTS) {
        let cost = children[0].cost[first - 1] + children[1].cost[roots - first - 1];
        if cost < best.1 {
            best = (first as u8, cost);
        }
    }
    best
}
