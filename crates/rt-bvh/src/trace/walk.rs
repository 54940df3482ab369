//! The traversal loop.

use super::slabs::{Frame, LocalRay};
use super::stack::{Pending, Stack};
use core::ops::ControlFlow;
use rt_core::{Child, Hit, Node, Ray, Scene, TestCounts};

/// What a traversal does along its way. Every kind of traversal is one of these over the same loop.
pub(super) trait Visitor {
    /// The ray.
    fn ray(&self) -> &LocalRay;

    /// So many boxes are tested.
    fn boxes(&mut self, count: u32);

    /// Boxes entered beyond this local distance are passed by.
    fn limit(&self) -> f32;

    /// The ray entered the box of the leaf that holds triangles `first .. first + count`, at local distance `entry`.
    /// `Break` ends the ray.
    fn leaf(&mut self, entry: f32, first: u32, count: u32) -> ControlFlow<()>;
}

/// A visitor that a ray and the scene make, and that finds one hit at most.
pub(super) trait RayVisitor<'a>: Visitor + Sized {
    /// Begins a ray that must not hit the primitive `excluded`.
    fn begin(scene: &'a Scene, ray: LocalRay, excluded: u32) -> Self;

    /// Ends a ray.
    fn finish(self) -> (Hit, TestCounts);
}

/// Walks every ray through the scene's tree with a visitor of its own.
pub(super) fn each<'a, V, R, S>(scene: &'a Scene, stack: &mut Stack, rays: R, mut sink: S)
where
    V: RayVisitor<'a>,
    R: Iterator<Item = (Ray, u32)>,
    S: FnMut(Hit, TestCounts),
{
    stack.fit(scene);
    let (frame, nodes, whole) = (Frame::of(scene), scene.nodes(), is_whole(scene.nodes()));
    for (ray, excluded) in rays {
        let Some(ray) = frame.localize(&ray) else {
            sink(Hit::MISS, TestCounts::default());
            continue;
        };
        let mut visitor = V::begin(scene, ray, excluded);
        walk_nodes(nodes, whole, stack, &mut visitor);
        let (hit, counts) = visitor.finish();
        sink(hit, counts);
    }
}

/// Whether the root has both children.
pub(super) fn is_whole(nodes: &[Node]) -> bool {
    (0..2).all(|side| nodes[0].child(side) != Child::Absent)
}

/// Walks one ray. The stack fits the tree; `whole` is what [`is_whole`] says of it, asked once for all rays.
#[inline(always)]
pub(super) fn walk_nodes<V: Visitor>(nodes: &[Node], whole: bool, stack: &mut Stack, visitor: &mut V) {
    let start = if whole { Some(Pending::ROOT) } else { enter_part(&nodes[0], visitor) };
    if let Some(start) = start {
        // The visitor leaves the loop early when it knows the answer.
        let _ = walk(nodes, &mut stack.entries, start, visitor);
    }
}

/// Enters a root that lacks a child: the loop below trusts that every node has two.
fn enter_part<V: Visitor>(root: &Node, visitor: &mut V) -> Option<Pending> {
    let side = (0..2).find(|&side| root.child(side) != Child::Absent)?;
    visitor.boxes(1);
    let entry = visitor.ray().slabs.enter(&root.bounds[side], visitor.limit())?;
    Some(Pending { child: root.child[side], count: root.count[side], entry })
}

/// Visits what the ray enters, front to back.
#[inline(always)]
pub(super) fn walk<V: Visitor>(
    nodes: &[Node],
    stack: &mut [Pending],
    start: Pending,
    visitor: &mut V,
) -> ControlFlow<()> {
    // A copy, so that the compiler knows that visiting a leaf does not change it.
    let slabs = visitor.ray().slabs;
    let mut used = 0;
    let mut next = start;
    loop {
        if next.count == 0 {
            let node = &nodes[next.child as usize];
            visitor.boxes(2);
            let pending = |side: usize, entry| Pending { child: node.child[side], count: node.count[side], entry };
            match slabs.enter_children(node, visitor.limit()) {
                [Some(a), Some(b)] => {
                    let (near, far) =
                        if a <= b { (pending(0, a), pending(1, b)) } else { (pending(1, b), pending(0, a)) };
                    stack[used] = far;
                    used += 1;
                    next = near;
                    continue;
                }
                [Some(a), None] => {
                    next = pending(0, a);
                    continue;
                }
                [None, Some(b)] => {
                    next = pending(1, b);
                    continue;
                }
                [None, None] => {}
            }
        } else {
            visitor.leaf(next.entry, next.child, next.count)?;
        }
        // The limit may have come down since a child was left behind.
        loop {
            if used == 0 {
                return ControlFlow::Continue(());
            }
            used -= 1;
            next = stack[used];
            if next.entry <= visitor.limit() {
                break;
            }
        }
    }
}
