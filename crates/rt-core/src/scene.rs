//! A scene as kernels read it: a two-wide bounding volume hierarchy over triangles in leaf order.

mod attributes;
mod check;

use crate::{Aabb, Triangle};
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use attributes::Attributes;
use bytemuck::{Pod, Zeroable};
use check::{check_moved, check_tree};
use core::fmt;
use core::ops::{Range, RangeInclusive};

/// Greatest number of inner nodes on a path from the root; builders must stay below it, so that a traversal stack of
/// this many entries always suffices.
pub const MAX_DEPTH: u32 = 128;

/// What [`Scene::scale_exponent`] may be: what takes coordinates from the least to the largest of single precision to
/// about 1. The exact arithmetic of [`crate::intersect`] counts with it.
pub const SCALE_EXPONENTS: RangeInclusive<i32> = -148..=128;

/// An inner node of the two-wide tree: the boxes of both children and where they are. 64 bytes, one cache line.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Node {
    /// Bounds of the children; [`Aabb::EMPTY`] for an absent child.
    pub bounds: [Aabb; 2],
    /// Inner child: index of its node. Leaf: index of its first triangle.
    pub child: [u32; 2],
    /// Number of triangles of a leaf child; 0 for an inner or absent child.
    pub count: [u32; 2],
}

/// What one side of a [`Node`] leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Child {
    /// Nothing: only in the root of a scene with fewer than two leaves.
    Absent,
    /// Another node.
    Inner(u32),
    /// Triangles `first .. first + count` in leaf order.
    Leaf {
        /// Index of the first triangle.
        first: u32,
        /// Number of triangles, at least 1.
        count: u32,
    },
}

impl Node {
    /// A node without children: the root of an empty scene, and the start of every other.
    pub const EMPTY: Self = Self { bounds: [Aabb::EMPTY; 2], child: [u32::MAX; 2], count: [0; 2] };

    /// What side 0 or 1 leads to.
    #[must_use]
    pub const fn child(&self, side: usize) -> Child {
        match (self.child[side], self.count[side]) {
            (u32::MAX, 0) => Child::Absent,
            (node, 0) => Child::Inner(node),
            (first, count) => Child::Leaf { first, count },
        }
    }

    /// Sets side 0 or 1.
    pub fn set(&mut self, side: usize, bounds: Aabb, child: Child) {
        self.bounds[side] = bounds;
        (self.child[side], self.count[side]) = match child {
            Child::Absent => (u32::MAX, 0),
            Child::Inner(node) => (node, 0),
            Child::Leaf { first, count } => (first, count),
        };
    }
}

/// Primitive ids in leaf order, in the narrowest width that holds them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PrimitiveIds {
    /// Every id is below 65,536.
    U16(Vec<u16>),
    /// Any id.
    U32(Vec<u32>),
}

impl PrimitiveIds {
    /// Stores `ids` in the narrowest width.
    #[must_use]
    pub fn new(ids: Vec<u32>) -> Self {
        if ids.iter().all(|&id| id <= u32::from(u16::MAX)) {
            Self::U16(ids.into_iter().map(|id| id as u16).collect())
        } else {
            Self::U32(ids)
        }
    }

    /// The id of the triangle at `slot` in leaf order.
    ///
    /// # Panics
    /// When `slot` is not below [`PrimitiveIds::len`].
    #[inline]
    #[must_use]
    pub fn get(&self, slot: usize) -> u32 {
        match self {
            Self::U16(ids) => u32::from(ids[slot]),
            Self::U32(ids) => ids[slot],
        }
    }

    /// Number of triangles.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::U16(ids) => ids.len(),
            Self::U32(ids) => ids.len(),
        }
    }

    /// Whether there is no triangle.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bits per id: 16 or 32.
    #[must_use]
    pub const fn bits(&self) -> u32 {
        match self {
            Self::U16(_) => 16,
            Self::U32(_) => 32,
        }
    }
}

/// What a builder hands to [`Scene::new`].
#[derive(Clone, Debug, Default)]
pub struct SceneParts {
    /// Node 0 is the root; children have larger indices than their parent.
    pub nodes: Vec<Node>,
    /// Triangles in leaf order, in local coordinates (see [`Scene::scale_exponent`]).
    pub triangles: Vec<Triangle>,
    /// For each triangle, its index in the caller's index buffer.
    pub primitives: Vec<u32>,
    /// Local coordinates are given ones times `2^−scale_exponent`, none rounded; in [`SCALE_EXPONENTS`].
    pub scale_exponent: i32,
    /// Number of triangles the caller gave, those left out included; every id is below it.
    pub primitive_count: u32,
}

