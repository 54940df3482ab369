//! The visitors: what a traversal is for.

use super::slabs::LocalRay;
use super::triangle::TriangleTest;
use super::walk::{RayVisitor, Visitor};
use core::ops::ControlFlow;
use rt_core::intersect::Intersection;
use rt_core::{Hit, Scene, TestCounts};

/// Finds the nearest hit, or with `ANY` whether there is one; counts tests with `COUNT`.
pub(super) struct Nearest<'a, T, const ANY: bool, const COUNT: bool> {
    test: T,
    found: Found<'a>,
    counts: TestCounts,
}

/// What a ray has met so far.
struct Found<'a> {
    scene: &'a Scene,
    ray: LocalRay,
    excluded: u32,
    best: Hit,
    /// Local distance of `best`.
    limit: f32,
}

impl Found<'_> {
    /// Notes that `test` lets the ray's line meet triangle `slot`; whether that is the best hit so far.
    #[inline(always)]
    fn meet<T: TriangleTest>(&mut self, test: &T, slot: usize, intersection: &Intersection) -> bool {
        let Self { scene, ray, excluded, best, limit } = self;
        let primitive = scene.primitives().get(slot);
        if primitive == *excluded {
            return false;
        }
        let tmax = if best.t < ray.given.tmax { best.t } else { ray.given.tmax };
        let Some(hit) = test.resolve(intersection, &scene.triangles()[slot], [ray.given.tmin, tmax], primitive) else {
            return false;
        };
        if !hit.is_before(best) {
            return false;
        }
        (*best, *limit) = (hit, ray.local_limit(hit.t));
        true
    }
}

impl<T: TriangleTest, const ANY: bool, const COUNT: bool> Visitor for Nearest<'_, T, ANY, COUNT> {
    #[inline(always)]
    fn ray(&self) -> &LocalRay {
        &self.found.ray
    }

    #[inline(always)]
    fn boxes(&mut self, count: u32) {
        if COUNT {
            self.counts.boxes += count;
        }
    }

    #[inline(always)]
    fn limit(&self) -> f32 {
        self.found.limit
    }

    #[inline(always)]
    fn leaf(&mut self, _entry: f32, first: u32, count: u32) -> ControlFlow<()> {
        let Self { test, found, counts } = self;
        let triangles = &found.scene.triangles()[first as usize..][..count as usize];
        let mut tests = count;
        let flow = test.leaf(triangles, |i, intersection| {
            if found.meet(test, first as usize + i, intersection) && ANY {
                tests = i as u32 + 1;
                return ControlFlow::Break(());
            }
            ControlFlow::Continue(())
        });
        if COUNT {
            counts.triangles += tests;
        }
        flow
    }
}

impl<'a, T: TriangleTest, const ANY: bool, const COUNT: bool> RayVisitor<'a> for Nearest<'a, T, ANY, COUNT> {
    #[inline]
    fn begin(scene: &'a Scene, ray: LocalRay, excluded: u32) -> Self {
        let (test, limit) = (T::new(&ray), ray.local_limit(ray.given.tmax));
        Self { test, found: Found { scene, ray, excluded, best: Hit::MISS, limit }, counts: TestCounts::default() }
    }

    #[inline]
    fn finish(self) -> (Hit, TestCounts) {
        (self.found.best, self.counts)
    }
}

/// Counts tests and touches no triangle; with `CUT` it takes the first leaf it enters for a hit.
pub(super) struct Reduced<const CUT: bool> {
    ray: LocalRay,
    limit: f32,
    counts: TestCounts,
}

impl<const CUT: bool> Visitor for Reduced<CUT> {
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

    #[inline(always)]
    fn leaf(&mut self, entry: f32, _first: u32, count: u32) -> ControlFlow<()> {
        self.counts.triangles += count;
        // Leaves are entered before the limit, so this never raises it.
        if CUT {
            self.limit = entry;
        }
        ControlFlow::Continue(())
    }
}

impl<'a, const CUT: bool> RayVisitor<'a> for Reduced<CUT> {
    #[inline]
    fn begin(_scene: &'a Scene, ray: LocalRay, _excluded: u32) -> Self {
        Self { limit: ray.local_limit(ray.given.tmax), ray, counts: TestCounts::default() }
    }

    #[inline]
    fn finish(self) -> (Hit, TestCounts) {
        (Hit::MISS, self.counts)
    }
}
