//! The traversal loop over the eight-wide layout, and its ray–box test.
//!
//! The loop is that of Ylitie, Karras and Laine (2017): what a ray enters of a node are bits of one word, the nodes
//! among them in the order in which the ray should visit them, and the stack holds such words. Kernels do the same step
//! for step, so that counts are the same.
//!
//! # Why the test is conservative, and hits do not depend on the layout
//!
//! The distance to plane q of a node's grid, whose origin is p and whose step is S = 2^e, is computed as q·(S·r) + A·r
//! with A = p − o″, where r is the computed reciprocal of the direction's component. S·r is exact. The origin o″ is
//! padded by twice P, the padding of the module `slabs`. It suffices that a plane c of a box inside, which is on the
//! inner side of p + q·S, is never computed to be further out than its parent's: for the planes through which a ray
//! enters, that T″ = fl(fl(q·S·r) + fl(A·r)) ≤ T = fl(fl(c − o′)·r), where o′ is padded by P. Then what passes the
//! plain test of a triangle's own box passes every box of the wide tree above it, under the same limits, and the
//! argument of the module `trace` holds.
//!
//! Take r > 0 and a lower plane; the other cases are its mirror images. Let u = 2⁻²⁴, M_k and M as in `slabs`, and B =
//! M_k + 2P, which is not less than the distance of any plane of the scene, or of p, from any of the padded origins.
//!
//! * o″ is below o′ by G ≥ P − 3·u·P − 2·u·|o_k|, of which P holds 8·u·M_k + 2⁻⁴¹·M + 4·u·|o_k|. So (with 1 − 8u for
//!   the roundings of P itself) G ≥ (8·u·M_k + 2⁻⁴¹·M + 2·u·|o_k|)·(1 − 8u).
//! * T has two roundings: T ≥ (c − o′)·r − 2.01·u·B·r.
//! * T″ has two in A·r, one in q·S·r, where q·S ≤ 2.04·M_k (a box of the scene is at most 2·M_k wide, and a grid ends
//!   at most a 64th of that later), and one in the sum: T″ ≤ (p + q·S − o″)·r + (2.01 + 2.05 + 1.05)·u·B·r.
//! * p + q·S ≤ c, so T″ ≤ T if G ≥ 7.2·u·B = 7.2·u·M_k + 14.4·u·P. Of the 8·u·M_k in G are 0.8·u·M_k left, against
//!   14.4·u·P ≤ 116·u²·M_k + 15·u·2⁻⁴¹·M + 58·u²·|o_k|: each term is far below its own in G.
//! * Underflow makes errors below 2⁻¹²⁵, also where denormal numbers are flushed; G·r is above 2⁻⁸³ as M is at least
//!   2⁻⁴⁰. Overflow cannot be, as M is at most 2⁶⁰ and r at most 2⁶⁰. Rays of other M walk the two-wide tree, which has
//!   no such limits.
//!
//! A device that fuses the multiplication and the addition rounds once less: the bounds hold.

use super::slabs::{Frame, LocalRay};
use super::stack::{NodeGroup, Stack};
use super::triangle::REACH;
use super::walk::{RayVisitor, Visitor, is_whole, walk_nodes};
use crate::collapse::WIDTH;
use crate::wide::{WideNode, WideTree};
use core::ops::ControlFlow;
use glam::Vec3;
use rt_core::{Hit, Ray, TestCounts};

/// Bits of a word of hits that stand for nodes; the others stand for triangles.
const NODES: u32 = 0xff00_0000;

/// What the box test knows of a ray.
#[derive(Clone, Copy, Debug)]
struct WideSlabs {
    /// The origin, moved away from the planes through which the ray enters, and from those through which it leaves.
    near: Vec3,
    far: Vec3,
    reciprocal: Vec3,
    /// Whether the ray goes up along each axis.
    up: [bool; 3],
    /// A slot's number with these bits flipped is greater the earlier it is to be visited.
    flip: u32,
    tmin: f32,
}

/// Walks every ray with a visitor of its own.
pub(super) fn each<'a, V, R, S>(tree: &'a WideTree, stack: &mut Stack, rays: R, mut sink: S)
where
    V: RayVisitor<'a>,
    R: Iterator<Item = (Ray, u32)>,
    S: FnMut(Hit, TestCounts),
{
    let scene = tree.scene();
    stack.fit_wide(tree);
    let frame = Frame::of(scene);
    for (ray, excluded) in rays {
        let Some(ray) = frame.localize(&ray) else {
            sink(Hit::MISS, TestCounts::default());
            continue;
        };
        let mut visitor = V::begin(scene, ray, excluded);
        if (REACH[0]..=REACH[1]).contains(&ray.reach) {
            let slabs = WideSlabs::new(&frame, &ray);
            // The visitor leaves the loop early when it knows the answer.
            let _ = walk(tree.nodes(), &mut stack.node_groups, &slabs, &mut visitor);
        } else {
            walk_nodes(scene.nodes(), is_whole(scene.nodes()), stack, &mut visitor);
        }
        let (hit, counts) = visitor.finish();
        sink(hit, counts);
    }
}

