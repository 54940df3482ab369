//! Trees in the making, whose nodes can still be moved about.

use super::bounds::Bounds;
use super::{BuildError, Tree, filled, reserve, reserved};
use alloc::vec::Vec;
use rt_core::{Aabb, Child, MAX_DEPTH, Node};

/// What a node costs beside its triangles where small subtrees become leaves, in triangle tests: high, for leaves of
/// several triangles. The value is that of the crate `obvhs` 0.4.
const LEAF_GAIN: f32 = 3.0;

/// One node: a box, and what is in it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Branch {
    pub bounds: Bounds,
    /// The first of two children that lie side by side, or the place in [`Draft::order`] of the first of `count`
    /// triangles.
    pub first: u32,
    /// 0 for inner nodes.
    pub count: u32,
}

impl Branch {
    pub(super) const EMPTY: Self = Self { bounds: Bounds::EMPTY, first: 0, count: 0 };

    /// The children of an inner node.
    #[inline]
    pub(super) fn children(&self) -> Option<[u32; 2]> {
        (self.count == 0).then_some([self.first, self.first + 1])
    }
}

/// Node 0 is the root; the others lie in pairs of siblings behind it, those near the root more or less in front.
#[derive(Debug)]
pub(super) struct Draft {
    pub nodes: Vec<Branch>,
    /// Of every node but the root.
    pub parents: Vec<u32>,
    /// The references' positions.
    pub order: Vec<u32>,
}

/// The other child of the parent of a node that is not the root.
#[inline]
pub(super) const fn sibling(node: u32) -> u32 {
    ((node - 1) ^ 1) + 1
}

impl Draft {
    /// Over nodes that are placed as they should be.
    pub(super) fn new(nodes: Vec<Branch>, order: Vec<u32>) -> Result<Self, BuildError> {
        let mut parents = filled(0, nodes.len(), "the parents of nodes")?;
        for (parent, node) in (0..).zip(&nodes) {
            for child in node.children().into_iter().flatten() {
                parents[child as usize] = parent;
            }
        }
        Ok(Self { nodes, parents, order })
    }

    /// Of a tree whose nodes all have two children.
    pub(super) fn of(tree: &Tree) -> Result<Self, BuildError> {
        let most = 2 * tree.nodes.len() + 1;
        let mut nodes: Vec<Branch> = reserved(most, "nodes")?;
        // For each inner node, that of the tree.
        let mut given: Vec<u32> = reserved(most, "the order of nodes")?;
        let [near, far] = &tree.nodes[0].bounds;
        nodes.push(Branch { bounds: Bounds::from(&near.union(*far)), first: 0, count: 0 });
        given.push(0);
        let mut next = 0;
        while next < nodes.len() {
            if nodes[next].count == 0 {
                nodes[next].first = nodes.len() as u32;
                let node = &tree.nodes[given[next] as usize];
                for side in 0..2 {
                    let (first, count, inner) = match node.child(side) {
                        Child::Leaf { first, count } => (first, count, 0),
                        Child::Inner(inner) => (0, 0, inner),
                        Child::Absent => unreachable!("all nodes have two children"),
                    };
                    nodes.push(Branch { bounds: Bounds::from(&node.bounds[side]), first, count });
                    given.push(inner);
                }
            }
            next += 1;
        }
        let mut order = reserved(tree.order.len(), "the order of triangles")?;
        order.extend_from_slice(&tree.order);
        Self::new(nodes, order)
    }

    /// All nodes, parents before their children.
    fn parents_first(&self) -> Result<Vec<u32>, BuildError> {
        let mut visits: Vec<u32> = reserved(self.nodes.len(), "the order of nodes")?;
        visits.push(0);
        let mut next = 0;
        while next < visits.len() {
            visits.extend(self.nodes[visits[next] as usize].children().into_iter().flatten());
            next += 1;
        }
        Ok(visits)
    }

