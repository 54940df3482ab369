//! The nearest hit of a ray with a set of triangles, decided in whole numbers.
//!
//! A hit is defined exactly (`rt_core::intersect`), so every ray has one right answer: a triangle and the bits of its
//! distance, or a miss. That is what our own devices are held to, on every ray ([`Verdict::is_right`]).
//!
//! Tracers that follow another definition, in double precision or less, may rightly differ where the ray comes within
//! [`crate::exact::NEARNESS`] of a triangle's edge, where two hits are a few roundings apart, or where a hit lies at a
//! limit of `t`: such a ray is *ambiguous* to them ([`Verdict::admits`]). Whether it is says this module alone, never a
//! comparison of tracers, and an ambiguous ray must still hit one of its candidates.

use crate::brute;
use crate::exact::{self, Contact, NEARNESS};
use core::fmt;
use rt_core::intersect::shear_axes;
use rt_core::{Hit, Ray, Triangle};
use std::collections::HashSet;

/// How far a reported `t` may lie from the exact one beyond the tolerances of [`crate::exact`], in units of its last
/// place. Rounding to single precision moves it by half a unit; the rest allows one more single-precision operation.
pub const T_ULPS: u32 = 2;

/// How many triangles are filtered at once: 36 KiB of coordinates, which stay in a first-level cache for all rays of
/// a batch.
const BLOCK: usize = 1024;

/// The nearest hit of a ray: the right answer, and what tracers of other definitions may say.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    right: Option<Right>,
    candidates: Vec<Nearest>,
    may_miss: bool,
}

/// The one right hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Right {
    /// Position of the triangle in the list the reference was made from.
    pub primitive: u32,
    /// Its distance, rounded once.
    pub t: f32,
}

/// A triangle that may be reported, and the distances that may be reported with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Position of the triangle in the list the reference was made from.
    pub primitive: u32,
    /// Whether every careful tracer hits it, so that only the order of hits is in doubt.
    pub certain: bool,
    /// Least and greatest `t`, both included.
    pub t: [f32; 2],
}

/// Most candidates that are written out.
const SHOWN: usize = 3;

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.right {
            None => write!(f, "it misses")?,
            Some(Right { primitive, t }) => write!(f, "it hits {primitive} at {t:e}")?,
        }
        if !self.is_ambiguous() {
            return Ok(());
        }
        write!(f, " (within tolerances it may hit ")?;
        for (i, candidate) in self.candidates.iter().take(SHOWN).enumerate() {
            write!(f, "{}{candidate}", if i == 0 { "" } else { ", " })?;
        }
        let more = self.candidates.len().saturating_sub(SHOWN);
        if more > 0 {
            write!(f, " or {more} others")?;
        }
        f.write_str(if self.may_miss { ", or miss)" } else { ")" })
    }
}

impl fmt::Display for Nearest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} at {:e} to {:e}", self.primitive, self.t[0], self.t[1])
    }
}

impl Verdict {
    /// The right hit; `None` where the ray misses.
    #[must_use]
    pub const fn right(&self) -> Option<Right> {
        self.right
    }

    /// Whether a nearest hit is the right one, to the last bit of its distance. Weights are not looked at.
    #[must_use]
    pub fn is_right(&self, hit: &Hit) -> bool {
        match self.right {
            None => !hit.is_hit(),
            Some(right) => hit.primitive == right.primitive && hit.t.to_bits() == right.t.to_bits(),
        }
    }

    /// Whether a tracer of another definition may report `primitive` (`u32::MAX`: a miss) at distance `t`.
    #[must_use]
    pub fn admits(&self, primitive: u32, t: f32) -> bool {
        let fits = |n: &Nearest| n.primitive == primitive && n.t[0] <= t && t <= n.t[1];
        self.candidates.iter().any(fits) || (self.may_miss && primitive == u32::MAX)
    }

    /// [`Verdict::admits`] without a look at the distance.
    #[must_use]
    pub fn admits_primitive(&self, primitive: u32) -> bool {
        self.candidates.iter().any(|n| n.primitive == primitive) || (self.may_miss && primitive == u32::MAX)
    }

