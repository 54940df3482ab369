//! How far a kernel's hits are from those of double precision: wrong answers and the error of distances.
//!
//! Double precision is not exact; [`sample`] says what the exact reference thinks of some of the same rays.

use crate::exact;
use crate::reference::Reference;
use crate::stats::{clopper_pearson, quantile};
use rayon::prelude::*;
use rt_core::intersect::Shear;
use rt_core::{Hit, Query, Ray, Triangle};
use serde::Serialize;

/// Errors of distances in units in the last place of single precision, over the rays on which the primitive is right.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct UlpErrors {
    /// Half of all errors are at most this.
    pub p50: f64,
    /// 99% of them.
    pub p99: f64,
    /// The greatest.
    pub max: f64,
}

/// A count of wrong answers among the rays compared.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Wrong {
    /// How many.
    pub count: u64,
    /// Per million rays.
    pub ppm: f64,
    /// Clopper–Pearson 95% bounds per million rays.
    pub bounds_ppm: [f64; 2],
}

impl Wrong {
    /// `count` of `rays`.
    #[must_use]
    pub fn new(count: u64, rays: u64) -> Self {
        let ppm = if rays == 0 { 0.0 } else { 1e6 * count as f64 / rays as f64 };
        Self { count, ppm, bounds_ppm: clopper_pearson(count, rays).map(|rate| 1e6 * rate) }
    }
}

/// Hits compared with those of double precision.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Accuracy {
    /// Rays compared: all.
    pub rays: u64,
    /// Misses where double precision hits.
    pub false_misses: Wrong,
    /// Hits where double precision misses.
    pub false_hits: Wrong,
    /// Other primitives; none for any-hit queries, which may return any.
    pub other_ids: Wrong,
    /// Any of the three.
    pub wrong: Wrong,
    /// `None` for any-hit queries, and where no ray hits the right primitive.
    pub t_ulp: Option<UlpErrors>,
}

impl Accuracy {
    /// Compares `hits` with `reference`, both of `rays` (each with the primitive it starts on); `triangle` knows the
    /// triangle of a primitive.
    #[must_use]
    pub fn of(
        rays: impl Fn(usize) -> Ray,
        query: Query,
        hits: &[Hit],
        reference: &[Hit],
        triangle: impl Fn(u32) -> Option<Triangle>,
    ) -> Self {
        let (mut misses, mut extra, mut others) = (0, 0, 0);
        let mut errors = Vec::new();
        for (i, (hit, right)) in hits.iter().zip(reference).enumerate() {
            match (hit.is_hit(), right.is_hit()) {
                (false, true) => misses += 1,
                (true, false) => extra += 1,
                (true, true) if query == Query::Closest && hit.primitive != right.primitive => others += 1,
                (true, true) if query == Query::Closest => {
                    errors.extend(triangle(hit.primitive).and_then(|t| ulp_error(&rays(i), &t, hit.t)));
                }
                _ => {}
            }
        }
        let rays = hits.len().min(reference.len()) as u64;
        let at = |q| quantile(&errors, q);
        let ulps = || Some(UlpErrors { p50: at(0.5)?, p99: at(0.99)?, max: at(1.0)? });
        Self {
            rays,
            false_misses: Wrong::new(misses, rays),
            false_hits: Wrong::new(extra, rays),
            other_ids: Wrong::new(others, rays),
            wrong: Wrong::new(misses + extra + others, rays),
            t_ulp: ulps(),
        }
    }
}

/// How far `t` is from the distance, in units of its last place in single precision.
///
/// Double precision tells that to a fraction of a unit, but not where a ray starts so close to the triangle's plane
/// that nearly all digits cancel: what seems off by more than a unit is compared with the exact distance, rounded once.
fn ulp_error(ray: &Ray, triangle: &Triangle, t: f32) -> Option<f64> {
    let error = units_between(t, Shear::new(ray, 0, f64::INFINITY).intersect(triangle)?.t);
    if error <= 1.0 {
        return Some(error);
    }
    match exact::hit(ray, triangle) {
        // It is the nearest there is.
        Some(right) if right == t => Some(0.5),
        Some(right) => Some(units_between(t, right.into())),
        None => Some(error),
    }
}

fn units_between(t: f32, right: f64) -> f64 {
    let nearest = right.abs() as f32;
    let unit = f64::from(nearest.next_up()) - f64::from(nearest);
    (f64::from(t) - right).abs() / unit
}

