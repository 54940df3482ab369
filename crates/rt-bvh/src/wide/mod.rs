//! The eight-wide compressed layout, made from a scene's two-wide tree.
//!
//! After H. Ylitie, T. Karras and S. Laine, *Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs*
//! (HPG 2017): nodes of 80 bytes for up to eight children, whose boxes are given in 8 bits on a grid of the node's own.
//! The module `collapse` chooses which nodes of the two-wide tree become children of a wide one, `encode` puts their
//! boxes on the grid, `check` proves in exact arithmetic that every box holds what is below it.
//!
//! We deviate from the paper in these:
//! * Exponents and boxes are computed exactly, by bit operations, not by logarithms and rounded divisions.
//! * A grid's origin is the lower corner of the children's boxes, hence inside the scene: the error bound of the
//!   ray–box test (module `trace::wide`) rests on it.
//! * The order of the triangles suits both layouts, so that a device which holds both needs the triangles once: see
//!   [`WideTree::scene`].

mod check;
mod emit;
mod encode;
mod refit;

pub use check::WideError;
pub use refit::WideShape;

use crate::collapse::{Costs, Plan, WIDTH};
use alloc::vec::Vec;
use bytemuck::{Pod, Zeroable};
use rt_core::Scene;

/// What visits cost, where a triangle test costs 1. A node: eight box tests, which are computed side by side. Between 1
/// and 8 trees hardly differ (2% in nodes, 4% in tests of a ray): nearly every node fills its slots whatever it costs.
/// A byte per child has three bits for its triangles.
const COSTS: Costs = Costs { node: 3.0, leaf: |triangles| triangles as f32, largest_leaf: 3 };

/// A node of the wide tree. 80 bytes, five loads of 16.
///
/// Plane `q` of an axis is at `origin + q · 2^(exponents − 127)`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct WideNode {
    /// Where the grid begins: three single-precision numbers, as bits.
    origin: [u32; 3],
    /// Width of the grid's steps by axis, as a biased exponent.
    exponents: [u8; 3],
    /// Bit `slot`: that child is a node.
    inner: u8,
    /// Index of the first child that is a node; the others follow in the order of their slots.
    first_node: u32,
    /// First triangle of the node's leaves.
    first_triangle: u32,
    /// What is in each slot. 0: nothing. A node: `0x20 + 24 + slot`. A leaf: the first triangle after `first_triangle`,
    /// and above five bits for that as many ones as it has triangles.
    meta: [u8; WIDTH],
    /// Lower planes by axis and slot.
    low: [[u8; WIDTH]; 3],
    /// Upper planes.
    high: [[u8; WIDTH]; 3],
}

/// What is in a slot of a [`WideNode`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Slot {
    Empty,
    /// Index of a node.
    Node(u32),
    /// Triangles.
    Leaf {
        first: u32,
        count: u32,
    },
}

/// Exponent of the narrowest grid. Products with the reciprocals of directions stay far from underflow; and scenes,
/// whose largest coordinate is near 1, are never that small where it matters.
pub(crate) const LEAST_EXPONENT: i32 = -100;

/// Lowest value of `WideNode::meta` without its upper bits that means a node.
const NODE: u8 = 24;

impl WideNode {
    const EMPTY: Self = Self {
        origin: [0; 3],
        exponents: [(LEAST_EXPONENT + 127) as u8; 3],
        inner: 0,
        first_node: 0,
        first_triangle: 0,
        meta: [0; WIDTH],
        low: [[u8::MAX; WIDTH]; 3],
        high: [[0; WIDTH]; 3],
    };

    #[inline(always)]
    pub(crate) const fn origin(&self, axis: usize) -> f32 {
        f32::from_bits(self.origin[axis])
    }

    /// Width of the grid's steps.
    #[inline(always)]
    pub(crate) const fn step(&self, axis: usize) -> f32 {
        f32::from_bits((self.exponents[axis] as u32) << 23)
    }

    #[inline(always)]
    pub(crate) const fn planes(&self, axis: usize) -> (&[u8; WIDTH], &[u8; WIDTH]) {
        (&self.low[axis], &self.high[axis])
    }

    #[inline(always)]
    pub(crate) const fn meta(&self) -> [u8; WIDTH] {
        self.meta
    }

    #[inline(always)]
    pub(crate) const fn inner(&self) -> u32 {
        self.inner as u32
    }

    #[inline(always)]
    pub(crate) const fn first_node(&self) -> u32 {
        self.first_node
    }

    #[inline(always)]
    pub(crate) const fn first_triangle(&self) -> u32 {
        self.first_triangle
    }

    /// `None` where the byte means nothing.
    const fn slot(&self, slot: usize) -> Option<Slot> {
        let meta = self.meta[slot];
        let is_node = self.inner >> slot & 1 == 1;
        match (meta >> 5, meta & 0x1f, is_node) {
            (0, 0, false) => Some(Slot::Empty),
            (1, low, true) if low as usize == NODE as usize + slot => {
                let before = self.inner & ((1_u16 << slot) - 1) as u8;
                Some(Slot::Node(self.first_node + before.count_ones()))
            }
            (ones @ (1 | 3 | 7), low, false) if low < NODE => {
                Some(Slot::Leaf { first: self.first_triangle + low as u32, count: ones.count_ones() })
            }
            _ => None,
        }
    }
}

/// A scene in the wide layout, beside the two-wide one over the same triangles.
#[derive(Clone, Debug)]
pub struct WideTree {
    nodes: Vec<WideNode>,
    scene: Scene,
    slots: Vec<u32>,
    depth: u32,
}

impl WideTree {
    /// Collapses the tree of `given`, in time linear in its size.
    ///
    /// Nodes are chosen so that the expected cost is least; leaves of more than three triangles are split.
    #[must_use]
    pub fn new(given: &Scene) -> Self {
        let plan = Plan::of(given, COSTS);
        let emitted = emit::emit(given, &plan);
        let scene = emit::arrange(given, &emitted.slots);
        Self { nodes: emitted.nodes, scene, slots: emitted.slots, depth: emitted.depth }
    }

    /// Nodes; node 0 is the root and always exists. Children have larger indices than their parent.
    #[must_use]
    pub fn nodes(&self) -> &[WideNode] {
        &self.nodes
    }

    /// The given scene with its triangles in the order of the wide tree's leaves.
    ///
    /// Its tree is the given one: triangles of a leaf are still side by side, in the same order. So rays have the same
    /// hits and the same counts in it.
    #[must_use]
    pub const fn scene(&self) -> &Scene {
        &self.scene
    }

    /// For each triangle of [`WideTree::scene`], where it is in the leaf order of the given scene.
    #[must_use]
    pub fn slots(&self) -> &[u32] {
        &self.slots
    }

    /// A copy of [`WideTree::into_shape`].
    #[must_use]
    pub fn shape(&self) -> WideShape {
        WideShape { nodes: self.nodes.clone(), slots: self.slots.clone(), depth: self.depth }
    }

    /// What is to be kept to find triangles again, and to fit the tree to them when they have moved.
    #[must_use]
    pub fn into_shape(self) -> WideShape {
        WideShape { nodes: self.nodes, slots: self.slots, depth: self.depth }
    }

    /// Most nodes on a path from the root, hence one more than the entries that a traversal stack can hold.
    #[must_use]
    pub const fn depth(&self) -> u32 {
        self.depth
    }

    /// Bytes of the nodes.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        size_of_val(&self.nodes[..]) as u64
    }
}
