//! What is believed of a device's answers.
//!
//! Two nets, of different mesh. *What cannot be true* is looked for in every hit, since it costs next to nothing beside
//! copying it: another number of hits than rays, a primitive that the scene does not have or that the ray starts on, a
//! distance that is no number or outside the ray. One such hit, and the device is not believed any more. *What is not
//! true* is looked for in a sample, which the host traces again ([`Audit`]): a single hit that is refused may be a
//! rounding that the host sees otherwise, so it is replaced by the host's and counted; a device of which more than
//! [`MOST_REFUSED`](rt_core::arguments::MOST_REFUSED) is refused is not believed.
//!
//! A device that is not believed drops out, and all that it brought in the stream is done again by others.
//!
//! This cannot see: single wrong hits that no sample met; wrong counts, which cost balance but no hit.

use rt_bvh::Stack;
use rt_core::arguments::is_disbelieved;
use rt_core::{
    DeviceError, DeviceErrorKind, Hit, Launch, Query, Ray, RayMask, RaySource, Scene, Span, StreamSpec, Task,
    TestCounts, random,
};
use std::ops::Range;
use std::sync::Arc;

/// Rays of a launch that are traced again where one of the sample was refused: enough to tell a share of a
/// thirty-second from a single ray.
const CLOSER_LOOK: usize = 256;

/// Relative difference of distances that a rounding may make: single precision at grazing angles.
const ROUNDING: f32 = 1e-3;

/// By how much barycentric weights may leave 0 to 1, for the same reason.
const SLACK: f32 = 1e-3;

/// How many of a device's hits the host traces again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Audit(f64);

impl Audit {
    /// No hit.
    pub const OFF: Self = Self(0.0);

    /// Every hit: as slow as the host.
    pub const ALL: Self = Self(1.0);

    /// That share of each launch's rays, at least one of them; `None` unless it is from 0 to 1.
    #[must_use]
    pub fn share(share: f64) -> Option<Self> {
        (0.0..=1.0).contains(&share).then_some(Self(share))
    }

    /// Every how many rays one is traced again; `None` for none.
    fn period(self) -> Option<usize> {
        // Saturates.
        (self.0 > 0.0).then(|| (1.0 / self.0).round() as usize)
    }
}

impl Default for Audit {
    /// One ray in ten thousand, and one of each launch: a thousandth of the time of a launch of a thousand rays. A
    /// device whose launches are wrong in half of their rays is found out in its first two, on average.
    fn default() -> Self {
        Self(1e-4)
    }
}

/// What was looked at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Checked {
    /// Rays that the host traced again.
    pub(crate) audited: u64,
    /// Those of them whose answer was replaced by the host's.
    pub(crate) refused: u64,
}

impl Checked {
    pub(crate) fn add(&mut self, other: Self) {
        self.audited += other.audited;
        self.refused += other.refused;
    }
}

/// What a device is asked, and so what its answers must fit.
#[derive(Debug)]
pub(crate) struct Asked {
    scene: Arc<Scene>,
    source: RaySource,
    spec: StreamSpec,
    audit: Audit,
    /// Of the host's traversal.
    stack: Stack,
    /// Launches and walks so far, so that each is sampled elsewhere.
    number: u32,
}

fn untrue(message: String) -> DeviceError {
    DeviceError::new(DeviceErrorKind::WrongAnswer, message)
}

impl Asked {
    pub(crate) fn new(scene: Arc<Scene>) -> Self {
        let source = RaySource::Explicit { rays: Arc::new([]), origins: None };
        Self {
            stack: Stack::for_scene(&scene),
            scene,
            source,
            spec: StreamSpec::default(),
            audit: Audit::OFF,
            number: 0,
        }
    }

    /// From now on these rays are asked for.
    pub(crate) fn load(&mut self, source: RaySource, spec: StreamSpec, audit: Audit) {
        (self.source, self.spec, self.audit) = (source, spec, audit);
    }