/// What the exact reference says of some rays.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sampled {
    /// Rays looked at.
    pub rays: u64,
    /// Rays on which tracers of other definitions than the exact one may differ.
    pub ambiguous: u64,
    /// Other rays with a wrong triangle, or a wrong miss.
    pub wrong: Wrong,
    /// Ambiguous rays with one.
    pub wrong_ambiguous: u64,
}

/// Has the exact reference judge `hits`, on all cores; `rays` are paired with the primitive they start on.
#[must_use]
pub fn sample(triangles: &[Triangle], rays: &[(Ray, u32)], hits: &[Hit], query: Query) -> Sampled {
    let reference = Reference::new(triangles);
    let verdicts: Vec<_> = rays.par_chunks(32).flat_map_iter(|batch| reference.resolve_all(batch)).collect();
    let (mut ambiguous, mut wrong, mut wrong_ambiguous) = (0, 0, 0);
    for (verdict, hit) in verdicts.iter().zip(hits) {
        let right = match query {
            Query::Closest | Query::All { .. } => {
                verdict.right().map_or(u32::MAX, |right| right.primitive) == hit.primitive
            }
            Query::Any => verdict.right().is_some() == hit.is_hit(),
        };
        ambiguous += u64::from(verdict.is_ambiguous());
        *if verdict.is_ambiguous() { &mut wrong_ambiguous } else { &mut wrong } += u64::from(!right);
    }
    let rays = verdicts.len() as u64;
    Sampled { rays, ambiguous, wrong: Wrong::new(wrong, rays - ambiguous), wrong_ambiguous }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use rt_core::random::{pcg3d, unit};

    // Fails when hits and reference are exchanged, and when the unit is that of the next power of two.
    #[test]
    fn every_kind_of_error_is_counted_apart() {
        let triangle = Triangle::new(Vec3::new(-1.0, -1.0, 3.0), Vec3::new(3.0, -1.0, 3.0), Vec3::new(-1.0, 3.0, 3.0));
        let ray = Ray::new(Vec3::ZERO, Vec3::Z);
        let hit = |t: f32, primitive| Hit { t, u: 0.25, v: 0.25, primitive };
        let right = [hit(3.0, 0), hit(3.0, 0), Hit::MISS, hit(3.0, 0), Hit::MISS, hit(3.0, 0)];
        let found = [hit(3.0, 0), Hit::MISS, hit(3.0, 0), hit(3.0, 1), Hit::MISS, hit(3.0_f32.next_up().next_up(), 0)];
        let accuracy = Accuracy::of(|_| ray, Query::Closest, &found, &right, |_| Some(triangle));
        let counts = [accuracy.false_misses, accuracy.false_hits, accuracy.other_ids, accuracy.wrong].map(|w| w.count);
        assert_eq!((counts, accuracy.rays), ([1, 1, 1, 3], 6));
        assert_eq!(accuracy.t_ulp, Some(UlpErrors { p50: 1.0, p99: 1.98, max: 2.0 }));
        let any = Accuracy::of(|_| ray, Query::Any, &found, &right, |_| Some(triangle));
        assert_eq!((any.other_ids.count, any.wrong.count, any.t_ulp), (0, 2, None));
        let sampled = sample(&[triangle], &[(ray, u32::MAX); 6], &found, Query::Closest);
        assert_eq!((sampled.rays, sampled.ambiguous, sampled.wrong.count), (6, 0, 3));
    }

    // Fails when the error of double precision is taken for the hit's.
    #[test]
    fn exact_distances_have_no_error_where_rays_start() {
        let (mut seen, mut doubtful) = (0, 0);
        for i in 0..20_000 {
            let corner = |k| Vec3::from(pcg3d([7, i, k]).map(unit));
            let [a, b, c] = [corner(0), corner(1), corner(2)];
            let ray = Ray::new((a + b + c) / 3.0, corner(3) * 2.0 - Vec3::ONE);
            let triangle = Triangle::new(a, b, c);
            let Some(t) = exact::hit(&ray, &triangle).filter(|t| *t > 0.0) else { continue };
            seen += 1;
            let double = Shear::new(&ray, 0, f64::INFINITY).intersect(&triangle).map(|hit| units_between(t, hit.t));
            doubtful += u32::from(double.is_some_and(|units| units > 1.0));
            assert!(ulp_error(&ray, &triangle, t).is_none_or(|units| units <= 1.0), "{ray:?} {triangle:?}");
        }
        assert!(doubtful > 0, "{seen} rays hit, but none starts close enough to its plane");
    }
}
