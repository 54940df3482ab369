//! The nearest hit of a ray with a set of triangles, decided in whole numbers, or the reason why it is not decided.
//!
//! A ray is *ambiguous* when kernels that keep the tolerances of [`crate::exact`] may rightly differ: a triangle is met
//! near its edge, two hits are a few roundings apart, or a hit lies at a limit of `t`. Whether it is says this module
//! alone, never a comparison of kernels. An ambiguous ray must still hit one of its candidates.

use crate::brute;
use crate::exact::{self, Contact, EDGE_TOLERANCE};
use core::fmt;
use glam::DVec3;
use rt_core::intersect::shear_axes;
use rt_core::{Hit, Ray, Triangle};
use std::collections::HashSet;

/// How far a reported `t` may lie from the exact one beyond the tolerances of [`crate::exact`], in units of its last
/// place. Rounding to single precision moves it by half a unit; the rest allows one more single-precision operation.
pub const T_ULPS: u32 = 2;

/// How many triangles are filtered at once: 36 KiB of coordinates, which stay in a first-level cache for all rays of
/// a batch.
const BLOCK: usize = 1024;

/// What a correct kernel may report as the nearest hit of a ray.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// Only this.
    Unambiguous(Option<Nearest>),
    /// One of several.
    Ambiguous {
        /// The triangles that may be reported, in the order of their ids.
        candidates: Vec<Nearest>,
        /// Whether a miss may be reported as well.
        may_miss: bool,
    },
}

/// Most candidates that are written out.
const SHOWN: usize = 3;

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (candidates, may_miss) = match self {
            Self::Unambiguous(None) => return f.write_str("it must miss"),
            Self::Unambiguous(Some(nearest)) => return write!(f, "it must hit {nearest}"),
            Self::Ambiguous { candidates, may_miss } => (candidates, may_miss),
        };
        write!(f, "it may hit ")?;
        for (i, candidate) in candidates.iter().take(SHOWN).enumerate() {
            write!(f, "{}{candidate}", if i == 0 { "" } else { ", " })?;
        }
        let more = candidates.len().saturating_sub(SHOWN);
        if more > 0 {
            write!(f, " or {more} others")?;
        }
        f.write_str(if *may_miss { ", or miss" } else { "" })
    }
}

impl fmt::Display for Nearest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} at {:e} to {:e}", self.primitive, self.t[0], self.t[1])
    }
}

/// A triangle that may be reported, and the distances that may be reported with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Position of the triangle in the list the reference was made from.
    pub primitive: u32,
    /// Whether every kernel hits it, so that only the order of hits is in doubt.
    pub certain: bool,
    /// Least and greatest `t`, both included.
    pub t: [f32; 2],
}

impl Verdict {
    /// Whether a kernel may report `primitive` (`u32::MAX`: a miss) at distance `t`.
    #[must_use]
    pub fn admits(&self, primitive: u32, t: f32) -> bool {
        let fits = |n: &Nearest| n.primitive == primitive && n.t[0] <= t && t <= n.t[1];
        match self {
            Self::Unambiguous(None) => primitive == u32::MAX,
            Self::Unambiguous(Some(nearest)) => fits(nearest),
            Self::Ambiguous { candidates, may_miss } => {
                candidates.iter().any(fits) || (*may_miss && primitive == u32::MAX)
            }
        }
    }

    /// [`Verdict::admits`] without a look at the distance.
    #[must_use]
    pub fn admits_primitive(&self, primitive: u32) -> bool {
        match self {
            Self::Unambiguous(nearest) => nearest.map_or(u32::MAX, |n| n.primitive) == primitive,
            Self::Ambiguous { candidates, may_miss } => {
                candidates.iter().any(|n| n.primitive == primitive) || (*may_miss && primitive == u32::MAX)
            }
        }
    }

    /// Whether a kernel may report that there is a hit (`true`) or none.
    #[must_use]
    pub const fn admits_presence(&self, hit: bool) -> bool {
        match self {
            Self::Unambiguous(nearest) => nearest.is_some() == hit,
            Self::Ambiguous { may_miss, .. } => hit || *may_miss,
        }
    }

    /// The triangles that may be reported, in the order of their ids.
    #[must_use]
    pub fn candidates(&self) -> &[Nearest] {
        match self {
            Self::Unambiguous(nearest) => nearest.as_slice(),
            Self::Ambiguous { candidates, .. } => candidates,
        }
    }

    /// Whether the ray is ambiguous only because of hits that lie within a few roundings of each other, as on faces
    /// that were modelled twice.
    #[must_use]
    pub fn is_tie(&self) -> bool {
        matches!(self, Self::Ambiguous { candidates, .. } if candidates.iter().all(|c| c.certain))
    }

    /// Whether kernels may differ on the ray.
    #[must_use]
    pub const fn is_ambiguous(&self) -> bool {
        matches!(self, Self::Ambiguous { .. })
    }
}

/// A set of triangles that rays can be resolved against.
#[derive(Debug)]
pub struct Reference<'a> {
    triangles: &'a [Triangle],
    /// `coordinates[3 · vertex + axis]`, one entry for each triangle.
    coordinates: [Vec<f32>; 9],
    bounds: [DVec3; 2],
}

