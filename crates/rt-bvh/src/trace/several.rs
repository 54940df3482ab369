//! Several hits of a ray, and hits among what a mask shows.
//!
//! One traversal does both, beside those that find one hit among all: it keeps a list and asks for masks, which nobody
//! else has to pay for. The list is the nearest hit made long: what is beyond its last place is passed by, once all
//! places are taken. So the hits are those of a test of every triangle, for the reason that the module above gives, and
//! with one place and no mask they are those of [`trace`](super::trace()), in as many tests.

use super::slabs::{Frame, LocalRay};
use super::stack::Stack;
use super::triangle::{Double, Fast, Robust, TriangleTest};
use super::walk::{Visitor, is_whole, walk_nodes};
use alloc::vec;
use core::ops::ControlFlow;
use rt_core::{Hit, Precision, Query, Ray, Scene, StreamSpec, TestCounts};

/// Traces rays and hands the hits of each to `sink`, in order: [`Query::hits_per_ray`] places, those beyond a ray's
/// hits misses. Rays pass by what `spec.mask` hides.
///
/// Beside each ray stands the primitive that it starts on, which it never hits (`u32::MAX`: none). The counts are zero
/// unless `spec.counts` asks for them. An invalid ray (see [`Ray::is_valid`]) misses with zero counts.
pub fn trace_several<R, S>(scene: &Scene, stack: &mut Stack, spec: StreamSpec, rays: R, sink: S)
where
    R: Iterator<Item = (Ray, u32)>,
    S: FnMut(&[Hit], TestCounts),
{
    match spec.precision {
        Precision::Robust => each::<Robust, R, S>(scene, stack, spec, rays, sink),
        Precision::Fast => each::<Fast, R, S>(scene, stack, spec, rays, sink),
        Precision::Double => each::<Double, R, S>(scene, stack, spec, rays, sink),
    }
}

fn each<T, R, S>(scene: &Scene, stack: &mut Stack, spec: StreamSpec, rays: R, mut sink: S)
where
    T: TriangleTest,
    R: Iterator<Item = (Ray, u32)>,
    S: FnMut(&[Hit], TestCounts),
{
    stack.fit(scene);
    let (frame, nodes, whole) = (Frame::of(scene), scene.nodes(), is_whole(scene.nodes()));
    let mut hits = vec![Hit::MISS; spec.query.hits_per_ray()];
    let mut found = 0;
    for (ray, excluded) in rays {
        hits[..found].fill(Hit::MISS);
        found = 0;
        let mut counts = TestCounts::default();
        if let Some(ray) = frame.localize(&ray) {
            let (test, limit) = (T::new(&ray), ray.local_limit(ray.given.tmax));
            let ends = spec.query == Query::Any;
            let mut visitor =
                Several { test, scene, ray, excluded, mask: spec.mask, ends, hits: &mut hits, found, limit, counts };
            walk_nodes(nodes, whole, stack, &mut visitor);
            (found, counts) = (visitor.found, visitor.counts);
        }
        sink(&hits, if spec.counts { counts } else { TestCounts::default() });
    }
}

/// Finds the nearest hits among what a mask shows, as many as there are places; or some hit.
struct Several<'a, T> {
    test: T,
    scene: &'a Scene,
    ray: LocalRay,
    excluded: u32,
    mask: u32,
    /// Whether the first hit that is met ends the ray.
    ends: bool,
    /// In order; places without a hit are misses, which are behind all hits. At least one.
    hits: &'a mut [Hit],
    /// How many places have a hit.
    found: usize,
    /// Local distance beyond which no hit has a place.
    limit: f32,
    counts: TestCounts,
}

impl<T: TriangleTest> Visitor for Several<'_, T> {
    #[inline(always)]
    fn ray(&self) -> &LocalRay {
        &self.ray
    }

    #[inline(always)]
    fn boxes(&mut self, count: u32) {
        self.counts.boxes += count;
    }

    #[inline(always)]
    fn limit(&self) -> f32 {
        self.limit
    }

    #[inline]
    fn leaf(&mut self, _entry: f32, first: u32, count: u32) -> ControlFlow<()> {
        let Self { test, scene, ray, excluded, mask, ends, hits, found, limit, counts } = self;
        let triangles = &scene.triangles()[first as usize..][..count as usize];
        let mut tests = count;
        let flow = test.leaf(triangles, |i, met| {
            let slot = first as usize + i;
            let primitive = scene.primitives().get(slot);
            if primitive == *excluded || !scene.shows(primitive, *mask) {
                return ControlFlow::Continue(());
            }
            let last = hits[hits.len() - 1];
            let tmax = last.t.min(ray.given.tmax);
            let hit = test.resolve(met, &scene.triangles()[slot], [ray.given.tmin, tmax], primitive);
            let Some(hit) = hit.filter(|hit| hit.is_before(&last)) else { return ControlFlow::Continue(()) };
            *found = hits.len().min(*found + 1);
            let place = hits[..*found].partition_point(|other| other.is_before(&hit));
            hits[place..*found].rotate_right(1);
            hits[place] = hit;
            *limit = ray.local_limit(hits[hits.len() - 1].t.min(ray.given.tmax));
            if *ends {
                tests = i as u32 + 1;
                return ControlFlow::Break(());
            }
            ControlFlow::Continue(())
        });
        counts.triangles += tests;
        flow
    }
}
