//! A device without hardware, and its broken sisters: proof that the conformance suite can fail.

use glam::Vec3;
use rt_bvh::{Stack, WideTree};
use rt_core::arguments::check_spec;
use rt_core::intersect::{Shear, round_distance, shear_axes};
use rt_core::{
    Capabilities, Clock, Counted, Device, DeviceError, DeviceErrorKind, DeviceInfo, Hit, Launch, Precision, Query, Ray,
    RayMask, RaySource, Scene, Span, StreamSpec, Task, TestCounts, Ticket, Tracer, Triangle, Walk,
};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

/// One mistake a backend might make.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Flaw {
    /// Everything misses.
    Misses,
    /// Of tied hits, not the one with the lowest id.
    WrongTie,
    /// The primitive a ray starts on is hit.
    IgnoresOrigins,
    /// `tmax` is taken for infinity.
    IgnoresLimit,
    /// Rays marked as done are traced.
    IgnoresMask,
    /// The last ray of each task misses.
    LosesLastRay,
    /// Results come in the order of the rays, not of the tasks.
    SortsTasks,
    /// One box test too many.
    Miscounts,
    /// `t` off by one unit in the last place.
    Imprecise,
    /// Rays loaded later are ignored.
    KeepsFirstRays,
    /// Tasks beyond the rays are cut to fit.
    AcceptsAnyTask,
    /// More launches than were announced are taken.
    AcceptsAnyNumber,
    /// Results of the launch before.
    Lags,
    /// Times on another clock.
    WrongClock,
    /// Results are added to what is in the buffer.
    Appends,
    /// Every ray is normalised in single precision first.
    Normalizes,
    /// One of the three edges of a triangle does not belong to it: `>` for `≥`.
    OpenEdge,
    /// One edge function has the wrong sign.
    FlippedSign,
    /// What is met a little before `tmin` counts too.
    Thick,
    /// Hits nearer than a ten-thousandth of a unit do not count, whatever the unit.
    AbsoluteEpsilon,
    /// Rays that are not valid hit primitive 0.
    AcceptsInvalid,
    /// Primitive ids pass through single precision.
    RoundedIds,
    /// Edge functions in double precision are trusted, however small.
    TrustsRoundings,
    /// Coordinates below 2⁻¹²⁶ of the largest are taken for zero, as where a scene is normalised whatever it costs.
    LosesDetails,
    /// A surface that a ray starts on is not hit.
    SkipsZero,
    /// Counts, walks, and precisions but the robust one are refused.
    RefusesExtras,
    /// Of several hits of a ray the first two change places.
    Unsorted,
    /// Primitives that a mask hides are hit.
    SeesHidden,
    /// Walks know no masks.
    WalksSeeHidden,
    /// Walks of several hits cost what the nearest does.
    WalksEndAtNearest,
}

impl Flaw {
    /// All of them.
    pub const ALL: [Self; 30] = [
        Self::Misses,
        Self::WrongTie,
        Self::IgnoresOrigins,
        Self::IgnoresLimit,
        Self::IgnoresMask,
        Self::LosesLastRay,
        Self::SortsTasks,
        Self::Miscounts,
        Self::Imprecise,
        Self::KeepsFirstRays,
        Self::AcceptsAnyTask,
        Self::AcceptsAnyNumber,
        Self::Lags,
        Self::WrongClock,
        Self::Appends,
        Self::Normalizes,
        Self::OpenEdge,
        Self::FlippedSign,
        Self::Thick,
        Self::AbsoluteEpsilon,
        Self::AcceptsInvalid,
        Self::RoundedIds,
        Self::TrustsRoundings,
        Self::LosesDetails,
        Self::SkipsZero,
        Self::RefusesExtras,
        Self::Unsorted,
        Self::SeesHidden,
        Self::WalksSeeHidden,
        Self::WalksEndAtNearest,
    ];
}

/// The smallest correct device: `rt_bvh` on the calling thread. Or one with a [`Flaw`].
#[derive(Clone, Debug)]
pub struct FakeDevice {
    info: DeviceInfo,
    flaw: Option<Flaw>,
    wide: bool,
}

impl FakeDevice {
    /// Keeps every promise.
    #[must_use]
    pub fn honest() -> Self {
        Self::new(None)
    }

