//! The eight-wide layout for processors, made from a scene's two-wide tree.
//!
//! Nodes hold the boxes of eight children in plain single precision, plane by plane, so that a SIMD word holds one
//! plane of all eight; leaves are blocks of up to four triangles, coordinate by coordinate. The module `collapse`
//! chooses which nodes of the two-wide tree become children of a wide one; [`BlockTree::check`] proves what kernels
//! rely on.
//!
//! Bytes, not instructions, are what incoherent rays pay for: a node is four cache lines, a block three. Of 257,000
//! triangles in the spaceship of B. Bitterli's *Rendering Resources* there are some 4.7 MB of nodes and 20 MB of
//! blocks.

mod check;
mod emit;
mod order;
mod refit;
mod shown;

pub use check::BlockTreeError;

use crate::collapse::{Costs, Plan, WIDTH};
use crate::stats::Areas;
use alloc::sync::Arc;
use alloc::vec::Vec;
use bytemuck::{Pod, Zeroable};
use rt_core::{Aabb, Scene, Triangle};

/// Triangles in a block.
const BLOCK: usize = 4;

/// What visits cost: a block's triangles are tested side by side, however many there are. Measured with kernels of 16
/// lanes, times differ by 2% for leaves between 0.4 and 1 of a node.
const COSTS: Costs =
    Costs { node: 1.0, leaf: |triangles| 0.7 * triangles.div_ceil(BLOCK as u32) as f32, largest_leaf: BLOCK as u32 };

/// A node of a [`BlockTree`]. 256 bytes, four cache lines.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct BlockNode {
    planes: [[[f32; WIDTH]; 2]; 3],
    children: [u32; WIDTH],
    orders: [u32; WIDTH],
}

/// What a word of [`BlockNode::children`] means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlockChild {
    /// Nothing.
    Empty,
    /// A node.
    Node(u32),
    /// A leaf.
    Block {
        /// Which block.
        index: u32,
        /// Number of its triangles, from 1 to 4.
        count: u32,
    },
}

impl BlockChild {
    /// The bit that tells leaves from nodes.
    const LEAF: u32 = 1 << 31;

    /// Most blocks of a tree, so that every leaf has a word that does not mean nothing.
    const MOST_BLOCKS: usize = (1 << 29) - 1;

    /// What a word means.
    #[inline(always)]
    #[must_use]
    pub const fn of(word: u32) -> Self {
        match word {
            u32::MAX => Self::Empty,
            node if node & Self::LEAF == 0 => Self::Node(node),
            leaf => Self::Block { index: (leaf & !Self::LEAF) >> 2, count: (leaf & 3) + 1 },
        }
    }

    const fn word(self) -> u32 {
        match self {
            Self::Empty => u32::MAX,
            Self::Node(index) => index,
            Self::Block { index, count } => Self::LEAF | index << 2 | (count - 1),
        }
    }
}

impl BlockNode {
    /// Boxes of empty slots are those of [`Aabb::EMPTY`], which no ray enters.
    const EMPTY: Self = Self {
        planes: [[[f32::MAX; WIDTH], [f32::MIN; WIDTH]]; 3],
        children: [BlockChild::Empty.word(); WIDTH],
        orders: [0; WIDTH],
    };

    /// By axis, the lower planes of the children's boxes and their upper planes.
    #[inline(always)]
    #[must_use]
    pub const fn planes(&self) -> &[[[f32; WIDTH]; 2]; 3] {
        &self.planes
    }

    /// The box in a slot.
    #[must_use]
    pub fn bounds(&self, slot: usize) -> Aabb {
        let corner = |side: usize| self.planes.map(|planes| planes[side][slot]).into();
        Aabb { min: corner(0), max: corner(1) }
    }

    /// What is in each slot, as [`BlockChild::of`] reads it. Slots are in the order in which rays that ask for any hit
    /// should put them on a stack: those to be visited last come first.
    #[inline(always)]
    #[must_use]
    pub const fn children(&self) -> &[u32; WIDTH] {
        &self.children
    }

