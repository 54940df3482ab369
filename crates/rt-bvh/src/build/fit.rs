//! Boxes that fit what is in the leaves, on all cores.
//!
//! Boxes of leaves are each their own. Those above them come after what is below: builders write nodes depth first, so
//! that a subtree's lie side by side, and a thread fits one subtree after the other. Where nodes lie otherwise, as
//! those of a caller's own builder may, one thread fits all.

use super::CHUNK;
use crate::parallel::each;
use alloc::vec;
use alloc::vec::Vec;
use core::mem::take;
use core::ops::Range;
use rt_core::{Aabb, Child, Node, Triangle};

/// Most nodes of a subtree that one thread fits: some tenths of a millisecond.
const SUBTREE: usize = 1 << 13;

/// Fits all boxes to triangles in leaf order. The result does not depend on threads: boxes are unions, which are exact.
pub(super) fn fit(nodes: &mut [Node], triangles: &[Triangle]) {
    each(nodes.chunks_mut(CHUNK).collect(), |nodes| nodes.iter_mut().for_each(|node| fit_leaves(node, triangles)));
    let Some(Subtrees { ranges, above }) = Subtrees::of(nodes) else {
        fit_inner(nodes, 0);
        return;
    };
    let (mut rest, mut begin) = (&mut *nodes, 0);
    let mut jobs = Vec::with_capacity(ranges.len());
    for range in ranges {
        let (own, behind) = take(&mut rest)[range.start - begin..].split_at_mut(range.len());
        (rest, begin) = (behind, range.end);
        jobs.push((own, range.start));
    }
    if each(jobs, |(own, first)| fit_inner(own, first)).contains(&false) {
        fit_inner(nodes, 0);
        return;
    }
    for &node in above.iter().rev() {
        for side in 0..2 {
            if let Child::Inner(child) = nodes[node].child(side) {
                nodes[node].bounds[side] = around(&nodes[child as usize]);
            }
        }
    }
}

/// The box of both children.
fn around(node: &Node) -> Aabb {
    node.bounds[0].union(node.bounds[1])
}

fn fit_leaves(node: &mut Node, triangles: &[Triangle]) {
    for side in 0..2 {
        if let Child::Leaf { first, count } = node.child(side) {
            let leaf = &triangles[first as usize..][..count as usize];
            node.bounds[side] = leaf.iter().fold(Aabb::EMPTY, |all, triangle| all.union(triangle.bounds()));
        }
    }
}

/// Fits the boxes of children that are nodes, where all of those are among these nodes, the first of which has number
/// `first`; `false` where one is not.
fn fit_inner(nodes: &mut [Node], first: usize) -> bool {
    // Children come after their parents.
    for index in (0..nodes.len()).rev() {
        for side in 0..2 {
            if let Child::Inner(child) = nodes[index].child(side) {
                let Some(below) = (child as usize).checked_sub(first).and_then(|child| nodes.get(child)) else {
                    return false;
                };
                nodes[index].bounds[side] = around(below);
            }
        }
    }
    true
}

/// Nodes that lie depth first, cut into subtrees and what is above them.
struct Subtrees {
    /// A subtree's nodes each, in order.
    ranges: Vec<Range<usize>>,
    /// The others, parents before their children.
    above: Vec<usize>,
}