    /// Keeps every promise about hits; traces and counts over the eight-wide layout, so that counts are another one's.
    #[must_use]
    pub fn wide() -> Self {
        let device = Self::new(None);
        let own = Capabilities::UNKNOWN.with_counts(Counted::OwnTree).with_defined_bits();
        let info = DeviceInfo::new("eight-wide", "fake").with_in_flight(2).with_capabilities(own);
        Self { info, wide: true, ..device }
    }

    /// Does everything but tracing: all rays miss.
    #[must_use]
    pub fn null() -> Self {
        Self::flawed(Flaw::Misses)
    }

    /// Makes one mistake.
    #[must_use]
    pub fn flawed(flaw: Flaw) -> Self {
        Self::new(Some(flaw))
    }

    /// The same device, that says this of itself.
    #[must_use]
    pub fn saying(mut self, capabilities: Capabilities) -> Self {
        self.info = self.info.with_capabilities(capabilities);
        self
    }

    fn new(flaw: Option<Flaw>) -> Self {
        let name = flaw.map_or_else(|| "honest".to_owned(), |flaw| format!("{flaw:?}"));
        let capabilities = Capabilities::UNKNOWN.with_counts(Counted::SceneTree).with_defined_bits();
        let capabilities = capabilities.with_all_hits().with_masks();
        let info = DeviceInfo::new(name, "fake").with_in_flight(2).with_capabilities(capabilities);
        Self { info, flaw, wide: false }
    }
}

impl Device for FakeDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn tracer(&self, scene: Arc<Scene>, clock: Clock) -> Result<Box<dyn Tracer>, DeviceError> {
        Ok(Box::new(FakeTracer {
            wide: self.wide.then(|| WideTree::new(&scene)),
            scene,
            clock,
            capabilities: self.info.capabilities,
            flaw: self.flaw,
            source: RaySource::Explicit { rays: [].into(), origins: None },
            spec: StreamSpec::default(),
            loaded: false,
            tickets: 0,
            in_flight: VecDeque::new(),
            last: Vec::new(),
        }))
    }
}

#[derive(Debug)]
struct FakeTracer {
    scene: Arc<Scene>,
    /// What is walked instead of the scene's own tree.
    wide: Option<WideTree>,
    clock: Clock,
    capabilities: Capabilities,
    flaw: Option<Flaw>,
    source: RaySource,
    spec: StreamSpec,
    loaded: bool,
    tickets: u64,
    in_flight: VecDeque<(Ticket, Launch)>,
    /// Hits of the launch before.
    last: Vec<Hit>,
}

fn invalid<T>(message: &str) -> Result<T, DeviceError> {
    Err(DeviceError::new(DeviceErrorKind::InvalidArgument, message))
}

impl FakeTracer {
    fn has(&self, flaw: Flaw) -> bool {
        self.flaw == Some(flaw)
    }

    fn timed<R>(&self, work: impl FnOnce() -> R) -> (R, Span) {
        let start = (self.clock)();
        let result = work();
        let mut end = (self.clock)();
        if self.has(Flaw::WrongClock) {
            end += Duration::from_secs(1);
        }
        (result, Span { start, end, in_kernel: end.saturating_sub(start) })
    }