    /// Looks at the results of a launch. What the host refused is replaced.
    ///
    /// # Errors
    /// When the device cannot be believed.
    pub(crate) fn check_launch(
        &mut self,
        tasks: &[Task],
        done: Option<&RayMask>,
        launch: &mut Launch,
    ) -> Result<Checked, DeviceError> {
        // The backend may have left another one behind.
        let _environment = rt_fenv::Environment::enter();
        let rays: usize = tasks.iter().map(|task| task.rays as usize).sum();
        let Launch { hits, counts, task_seconds, span } = launch;
        let per_ray = self.spec.query.hits_per_ray();
        if hits.len() != rays * per_ray || (self.spec.counts && counts.len() != rays) {
            let (found, counted) = (hits.len(), counts.len());
            return Err(untrue(format!("a launch of {rays} rays came back with {found} hits and {counted} counts")));
        }
        *span = self.check_span(*span)?;
        if !task_seconds.iter().all(|seconds| seconds.is_finite() && *seconds >= 0.0) {
            // Then only the launch's time is known.
            task_seconds.clear();
        }
        let known = |ray: u32| done.is_some_and(|mask| mask.contains(ray));
        let mut rest = &hits[..];
        for task in tasks {
            let own = rest.split_off(..task.rays as usize * per_ray).unwrap_or_default();
            self.possible(task.range(), per_ray, own, known)?;
        }
        if per_ray > 1 && !hits.chunks(per_ray).all(is_in_order) {
            return Err(untrue("hits of a ray are not in order of distance and number".to_owned()));
        }
        let counts = if self.spec.counts { &mut counts[..] } else { &mut [] };
        // Where a launch's rays are in the list of all its rays.
        let mut starts = Vec::with_capacity(tasks.len());
        let mut sum = 0;
        for task in tasks {
            starts.push(sum);
            sum += task.rays as usize;
        }
        let ray = |place: usize| {
            let task = starts.partition_point(|&start| start <= place).checked_sub(1)?;
            let ray = tasks.get(task)?.first + (place - starts[task]) as u32;
            (!known(ray)).then_some(ray)
        };
        self.audit(rays, ray, (self.spec.query, hits), counts)
    }

    /// Looks at the hits of a full walk. What the host refused is replaced.
    ///
    /// # Errors
    /// When the device cannot be believed.
    pub(crate) fn check_walk(
        &mut self,
        rays: &[u32],
        hits: &mut [Hit],
        counts: &mut [TestCounts],
    ) -> Result<Checked, DeviceError> {
        let _environment = rt_fenv::Environment::enter();
        for (&ray, hit) in rays.iter().zip(&*hits) {
            self.possible(ray..ray + 1, 1, std::slice::from_ref(hit), |_| false)?;
        }
        // A walk brings the nearest of several hits.
        let query = if self.spec.query == Query::Any { Query::Any } else { Query::Closest };
        self.audit(rays.len(), |place| rays.get(place).copied(), (query, hits), counts)
    }

    /// A span that ends after it began. A device's clock is not the host's, but it must be a clock.
    pub(crate) fn check_span(&self, span: Span) -> Result<Span, DeviceError> {
        if span.end < span.start {
            return Err(untrue(format!("a launch that began at {:?} ended at {:?}", span.start, span.end)));
        }
        Ok(Span { in_kernel: span.in_kernel.min(span.duration()), ..span })
    }

    /// Refuses what cannot be true, whatever the scene looks like, of the hits of consecutive rays, so many for each;
    /// but for rays whose hits do not count as they are `known`.
    fn possible(
        &self,
        rays: Range<u32>,
        per_ray: usize,
        hits: &[Hit],
        known: impl Fn(u32) -> bool,
    ) -> Result<(), DeviceError> {
        let primitives = self.scene.primitive_count();
        // Of every ray of a picture: no quotient for each.
        let ray = |place: usize| rays.start + if per_ray == 1 { place } else { place / per_ray } as u32;
        let is_possible = |hit: &Hit, ray: u32| {
            let (limits, start) = match &self.source {
                RaySource::Explicit { rays, .. } if !rays[ray as usize].is_valid() => return false,
                RaySource::Explicit { rays, origins } => {
                    let Ray { tmin, tmax, .. } = rays[ray as usize];
                    ([tmin, tmax], origins.as_ref().map_or(u32::MAX, |origins| origins[ray as usize]))
                }
                RaySource::Camera(_) => ([0.0, f32::INFINITY], u32::MAX),
                RaySource::Bounce(bounce) => ([0.0, f32::INFINITY], bounce.departures[ray as usize].primitive),
            };
            is_possible(hit, limits, start, primitives) && self.scene.shows(hit.primitive, self.spec.mask)
        };
        let is_wrong = |place: usize, hit: &Hit| !(is_miss(hit) || is_possible(hit, ray(place)) || known(ray(place)));
        let wrong = hits.iter().enumerate().find(|&(place, hit)| is_wrong(place, hit));
        let Some((place, Hit { t, u, v, primitive })) = wrong else { return Ok(()) };
        let ray = ray(place);
        Err(untrue(format!(
            "its answer for ray {ray} cannot be true: t {t}, u {u}, v {v}, primitive {primitive} of {primitives}"
        )))
    }