    /// For rays that ask for the nearest hit and each octant of directions, whose bit k says that a direction is
    /// negative along axis k, the slots in the order in which to put them on a stack: those that a ray should visit
    /// last come first. Three bits a slot, from the lowest up.
    #[inline(always)]
    #[must_use]
    pub const fn orders(&self) -> &[u32; WIDTH] {
        &self.orders
    }
}

/// One coordinate of the triangles of a [`Block`]. 64 bytes, a cache line and a word of AVX-512.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct BlockAxis {
    /// Of the first vertices.
    pub a: [f32; BLOCK],
    /// Of the second vertices.
    pub b: [f32; BLOCK],
    /// Of the third vertices.
    pub c: [f32; BLOCK],
    /// Least and greatest of them all.
    pub bounds: [f32; 2],
    /// Primitive ids of two triangles: see [`Block::id`]. The third axis has none.
    ids: [u32; 2],
}

/// A leaf: up to four triangles. Lanes without one hold the first one again, which changes no answer. 192 bytes, three
/// cache lines.
///
/// Which coordinate is a ray's dominant one is an address, not a branch or a shuffle.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Block {
    /// x, y and z.
    pub axes: [BlockAxis; 3],
}

impl Block {
    /// The primitive id of the triangle in a lane below 4.
    #[inline(always)]
    #[must_use]
    pub const fn id(&self, lane: usize) -> u32 {
        self.axes[lane / 2 % 2].ids[lane % 2]
    }

    /// The primitive ids of all lanes.
    #[inline(always)]
    #[must_use]
    pub const fn ids(&self) -> [u32; BLOCK] {
        let [[a, b], [c, d]] = [self.axes[0].ids, self.axes[1].ids];
        [a, b, c, d]
    }

    /// The triangle in a lane below 4.
    #[must_use]
    pub fn triangle(&self, lane: usize) -> Triangle {
        let [x, y, z] = &self.axes;
        Triangle::new(
            [x.a[lane], y.a[lane], z.a[lane]].into(),
            [x.b[lane], y.b[lane], z.b[lane]].into(),
            [x.c[lane], y.c[lane], z.c[lane]].into(),
        )
    }
}

/// A scene in the layout for processors: all that tracing needs, the two-wide tree not among it.
#[derive(Clone, Debug)]
pub struct BlockTree {
    nodes: Vec<BlockNode>,
    blocks: Vec<Block>,
    bounds: Aabb,
    scale_exponent: i32,
    depth: u32,
    /// For each block, where its triangles are in the scene's leaf order; found out when the tree is first fitted.
    slots: Option<Arc<[[u32; BLOCK]]>>,
}

impl BlockTree {
    /// Collapses the tree of a scene, in time linear in its size.
    ///
    /// `None` where there would be more than 5 · 10⁸ blocks, 100 GB of them: words of children cannot number them.
    #[must_use]
    pub fn new(scene: &Scene) -> Option<Self> {
        let plan = Plan::of(scene, COSTS);
        let (mut nodes, blocks, depth) = emit::emit(scene, &plan)?;
        order::arrange(&mut nodes, &blocks, Areas::of(scene));
        let (bounds, scale_exponent) = (scene.bounds(), scene.scale_exponent());
        Some(Self { nodes, blocks, bounds, scale_exponent, depth, slots: None })
    }

    /// Nodes; node 0 is the root and always exists. Children have larger indices than their parent.
    #[inline(always)]
    #[must_use]
    pub fn nodes(&self) -> &[BlockNode] {
        &self.nodes
    }

    /// Leaves.
    #[inline(always)]
    #[must_use]
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// Bounds of all triangles, in the scene's local coordinates, as all coordinates of the tree.
    #[must_use]
    pub const fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// As [`Scene::scale_exponent`].
    #[must_use]
    pub const fn scale_exponent(&self) -> i32 {
        self.scale_exponent
    }

    /// Most nodes on a path from the root.
    ///
    /// Every node but the last one of a path leaves at most seven children on a traversal stack, and the last one
    /// eight.
    #[must_use]
    pub const fn depth(&self) -> u32 {
        self.depth
    }

    /// Bytes of nodes and blocks.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        size_of_val(&self.nodes[..]) as u64 + size_of_val(&self.blocks[..]) as u64
    }
}