    /// Traces one ray, with the flaws that are a ray's own.
    fn ray(&self, stack: &mut Stack, index: u32, walk: Option<Walk>) -> (Hit, TestCounts) {
        let (mut ray, mut origin) = self.source.ray(index);
        if self.has(Flaw::IgnoresOrigins) {
            origin = u32::MAX;
        }
        if self.has(Flaw::IgnoresLimit) && ray.tmin <= ray.tmax {
            ray.tmax = f32::INFINITY;
        }
        if self.has(Flaw::Normalizes) {
            ray.direction = ray.direction.normalize();
        }
        if self.has(Flaw::Thick) {
            ray.tmin -= 1e-3;
        }
        if self.has(Flaw::AbsoluteEpsilon) {
            ray.tmin = ray.tmin.max(1e-4);
        }
        let (mut hit, mut counts) = self.once(stack, ray, origin, walk);
        match self.flaw {
            // The other triangle of the edge, which has its own open edge, or what is behind.
            Some(Flaw::OpenEdge) if hit.v == 0.0 && hit.is_hit() => {
                let (other, _) = self.once(stack, ray, hit.primitive, walk);
                hit = if other.v == 0.0 { Hit::MISS } else { other };
            }
            Some(Flaw::FlippedSign) => hit = self.mirrored(&ray, origin),
            Some(Flaw::TrustsRoundings) => hit = self.roughly(&ray, origin),
            Some(Flaw::LosesDetails) => hit = self.coarsely(&ray, origin),
            Some(Flaw::SkipsZero) if hit.is_hit() && hit.t == 0.0 => {
                let beyond = Ray { tmin: f32::from_bits(1), ..ray };
                (hit, _) = self.once(stack, beyond, origin, walk);
            }
            Some(Flaw::AcceptsInvalid) if !ray.is_valid() => hit = Hit { t: 0.0, u: 0.0, v: 0.0, primitive: 0 },
            Some(Flaw::RoundedIds) if hit.is_hit() => hit.primitive = hit.primitive as f32 as u32,
            Some(Flaw::Misses) => hit = Hit::MISS,
            Some(Flaw::Miscounts) => counts.boxes += 1,
            Some(Flaw::Imprecise) if hit.is_hit() => hit.t = hit.t.next_up(),
            Some(Flaw::WrongTie) if hit.is_hit() && self.spec.query == Query::Closest => {
                // Leave the winner out: if another one is as near, report that.
                let (other, _) = self.once(stack, ray, hit.primitive, walk);
                if other.t == hit.t {
                    hit = other;
                }
            }
            _ => {}
        }
        (hit, counts)
    }

    /// The nearest hit where the third edge function has the wrong sign: instead of a triangle, what lies beyond its
    /// edge opposite the first vertex is hit.
    fn mirrored(&self, ray: &Ray, origin: u32) -> Hit {
        let shear = Shear::new(ray, self.scene.scale_exponent(), f64::INFINITY);
        self.nearest(ray, origin, |triangle, primitive| {
            // The mirror image of the first vertex stands for the other side of the edge.
            let [a, b, c] = triangle.vertices();
            shear.hit(&Triangle::new(b + c - a, b, c), [ray.tmin, ray.tmax], primitive)
        })
    }

    /// The nearest hit by sheared edge functions in double precision as they come, without a bound on their errors.
    fn roughly(&self, ray: &Ray, origin: u32) -> Hit {
        let scale = 2.0_f64.powi(self.scene.scale_exponent());
        let (o, d) = (ray.origin.as_dvec3() / scale, ray.direction.as_dvec3());
        let [x, y, z] = shear_axes(ray.direction);
        let slopes = [d[x] / d[z], d[y] / d[z]];
        self.nearest(ray, origin, |triangle, primitive| {
            let [a, b, c] = triangle.vertices().map(|p| {
                let p = p.as_dvec3() - o;
                [p[x] - slopes[0] * p[z], p[y] - slopes[1] * p[z], p[z]]
            });
            let edge = |p: [f64; 3], q: [f64; 3]| q[0] * p[1] - q[1] * p[0];
            let edges = [edge(b, c), edge(c, a), edge(a, b)];
            let determinant = edges.iter().sum::<f64>();
            let one_sign = edges.iter().all(|e| *e >= 0.0) || edges.iter().all(|e| *e <= 0.0);
            let depth = edges[0] * a[2] + edges[1] * b[2] + edges[2] * c[2];
            let t = round_distance(depth / determinant / d[z] * scale);
            let [_, u, v] = edges.map(|edge| (edge / determinant) as f32);
            let met = one_sign && determinant != 0.0 && ray.tmin <= t && t <= ray.tmax && t.is_finite();
            met.then_some(Hit { t, u, v, primitive })
        })
    }

    /// The nearest hit with triangles whose small coordinates are lost.
    fn coarsely(&self, ray: &Ray, origin: u32) -> Hit {
        let (shear, bounds) = (Shear::new(ray, self.scene.scale_exponent(), f64::INFINITY), self.scene.bounds());
        let least = bounds.min.abs().max(bounds.max.abs()).max_element() * f32::MIN_POSITIVE;
        let coarse = |p: Vec3| Vec3::select(p.abs().cmplt(Vec3::splat(least)), Vec3::ZERO, p);
        self.nearest(ray, origin, |triangle, primitive| {
            let [a, b, c] = triangle.vertices().map(coarse);
            shear.hit(&Triangle::new(a, b, c), [ray.tmin, ray.tmax], primitive)
        })
    }

