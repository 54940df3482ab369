//! Tracing rays: what is asked, and the choice of the kernel that answers.
//!
//! # Why hits do not depend on the tree
//!
//! Whether a ray hits a triangle, and at which distance, is defined by exact arithmetic ([`rt_core::intersect`]), and
//! no box has a say in it. Where there is a hit, the ray enters the triangle's own box before any limit that would
//! still let the hit improve the result: the box test is padded beyond all rounding errors (see `slabs`). Every box
//! above the triangle contains that one, and the box test is monotone: so the ray enters those, too. So a traversal
//! finds exactly the triangles that a test of all of them would find, whatever tree it walks.
//!
//! Boxes are tested alike in every precision: once padded, the careful test costs no more than the plain one. Single
//! precision ([`Precision::Fast`]) has hits that do not exist, and then promises nothing of the kind.

pub mod kernel_io;
mod several;
mod slabs;
mod stack;
mod triangle;
mod visitor;
mod walk;
mod wide;

pub use several::trace_several;
pub use stack::Stack;

use crate::wide::WideTree;
use rt_core::{Hit, Precision, Query, Ray, ReducedWalk, Scene, StreamSpec, TestCounts, Walk};
use triangle::{Double, Fast, Robust, TriangleTest};
use visitor::{Nearest, Reduced};
use walk::RayVisitor;

/// Traces rays and hands each one's hit to `sink`, in order.
///
/// Beside each ray stands the primitive it starts on, which it never hits (`u32::MAX`: none). The counts are zero
/// unless `spec.counts` asks for them. An invalid ray (see [`Ray::is_valid`]) misses with zero counts.
///
/// With [`Query::Closest`] ties go to the lowest primitive id. With [`Query::Any`] the hit is one of the candidates.
/// With [`Query::All`] it is the nearest: [`trace_several`] finds the others as well.
pub fn trace<R, S>(scene: &Scene, stack: &mut Stack, spec: StreamSpec, rays: R, mut sink: S)
where
    R: Iterator<Item = (Ray, u32)>,
    S: FnMut(Hit, TestCounts),
{
    if scene.hides(spec.mask) {
        // Nobody but such a stream pays for masks: the kernels below know none.
        let query = if spec.query == Query::Any { Query::Any } else { Query::Closest };
        trace_several(scene, stack, StreamSpec { query, ..spec }, rays, |hits, counts| sink(hits[0], counts));
    } else {
        trace_over(scene, stack, spec, rays, sink);
    }
}

/// [`trace`] over the wide layout: the same hits, other counts, and with [`Query::Any`] maybe another of the
/// candidates. It knows no masks: [`Scene::hides`] tells whether a stream needs them.
pub fn trace_wide<R, S>(tree: &WideTree, stack: &mut Stack, spec: StreamSpec, rays: R, sink: S)
where
    R: Iterator<Item = (Ray, u32)>,
    S: FnMut(Hit, TestCounts),
{
    trace_over(tree, stack, spec, rays, sink);
}

/// Counts the tests of rays and hands them to `sink`, in order.
///
/// A visited node costs two box tests, one where a child is absent; a leaf costs as many triangle tests as it holds
/// triangles. [`Walk::Full`] finds the nearest hit as well: its counts and hits are those of [`trace`]. Reduced walks
/// touch no triangle and always report [`Hit::MISS`]; `precision` means nothing to them.
pub fn count<R, S>(scene: &Scene, stack: &mut Stack, walk: Walk, precision: Precision, rays: R, sink: S)
where
    R: Iterator<Item = (Ray, u32)>,
    S: FnMut(Hit, TestCounts),
{
    count_over(scene, stack, walk, precision, rays, sink);
}

/// [`count`] over the wide layout: a visited node costs eight box tests, whatever is in its slots. Where leaves are
/// taken for hits, those of one node are entered at once, and the nearest one cuts the ray.
pub fn count_wide<R, S>(tree: &WideTree, stack: &mut Stack, walk: Walk, precision: Precision, rays: R, sink: S)
where
    R: Iterator<Item = (Ray, u32)>,
    S: FnMut(Hit, TestCounts),
{
    count_over(tree, stack, walk, precision, rays, sink);
}

/// A tree that visitors can be sent through.
trait Layout {
    /// Walks every ray with a visitor of its own.
    fn each<'a, V, R, S>(&'a self, stack: &mut Stack, rays: R, sink: S)
    where
        V: RayVisitor<'a>,
        R: Iterator<Item = (Ray, u32)>,
        S: FnMut(Hit, TestCounts);
}

impl Layout for Scene {
    fn each<'a, V, R, S>(&'a self, stack: &mut Stack, rays: R, sink: S)
    where
        V: RayVisitor<'a>,
        R: Iterator<Item = (Ray, u32)>,
        S: FnMut(Hit, TestCounts),
    {
        walk::each::<V, R, S>(self, stack, rays, sink);
    }
}

impl Layout for WideTree {
    fn each<'a, V, R, S>(&'a self, stack: &mut Stack, rays: R, sink: S)
    where
        V: RayVisitor<'a>,
        R: Iterator<Item = (Ray, u32)>,
        S: FnMut(Hit, TestCounts),
    {
        wide::each::<V, R, S>(self, stack, rays, sink);
    }
}

#[inline(always)]
fn trace_over<L, R, S>(layout: &L, stack: &mut Stack, spec: StreamSpec, rays: R, sink: S)
where
    L: Layout,
    R: Iterator<Item = (Ray, u32)>,
    S: FnMut(Hit, TestCounts),
{
    match spec.precision {
        Precision::Robust => trace_with::<Robust, L, R, S>(layout, stack, spec.query, spec.counts, rays, sink),
        Precision::Fast => trace_with::<Fast, L, R, S>(layout, stack, spec.query, spec.counts, rays, sink),
        Precision::Double => trace_with::<Double, L, R, S>(layout, stack, spec.query, spec.counts, rays, sink),
    }
}

#[inline(always)]
fn count_over<L, R, S>(layout: &L, stack: &mut Stack, walk: Walk, precision: Precision, rays: R, sink: S)
where
    L: Layout,
    R: Iterator<Item = (Ray, u32)>,
    S: FnMut(Hit, TestCounts),
{
    match walk {
        Walk::Full => {
            trace_over(layout, stack, StreamSpec::new(Query::Closest, precision, true), rays, sink);
        }
        Walk::Reduced(ReducedWalk::LeafAsHit) => layout.each::<Reduced<true>, R, S>(stack, rays, sink),
        Walk::Reduced(ReducedWalk::Unshortened) => layout.each::<Reduced<false>, R, S>(stack, rays, sink),
    }
}

/// Chooses the kernel, once per batch.
#[inline(always)]
fn trace_with<T, L, R, S>(layout: &L, stack: &mut Stack, query: Query, counts: bool, rays: R, sink: S)
where
    T: TriangleTest,
    L: Layout,
    R: Iterator<Item = (Ray, u32)>,
    S: FnMut(Hit, TestCounts),
{
    match (query, counts) {
        (Query::Closest | Query::All { .. }, false) => layout.each::<Nearest<T, false, false>, R, S>(stack, rays, sink),
        (Query::Closest | Query::All { .. }, true) => layout.each::<Nearest<T, false, true>, R, S>(stack, rays, sink),
        (Query::Any, false) => layout.each::<Nearest<T, true, false>, R, S>(stack, rays, sink),
        (Query::Any, true) => layout.each::<Nearest<T, true, true>, R, S>(stack, rays, sink),
    }
}