/// What a builder hands to [`Scene::moved`].
#[derive(Clone, Debug, Default)]
pub struct MovedParts {
    /// Those of the scene, with boxes that fit.
    pub nodes: Vec<Node>,
    /// As [`SceneParts::triangles`], each in the place that it had.
    pub triangles: Vec<Triangle>,
    /// As [`SceneParts::scale_exponent`].
    pub scale_exponent: i32,
}

/// Does a check for ranges that together are those numbers from 0 on, on whatever threads; the error of one of them.
pub type InParts<'a> =
    &'a dyn Fn(usize, &(dyn Fn(Range<usize>) -> Result<(), SceneError> + Sync)) -> Result<(), SceneError>;

/// A traceable scene. Immutable and checked once, so that kernels may trust every index.
#[derive(Clone, Debug)]
pub struct Scene {
    nodes: Vec<Node>,
    triangles: Vec<Triangle>,
    primitives: PrimitiveIds,
    scale_exponent: i32,
    primitive_count: u32,
    depth: u32,
    /// Shared by scenes that are moved from each other.
    shape: Arc<()>,
    attributes: Attributes,
}

impl Scene {
    /// Checks `parts` in linear time.
    ///
    /// # Errors
    /// When an index leads nowhere or twice to one place, a child is not inside its bounds, a triangle is not finite,
    /// the scale is not one that single precision asks for, or the tree is deeper than [`MAX_DEPTH`].
    pub fn new(parts: SceneParts) -> Result<Self, SceneError> {
        let SceneParts { nodes, triangles, primitives, scale_exponent, primitive_count } = parts;
        if nodes.is_empty() {
            return Err(SceneError::NoRoot);
        }
        if triangles.len() != primitives.len() {
            return Err(SceneError::IdCount { triangles: triangles.len(), ids: primitives.len() });
        }
        if !SCALE_EXPONENTS.contains(&scale_exponent) {
            return Err(SceneError::Scale { exponent: scale_exponent });
        }
        if let Some(&id) = primitives.iter().find(|&&id| id >= primitive_count) {
            return Err(SceneError::IdRange { id, primitive_count });
        }
        let depth = check_tree(&nodes, &triangles)?;
        let primitives = PrimitiveIds::new(primitives);
        let (shape, attributes) = (Arc::default(), Attributes::default());
        Ok(Self { nodes, triangles, primitives, scale_exponent, primitive_count, depth, shape, attributes })
    }

    /// The same tree over triangles that have moved: nodes, leaves and ids stay, boxes and coordinates are others.
    /// Checks them in linear time, in parts that `check` deals.
    ///
    /// # Errors
    /// When the nodes do not lead where they did, a child is not inside its bounds, a triangle is not finite, or the
    /// scale is not one that single precision asks for.
    pub fn moved(&self, parts: MovedParts, check: InParts<'_>) -> Result<Self, SceneError> {
        let MovedParts { nodes, triangles, scale_exponent } = parts;
        if nodes.len() != self.nodes.len() {
            return Err(SceneError::NodeIndex { index: nodes.len().min(self.nodes.len()) as u32 });
        }
        if triangles.len() != self.triangles.len() {
            return Err(SceneError::IdCount { triangles: triangles.len(), ids: self.triangles.len() });
        }
        if !SCALE_EXPONENTS.contains(&scale_exponent) {
            return Err(SceneError::Scale { exponent: scale_exponent });
        }
        check(nodes.len(), &|range| check_moved(&self.nodes, &nodes, &triangles, range))?;
        let (primitives, shape) = (self.primitives.clone(), Arc::clone(&self.shape));
        let Self { primitive_count, depth, .. } = *self;
        let attributes = self.attributes.clone();
        Ok(Self { nodes, triangles, primitives, scale_exponent, primitive_count, depth, shape, attributes })
    }

    /// For each primitive its slot in leaf order; [`u32::MAX`] where it has none.
    #[must_use]
    pub fn slots(&self) -> Vec<u32> {
        let mut slots = vec![u32::MAX; self.primitive_count as usize];
        for slot in 0..self.primitives.len() {
            // Ids are below the number of primitives, and triangles can be numbered in 32 bits.
            slots[self.primitives.get(slot) as usize] = slot as u32;
        }
        slots
    }