    /// The nearest of what `hit` says of every triangle, in the coordinates of the tree.
    fn nearest(&self, ray: &Ray, origin: u32, hit: impl Fn(&Triangle, u32) -> Option<Hit>) -> Hit {
        let triangles = self.scene.triangles().iter().enumerate().filter(|_| ray.is_valid());
        let hits = triangles.filter_map(|(slot, triangle)| {
            let primitive = self.scene.primitives().get(slot);
            hit(triangle, primitive).filter(|_| primitive != origin)
        });
        hits.fold(Hit::MISS, |best, hit| if hit.is_before(&best) { hit } else { best })
    }

    fn once(&self, stack: &mut Stack, ray: Ray, origin: u32, walk: Option<Walk>) -> (Hit, TestCounts) {
        let mut answer = (Hit::MISS, TestCounts::default());
        let sink = |hit, counts| answer = (hit, counts);
        let rays = std::iter::once((ray, origin));
        match (walk, &self.wide) {
            // Counting knows neither masks nor several hits.
            (Some(Walk::Full), None) if self.asks_for_more_than_counting() => {
                let query = match self.spec.query {
                    Query::All { .. } if !self.has(Flaw::WalksEndAtNearest) => self.spec.query,
                    _ => Query::Closest,
                };
                let mask = if self.has(Flaw::WalksSeeHidden) { u32::MAX } else { self.spec.mask };
                let spec = StreamSpec { query, mask, counts: true, ..self.spec };
                let mut sink = sink;
                rt_bvh::trace_several(&self.scene, stack, spec, rays, |hits, counts| sink(hits[0], counts));
            }
            (Some(walk), None) => rt_bvh::count(&self.scene, stack, walk, self.spec.precision, rays, sink),
            (None, None) => rt_bvh::trace(&self.scene, stack, self.spec, rays, sink),
            (Some(walk), Some(tree)) => rt_bvh::count_wide(tree, stack, walk, self.spec.precision, rays, sink),
            (None, Some(tree)) => rt_bvh::trace_wide(tree, stack, self.spec, rays, sink),
        }
        answer
    }

    /// Whether the stream is one of several hits, or its mask hides something.
    fn asks_for_more_than_counting(&self) -> bool {
        matches!(self.spec.query, Query::All { .. }) || self.scene.hides(self.spec.mask)
    }

    /// Several hits of one ray.
    fn several(&self, stack: &mut Stack, index: u32, hits: &mut [Hit]) -> TestCounts {
        let mut tests = TestCounts::default();
        let rays = std::iter::once(self.source.ray(index));
        rt_bvh::trace_several(&self.scene, stack, self.spec, rays, |found, counted| {
            hits.copy_from_slice(found);
            tests = counted;
        });
        if let ([first, second, ..], true) = (hits, self.has(Flaw::Unsorted)) {
            std::mem::swap(first, second);
        }
        tests
    }

    fn launch(&self, tasks: &[Task], done: Option<&RayMask>) -> (Vec<Hit>, Vec<TestCounts>) {
        let mut stack = Stack::for_scene(&self.scene);
        let mut tasks = tasks.to_vec();
        if self.has(Flaw::SortsTasks) {
            tasks.sort_by_key(|task| task.first);
        }
        let left_out = |i| done.is_some_and(|mask| mask.contains(i)) && !self.has(Flaw::IgnoresMask);
        let mut results = (Vec::new(), Vec::new());
        for task in tasks {
            let loaded = self.source.len();
            for index in task.first..task.first.saturating_add(task.rays).min(loaded) {
                let lost = self.has(Flaw::LosesLastRay) && index + 1 == task.first + task.rays;
                let nothing = (Hit::MISS, TestCounts::default());
                let is_lost = lost || left_out(index);
                if let Query::All { most } = self.spec.query {
                    let hits = results.0.len();
                    results.0.resize(hits + most.get() as usize, Hit::MISS);
                    let counts =
                        if is_lost { nothing.1 } else { self.several(&mut stack, index, &mut results.0[hits..]) };
                    results.1.push(counts);
                    continue;
                }
                let (hit, counts) = if is_lost { nothing } else { self.ray(&mut stack, index, None) };
                results.0.push(hit);
                results.1.push(counts);
            }
        }
        if !self.spec.counts {
            results.1.clear();
        }
        results
    }
}

