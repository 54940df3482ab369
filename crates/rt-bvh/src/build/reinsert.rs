//! Improves trees by moving nodes to where they cost less.
//!
//! After D. Meister and J. Bittner, *Parallel Reinsertion for Bounding Volume Hierarchy Optimization* (2018), with the
//! sequence of ever smaller batches of the crate `obvhs` 0.4. We deviate in one way: the search for a place is given up
//! after [`MOST_VISITED`] nodes. In nested boxes nothing bounds it, for every place is nearly as good, and the time is
//! quadratic.

use super::bounds::Bounds;
use super::draft::{Branch, Draft, sibling};
use super::{BuildError, Control, filled, reserved};
use crate::parallel::each;
use alloc::vec::Vec;

/// Most nodes visited for one that may be moved.
const MOST_VISITED: u32 = 1 << 8;

/// Batches: the first has all nodes that are to be tried, the one with number i a (2i + 1)th of them.
const BATCHES: u32 = 16;

/// Nodes that a thread tries at a time.
const CHUNK: usize = 1 << 9;

/// Nodes tried between two words to whoever waits.
const WORD: usize = 1 << 14;

/// A node that may be moved beside another, and how much less the sum of areas then is.
#[derive(Clone, Copy)]
struct Move {
    node: u32,
    to: u32,
    gain: f32,
}

/// Tries to move this share of all nodes, the largest near the root: of all work the part from `from` to `to`.
pub(super) fn improve(
    draft: &mut Draft,
    share: f32,
    control: &mut Control<'_>,
    [from, to]: [f32; 2],
) -> Result<(), BuildError> {
    let count = draft.nodes.len();
    // No node of three can be elsewhere.
    if share <= 0.0 || count <= 3 {
        return Ok(());
    }
    let most = batch(count, share, 0);
    let mut candidates: Vec<u32> = reserved((2 * most + 1).min(count), "the nodes to move")?;
    let mut moves: Vec<Move> = reserved(most, "the nodes to move")?;
    let mut touched = filled(false, count, "the nodes moved")?;
    for number in 0..BATCHES {
        let size = batch(count, share, number);
        candidates.clear();
        candidates.extend(1..(2 * size + 1).min(count) as u32);
        let area = |node: u32| draft.nodes[node as usize].bounds.half_area();
        if size < candidates.len() {
            candidates.select_nth_unstable_by(size, |&a, &b| area(b).total_cmp(&area(a)).then(a.cmp(&b)));
        }
        moves.clear();
        for (i, some) in candidates[..size].chunks(WORD).enumerate() {
            let found = each(some.chunks(CHUNK).collect(), |some| find_all(draft, some));
            let part = (number as f32 + (i * WORD) as f32 / size as f32) / BATCHES as f32;
            control.reached(from + (to - from) * part);
            control.worked(found.iter().map(|(_, visits)| visits).sum())?;
            moves.extend(found.into_iter().flat_map(|(moves, _)| moves));
        }
        moves.sort_unstable_by(|a, b| b.gain.total_cmp(&a.gain).then(a.node.cmp(&b.node)));
        touched.fill(false);
        for Move { node, to, .. } in &moves {
            let parent = |node: u32| draft.parents[node as usize];
            let changed = [*to, *node, sibling(*node), parent(*to), parent(*node)].map(|node| node as usize);
            // What was moved by a better one before is where it was not when this was found.
            if changed.iter().all(|&node| !touched[node]) {
                changed.iter().for_each(|&node| touched[node] = true);
                draft.move_beside(*node, *to);
            }
        }
    }
    Ok(())
}

/// How many of `count` nodes are tried in a batch.
fn batch(count: usize, share: f32, number: u32) -> usize {
    let all = count as f32 * share;
    ((all / (2 * number + 1) as f32) as usize).clamp(1, count - 1)
}

/// What is to be moved of some nodes, and how many were visited for that.
fn find_all(draft: &Draft, nodes: &[u32]) -> (Vec<Move>, u64) {
    let (mut open, mut visits) = (Vec::new(), 0);
    let moves = nodes.iter().filter_map(|&node| find(draft, node, &mut open, &mut visits)).collect();
    (moves, visits)
}

/// The place where `node` costs least, if that is not where it is.
///
/// A node leaves its parent, whose place its sibling takes, so all boxes on the way up shrink; and where it goes, all
/// boxes on the way down grow, and it gets a new parent together with what is there. The search goes up one node at a
/// time and looks at what is below the other child, as far as less would be gained already without the new parent's box
/// than was found.
fn find(draft: &Draft, node: u32, open: &mut Vec<(f32, u32)>, visits: &mut u64) -> Option<Move> {
    let at = |node: u32| -> &Branch { &draft.nodes[node as usize] };
    let own = at(node).bounds;
    let own_area = own.half_area();
    let parent = draft.parents[node as usize];
    let mut best = Move { node, to: 0, gain: 0.0 };
    // What is gained so far by leaving, and the box of what stays below the present ancestor.
    let mut gain = at(parent).bounds.half_area();
    let (mut ancestor, mut beside) = (parent, sibling(node));
    let mut rest: Bounds = at(beside).bounds;
    let mut left = MOST_VISITED;
    loop {
        open.clear();
        open.push((gain, beside));
        while let Some((gain, to)) = open.pop() {
            if gain - own_area <= best.gain {
                continue;
            }
            left = left.saturating_sub(1);
            if left == 0 {
                break;
            }
            let there = at(to);
            let gain = gain - there.bounds.union(&own).half_area();
            if gain > best.gain {
                best = Move { node, to, gain };
            }
            if let Some(children) = there.children() {
                let below = gain + there.bounds.half_area();
                open.extend(children.map(|child| (below, child)));
            }
        }
        left = left.saturating_sub(1);
        if ancestor != parent {
            rest.add(&at(beside).bounds);
            gain += at(ancestor).bounds.half_area() - rest.half_area();
        }
        if ancestor == 0 || left == 0 {
            break;
        }
        beside = sibling(ancestor);
        ancestor = draft.parents[ancestor as usize];
    }
    *visits += u64::from(MOST_VISITED - left);
    (best.gain > 0.0 && best.to != sibling(node) && best.to != parent).then_some(best)
}

impl Draft {
    /// Gives `node` and `to` a common parent in `to`'s place, and its sibling the place of its parent.
    fn move_beside(&mut self, node: u32, to: u32) {
        let (stays, parent) = (sibling(node), self.parents[node as usize]);
        let (staying, there) = (self.nodes[stays as usize], self.nodes[to as usize]);
        self.nodes[to as usize] = Branch { first: node.min(stays), count: 0, ..there };
        self.place(there, stays);
        self.place(staying, parent);
        self.parents[stays as usize] = to;
        self.parents[node as usize] = to;
        self.fit_from(to);
        if parent != 0 {
            self.fit_from(self.parents[parent as usize]);
        }
    }

    fn place(&mut self, branch: Branch, place: u32) {
        self.nodes[place as usize] = branch;
        for child in branch.children().into_iter().flatten() {
            self.parents[child as usize] = place;
        }
    }

    /// Fits the boxes of an inner node and of what is above it, as far as that changes them.
    fn fit_from(&mut self, mut node: u32) {
        while let Some(children) = self.nodes[node as usize].children() {
            let [first, second] = children.map(|child| self.nodes[child as usize].bounds);
            let (fitted, old) = (first.union(&second), self.nodes[node as usize].bounds);
            self.nodes[node as usize].bounds = fitted;
            if node == 0 || (fitted.aabb() == old.aabb()) {
                break;
            }
            node = self.parents[node as usize];
        }
    }
}
