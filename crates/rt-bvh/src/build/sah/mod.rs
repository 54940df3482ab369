//! Top-down construction by the surface area heuristic over binned centroids.
//!
//! After I. Wald, *On fast Construction of SAH-based Bounding Volume Hierarchies* (2007). We deviate in two ways: a
//! range that no plane can split is halved by position, and so is one that has grown too deep, which bounds depth and
//! time for every input.
//!
//! Large ranges are split one after the other, each by all threads in chunks; what is left below [`SUBTREE`] is built
//! by one thread each. Which ranges these are, and what is done with either, does not depend on threads: so neither
//! does the tree.
//!
//! What is decided from the root on is not always best: some nodes are moved then (the module `reinsert`). The largest
//! fiftieth takes 6 to 15% of the time to build and mends what went wrong near the root; all of them, twice, take four
//! times as long as all else (docs/results/cpu.md).

mod binning;
mod range;

use super::draft::Draft;
use super::gather::Reference;
use super::{BuildError, Control, Tree, reinsert, reserve, reserved, zeroed};
use crate::parallel::each;
use alloc::vec::Vec;
use binning::Chunks;
use core::mem::take;
use range::Range;
use rt_core::{Aabb, Child, MAX_DEPTH, Node};

/// Most references in a subtree that one thread builds: some milliseconds, in the second-level cache of a core.
const SUBTREE: u32 = 1 << 14;

/// Subtrees built between two words to whoever waits.
const WAVE: usize = 32;

/// Shares of nodes that are tried elsewhere, one after the other, and which part of all work is done before.
struct Effort {
    shares: &'static [f32],
    before: f32,
}

impl Effort {
    const USUAL: Self = Self { shares: &[0.02], before: 0.95 };
    const THOROUGH: Self = Self { shares: &[1.0, 1.0], before: 0.4 };
}

pub(super) fn build(
    references: Vec<Reference>,
    max_leaf: u32,
    thorough: bool,
    control: &mut Control<'_>,
) -> Result<Tree, BuildError> {
    let Effort { shares, before } = if thorough { Effort::THOROUGH } else { Effort::USUAL };
    let tree = split(references, max_leaf, before, control)?;
    // A root may have one child.
    if tree.nodes.len() < 2 {
        return Ok(tree);
    }
    let mut draft = Draft::of(&tree)?;
    let part = (1.0 - before) / shares.len() as f32;
    for (number, &share) in shares.iter().enumerate() {
        let from = before + part * number as f32;
        reinsert::improve(&mut draft, share, control, [from, from + part])?;
    }
    // Moved nodes may lie too deep.
    Ok(draft.into_tree()?.unwrap_or(tree))
}

/// The tree from the root on, which is the part `all` of all work.
fn split(references: Vec<Reference>, max_leaf: u32, all: f32, control: &mut Control<'_>) -> Result<Tree, BuildError> {
    if references.is_empty() {
        return Ok(Tree::empty());
    }
    // Large ranges are split from one buffer into the other and back.
    let count = references.len();
    let whole = Range::around(&references);
    let large = if count > SUBTREE as usize { count } else { 0 };
    let mut buffers = [references, zeroed(large, "the boxes of triangles")?];

    let mut upper = reserved(4 * count / SUBTREE as usize + 1, "the upper tree")?;
    let mut open = reserved(MAX_DEPTH as usize + 1, "the ranges to split")?;
    open.push((whole, 0_usize, 1_u32));
    while let Some((range, buffer, depth)) = open.pop() {
        if range.count > SUBTREE {
            control.worked(range.count.into())?;
            let [first, second] = &mut buffers;
            let (from, to) = if buffer == 0 { (first, second) } else { (second, first) };
            let places = range.first as usize..(range.first + range.count) as usize;
            let chunks = Chunks { from: &from[places.clone()], to: &mut to[places] };
            if let Some([near, far]) = range.split_apart(chunks, max_leaf, depth) {
                upper.push(Upper::Node(range.bounds.aabb()));
                open.push((far, 1 - buffer, depth + 1));
                open.push((near, 1 - buffer, depth + 1));
                continue;
            }
        }
        upper.push(Upper::Subtree { range, buffer, depth });
    }
    let subtrees = grow(&upper, &mut buffers, max_leaf, all, control)?;
    let nodes = join(&upper, subtrees)?;

    let mut order = reserved(count, "the order of triangles")?;
    for part in &upper {
        if let Upper::Subtree { range, buffer, .. } = part {
            let own = &buffers[*buffer][range.first as usize..][..range.count as usize];
            order.extend(own.iter().map(|reference| reference.triangle));
        }
    }
    Ok(Tree { nodes, order })
}

/// The upper part of a tree: each node comes before all that is below its first child, and that before its second.
enum Upper {
    /// Its box.
    Node(Aabb),
    Subtree {
        range: Range,
        /// Where its references are.
        buffer: usize,
        /// Of its root.
        depth: u32,
    },
}

/// A subtree whose nodes count from 0.
struct Subtree {
    bounds: Aabb,
    root: Child,
    nodes: Vec<Node>,
    steps: u64,
}

