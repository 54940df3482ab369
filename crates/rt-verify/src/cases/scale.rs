//! Units do not matter: of the scene, and of directions.

use super::watertight::number;
use super::{built, judge_nearest};
use crate::closed::{Closed, Solid, Target};
use crate::rays::RayMaker;
use crate::report::Row;
use crate::suite::{Exam, Stopped};
use crate::tally::Tally;
use crate::trial::Trial;
use crate::{Promise, shapes, tree};
use glam::Vec3;
use rt_core::{Hit, Query, Ray, Triangle};

pub(super) const SWEEP: &str = "scale";
pub(super) const POWERS: &str = "powers of two";
pub(super) const LENGTHS: &str = "direction length";

/// Scales of scenes and lengths of directions: single precision ends at 3.4·10³⁸ and, with all its digits, at 10⁻³⁸.
const SCALES: [f32; 8] = [1e-30, 1e-20, 1e-10, 1e-5, 1e5, 1e10, 1e20, 1e30];

/// A line for each scale: a closed sphere does not leak, and a soup's hits are the reference's.
pub(super) fn sweep(trial: &Trial<'_>, rows: &mut Vec<Row>) -> Result<(), Stopped> {
    let options = trial.options();
    for (i, scale) in SCALES.into_iter().enumerate() {
        trial.advance(i as f64 / SCALES.len() as f64)?;
        let mut tally = Tally::new(SWEEP, format!("times {}", number(scale)), Promise::Agreement);
        let sphere = Closed::solid(Solid::Sphere, Vec3::ZERO).scaled(scale);
        let escapes = (0..options.rays() / 8).map(|k| sphere.ray(Target::ALL[k as usize % 4], options.seed, k));
        let (rays, latest): (Vec<_>, Vec<_>) = escapes.map(|e| ((e.ray, u32::MAX), e.latest)).unzip();
        if let Some(scene) = built(tree::build(&sphere.triangles, options.builder), &mut tally) {
            match trial.trace(&scene, &rays, Query::Closest) {
                Ok(hits) => hits.iter().zip(&latest).zip(&rays).for_each(|((hit, latest), (ray, _))| {
                    tally.check(hit.is_hit() && hit.t <= *latest, || format!("{ray:?} gets out of a sphere: {hit:?}"));
                }),
                Err(refusal) => tally.refuse(&refusal, rays.len()),
            }
        }
        let soup: Vec<Triangle> = shapes::soup(300, 0.3, options.seed).iter().map(|t| t.scaled(scale)).collect();
        if let Some(exam) = built(Exam::new("soup".to_owned(), soup, options.sample(), options), &mut tally) {
            judge_nearest(trial, &exam, &mut tally);
        }
        rows.push(tally.row());
    }
    Ok(())
}

/// Multiples of 2⁻¹⁰, so that times 2⁻¹⁰⁰ no coordinate is subnormal.
fn coarse(p: Vec3) -> Vec3 {
    (p * 1024.0).round() / 1024.0
}

/// A line for each power of two: every bit of every hit is as it was, but for the exponent of `t`.
pub(super) fn powers_of_two(trial: &Trial<'_>, rows: &mut Vec<Row>) -> Result<(), Stopped> {
    let options = trial.options();
    let triangles: Vec<Triangle> = [shapes::icosphere(3), shapes::soup(300, 0.4, options.seed)]
        .concat()
        .iter()
        .map(|t| Triangle::new(coarse(t.a), coarse(t.b), coarse(t.c)))
        .collect();
    let rays: Vec<(Ray, u32)> = RayMaker::new(&triangles, options.seed)
        .mixed(options.rays() / 10)
        .into_iter()
        .map(|(ray, origin)| (Ray::new(coarse(ray.origin), ray.direction), origin))
        .collect();
    let trace = |triangles: &[Triangle], rays: &[(Ray, u32)], tally: &mut Tally| -> Option<Vec<Hit>> {
        let scene = built(tree::build(triangles, options.builder), tally)?;
        trial.trace(&scene, rays, Query::Closest).map_err(|refusal| tally.refuse(&refusal, rays.len())).ok()
    };
    const EXPONENTS: [i32; 8] = [-100, -64, -20, -1, 1, 20, 64, 100];
    let mut tally = Tally::new(POWERS, "exponents -100 to 100", Promise::ScaleInvariance);
    let Some(unit) = trace(&triangles, &rays, &mut tally) else {
        rows.push(tally.row());
        return Ok(());
    };
    for (i, exponent) in EXPONENTS.into_iter().enumerate() {
        trial.advance(i as f64 / EXPONENTS.len() as f64)?;
        let factor = 2.0_f32.powi(exponent);
        let scaled: Vec<Triangle> = triangles.iter().map(|t| t.scaled(factor)).collect();
        let moved: Vec<_> = rays.iter().map(|(r, o)| (Ray::new(r.origin * factor, r.direction), *o)).collect();
        let Some(hits) = trace(&scaled, &moved, &mut tally) else { continue };
        for ((hit, before), (ray, _)) in hits.iter().zip(&unit).zip(&moved) {
            let bits = |h: &Hit, t: f32| [t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.primitive];
            // A distance that leaves the normal range has no bits to keep.
            let t = before.t * factor;
            if before.is_hit() && before.t != 0.0 && !t.is_normal() {
                continue;
            }
            tally.check(bits(hit, hit.t) == bits(before, t), || {
                format!("times 2^{exponent}: {ray:?}: {hit:?}, but {before:?} before")
            });
        }
    }
    rows.push(tally.row());
    Ok(())
}

/// A line for each length: hits are the reference's.
pub(super) fn direction_lengths(trial: &Trial<'_>, rows: &mut Vec<Row>) -> Result<(), Stopped> {
    let options = trial.options();
    let triangles = shapes::soup(300, 0.3, options.seed);
    let rays = RayMaker::new(&triangles, options.seed).mixed(options.sample());
    for (i, length) in SCALES.into_iter().enumerate() {
        trial.advance(i as f64 / SCALES.len() as f64)?;
        let mut tally = Tally::new(LENGTHS, format!("times {}", number(length)), Promise::Agreement);
        let rays = rays.iter().map(|(r, o)| (Ray::new(r.origin, r.direction * length), *o)).collect();
        if let Some(exam) = built(Exam::with_rays("soup".to_owned(), triangles.clone(), rays, options), &mut tally) {
            judge_nearest(trial, &exam, &mut tally);
        }
        rows.push(tally.row());
    }
    Ok(())
}
