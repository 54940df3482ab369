//! The visitors: what a traversal is for.

use super::slabs::LocalRay;
use super::triangle::TriangleTest;
use super::walk::Visitor;
use core::ops::ControlFlow;
use rt_core::{Hit, Scene, TestCounts};

/// Finds the nearest hit, or with `ANY` whether there is one; counts tests with `COUNT`.
pub(super) struct Nearest<'a, T, const ANY: bool, const COUNT: bool> {
    scene: &'a Scene,
    ray: LocalRay,
    excluded: u32,
    test: T,
    best: Hit,
    /// Local distance of `best`.
    limit: f32,
    counts: TestCounts,
}

impl<T, const ANY: bool, const COUNT: bool> Nearest<'_, T, ANY, COUNT> {
    /// The tests so far.
    pub(super) const fn counts(&self) -> TestCounts {
        self.counts
    }
}

impl<'a, T: TriangleTest, const ANY: bool, const COUNT: bool> Visitor<'a> for Nearest<'a, T, ANY, COUNT> {
    type Data = Scene;

    #[inline]
    fn begin(scene: &'a Scene, ray: LocalRay, excluded: u32) -> Self {
        let (test, limit) = (T::new(&ray), ray.local_distance(ray.given.tmax));
        Self { scene, ray, excluded, test, best: Hit::MISS, limit, counts: TestCounts::default() }
    }

    #[inline(always)]
    fn ray(&self) -> &LocalRay {
        &self.ray
    }

    #[inline(always)]
    fn boxes(&mut self, count: u32) {
        if COUNT {
            self.counts.boxes += count;
        }
    }

    #[inline(always)]
    fn limit(&self) -> f32 {
        self.limit
    }

    #[inline(always)]
    fn leaf(&mut self, _entry: f32, first: u32, count: u32) -> ControlFlow<()> {
        let Self { scene, ray, excluded, test, best, limit, counts } = self;
        let triangles = &scene.triangles()[first as usize..][..count as usize];
        let mut tests = count;
        let flow = test.leaf(triangles, |i, intersection| {
            let primitive = scene.primitives().get(first as usize + i);
            let Some(hit) = intersection.to_hit(test.t_scale(), ray.given.tmin, ray.given.tmax, primitive) else {
                return ControlFlow::Continue(());
            };
            if !hit.is_before(best) || primitive == *excluded {
                return ControlFlow::Continue(());
            }
            let t = ray.local_distance(hit.t);
            if T::GATED && ray.slabs.enter(&triangles[i].bounds(), t).is_none() {
                return ControlFlow::Continue(());
            }
            (*best, *limit) = (hit, t);
            if ANY {
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

    #[inline]
    fn finish(self) -> (Hit, TestCounts) {
        (self.best, self.counts)
    }
}

/// Counts tests and touches no triangle; with `CUT` it takes the first leaf it enters for a hit.
pub(super) struct Reduced<const CUT: bool> {
    ray: LocalRay,
    limit: f32,
    counts: TestCounts,
}

impl<'a, const CUT: bool> Visitor<'a> for Reduced<CUT> {
    type Data = Scene;

    #[inline]
    fn begin(_scene: &'a Scene, ray: LocalRay, _excluded: u32) -> Self {
        Self { limit: ray.local_distance(ray.given.tmax), ray, counts: TestCounts::default() }
    }

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

    #[inline]
    fn finish(self) -> (Hit, TestCounts) {
        (Hit::MISS, self.counts)
    }
}
