//! That a wide tree is whole and its boxes hold what is below them, in exact arithmetic.

use super::encode::compare;
use super::{LEAST_EXPONENT, Slot, WideTree};
use crate::collapse::{WIDTH, bounds};
use crate::scale::pow2;
use alloc::vec;
use core::cmp::Ordering;
use core::fmt;
use rt_core::Aabb;

/// Steps of a grid that may span at most the scene, beyond which a box may reach by one step: so that a plane is off
/// the scene by less than 2⁻⁶ of its size, as the error bound of the ray–box test assumes.
const STEPS: f64 = 127.0;

impl WideTree {
    /// Checks every box against the triangles below it, and every index; returns the number of boxes.
    ///
    /// No rounding is involved: where a plane is, and on which side of it a vertex, is decided exactly.
    ///
    /// # Errors
    /// The first defect found; always one of this crate, never of the mesh.
    pub fn check(&self) -> Result<u64, WideError> {
        let scene = self.scene();
        let mut node_seen = vec![false; self.nodes.len()];
        let mut triangle_seen = vec![false; scene.triangles().len()];
        let mut below = vec![Aabb::EMPTY; self.nodes.len()];
        let mut boxes = 0;
        // Children come after their parents.
        for index in (0..self.nodes.len()).rev() {
            self.check_grid(index)?;
            for slot in 0..WIDTH {
                let held = match self.nodes[index].slot(slot).ok_or(WideError::Index { node: index, slot })? {
                    Slot::Empty => continue,
                    Slot::Node(child) => {
                        let child = child as usize;
                        let new = child > index
                            && node_seen.get_mut(child).is_some_and(|seen| !core::mem::replace(seen, true));
                        if !new {
                            return Err(WideError::Index { node: index, slot });
                        }
                        below[child]
                    }
                    Slot::Leaf { first, count } => {
                        let range = first as usize..first as usize + count as usize;
                        let new = triangle_seen.get_mut(range.clone());
                        let new = new.is_some_and(|seen| seen.iter_mut().all(|seen| !core::mem::replace(seen, true)));
                        if !new {
                            return Err(WideError::Index { node: index, slot });
                        }
                        bounds(&scene.triangles()[range])
                    }
                };
                if let Some(axis) = (0..3).find(|&axis| !self.holds(index, slot, axis, &held)) {
                    return Err(WideError::Containment { node: index, slot, axis });
                }
                below[index] = below[index].union(held);
                boxes += 1;
            }
        }
        // The root is nobody's child.
        if let Some(node) = node_seen.iter().skip(1).position(|&seen| !seen) {
            return Err(WideError::LostNode { node: node + 1 });
        }
        match triangle_seen.iter().position(|&seen| !seen) {
            Some(triangle) => Err(WideError::LostTriangle { triangle }),
            None => Ok(boxes),
        }
    }

    /// That the grid begins inside the scene, and is not so coarse that it ends far outside.
    fn check_grid(&self, index: usize) -> Result<(), WideError> {
        let (node, scene) = (&self.nodes[index], self.scene().bounds());
        for axis in 0..3 {
            let (origin, step) = (node.origin(axis), f64::from(node.step(axis)));
            let inside = (scene.min[axis]..=scene.max[axis]).contains(&origin);
            let fine = step == pow2(LEAST_EXPONENT)
                || compare(scene.max[axis], scene.min[axis], STEPS * step) != Ordering::Less;
            if !(scene.is_empty() || inside && fine) {
                return Err(WideError::Grid { node: index, axis });
            }
        }
        Ok(())
    }

    /// Whether the box in a slot holds another along an axis.
    fn holds(&self, index: usize, slot: usize, axis: usize, held: &Aabb) -> bool {
        let node = &self.nodes[index];
        let (low, high) = node.planes(axis);
        let plane = |steps: u8| f64::from(steps) * f64::from(node.step(axis));
        compare(held.min[axis], node.origin(axis), plane(low[slot])) != Ordering::Less
            && compare(held.max[axis], node.origin(axis), plane(high[slot])) != Ordering::Greater
    }
}