/// Visits what the ray enters, roughly front to back.
#[inline(always)]
fn walk<V: Visitor>(
    nodes: &[WideNode],
    stack: &mut [NodeGroup],
    slabs: &WideSlabs,
    visitor: &mut V,
) -> ControlFlow<()> {
    let mut used = 0;
    // The root, as the only child of nobody.
    let mut group = NodeGroup { first: 0, bits: 1 << (24 + slabs.flip) };
    loop {
        let bit = group.bits.ilog2();
        group.bits &= !(1 << bit);
        let slot = (bit - 24) ^ slabs.flip;
        let before = (group.bits & ((1 << slot) - 1)).count_ones();
        let node = &nodes[(group.first + before) as usize];
        if group.bits & NODES != 0 {
            stack[used] = group;
            used += 1;
        }
        visitor.boxes(WIDTH as u32);
        let (hits, entry) = slabs.enter(node, visitor.limit());
        let mut triangles = hits & !NODES;
        while triangles != 0 {
            let first = triangles.trailing_zeros();
            let count = (triangles >> first).trailing_ones();
            triangles &= !(((1 << count) - 1) << first);
            visitor.leaf(entry, node.first_triangle() + first, count)?;
        }
        group = NodeGroup { first: node.first_node(), bits: hits & NODES | node.inner() };
        if group.bits & NODES == 0 {
            if used == 0 {
                return ControlFlow::Continue(());
            }
            used -= 1;
            group = stack[used];
        }
    }
}

impl WideSlabs {
    #[inline]
    fn new(frame: &Frame, ray: &LocalRay) -> Self {
        let reciprocal = ray.slabs.reciprocal();
        let padding = frame.padding(ray.origin).0 * 2.0;
        let down = reciprocal.cmplt(Vec3::ZERO);
        let (lower, upper) = (ray.origin + padding, ray.origin - padding);
        Self {
            near: Vec3::select(down, upper, lower),
            far: Vec3::select(down, lower, upper),
            reciprocal,
            up: [!down.test(0), !down.test(1), !down.test(2)],
            flip: !down.bitmask() & 7,
            tmin: ray.slabs.tmin(),
        }
    }

    /// Which children the ray enters before `limit`, as bits, and the least distance at which it enters a leaf of them.
    #[inline(always)]
    fn enter(&self, node: &WideNode, limit: f32) -> (u32, f32) {
        let mut near = [self.tmin; WIDTH];
        let mut far = [limit; WIDTH];
        for axis in 0..3 {
            let (low, high) = node.planes(axis);
            let (enters, leaves) = if self.up[axis] { (low, high) } else { (high, low) };
            let reciprocal = self.reciprocal[axis];
            let step = node.step(axis) * reciprocal;
            let near_origin = (node.origin(axis) - self.near[axis]) * reciprocal;
            let far_origin = (node.origin(axis) - self.far[axis]) * reciprocal;
            for slot in 0..WIDTH {
                let t = f32::from(enters[slot]) * step + near_origin;
                near[slot] = if t > near[slot] { t } else { near[slot] };
                let t = f32::from(leaves[slot]) * step + far_origin;
                far[slot] = if t < far[slot] { t } else { far[slot] };
            }
        }
        let (mut hits, mut entry) = (0, f32::MAX);
        for (slot, meta) in node.meta().into_iter().enumerate() {
            let meta = u32::from(meta);
            if near[slot] <= far[slot] {
                // Five bits from 24 up mean a node: its place is turned into the order of visits.
                let is_node = meta & 24 == 24;
                let place = meta & 31 ^ if is_node { self.flip } else { 0 };
                hits |= (meta >> 5) << place;
                if !is_node && meta != 0 && near[slot] < entry {
                    entry = near[slot];
                }
            }
        }
        (hits, entry)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BuildOptions, Mesh, build};
    use alloc::vec::Vec;
    use rt_core::random;

    /// A number in [−1, 1), of any size down to 2⁻²⁰ now and then.
    fn number(seed: u32, index: u32, dimension: u32) -> f32 {
        let [x, size] = random::pair(seed, index, dimension);
        (2.0 * x - 1.0) * if size < 0.3 { 1.0 / (1 << 20) as f32 } else { 1.0 }
    }

    fn point(seed: u32, index: u32) -> Vec3 {
        Vec3::new(number(seed, index, 0), number(seed, index, 1), number(seed, index, 2))
    }

    // What the derivation above claims, to the last bit. Fails when wide boxes are padded like others.
    #[test]
    fn wide_boxes_are_entered_no_later_than_what_is_in_them() {
        let (mut entered, mut level) = (0, 0);
        for scene in 0..60 {
            // So few triangles that all are the root's.
            let shift = [Vec3::ZERO, Vec3::new(1e3, 0.0, -1e5)][scene as usize % 2];
            let positions: Vec<Vec3> = (0..24).map(|i| shift + point(scene, i)).collect();
            let indices: Vec<_> = (0..8).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
            let mesh = Mesh { positions: &positions, indices: &indices };
            let tree = WideTree::new(&build(mesh, &BuildOptions::default()).expect("valid").scene);
            assert_eq!(tree.nodes().len(), 1);
            let frame = Frame::of(tree.scene());
            for i in 0..500 {
                let origin = shift + point(scene, 1_000 + i) * [1.0, 30.0][i as usize % 2];
                let target = positions[i as usize % positions.len()];
                let Some(ray) = frame.localize(&Ray::new(origin, target - origin)) else { continue };
                let (hits, entry) = WideSlabs::new(&frame, &ray).enter(&tree.nodes()[0], f32::MAX);
                for (slot, triangle) in tree.scene().triangles().iter().enumerate() {
                    if let Some(near) = ray.slabs.enter(&triangle.bounds(), f32::MAX) {
                        assert!(hits >> slot & 1 == 1 && entry <= near, "{scene}, {i}: {entry} {near}");
                        entered += 1;
                        level += u32::from(entry > 0.0 && near - entry < 1e-5 * near);
                    }
                }
            }
        }
        // Planes that bound node and triangle alike are where it matters.
        assert!(entered > 10_000 && level > 100, "{entered} {level}");
    }
}