    /// Whether such a tracer may report that there is a hit (`true`) or none.
    #[must_use]
    pub const fn admits_presence(&self, hit: bool) -> bool {
        if hit { !self.candidates.is_empty() } else { self.may_miss }
    }

    /// The triangles that may be reported, in the order of their ids.
    #[must_use]
    pub fn candidates(&self) -> &[Nearest] {
        &self.candidates
    }

    /// Whether the ray is ambiguous only because of hits that lie within a few roundings of each other, as on faces
    /// that were modelled twice.
    #[must_use]
    pub fn is_tie(&self) -> bool {
        self.is_ambiguous() && self.candidates.iter().all(|c| c.certain)
    }

    /// Whether tracers of other definitions may differ on the ray.
    #[must_use]
    pub const fn is_ambiguous(&self) -> bool {
        self.candidates.len() + self.may_miss as usize != 1
    }
}

/// A set of triangles that rays can be resolved against.
#[derive(Debug)]
pub struct Reference<'a> {
    triangles: &'a [Triangle],
    /// `coordinates[3 · vertex + axis]`, one entry for each triangle.
    coordinates: [Vec<f32>; 9],
}

impl<'a> Reference<'a> {
    /// Prepares `triangles`, whose ids are their positions. Those with a coordinate that is not finite are never hit.
    #[must_use]
    pub fn new(triangles: &'a [Triangle]) -> Self {
        let coordinates = core::array::from_fn(|i| triangles.iter().map(|t| t.vertices()[i / 3][i % 3]).collect());
        Self { triangles, coordinates }
    }

    /// The nearest hit of `ray`, the triangle `origin` (`u32::MAX`: none) left out.
    #[must_use]
    pub fn resolve(&self, ray: &Ray, origin: u32) -> Verdict {
        self.resolve_all(&[(*ray, origin)]).pop().unwrap_or_else(|| nearest_of(&[], self.triangles))
    }

    /// [`Reference::resolve`] for several rays, which share the passes over the triangles: give some dozens at once.
    #[must_use]
    pub fn resolve_all(&self, rays: &[(Ray, u32)]) -> Vec<Verdict> {
        let verdict = |((ray, origin), ids): (&(Ray, u32), Vec<u32>)| {
            nearest_of(&self.meetings(ray, *origin, &ids), self.triangles)
        };
        rays.iter().zip(self.survivors(rays)).map(verdict).collect()
    }

    /// [`Reference::resolve_all`] and, beside each verdict, the answer of brute force with the kernels' own test.
    #[must_use]
    pub fn answers(&self, rays: &[(Ray, u32)]) -> Vec<(Verdict, Hit)> {
        let answer = |((ray, origin), ids): (&(Ray, u32), Vec<u32>)| {
            let verdict = nearest_of(&self.meetings(ray, *origin, &ids), self.triangles);
            // What does not survive the filter is a miss.
            (verdict, brute::closest_among(self.triangles, ids, ray, *origin))
        };
        rays.iter().zip(self.survivors(rays)).map(answer).collect()
    }

    /// Whether an answer to the question for any hit is right: one of the ray's hits, or a miss where there is none.
    #[must_use]
    pub fn is_right_any(&self, ray: &Ray, origin: u32, hit: &Hit) -> bool {
        let ids = self.survivors(&[(*ray, origin)]).pop().unwrap_or_default();
        let mut hits = self.meetings(ray, origin, &ids).into_iter().filter_map(|(right, _)| right);
        if hit.is_hit() {
            hits.any(|right| right.primitive == hit.primitive && right.t.to_bits() == hit.t.to_bits())
        } else {
            hits.next().is_none()
        }
    }