    /// Traces a sample again; `ray` is the ray at a place, unless its answer does not count.
    fn audit(
        &mut self,
        places: usize,
        ray: impl Fn(usize) -> Option<u32>,
        (query, hits): (Query, &mut [Hit]),
        counts: &mut [TestCounts],
    ) -> Result<Checked, DeviceError> {
        let mut checked = Checked::default();
        let Some(period) = self.audit.period().filter(|_| places > 0) else { return Ok(checked) };
        self.number = self.number.wrapping_add(1);
        let period = period.min(places);
        let start = random::below(period as u32, self.number, places as u32, 0) as usize;
        self.retrace((start..places).step_by(period), &ray, (query, &mut *hits), counts, &mut checked);
        if checked.refused == 0 {
            return Ok(checked);
        }
        let mut closer = Checked::default();
        self.retrace((0..places).step_by(places.div_ceil(CLOSER_LOOK)), &ray, (query, hits), counts, &mut closer);
        // What was found first is right by now.
        closer.add(checked);
        if is_disbelieved(closer.audited, closer.refused) {
            let Checked { audited, refused } = closer;
            return Err(untrue(format!("of {audited} of its answers that the host traced again {refused} are wrong")));
        }
        Ok(closer)
    }

    fn retrace(
        &mut self,
        places: impl Iterator<Item = usize>,
        ray: impl Fn(usize) -> Option<u32>,
        (query, hits): (Query, &mut [Hit]),
        counts: &mut [TestCounts],
        checked: &mut Checked,
    ) {
        let Self { scene, source, spec, stack, .. } = self;
        let spec = StreamSpec { query, counts: !counts.is_empty(), ..*spec };
        let per_ray = query.hits_per_ray();
        for (place, ray) in places.filter_map(|place| Some((place, ray(place)?))) {
            let Some(hits) = hits.get_mut(place * per_ray..(place + 1) * per_ray) else { continue };
            let mut compare = |right: &[Hit], count: TestCounts| {
                checked.audited += 1;
                if !hits.iter().zip(right).all(|(hit, right)| is_right(hit, right, query)) {
                    checked.refused += 1;
                    hits.copy_from_slice(right);
                    counts.get_mut(place).into_iter().for_each(|slot| *slot = count);
                }
            };
            let rays = std::iter::once(source.ray(ray));
            match query {
                Query::All { .. } => rt_bvh::trace_several(scene, stack, spec, rays, compare),
                _ => rt_bvh::trace(scene, stack, spec, rays, |right, count| compare(&[right], count)),
            }
        }
    }
}

/// Whether hits of a ray come as [`Query::All`] wants them: each before the next, and behind a miss none.
fn is_in_order(hits: &[Hit]) -> bool {
    hits.is_sorted_by(|a, b| a.is_before(b) || is_miss(a) && is_miss(b))
}

/// Whether that is how a miss looks.
fn is_miss(hit: &Hit) -> bool {
    *hit == Hit::MISS
}

/// Whether there can be such a hit on a ray from `tmin` to `tmax` that starts on primitive `start`. Not a number is not
/// possible, whatever it is compared with.
fn is_possible(hit: &Hit, [tmin, tmax]: [f32; 2], start: u32, primitives: u32) -> bool {
    let weights = -SLACK..=1.0 + SLACK;
    hit.primitive < primitives
        && hit.primitive != start
        && hit.t.is_finite()
        && hit.t >= tmin
        && hit.t <= tmax
        && weights.contains(&hit.u)
        && weights.contains(&hit.v)
}

/// Whether an answer is as good as the host's: the same but for a rounding. Of several candidates for any hit, each is
/// right.
fn is_right(hit: &Hit, right: &Hit, query: Query) -> bool {
    let as_near = (hit.t - right.t).abs() <= ROUNDING * right.t.abs().max(f32::MIN_POSITIVE);
    hit == right || hit.is_hit() && right.is_hit() && (query == Query::Any || as_near)
}