impl<'a> Reference<'a> {
    /// Prepares `triangles`, whose ids are their positions. Those with a coordinate that is not finite are never hit.
    #[must_use]
    pub fn new(triangles: &'a [Triangle]) -> Self {
        let coordinates = core::array::from_fn(|i| triangles.iter().map(|t| t.vertices()[i / 3][i % 3]).collect());
        let finite = triangles.iter().filter(|t| t.is_finite()).flat_map(|t| t.vertices());
        let bounds =
            finite.fold([DVec3::MAX, DVec3::MIN], |[min, max], p| [min.min(p.as_dvec3()), max.max(p.as_dvec3())]);
        Self { triangles, coordinates, bounds }
    }

    /// The nearest hit of `ray`, the triangle `origin` (`u32::MAX`: none) left out.
    #[must_use]
    pub fn resolve(&self, ray: &Ray, origin: u32) -> Verdict {
        let mut verdicts = self.resolve_all(&[(*ray, origin)]);
        verdicts.pop().unwrap_or(Verdict::Unambiguous(None))
    }

    /// [`Reference::resolve`] for several rays, which share the passes over the triangles: give some dozens at once.
    #[must_use]
    pub fn resolve_all(&self, rays: &[(Ray, u32)]) -> Vec<Verdict> {
        let verdict = |((ray, origin), ids): (&(Ray, u32), Vec<u32>)| {
            nearest_of(&self.candidates(ray, *origin, &ids), self.triangles)
        };
        rays.iter().zip(self.survivors(rays)).map(verdict).collect()
    }

    /// [`Reference::resolve_all`] and, beside each verdict, the answer of brute force in double precision.
    #[must_use]
    pub fn answers(&self, rays: &[(Ray, u32)]) -> Vec<(Verdict, Hit)> {
        let answer = |((ray, origin), ids): (&(Ray, u32), Vec<u32>)| {
            let verdict = nearest_of(&self.candidates(ray, *origin, &ids), self.triangles);
            // What does not survive the filter is a miss in double precision too.
            (verdict, brute::closest_among(self.triangles, ids, ray, *origin))
        };
        rays.iter().zip(self.survivors(rays)).map(answer).collect()
    }

    /// Whether a kernel may answer `primitive` (`u32::MAX`: a miss) when asked for any hit.
    #[must_use]
    pub fn admits_any(&self, ray: &Ray, origin: u32, primitive: u32) -> bool {
        let ids = self.survivors(&[(*ray, origin)]).pop().unwrap_or_default();
        let candidates = self.candidates(ray, origin, &ids);
        if primitive == u32::MAX {
            candidates.iter().all(|c| !c.certain)
        } else {
            candidates.iter().any(|c| c.primitive == primitive)
        }
    }

    /// For each ray, the triangles that are not clearly missed by its line, in the order of their ids: a superset of
    /// what any kernel within the tolerances can hit.
    #[must_use]
    pub fn survivors(&self, rays: &[(Ray, u32)]) -> Vec<Vec<u32>> {
        let lines: Vec<Line> = rays.iter().map(|(ray, _)| Line::new(ray, &self.bounds)).collect();
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

    fn candidates(&self, ray: &Ray, origin: u32, ids: &[u32]) -> Vec<Nearest> {
        ids.iter()
            .filter(|id| **id != origin)
            .filter_map(|&id| meeting(ray, id, &self.triangles[id as usize]))
            .collect()
    }
}

/// How a valid `ray` meets one triangle, whatever is before it; `None` for a clear miss.
#[must_use]
pub fn meeting(ray: &Ray, primitive: u32, triangle: &Triangle) -> Option<Nearest> {
    let Contact { certain, t } = triangle.is_finite().then(|| exact::contact(ray, triangle))??;
    let mut t = t.map(|t| t as f32);
    for _ in 0..T_ULPS {
        t = [t[0].next_down(), t[1].next_up()];
    }
    if t[1] < ray.tmin || t[0] > ray.tmax || t[0] == f32::INFINITY || t[1] == f32::NEG_INFINITY {
        return None;
    }
    let inside = ray.tmin <= t[0] && t[1] <= ray.tmax && t[1] < f32::INFINITY;
    Some(Nearest { primitive, certain: certain && inside, t })
}

/// [`Reference::resolve`] for one ray and no origin.
#[must_use]
pub fn resolve(ray: &Ray, triangles: &[Triangle]) -> Verdict {
    Reference::new(triangles).resolve(ray, u32::MAX)
}

/// Which of the candidates can be the nearest hit.
fn nearest_of(candidates: &[Nearest], triangles: &[Triangle]) -> Verdict {
    let sure = candidates.iter().filter(|c| c.certain).map(|c| c.t[1]).min_by(f32::total_cmp);
    let mut nearest: Vec<Nearest> = Vec::new();
    let mut seen = HashSet::new();
    for candidate in candidates.iter().filter(|c| sure.is_none_or(|sure| c.t[0] <= sure)) {
        // The same three vertices make the same `t` in every kernel, so of duplicates only the lowest id can win. Adding
        // zero makes the two zeros one.
        let corners = triangles[candidate.primitive as usize].vertices();
        if seen.insert(corners.map(|p| p.to_array().map(|x| (x + 0.0).to_bits()))) {
            nearest.push(*candidate);
        }
    }
    match (&nearest[..], sure) {
        ([], _) => Verdict::Unambiguous(None),
        ([only], Some(_)) => Verdict::Unambiguous(Some(*only)),
        _ => Verdict::Ambiguous { candidates: nearest, may_miss: sure.is_none() },
    }
}

/// A line sheared onto its dominant axis, as `rt_core::intersect` does it, and what its edge functions cannot exceed
/// by error.
struct Line {
    origin: [f64; 3],
    shear: [f64; 2],
    axes: [usize; 3],
    /// Edge functions beyond this are beyond [`EDGE_TOLERANCE`] in exact arithmetic too.
    doubt: f64,
}

impl Line {
    fn new(ray: &Ray, bounds: &[DVec3; 2]) -> Self {
        let axes = shear_axes(ray.direction);
        let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let reach = (bounds[0] - o).abs().max((bounds[1] - o).abs()).max_element();
        // The magnitude of an edge function is at most 2 · (2 · reach)²; it is found with an error below an eighth of
        // the tolerance, so twice the tolerance leaves no doubt.
        let doubt = 2.0 * EDGE_TOLERANCE * 8.0 * reach * reach;
        let shear = [d[axes[0]] / d[axes[2]], d[axes[1]] / d[axes[2]]];
        Self { origin: axes.map(|axis| o[axis]), shear, axes, doubt }
    }