/// What [`WideTree::check`] found wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum WideError {
    /// A box does not hold what is below it.
    Containment {
        /// The node.
        node: usize,
        /// Which of its boxes.
        slot: usize,
        /// Along which axis.
        axis: usize,
    },
    /// A node's grid begins outside the scene or is too coarse.
    Grid {
        /// The node.
        node: usize,
        /// Along which axis.
        axis: usize,
    },
    /// A slot means nothing, or leads to what is missing or reached already.
    Index {
        /// The node.
        node: usize,
        /// The slot.
        slot: usize,
    },
    /// A node is nobody's child.
    LostNode {
        /// The node.
        node: usize,
    },
    /// A triangle is in no leaf.
    LostTriangle {
        /// Its position in leaf order.
        triangle: usize,
    },
}

impl fmt::Display for WideError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Containment { node, slot, axis } => {
                write!(f, "box {slot} of wide node {node} does not hold what is below it along axis {axis}")
            }
            Self::Grid { node, axis } => {
                write!(f, "the grid of wide node {node} is outside the scene or too coarse along axis {axis}")
            }
            Self::Index { node, slot } => write!(f, "slot {slot} of wide node {node} leads nowhere or somewhere twice"),
            Self::LostNode { node } => write!(f, "wide node {node} is nobody's child"),
            Self::LostTriangle { triangle } => write!(f, "triangle {triangle} of the wide order is in no leaf"),
        }
    }
}

impl core::error::Error for WideError {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BuildOptions, Mesh, build};
    use alloc::vec::Vec;
    use glam::Vec3;

    /// A row of triangles.
    fn tree(count: u32) -> WideTree {
        let positions: Vec<Vec3> =
            (0..3 * count).map(|i| Vec3::new(i as f32 * 0.37, (i % 3) as f32, (i % 2) as f32)).collect();
        let indices: Vec<_> = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mesh = Mesh { positions: &positions, indices: &indices };
        WideTree::new(&build(mesh, &BuildOptions::default()).expect("valid").scene)
    }

    #[test]
    fn sound_trees_pass() {
        for count in [0, 1, 2, 3, 4, 9, 100] {
            let tree = tree(count);
            let boxes = tree.check().expect("sound");
            assert_eq!(boxes == 0, count == 0);
            assert!(tree.nodes()[0].slot(0).is_some() && tree.depth() >= 1);
        }
    }

    // Every plane is tight, so that one step inwards is a violation; and every other byte matters too.
    #[test]
    fn every_defect_is_found() {
        let good = tree(100);
        let broken = |change: &dyn Fn(&mut WideTree)| {
            let mut tree = good.clone();
            change(&mut tree);
            tree.check()
        };
        let used: Vec<_> = (0..WIDTH).filter(|&slot| good.nodes[0].slot(slot) != Some(Slot::Empty)).collect();
        assert_eq!(used.len(), WIDTH);
        for &slot in &used {
            for axis in 0..3 {
                let violation = Err(WideError::Containment { node: 0, slot, axis });
                assert_eq!(broken(&|t| t.nodes[0].low[axis][slot] += 1), violation);
                assert_eq!(broken(&|t| t.nodes[0].high[axis][slot] -= 1), violation);
            }
            assert!(broken(&|t| t.nodes[0].meta[slot] = 0).is_err());
        }
        let outside = |t: &mut WideTree| t.nodes[0].origin[1] = (-1.0_f32).to_bits();
        assert_eq!(broken(&outside), Err(WideError::Grid { node: 0, axis: 1 }));
        assert_eq!(broken(&|t| t.nodes[0].exponents[2] += 3), Err(WideError::Grid { node: 0, axis: 2 }));
        assert!(broken(&|t| t.nodes[0].first_node += 1).is_err());
        assert!(broken(&|t| t.nodes[1].first_triangle ^= 1).is_err());
    }

    #[test]
    fn differences_are_compared_exactly() {
        let tiny = 1.0 / (1_u64 << 60) as f32;
        // The difference rounds to 1 both times.
        assert_eq!(compare(1.0, tiny, 1.0), Ordering::Less);
        assert_eq!(compare(1.0, -tiny, 1.0), Ordering::Greater);
        assert_eq!(compare(1.0, 0.0, 1.0), Ordering::Equal);
        assert_eq!(compare(0.5, 0.25, 0.125), Ordering::Greater);
    }
}