/// Builds all subtrees, in their order. When all stand, the part `all` of all work is done.
fn grow(
    upper: &[Upper],
    buffers: &mut [Vec<Reference>; 2],
    max_leaf: u32,
    all: f32,
    control: &mut Control<'_>,
) -> Result<Vec<Subtree>, BuildError> {
    let [mut first, mut second] = buffers.each_mut().map(|buffer| &mut buffer[..]);
    let mut jobs = reserved(upper.len(), "subtrees")?;
    for part in upper {
        if let Upper::Subtree { range, buffer, depth } = part {
            // The second buffer is empty where it was not needed.
            let places = [range.count as usize, (range.count as usize).min(second.len())];
            let (here, rest) = take(&mut first).split_at_mut(places[0]);
            first = rest;
            let (there, rest) = take(&mut second).split_at_mut(places[1]);
            second = rest;
            jobs.push((range, if *buffer == 0 { here } else { there }, *depth));
        }
    }
    let mut subtrees = reserved(jobs.len(), "subtrees")?;
    let (mut placed, triangles) = (0, jobs.iter().map(|(range, ..)| range.count).sum::<u32>());
    while !jobs.is_empty() {
        let wave: Vec<_> = jobs.drain(..WAVE.min(jobs.len())).collect();
        let mut steps = 0;
        for (subtree, count) in
            each(wave, |(range, own, depth)| (Subtree::grow(range, own, max_leaf, depth), range.count))
        {
            let subtree = subtree?;
            steps += subtree.steps;
            placed += count;
            subtrees.push(subtree);
        }
        control.reached(all * (placed as f32 / triangles as f32));
        control.worked(steps)?;
    }
    Ok(subtrees)
}

impl Subtree {
    fn grow(whole: &Range, references: &mut [Reference], max_leaf: u32, depth: u32) -> Result<Self, BuildError> {
        let mut tree = Self { bounds: whole.bounds.aabb(), root: Child::Absent, nodes: Vec::new(), steps: 0 };
        // As many as there are if leaves have three triangles, which is usual.
        reserve(&mut tree.nodes, references.len() / 3, "nodes")?;
        // A node is made when its turn comes, so that a subtree's nodes lie together.
        let mut open = reserved(MAX_DEPTH as usize + 1, "the ranges to split")?;
        open.push((*whole, None::<(usize, usize)>, depth));
        while let Some((range, parent, depth)) = open.pop() {
            tree.steps += u64::from(range.count);
            let own = &mut references[(range.first - whole.first) as usize..][..range.count as usize];
            let child = match range.split(own, max_leaf, depth) {
                None => Child::Leaf { first: range.first, count: range.count },
                Some([near, far]) => {
                    let index = tree.nodes.len();
                    reserve(&mut tree.nodes, 1, "nodes")?;
                    tree.nodes.push(Node::EMPTY);
                    open.push((far, Some((index, 1)), depth + 1));
                    open.push((near, Some((index, 0)), depth + 1));
                    Child::Inner(index as u32)
                }
            };
            match parent {
                Some((node, side)) => tree.nodes[node].set(side, range.bounds.aabb(), child),
                None => tree.root = child,
            }
        }
        Ok(tree)
    }
}

/// All nodes in one list.
fn join(upper: &[Upper], subtrees: Vec<Subtree>) -> Result<Vec<Node>, BuildError> {
    let mut subtrees = subtrees.into_iter();
    let all = upper.len() + subtrees.as_slice().iter().map(|subtree| subtree.nodes.len()).sum::<usize>();
    let mut nodes: Vec<Node> = Vec::new();
    // Where what comes next belongs: the last entry.
    let mut places: Vec<(usize, usize)> = Vec::new();
    for part in upper {
        let index = nodes.len();
        let place = places.pop();
        let (bounds, child) = match part {
            Upper::Node(bounds) => {
                reserve(&mut nodes, all - index, "nodes")?;
                nodes.push(Node::EMPTY);
                places.extend([(index, 1), (index, 0)]);
                (*bounds, Child::Inner(index as u32))
            }
            Upper::Subtree { .. } => {
                let Some(subtree) = subtrees.next() else { break };
                let moved = |child| match child {
                    Child::Inner(node) => Child::Inner(index as u32 + node),
                    other => other,
                };
                if nodes.is_empty() {
                    nodes = subtree.nodes;
                } else {
                    nodes.extend(subtree.nodes.into_iter().map(|mut node| {
                        for side in 0..2 {
                            node.set(side, node.bounds[side], moved(node.child(side)));
                        }
                        node
                    }));
                }
                (subtree.bounds, moved(subtree.root))
            }
        };
        match (place, child) {
            (Some((node, side)), _) => nodes[node].set(side, bounds, child),
            // The root of a tree is a node, even with one child.
            (None, Child::Leaf { .. }) => {
                nodes.push(Node::EMPTY);
                nodes[0].set(0, bounds, child);
            }
            (None, _) => {}
        }
    }
    Ok(nodes)
}