    /// Marks with 1 the triangles from `first` on that are not clearly missed. Without branches, so that it compiles
    /// to vector instructions.
    fn filter(&self, coordinates: &[Vec<f32>; 9], first: usize, kept: &mut [u8]) {
        let n = kept.len();
        let of = |vertex: usize| self.axes.map(|axis| &coordinates[3 * vertex + axis][first..][..n]);
        let ([ax, ay, az], [bx, by, bz], [cx, cy, cz]) = (of(0), of(1), of(2));
        let project = |x: f32, y: f32, z: f32| {
            let z = f64::from(z) - self.origin[2];
            let x = f64::from(x) - self.origin[0] - self.shear[0] * z;
            let y = f64::from(y) - self.origin[1] - self.shear[1] * z;
            (x, y)
        };
        let (above, below) = (self.doubt, -self.doubt);
        for i in 0..n {
            let a = project(ax[i], ay[i], az[i]);
            let b = project(bx[i], by[i], bz[i]);
            let c = project(cx[i], cy[i], cz[i]);
            let u = c.0 * b.1 - c.1 * b.0;
            let v = a.0 * c.1 - a.1 * c.0;
            let w = b.0 * a.1 - b.1 * a.0;
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
        match verdict {
            Verdict::Unambiguous(nearest) => nearest.map(|n| n.primitive),
            Verdict::Ambiguous { .. } => panic!("ambiguous: {verdict:?}"),
        }
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

    #[test]
    fn ties_edges_and_limits_are_ambiguous_and_duplicates_are_not() {
        let ray = Ray::new(Vec3::new(0.25, 0.25, -1.0), Vec3::Z);
        assert_eq!(only(&resolve(&ray, &[at_depth(1.0), UNIT, UNIT])), Some(1));
        let tie = resolve(&ray, &[at_depth(0.0), UNIT]);
        assert!(tie.admits(0, 1.0) && tie.admits(1, 1.0) && !tie.admits(u32::MAX, f32::INFINITY));
        assert!(!tie.admits(0, 1.000_01) && !tie.admits(2, 1.0));
        let limit = resolve(&ray.with_range(0.0, 1.0), &[UNIT]);
        assert!(limit.is_ambiguous() && limit.admits(u32::MAX, f32::INFINITY) && limit.admits(0, 1.0));
        let edge = resolve(&Ray::new(Vec3::new(0.5, 0.5, -1.0), Vec3::Z), &[UNIT, at_depth(4.0)]);
        assert!(edge.admits(0, 1.0) && edge.admits(1, 5.0) && !edge.admits(u32::MAX, f32::INFINITY));
        // A doubtful triangle behind a certain hit does not matter.
        let behind = resolve(&Ray::new(Vec3::new(0.5, 0.5, -9.0), Vec3::Z), &[UNIT, at_depth(-4.0)]);
        assert_eq!(only(&behind), Some(1));
    }

    #[test]
    fn any_hit_admits_every_candidate_and_no_other() {
        let triangles = [at_depth(5.0), at_depth(2.0), at_depth(-1.0)];
        let reference = Reference::new(&triangles);
        let ray = Ray::new(Vec3::ZERO, Vec3::Z);
        let admitted = [0, 1, 2, u32::MAX].map(|id| reference.admits_any(&ray, u32::MAX, id));
        assert_eq!(admitted, [true, true, false, false]);
    }
}