    /// Whether one of both is [`Scene::moved`] from the other, or both from a third: they have the same tree with the
    /// same ids in its leaves, over triangles that may be elsewhere.
    #[must_use]
    pub fn has_tree_of(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.shape, &other.shape)
    }

    /// Inner nodes; node 0 is the root and always exists.
    #[must_use]
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Triangles in leaf order, in local coordinates.
    #[must_use]
    pub fn triangles(&self) -> &[Triangle] {
        &self.triangles
    }

    /// Primitive ids in leaf order.
    #[must_use]
    pub const fn primitives(&self) -> &PrimitiveIds {
        &self.primitives
    }

    /// Number of triangles the caller gave, those left out included.
    #[must_use]
    pub const fn primitive_count(&self) -> u32 {
        self.primitive_count
    }

    /// Local coordinates are given ones times `2^−scale_exponent`. No coordinate of a triangle is rounded. Where that
    /// is possible the largest of them is in [½, 1), which keeps single-precision products of coordinates away from
    /// overflow and underflow whatever the unit of the scene.
    #[must_use]
    pub const fn scale_exponent(&self) -> i32 {
        self.scale_exponent
    }

    /// Most inner nodes on a path from the root, hence the most entries a traversal stack can hold.
    #[must_use]
    pub const fn depth(&self) -> u32 {
        self.depth
    }

    /// Bounds of all triangles in local coordinates.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.nodes[0].bounds[0].union(self.nodes[0].bounds[1])
    }

    /// Bytes of nodes, triangles and ids together: what a device must hold.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let ids = self.primitives.len() as u64 * u64::from(self.primitives.bits() / 8);
        size_of_val(&self.nodes[..]) as u64 + size_of_val(&self.triangles[..]) as u64 + ids
    }
}

/// Why [`Scene::new`] refused its parts: but for memory always a defect of the builder, never of the caller's mesh. Or
/// why [`Scene::with_masks`] or [`Scene::with_geometries`] refused what they were given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SceneError {
    /// There is no node 0.
    NoRoot,
    /// Triangles and ids differ in number.
    IdCount {
        /// Number of triangles.
        triangles: usize,
        /// Number of ids.
        ids: usize,
    },
    /// An id is not below the number of primitives.
    IdRange {
        /// The id.
        id: u32,
        /// The number of primitives.
        primitive_count: u32,
    },
    /// A node is missing, reached twice or never, or placed before its parent.
    NodeIndex {
        /// The node.
        index: u32,
    },
    /// A leaf names triangles that do not exist or belong to another leaf.
    LeafRange {
        /// The leaf's parent.
        node: u32,
    },
    /// A child or triangle is not finite or not inside its bounds.
    Bounds {
        /// The node.
        node: u32,
    },
    /// A triangle is in no leaf.
    LostTriangle {
        /// Its position in leaf order.
        slot: usize,
    },
    /// The scale exponent is not in [`SCALE_EXPONENTS`].
    Scale {
        /// The exponent.
        exponent: i32,
    },
    /// A path is longer than [`MAX_DEPTH`].
    TooDeep,
    /// Not as many masks as primitives.
    MaskCount {
        /// Number of masks.
        masks: usize,
        /// Number of primitives.
        primitives: u32,
    },
    /// First primitives of geometries that do not begin at 0, are not in order, or are beyond the last primitive.
    Geometries {
        /// The first of them that is wrong.
        geometry: usize,
    },
    /// There is no memory to check them.
    OutOfMemory {
        /// How many bytes it takes.
        bytes: u64,
    },
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoRoot => write!(f, "the tree has no root node"),
            Self::IdCount { triangles, ids } => write!(f, "{triangles} triangles but {ids} primitive ids"),
            Self::IdRange { id, primitive_count } => {
                write!(f, "primitive id {id} in a scene of {primitive_count} primitives")
            }
            Self::NodeIndex { index } => {
                write!(f, "node {index} is missing, reached twice or never, or before its parent")
            }
            Self::LeafRange { node } => write!(f, "a leaf of node {node} names triangles outside its own"),
            Self::Bounds { node } => write!(f, "a child of node {node} is not finite or sticks out of its bounds"),
            Self::LostTriangle { slot } => write!(f, "triangle {slot} of the leaf order is in no leaf"),
            Self::Scale { exponent } => write!(
                f,
                "coordinates are scaled by 2^{exponent}, outside {} to {}",
                SCALE_EXPONENTS.start(),
                SCALE_EXPONENTS.end()
            ),
            Self::MaskCount { masks, primitives } => {
                write!(f, "{masks} masks for {primitives} primitives: give one for each")
            }
            Self::Geometries { geometry } => write!(
                f,
                "geometry {geometry} does not begin where it could: give first primitives from 0 on, in order"
            ),
            Self::TooDeep => write!(f, "the tree is deeper than {MAX_DEPTH}"),
            Self::OutOfMemory { bytes } => write!(f, "no memory to check the tree: {bytes} bytes are needed"),
        }
    }
}

