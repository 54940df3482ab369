//! That a tree for processors is whole and its boxes hold what is below them.

use super::{BLOCK, Block, BlockChild, BlockTree};
use crate::collapse::WIDTH;
use alloc::vec;
use alloc::vec::Vec;
use core::fmt;
use rt_core::{Aabb, Scene};

impl BlockTree {
    /// Checks the tree against the scene that it was made of: that every triangle is in one leaf with its own id, every
    /// node and block is reached once, every box holds what is below it, and every order names each slot once. Returns
    /// the number of boxes.
    ///
    /// # Errors
    /// The first defect found; always one of this crate, never of the mesh.
    pub fn check(&self, scene: &Scene) -> Result<u64, BlockTreeError> {
        self.check_shown(scene, |_| true)
    }

    /// The same of a tree without what `shows` denies.
    pub(super) fn check_shown(&self, scene: &Scene, shows: impl Fn(u32) -> bool) -> Result<u64, BlockTreeError> {
        let mut node_seen = vec![false; self.nodes.len()];
        let mut block_seen = vec![false; self.blocks.len()];
        let mut below = vec![Aabb::EMPTY; self.nodes.len()];
        let mut triangles = Triangles::of(scene, shows);
        let mut boxes = 0;
        // Children come after their parents.
        for (index, node) in self.nodes.iter().enumerate().rev() {
            if node.orders.iter().any(|&order| !names_each_slot(order)) {
                return Err(BlockTreeError::Order { node: index });
            }
            for slot in 0..WIDTH {
                let wrong = BlockTreeError::Index { node: index, slot };
                let once = |seen: &mut Vec<bool>, place: usize| {
                    let new = seen.get_mut(place).is_some_and(|seen| !core::mem::replace(seen, true));
                    if new { Ok(()) } else { Err(wrong) }
                };
                let bounds = node.bounds(slot);
                let held = match BlockChild::of(node.children[slot]) {
                    BlockChild::Empty if bounds == Aabb::EMPTY => continue,
                    BlockChild::Empty => return Err(BlockTreeError::Containment { node: index, slot }),
                    BlockChild::Node(child) if child as usize <= index => return Err(wrong),
                    BlockChild::Node(child) => {
                        once(&mut node_seen, child as usize)?;
                        below[child as usize]
                    }
                    BlockChild::Block { index: block, count } => {
                        once(&mut block_seen, block as usize)?;
                        let held = triangles.take(&self.blocks[block as usize], count);
                        held.ok_or(BlockTreeError::Block { block: block as usize })?
                    }
                };
                if !bounds.contains(&held) {
                    return Err(BlockTreeError::Containment { node: index, slot });
                }
                below[index] = below[index].union(bounds);
                boxes += 1;
            }
        }
        if !self.bounds.contains(&below[0]) || self.scale_exponent != scene.scale_exponent() {
            return Err(BlockTreeError::Frame);
        }
        // The root is nobody's child.
        let lost =
            node_seen.iter().skip(1).position(|&seen| !seen).map(|node| BlockTreeError::LostNode { node: node + 1 });
        let lost = lost.or(block_seen.iter().position(|&seen| !seen).map(|block| BlockTreeError::Block { block }));
        match lost.or(triangles.lost().map(|primitive| BlockTreeError::LostTriangle { primitive })) {
            Some(lost) => Err(lost),
            None => Ok(boxes),
        }
    }
}

/// Whether eight times three bits are the numbers from 0 to 7.
fn names_each_slot(order: u32) -> bool {
    order >> 24 == 0 && (0..WIDTH).fold(0, |seen, place| seen | 1 << (order >> (3 * place) & 7)) == 255
}

/// The triangles of a scene that are yet to be found, by id; what is hidden is not among them.
struct Triangles<'s> {
    scene: &'s Scene,
    /// Where a triangle is in leaf order, and whether it was found.
    places: Vec<Option<(u32, bool)>>,
}

impl<'s> Triangles<'s> {
    fn of(scene: &'s Scene, shows: impl Fn(u32) -> bool) -> Self {
        let mut places = vec![None; scene.primitive_count() as usize];
        let ids = (0..scene.triangles().len()).map(|slot| (slot, scene.primitives().get(slot)));
        for (slot, id) in ids.filter(|&(_, id)| shows(id)) {
            places[id as usize] = Some((slot as u32, false));
        }
        Self { scene, places }
    }

    /// Finds the triangles of a block and returns the box that it states; `None` where one is not the scene's or found
    /// before, a spare lane is not the first one, or the box does not hold them.
    fn take(&mut self, block: &Block, count: u32) -> Option<Aabb> {
        let corner = |side: usize| block.axes.each_ref().map(|axis| axis.bounds[side]).into();
        let stated = Aabb { min: corner(0), max: corner(1) };
        for lane in 0..BLOCK {
            let triangle = block.triangle(lane);
            let (slot, found) = self.places.get_mut(block.id(lane) as usize)?.as_mut()?;
            let right = triangle == self.scene.triangles()[*slot as usize] && stated.contains(&triangle.bounds());
            let spare = lane >= count as usize;
            if !right || spare && block.id(lane) != block.id(0) || !spare && core::mem::replace(found, true) {
                return None;
            }
        }
        Some(stated)
    }

