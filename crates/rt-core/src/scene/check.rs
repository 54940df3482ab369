//! Whether a tree is one.

use super::{Child, MAX_DEPTH, Node, SceneError};
use crate::{Aabb, Triangle};
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// Walks the tree without recursion, returns its depth.
pub(super) fn check_tree(nodes: &[Node], triangles: &[Triangle]) -> Result<u32, SceneError> {
    let mut node_seen = unseen(nodes.len())?;
    let mut slot_seen = unseen(triangles.len())?;
    let mut deepest = 0;
    let mut open = vec![(0_u32, 1_u32, None::<Aabb>)];
    while let Some((index, depth, within)) = open.pop() {
        let node = nodes.get(index as usize).ok_or(SceneError::NodeIndex { index })?;
        if core::mem::replace(&mut node_seen[index as usize], true) {
            return Err(SceneError::NodeIndex { index });
        }
        if depth > MAX_DEPTH {
            return Err(SceneError::TooDeep);
        }
        deepest = deepest.max(depth);
        for side in 0..2 {
            let bounds = node.bounds[side];
            if within.is_some_and(|outer| !outer.contains(&bounds)) {
                return Err(SceneError::Bounds { node: index });
            }
            match node.child(side) {
                Child::Absent if index == 0 && bounds.is_empty() => {}
                Child::Absent => return Err(SceneError::NodeIndex { index }),
                Child::Inner(child) if child > index => open.push((child, depth + 1, Some(bounds))),
                Child::Inner(child) => return Err(SceneError::NodeIndex { index: child }),
                Child::Leaf { first, count } => {
                    let range = first as usize..first as usize + count as usize;
                    let leaf = triangles.get(range.clone()).ok_or(SceneError::LeafRange { node: index })?;
                    for (triangle, seen) in leaf.iter().zip(&mut slot_seen[range]) {
                        if core::mem::replace(seen, true) {
                            return Err(SceneError::LeafRange { node: index });
                        }
                        if !triangle.is_finite() || !bounds.contains(&triangle.bounds()) {
                            return Err(SceneError::Bounds { node: index });
                        }
                    }
                }
            }
        }
    }
    if let Some(index) = node_seen.iter().position(|&seen| !seen) {
        return Err(SceneError::NodeIndex { index: index as u32 });
    }
    match slot_seen.iter().position(|&seen| !seen) {
        Some(slot) => Err(SceneError::LostTriangle { slot }),
        None => Ok(deepest),
    }
}

/// Checks a range of nodes that lead where others do, which were checked.
pub(super) fn check_moved(
    before: &[Node],
    nodes: &[Node],
    triangles: &[Triangle],
    range: Range<usize>,
) -> Result<(), SceneError> {
    for index in range {
        let (node, known) = (&nodes[index], &before[index]);
        if (node.child, node.count) != (known.child, known.count) {
            return Err(SceneError::NodeIndex { index: index as u32 });
        }
        for side in 0..2 {
            let bounds = node.bounds[side];
            let fits = match node.child(side) {
                Child::Absent => bounds.is_empty(),
                Child::Inner(child) => nodes[child as usize].bounds.iter().all(|below| bounds.contains(below)),
                Child::Leaf { first, count } => triangles[first as usize..][..count as usize]
                    .iter()
                    .all(|triangle| triangle.is_finite() && bounds.contains(&triangle.bounds())),
            };
            if !fits {
                return Err(SceneError::Bounds { node: index as u32 });
            }
        }
    }
    Ok(())
}

fn unseen(count: usize) -> Result<Vec<bool>, SceneError> {
    let mut seen = Vec::new();
    seen.try_reserve_exact(count).map_err(|_| SceneError::OutOfMemory { bytes: count as u64 })?;
    seen.resize(count, false);
    Ok(seen)
}