impl core::error::Error for SceneError {}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn one_leaf() -> SceneParts {
        let triangle = Triangle::new(Vec3::ZERO, Vec3::X, Vec3::Y);
        let mut root = Node::EMPTY;
        root.set(0, triangle.bounds(), Child::Leaf { first: 0, count: 1 });
        SceneParts {
            nodes: vec![root],
            triangles: vec![triangle],
            primitives: vec![5],
            scale_exponent: 0,
            primitive_count: 6,
        }
    }

    #[test]
    fn a_good_tree_passes_and_knows_its_depth() {
        let scene = Scene::new(one_leaf()).expect("valid");
        assert_eq!((scene.depth(), scene.primitives().bits(), scene.bytes()), (1, 16, 64 + 36 + 2));
        let empty = SceneParts { nodes: vec![Node::EMPTY], ..SceneParts::default() };
        assert!(Scene::new(empty).is_ok());
    }

    /// Mutants: any of the checks left out; a scene of as many triangles taken for a moved one.
    #[test]
    fn a_moved_scene_keeps_its_tree_and_every_defect_is_refused() {
        let scene = Scene::new(one_leaf()).expect("valid");
        let all: InParts<'_> = &|count, check| check(0..count);
        let triangle = Triangle::new(Vec3::X, Vec3::Y, Vec3::Z);
        let parts = || {
            let mut nodes = scene.nodes().to_vec();
            nodes[0].bounds[0] = triangle.bounds();
            MovedParts { nodes, triangles: vec![triangle], scale_exponent: 1 }
        };
        let moved = scene.moved(parts(), all).expect("valid");
        assert!(moved.has_tree_of(&scene) && moved.has_tree_of(&moved.clone()));
        assert_eq!((moved.triangles(), moved.scale_exponent(), moved.primitives().get(0)), (&[triangle][..], 1, 5));
        assert!(!Scene::new(one_leaf()).expect("valid").has_tree_of(&scene));
        let bad = |change: fn(&mut MovedParts)| {
            let mut parts = parts();
            change(&mut parts);
            scene.moved(parts, all).expect_err("defect")
        };
        assert_eq!(bad(|p| p.nodes.push(Node::EMPTY)), SceneError::NodeIndex { index: 1 });
        assert_eq!(bad(|p| p.nodes[0].count[0] = 0), SceneError::NodeIndex { index: 0 });
        assert_eq!(bad(|p| p.triangles.clear()), SceneError::IdCount { triangles: 0, ids: 1 });
        assert_eq!(bad(|p| p.scale_exponent = 129), SceneError::Scale { exponent: 129 });
        assert_eq!(bad(|p| p.nodes[0].bounds[0].max.x = 0.5), SceneError::Bounds { node: 0 });
        assert_eq!(bad(|p| p.nodes[0].bounds[1] = p.nodes[0].bounds[0]), SceneError::Bounds { node: 0 });
        assert_eq!(bad(|p| p.triangles[0].a.x = f32::NAN), SceneError::Bounds { node: 0 });
    }

    #[test]
    fn every_defect_is_refused() {
        let bad = |change: fn(&mut SceneParts)| {
            let mut parts = one_leaf();
            change(&mut parts);
            Scene::new(parts).expect_err("defect")
        };
        assert_eq!(bad(|p| p.nodes.clear()), SceneError::NoRoot);
        assert_eq!(bad(|p| p.primitive_count = 5), SceneError::IdRange { id: 5, primitive_count: 5 });
        assert_eq!(bad(|p| p.primitives.clear()), SceneError::IdCount { triangles: 1, ids: 0 });
        assert_eq!(bad(|p| p.nodes[0].count[0] = 2), SceneError::LeafRange { node: 0 });
        assert_eq!(bad(|p| p.nodes[0].bounds[0].max.x = 0.5), SceneError::Bounds { node: 0 });
        assert_eq!(bad(|p| p.triangles[0].a.x = f32::NAN), SceneError::Bounds { node: 0 });
        assert_eq!(bad(|p| p.nodes[0].set(1, Aabb::EMPTY, Child::Inner(0))), SceneError::NodeIndex { index: 0 });
        assert_eq!(bad(|p| p.nodes.push(Node::EMPTY)), SceneError::NodeIndex { index: 1 });
        assert_eq!(bad(|p| p.scale_exponent = 129), SceneError::Scale { exponent: 129 });
        assert_eq!(bad(|p| p.nodes[0] = Node::EMPTY), SceneError::LostTriangle { slot: 0 });
    }
}
