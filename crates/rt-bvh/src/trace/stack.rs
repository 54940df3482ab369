//! What traversals leave behind to visit later: one stack for all loops, so that a thread needs one only.

use crate::wide::WideTree;
use alloc::vec::Vec;
use rt_core::Scene;

/// Scratch memory of a traversal: children passed by that may have to be visited later.
#[derive(Clone, Debug, Default)]
pub struct Stack {
    pub(super) entries: Vec<Pending>,
    /// The same for wide trees.
    pub(super) node_groups: Vec<NodeGroup>,
}

/// A child whose box was entered.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pending {
    pub(super) child: u32,
    pub(super) count: u32,
    pub(super) entry: f32,
}

impl Pending {
    pub(super) const ROOT: Self = Self { child: 0, count: 0, entry: 0.0 };
}

impl Stack {
    /// A stack as deep as `scene` asks for. Used with a deeper scene it grows.
    #[must_use]
    pub fn for_scene(scene: &Scene) -> Self {
        let mut stack = Self::default();
        stack.fit(scene);
        stack
    }

    pub(super) fn fit(&mut self, scene: &Scene) {
        // Each inner node on the path from the root leaves at most one child behind.
        let depth = scene.depth() as usize;
        if self.entries.len() < depth {
            self.entries.resize(depth, Pending::default());
        }
    }

    pub(super) fn fit_wide(&mut self, tree: &WideTree) {
        self.fit(tree.scene());
        // Each node on the path from the root leaves at most one group behind, and the last one none.
        let depth = tree.depth() as usize;
        if self.node_groups.len() < depth {
            self.node_groups.resize(depth, NodeGroup::default());
        }
    }
}

/// Nodes to be visited: the first node of their parent; and in one word, in the order of visits from the uppermost bit
/// down, which of its slots, and below those, which of its slots are nodes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct NodeGroup {
    pub(super) first: u32,
    pub(super) bits: u32,
}