    /// For each ray, the triangles that are not clearly missed by its line, in the order of their ids: a superset of
    /// what any tracer within the tolerances can hit.
    #[must_use]
    pub fn survivors(&self, rays: &[(Ray, u32)]) -> Vec<Vec<u32>> {
        let lines: Vec<Line> = rays.iter().map(|(ray, _)| Line::new(ray)).collect();
        let mut found = vec![Vec::new(); rays.len()];
        let mut kept = [0_u8; BLOCK];
        for first in (0..self.triangles.len()).step_by(BLOCK) {
            let last = self.triangles.len().min(first + BLOCK);
            for ((line, (ray, _)), ids) in lines.iter().zip(rays).zip(&mut found) {
                if !ray.is_valid() {
                    continue;
                }
                let kept = &mut kept[..last - first];
                line.filter(&self.coordinates, first, kept);
                let hits = kept.iter().enumerate().filter(|(_, kept)| **kept != 0);
                ids.extend(hits.map(|(i, _)| (first + i) as u32));
            }
        }
        found
    }

    fn meetings(&self, ray: &Ray, origin: u32, ids: &[u32]) -> Vec<(Option<Right>, Option<Nearest>)> {
        ids.iter()
            .filter(|id| **id != origin)
            .map(|&id| decide(ray, id, &self.triangles[id as usize]))
            .filter(|(right, nearest)| right.is_some() || nearest.is_some())
            .collect()
    }
}

/// How a valid `ray` meets one triangle, whatever is before it, as tracers of other definitions may see it; `None` for
/// a clear miss.
#[must_use]
pub fn meeting(ray: &Ray, primitive: u32, triangle: &Triangle) -> Option<Nearest> {
    decide(ray, primitive, triangle).1
}

/// The right hit of one triangle, and [`meeting`].
fn decide(ray: &Ray, primitive: u32, triangle: &Triangle) -> (Option<Right>, Option<Nearest>) {
    let contact = if triangle.is_finite() { exact::contact(ray, triangle) } else { None };
    let Some(Contact { hit, certain, t }) = contact else { return (None, None) };
    let limits = ray.tmin..=ray.tmax;
    let right = hit.filter(|t| t.is_finite() && limits.contains(t)).map(|t| Right { primitive, t });
    let mut t = t.map(|t| t as f32);
    for _ in 0..T_ULPS {
        t = [t[0].next_down(), t[1].next_up()];
    }
    if t[1] < ray.tmin || t[0] > ray.tmax || t[0] == f32::INFINITY || t[1] == f32::NEG_INFINITY {
        return (right, None);
    }
    let inside = ray.tmin <= t[0] && t[1] <= ray.tmax && t[1] < f32::INFINITY;
    (right, Some(Nearest { primitive, certain: certain && inside, t }))
}

/// [`Reference::resolve`] for one ray and no origin.
#[must_use]
pub fn resolve(ray: &Ray, triangles: &[Triangle]) -> Verdict {
    Reference::new(triangles).resolve(ray, u32::MAX)
}

/// Which of the meetings is the nearest hit, and which may be taken for it.
fn nearest_of(meetings: &[(Option<Right>, Option<Nearest>)], triangles: &[Triangle]) -> Verdict {
    // Ids rise, so of equal distances the first is right.
    let right = meetings.iter().filter_map(|(right, _)| *right).min_by(|a, b| a.t.total_cmp(&b.t));
    let seen_by_others = || meetings.iter().filter_map(|(_, nearest)| *nearest);
    let sure = seen_by_others().filter(|c| c.certain).map(|c| c.t[1]).min_by(f32::total_cmp);
    let mut candidates: Vec<Nearest> = Vec::new();
    let mut seen = HashSet::new();
    for candidate in seen_by_others().filter(|c| sure.is_none_or(|sure| c.t[0] <= sure)) {
        // The same three vertices make the same `t` in every tracer, so of duplicates only the lowest id can win.
        // Adding zero makes the two zeros one.
        let corners = triangles[candidate.primitive as usize].vertices();
        if seen.insert(corners.map(|p| p.to_array().map(|x| (x + 0.0).to_bits()))) {
            candidates.push(candidate);
        }
    }
    Verdict { right, candidates, may_miss: sure.is_none() }
}