    /// The id of one that was not found.
    fn lost(&self) -> Option<u32> {
        let lost = self.places.iter().position(|place| place.is_some_and(|(_, found)| !found));
        lost.map(|id| id as u32)
    }
}

/// What [`BlockTree::check`] found wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum BlockTreeError {
    /// A box does not hold what is below it.
    Containment {
        /// The node.
        node: usize,
        /// Which of its boxes.
        slot: usize,
    },
    /// A slot leads to what is missing or reached already.
    Index {
        /// The node.
        node: usize,
        /// The slot.
        slot: usize,
    },
    /// A block is in no leaf, or holds what it should not.
    Block {
        /// The block.
        block: usize,
    },
    /// An order of a node's slots leaves one out.
    Order {
        /// The node.
        node: usize,
    },
    /// The tree's box or scale is not the scene's.
    Frame,
    /// A node is nobody's child.
    LostNode {
        /// The node.
        node: usize,
    },
    /// A triangle is in no block.
    LostTriangle {
        /// Its id.
        primitive: u32,
    },
}

impl fmt::Display for BlockTreeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Containment { node, slot } => write!(f, "box {slot} of node {node} does not hold what is below it"),
            Self::Index { node, slot } => write!(f, "slot {slot} of node {node} leads nowhere or somewhere twice"),
            Self::Block { block } => write!(f, "block {block} is in no leaf, or its triangles are not the scene's"),
            Self::Order { node } => write!(f, "an order of node {node} leaves out a slot"),
            Self::Frame => write!(f, "the tree's box or scale is not the scene's"),
            Self::LostNode { node } => write!(f, "node {node} is nobody's child"),
            Self::LostTriangle { primitive } => write!(f, "triangle {primitive} is in no block"),
        }
    }
}

impl core::error::Error for BlockTreeError {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BuildOptions, Mesh, build};
    use alloc::sync::Arc;
    use glam::Vec3;

    /// A row of triangles.
    fn row(count: u32, options: &BuildOptions) -> Arc<Scene> {
        let positions: Vec<Vec3> =
            (0..3 * count).map(|i| Vec3::new(i as f32 * 0.37, (i % 3) as f32, (i % 2) as f32)).collect();
        let indices: Vec<_> = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        build(Mesh { positions: &positions, indices: &indices }, options).expect("valid").scene
    }

    #[test]
    fn sound_trees_pass() {
        for count in [0, 1, 2, 3, 4, 5, 9, 33, 100, 1_000] {
            for max_leaf in [1, 4, 7, 64] {
                let scene = row(count, &BuildOptions { max_leaf, ..BuildOptions::default() });
                let tree = BlockTree::new(&scene).expect("few blocks");
                let boxes = tree.check(&scene).expect("sound");
                assert_eq!(boxes == 0, count == 0);
                assert!(tree.depth() >= 1 && tree.bytes() >= 256);
            }
        }
    }

    // Every plane is tight, so that the next number inwards is a violation; and every other word matters too.
    #[test]
    fn every_defect_is_found() {
        let scene = row(100, &BuildOptions::default());
        let good = BlockTree::new(&scene).expect("few blocks");
        let broken = |change: &dyn Fn(&mut BlockTree)| {
            let mut tree = good.clone();
            change(&mut tree);
            tree.check(&scene)
        };
        let used = good.nodes[0].children.iter().filter(|&&child| BlockChild::of(child) != BlockChild::Empty).count();
        assert_eq!(used, WIDTH);
        for slot in 0..WIDTH {
            for axis in 0..3 {
                let violation = Err(BlockTreeError::Containment { node: 0, slot });
                let [low, high] = good.nodes[0].planes[axis].map(|planes| planes[slot]);
                assert_eq!(broken(&|t| t.nodes[0].planes[axis][0][slot] = low.next_up()), violation);
                assert_eq!(broken(&|t| t.nodes[0].planes[axis][1][slot] = high.next_down()), violation);
            }
            assert!(broken(&|t| t.nodes[0].children[slot] ^= 1).is_err());
            assert!(broken(&|t| t.nodes[0].children[slot] = u32::MAX).is_err());
        }
        let block = Err(BlockTreeError::Block { block: 3 });
        assert_eq!(broken(&|t| t.blocks[3].axes[1].a[0] += 1.0), block);
        assert_eq!(broken(&|t| t.blocks[3].axes[2].c[3] += 1.0), block);
        assert_eq!(broken(&|t| t.blocks[3].axes[0].bounds[0] += 0.01), block);
        assert_eq!(broken(&|t| t.blocks[3].axes[0].ids[0] ^= 1), block);
        assert_eq!(broken(&|t| t.nodes[1].orders[5] ^= 1), Err(BlockTreeError::Order { node: 1 }));
        assert_eq!(broken(&|t| t.scale_exponent += 1), Err(BlockTreeError::Frame));
        assert_eq!(
            broken(&|t| t.nodes.push(t.nodes[1])).map_err(|e| matches!(e, BlockTreeError::Index { .. })),
            Err(true)
        );
    }
}