impl Tracer for FakeTracer {
    fn load_rays(&mut self, source: RaySource, spec: StreamSpec) -> Result<(), DeviceError> {
        if !self.in_flight.is_empty() {
            return invalid("launches are in flight: wait for them");
        }
        if let RaySource::Explicit { rays, origins: Some(origins) } = &source
            && rays.len() != origins.len()
        {
            return invalid("rays and origins differ in number");
        }
        if self.has(Flaw::RefusesExtras) && (spec.counts || spec.precision != Precision::Robust) {
            return Err(DeviceError::new(DeviceErrorKind::Unsupported, "hits alone, and robust ones"));
        }
        check_spec(&self.capabilities, &self.scene, spec)?;
        if !(self.loaded && self.has(Flaw::KeepsFirstRays)) {
            self.source = source;
        }
        let mask = if self.has(Flaw::SeesHidden) { u32::MAX } else { spec.mask };
        (self.spec, self.loaded) = (StreamSpec { mask, ..spec }, true);
        Ok(())
    }

    fn walk(
        &mut self,
        rays: &[u32],
        walk: Walk,
        counts: &mut [TestCounts],
        hits: Option<&mut [Hit]>,
    ) -> Result<Span, DeviceError> {
        if self.has(Flaw::RefusesExtras) {
            return Err(DeviceError::new(DeviceErrorKind::Unsupported, "there are no walks"));
        }
        if counts.len() != rays.len() || hits.as_ref().is_some_and(|hits| hits.len() != rays.len()) {
            return invalid("rays, counts and hits differ in number");
        }
        if rays.iter().any(|&ray| ray >= self.source.len()) {
            return invalid("a ray that is not loaded");
        }
        let (walked, span) = self.timed(|| {
            let mut stack = Stack::for_scene(&self.scene);
            rays.iter().map(|&ray| self.ray(&mut stack, ray, Some(walk))).collect::<Vec<_>>()
        });
        for (slot, (_, count)) in counts.iter_mut().zip(&walked) {
            *slot = *count;
        }
        for (slot, (hit, _)) in hits.into_iter().flatten().zip(&walked) {
            *slot = *hit;
        }
        Ok(span)
    }

    fn submit(&mut self, tasks: &[Task], done: Option<&Arc<RayMask>>) -> Result<Ticket, DeviceError> {
        if self.in_flight.len() >= 2 && !self.has(Flaw::AcceptsAnyNumber) {
            return invalid("two launches are in flight: wait for one");
        }
        let outside = |t: &Task| u64::from(t.first) + u64::from(t.rays) > u64::from(self.source.len());
        if tasks.iter().any(outside) && !self.has(Flaw::AcceptsAnyTask) {
            return invalid("a task beyond the loaded rays");
        }
        let ((mut hits, counts), span) = self.timed(|| self.launch(tasks, done.map(|d| &**d)));
        if self.has(Flaw::Lags) {
            let rays = hits.len();
            std::mem::swap(&mut hits, &mut self.last);
            hits.resize(rays, Hit::MISS);
        }
        let ticket = Ticket(self.tickets);
        self.tickets += 1;
        self.in_flight.push_back((ticket, Launch { hits, counts, task_seconds: Vec::new(), span }));
        Ok(ticket)
    }

    fn wait(&mut self, ticket: Ticket, _limit: Duration, out: &mut Launch) -> Result<(), DeviceError> {
        let Some(place) = self.in_flight.iter().position(|(t, _)| *t == ticket) else {
            return invalid("the launch is not in flight");
        };
        let Some((_, launch)) = self.in_flight.remove(place) else { return invalid("the launch is not in flight") };
        if self.has(Flaw::Appends) {
            out.hits.extend(launch.hits);
        } else {
            *out = launch;
        }
        Ok(())
    }
}