/// A line sheared onto its dominant axis, after S. Woop, C. Benthin and I. Wald (2013).
struct Line {
    origin: [f64; 3],
    shear: [f64; 2],
    axes: [usize; 3],
}

/// Twice the share of R · S, below, that a line within [`NEARNESS`] of a triangle can make an edge function's sign
/// wrong by.
const DOUBT: f64 = 16.0 * NEARNESS;

impl Line {
    fn new(ray: &Ray) -> Self {
        let axes = shear_axes(ray.direction);
        let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let shear = [d[axes[0]] / d[axes[2]], d[axes[1]] / d[axes[2]]];
        Self { origin: axes.map(|axis| o[axis]), shear, axes }
    }

    /// Marks with 1 the triangles from `first` on that are not clearly missed. Without branches, so that it compiles
    /// to vector instructions.
    ///
    /// Let X, Y, Z bound the sheared |x|, |y| and the |z| of the vertices, S = X + Y, and R = S + Z, so that no
    /// coordinate relative to the origin is above R and no distance above √3·R. A line within [`NEARNESS`] N of the
    /// triangle passes it, in the sheared plane, by at most √3 times that: r ≤ 3·N·R. Displaced by r it meets the
    /// triangle, and edge functions have one sign; each changes by at most r times the length of its edge, 2·S and what
    /// S itself changes by. So no two edge functions can be beyond 6·N·R·(S + 3·N·R) on opposite sides. Rounding adds
    /// some 2⁻⁵³ of R·S, far below the rest of `DOUBT`.
    fn filter(&self, coordinates: &[Vec<f32>; 9], first: usize, kept: &mut [u8]) {
        let n = kept.len();
        let of = |vertex: usize| self.axes.map(|axis| &coordinates[3 * vertex + axis][first..][..n]);
        let ([ax, ay, az], [bx, by, bz], [cx, cy, cz]) = (of(0), of(1), of(2));
        let project = |x: f32, y: f32, z: f32| {
            let z = f64::from(z) - self.origin[2];
            let x = f64::from(x) - self.origin[0] - self.shear[0] * z;
            let y = f64::from(y) - self.origin[1] - self.shear[1] * z;
            (x, y, z)
        };
        let greater = |a: f64, b: f64| if a > b { a } else { b };
        let largest = |a: f64, b: f64, c: f64| greater(greater(a.abs(), b.abs()), c.abs());
        for i in 0..n {
            let a = project(ax[i], ay[i], az[i]);
            let b = project(bx[i], by[i], bz[i]);
            let c = project(cx[i], cy[i], cz[i]);
            let u = c.0 * b.1 - c.1 * b.0;
            let v = a.0 * c.1 - a.1 * c.0;
            let w = b.0 * a.1 - b.1 * a.0;
            let size = largest(a.0, b.0, c.0) + largest(a.1, b.1, c.1);
            let reach = size + largest(a.2, b.2, c.2);
            let above = DOUBT * reach * (size + 4.0 * NEARNESS * reach);
            let below = -above;
            let positive = (u > above) | (v > above) | (w > above);
            let negative = (u < below) | (v < below) | (w < below);
            kept[i] = u8::from(!(positive & negative));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    const UNIT: Triangle = Triangle::new(Vec3::ZERO, Vec3::X, Vec3::Y);

    fn at_depth(z: f32) -> Triangle {
        Triangle::new(Vec3::new(-1.0, -1.0, z), Vec3::new(3.0, -1.0, z), Vec3::new(-1.0, 3.0, z))
    }

    fn only(verdict: &Verdict) -> Option<u32> {
        assert!(!verdict.is_ambiguous(), "ambiguous: {verdict:?}");
        let right = verdict.right().map(|right| right.primitive);
        assert_eq!(verdict.candidates().first().map(|candidate| candidate.primitive), right);
        right
    }

    fn hit(primitive: u32, t: f32) -> Hit {
        Hit { t, u: 0.0, v: 0.0, primitive }
    }

    // Guards against: `max_by` for `min_by`, comparing with the limits the wrong way round, ids lost in the filter.
    #[test]
    fn the_nearest_within_the_limits_is_found() {
        let triangles = [at_depth(5.0), at_depth(2.0), at_depth(-1.0), at_depth(9.0)];
        let ray = Ray::new(Vec3::ZERO, Vec3::Z);
        assert_eq!(only(&resolve(&ray, &triangles)), Some(1));
        assert_eq!(only(&resolve(&ray.with_range(3.0, 8.0), &triangles)), Some(0));
        assert_eq!(only(&resolve(&ray.with_range(6.0, 8.0), &triangles)), None);
        assert_eq!(only(&resolve(&Ray::new(Vec3::ZERO, Vec3::NEG_Z), &triangles)), Some(2));
        assert_eq!(only(&Reference::new(&triangles).resolve(&ray, 1)), Some(0));
        assert_eq!(only(&resolve(&ray.with_range(2.0, 1.0), &triangles)), None);
    }

    // Guards against: tolerances in what is right, none in what others may say.
    #[test]
    fn ties_edges_and_limits_have_one_right_answer_and_others_that_are_admitted() {
        let ray = Ray::new(Vec3::new(0.25, 0.25, -1.0), Vec3::Z);
        assert_eq!(only(&resolve(&ray, &[at_depth(1.0), UNIT, UNIT])), Some(1));
        let tie = resolve(&ray, &[at_depth(0.0), UNIT]);
        assert!(tie.admits(0, 1.0) && tie.admits(1, 1.0) && !tie.admits(u32::MAX, f32::INFINITY));
        assert!(!tie.admits(0, 1.000_01) && !tie.admits(2, 1.0));
        assert!(tie.is_right(&hit(0, 1.0)) && !tie.is_right(&hit(1, 1.0)) && !tie.is_right(&Hit::MISS));
        assert!(!tie.is_right(&hit(0, 1.0_f32.next_up())));
        let limit = resolve(&ray.with_range(0.0, 1.0), &[UNIT]);
        assert!(limit.is_ambiguous() && limit.admits(u32::MAX, f32::INFINITY) && limit.admits(0, 1.0));
        assert!(limit.is_right(&hit(0, 1.0)) && !limit.is_right(&Hit::MISS));
        let before = resolve(&ray.with_range(0.0, 1.0_f32.next_down()), &[UNIT]);
        assert!(before.is_right(&Hit::MISS) && !before.is_right(&hit(0, 1.0)) && before.admits(0, 1.0));
        let edge = resolve(&Ray::new(Vec3::new(0.5, 0.5, -1.0), Vec3::Z), &[UNIT, at_depth(4.0)]);
        assert!(edge.admits(0, 1.0) && edge.admits(1, 5.0) && !edge.admits(u32::MAX, f32::INFINITY));
        assert!(edge.is_right(&hit(0, 1.0)) && !edge.is_right(&hit(1, 5.0)));
        // A doubtful triangle behind a certain hit does not matter.
        let behind = resolve(&Ray::new(Vec3::new(0.5, 0.5, -9.0), Vec3::Z), &[UNIT, at_depth(-4.0)]);
        assert_eq!(only(&behind), Some(1));
    }

    #[test]
    fn any_hit_may_be_every_hit_and_no_other() {
        let triangles = [at_depth(5.0), at_depth(2.0), at_depth(-1.0)];
        let reference = Reference::new(&triangles);
        let ray = Ray::new(Vec3::ZERO, Vec3::Z);
        let right = |hit: Hit| reference.is_right_any(&ray, u32::MAX, &hit);
        assert!(right(hit(0, 5.0)) && right(hit(1, 2.0)));
        assert!(!right(hit(0, 5.0_f32.next_up())) && !right(hit(2, -1.0)) && !right(Hit::MISS));
        assert!(reference.is_right_any(&ray.with_range(6.0, 9.0), u32::MAX, &Hit::MISS));
    }
}