    /// The same tree with leaves of up to `most` triangles, where they are expected to cost less than the nodes they
    /// replace.
    pub(super) fn with_leaves(self, most: u32) -> Result<Self, BuildError> {
        if most <= 1 {
            return Ok(self);
        }
        // The number of triangles of each subtree that becomes a leaf.
        let mut leaf = filled(0_u32, self.nodes.len(), "the sizes of leaves")?;
        for &index in self.parents_first()?.iter().rev() {
            let node = &self.nodes[index as usize];
            let Some(children) = node.children() else {
                leaf[index as usize] = node.count;
                continue;
            };
            let counts = children.map(|child| leaf[child as usize]);
            let tests = |bounds: &Bounds, count: f32| bounds.half_area() * count;
            if counts[0] > 0 && counts[1] > 0 && counts[0] + counts[1] <= most {
                let apart = (0..2).map(|i| tests(&self.nodes[children[i] as usize].bounds, counts[i] as f32)).sum();
                if tests(&node.bounds, (counts[0] + counts[1]) as f32 - LEAF_GAIN) <= apart {
                    leaf[index as usize] = counts[0] + counts[1];
                }
            }
        }
        let mut nodes = reserved(self.nodes.len(), "nodes")?;
        let mut given: Vec<u32> = reserved(self.nodes.len(), "the order of nodes")?;
        let mut order = reserved(self.order.len(), "the order of triangles")?;
        given.push(0);
        let mut open = reserved(most as usize, "nodes")?;
        let mut next = 0;
        while next < given.len() {
            let index = given[next] as usize;
            let Branch { bounds, count, .. } = self.nodes[index];
            if leaf[index] == 0 {
                nodes.push(Branch { bounds, first: given.len() as u32, count });
                given.extend(self.nodes[index].children().into_iter().flatten());
            } else {
                nodes.push(Branch { bounds, first: order.len() as u32, count: leaf[index] });
                open.push(index as u32);
                while let Some(below) = open.pop() {
                    let node = &self.nodes[below as usize];
                    match node.children() {
                        Some(children) => open.extend(children),
                        None => order.extend_from_slice(&self.order[node.first as usize..][..node.count as usize]),
                    }
                }
            }
            next += 1;
        }
        Self::new(nodes, order)
    }

    /// The tree in its final layout; `None` where it is deeper than a traversal may go.
    pub(super) fn into_tree(self) -> Result<Option<Tree>, BuildError> {
        let mut nodes = reserved(self.nodes.len() / 2 + 1, "nodes")?;
        let mut order = reserved(self.order.len(), "the order of triangles")?;
        nodes.push(Node::EMPTY);
        // What is still to be placed: the node, where it goes, and how deep an inner node there is.
        let mut open = reserved(MAX_DEPTH as usize + 1, "the nodes to place")?;
        open.push((0_u32, None::<(usize, usize)>, 1));
        while let Some((index, parent, depth)) = open.pop() {
            let branch = &self.nodes[index as usize];
            let bounds: Aabb = branch.bounds.aabb();
            let (node, side) = parent.unwrap_or((0, 0));
            let Some([first, second]) = branch.children() else {
                let leaf = Child::Leaf { first: order.len() as u32, count: branch.count };
                nodes[node].set(side, bounds, leaf);
                order.extend_from_slice(&self.order[branch.first as usize..][..branch.count as usize]);
                continue;
            };
            if depth > MAX_DEPTH {
                return Ok(None);
            }
            let own = if parent.is_some() { nodes.len() } else { 0 };
            if parent.is_some() {
                reserve(&mut nodes, 1, "nodes")?;
                nodes.push(Node::EMPTY);
                nodes[node].set(side, bounds, Child::Inner(own as u32));
            }
            open.push((second, Some((own, 1)), depth + 1));
            open.push((first, Some((own, 0)), depth + 1));
        }
        Ok(Some(Tree { nodes, order }))
    }
}