impl Subtrees {
    /// `None` where nodes plainly do not lie so; where they do not below some node, it is not found out here.
    fn of(nodes: &[Node]) -> Option<Self> {
        let mut cut = Self { ranges: Vec::new(), above: Vec::new() };
        let whole = 0..nodes.len();
        let mut open = vec![whole];
        while let Some(range) = open.pop() {
            if range.len() <= SUBTREE {
                cut.ranges.push(range);
                continue;
            }
            cut.above.push(range.start);
            let node = &nodes[range.start];
            let inner = |side: usize| match node.child(side) {
                Child::Inner(child) => Some(child as usize),
                _ => None,
            };
            let mut children: Vec<usize> = (0..2).filter_map(inner).collect();
            children.sort_unstable();
            // The first child follows its parent, the second what is below the first.
            if children.first() != Some(&(range.start + 1)) || children.last().is_some_and(|&last| last >= range.end) {
                return None;
            }
            let mut end = range.end;
            for &child in children.iter().rev() {
                open.push(child..end);
                end = child;
            }
        }
        Some(cut)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// Triangles in a row, and a tree of so many nodes over them, in which each node has a leaf and a node, or is split
    /// in two; nodes lie depth first.
    fn tree(nodes: u32) -> (Vec<Node>, Vec<Triangle>) {
        let triangle = |i: u32| {
            let at = Vec3::new(i as f32, (i % 7) as f32, (i % 3) as f32);
            Triangle::new(at, at + Vec3::X, at + Vec3::Y)
        };
        let triangles: Vec<Triangle> = (0..=nodes).map(triangle).collect();
        let mut all = vec![Node::EMPTY; nodes as usize];
        // A node, and how many there are from it on.
        let mut open = vec![(0_u32, nodes)];
        let mut next = 0;
        while let Some((index, count)) = open.pop() {
            let mut leaf = || {
                next += 1;
                Child::Leaf { first: next - 1, count: 1 }
            };
            let below = count - 1;
            let near = if index % 5 == 0 { below.min(1) } else { below / 3 };
            let far = below - near;
            let first = if near > 0 { Child::Inner(index + 1) } else { leaf() };
            let second = if far > 0 { Child::Inner(index + 1 + near) } else { leaf() };
            all[index as usize].set(0, Aabb::EMPTY, first);
            all[index as usize].set(1, Aabb::EMPTY, second);
            open.extend([(index + 1 + near, far), (index + 1, near)].into_iter().filter(|&(_, count)| count > 0));
        }
        (all, triangles)
    }

    fn is_fitted(nodes: &[Node], triangles: &[Triangle]) -> bool {
        nodes.iter().all(|node| {
            (0..2).all(|side| match node.child(side) {
                Child::Absent => node.bounds[side].is_empty(),
                Child::Inner(child) => node.bounds[side] == around(&nodes[child as usize]),
                Child::Leaf { first, .. } => node.bounds[side] == triangles[first as usize].bounds(),
            })
        })
    }

    /// Mutants: nodes above the subtrees left as they were, or fitted before those; nodes that do not lie depth first
    /// taken to do so.
    #[test]
    fn boxes_fit_wherever_nodes_lie() {
        for count in [1, 2, 100, 3 * SUBTREE as u32, 10 * SUBTREE as u32 + 17] {
            let (mut nodes, triangles) = tree(count);
            assert_eq!(Subtrees::of(&nodes).expect("depth first").above.is_empty(), count as usize <= SUBTREE);
            let shape = nodes.clone();
            fit(&mut nodes, &triangles);
            assert!(is_fitted(&nodes, &triangles), "{count}");
            // The same tree with two nodes in each other's places: of the upper part, and far below.
            for (one, other) in [(1, 2), (count / 2, count / 2 + 1), (1, count / 2)] {
                if one == 0 || other >= count || one >= other {
                    continue;
                }
                let mut nodes = shape.clone();
                nodes.swap(one as usize, other as usize);
                let swapped = |child: u32| match child {
                    child if child == one => other,
                    child if child == other => one,
                    child => child,
                };
                for node in &mut nodes {
                    for side in 0..2 {
                        if let Child::Inner(child) = node.child(side) {
                            node.child[side] = swapped(child);
                        }
                    }
                }
                // A child must come after its parent all the same.
                let children = |node: &Node| [0, 1].map(|side| node.child(side));
                let is_ordered = (0..).zip(&nodes).all(|(index, node)| {
                    children(node).into_iter().all(|child| !matches!(child, Child::Inner(child) if child <= index))
                });
                if is_ordered {
                    fit(&mut nodes, &triangles);
                    assert!(is_fitted(&nodes, &triangles), "{count}: {one} and {other}");
                }
            }
        }
    }
}
