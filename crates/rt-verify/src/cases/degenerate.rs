//! Triangles that are hardly there, and several that are in one place.

use super::watertight::number;
use super::{built, judge_nearest};
use crate::rays::RayMaker;
use crate::report::Row;
use crate::suite::{Exam, Stopped};
use crate::tally::Tally;
use crate::trial::Trial;
use crate::{Promise, brute, shapes, tree};
use glam::Vec3;
use rt_core::{Query, Ray, Triangle, random};

pub(super) const THIN: &str = "thin triangles";
pub(super) const TIES: &str = "ties";

/// Widths of slivers of length 1: below 10⁻⁷ vertices in a unit cube are the same number.
const WIDTHS: [f32; 4] = [1e-3, 1e-5, 1e-6, 1e-7];

/// A line for each width of slivers, then one for triangles without any.
pub(super) fn thin(trial: &Trial<'_>, rows: &mut Vec<Row>) -> Result<(), Stopped> {
    let options = trial.options();
    for width in WIDTHS {
        trial.advance(0.0)?;
        let mut tally = Tally::new(THIN, format!("width {}", number(width)), Promise::Agreement);
        let needles = shapes::needles(300, width, options.seed);
        if let Some(exam) = built(Exam::new("needles".to_owned(), needles, options.sample(), options), &mut tally) {
            judge_nearest(trial, &exam, &mut tally);
        }
        rows.push(tally.row());
    }
    rows.push(without_area(trial));
    Ok(())
}

/// Points and lines among other triangles are never hit.
fn without_area(trial: &Trial<'_>) -> Row {
    let options = trial.options();
    let mut tally = Tally::new(THIN, "without area", Promise::Agreement);
    let [p, q] = [Vec3::new(0.25, 0.5, 0.75), Vec3::new(2.25, 1.5, 1.75)];
    let flat = [Triangle::new(p, p, p), Triangle::new(p, q, q), Triangle::new(p, q, (p + q) * 0.5)];
    let triangles: Vec<_> = flat.into_iter().chain(shapes::soup(5, 0.1, options.seed)).collect();
    let aims = [p, q, (p + q) * 0.5, p + (q - p) * 0.25];
    let ray = |i: u32| {
        let from = Vec3::from(random::pcg3d([options.seed, i, 0]).map(random::unit)) * 8.0 - 4.0;
        (Ray::new(from, aims[i as usize % 4] - from), u32::MAX)
    };
    let rays: Vec<_> = (0..options.sample()).map(ray).collect();
    if let Some(scene) = built(tree::build(&triangles, options.builder), &mut tally) {
        match trial.trace(&scene, &rays, Query::Closest) {
            Ok(hits) => hits.iter().zip(&rays).for_each(|(hit, (ray, _))| {
                tally.check(!hit.is_hit() || hit.primitive >= flat.len() as u32, || format!("{ray:?}: {hit:?}"));
            }),
            Err(refusal) => tally.refuse(&refusal, rays.len()),
        }
    }
    tally.row()
}

pub(super) fn ties(trial: &Trial<'_>, rows: &mut Vec<Row>) -> Result<(), Stopped> {
    trial.advance(0.0)?;
    rows.push(coplanar(trial));
    trial.advance(0.3)?;
    rows.push(duplicates(trial));
    trial.advance(0.6)?;
    rows.push(lattice(trial));
    Ok(())
}

/// Triangles and rays of small whole numbers: rays run along edges, through corners and in planes, and many hits are
/// exactly as near. The lowest id of the nearest wins, whatever the others' rounding.
fn lattice(trial: &Trial<'_>) -> Row {
    let options = trial.options();
    let mut tally = Tally::new(TIES, "whole numbers", Promise::Ties);
    let triangles = shapes::lattice(60, options.seed);
    let ray = |i: u32| {
        let whole =
            |dimension| Vec3::from(random::pcg3d([options.seed, i, dimension]).map(|bits| (bits % 13) as f32 - 6.0));
        let (origin, target) = (whole(30), whole(31));
        (Ray::new(origin, if target == origin { Vec3::X } else { target - origin }), u32::MAX)
    };
    let rays = (0..options.sample()).map(ray).collect();
    if let Some(exam) = built(Exam::with_rays("whole numbers".to_owned(), triangles, rays, options), &mut tally) {
        judge_nearest(trial, &exam, &mut tally);
    }
    tally.row()
}

/// The cells of the plane that ties are made on, along each side.
const SIDE: u32 = 8;

/// Layers in one plane, cut in three ways. Coordinates are dyadic and rays run along an axis: all arithmetic is exact,
/// so every tracer sees the same ties.
fn coplanar(trial: &Trial<'_>) -> Row {
    let options = trial.options();
    let mut tally = Tally::new(TIES, "coplanar layers", Promise::Ties);
    let once = shapes::grid(SIDE, 0.0, 0);
    let turned = once.iter().map(|t| Triangle::new(t.b, t.c, t.a));
    let coarse = shapes::grid(SIDE / 2, 0.0, 0);
    let triangles: Vec<_> = once.iter().rev().copied().chain(turned).chain(coarse).chain(once.clone()).collect();
    // Sixty-four steps to the unit: inside, on edges and on vertices.
    let down = |i: u32| {
        let at = Vec3::new((i % 65) as f32 / 64.0, 1.0, (i / 65) as f32 / 64.0);
        (Ray::new(at, Vec3::NEG_Y), u32::MAX)
    };
    let rays: Vec<_> = (0..65 * 65).map(down).collect();
    if let Some(scene) = built(tree::build(&triangles, options.builder), &mut tally) {
        match trial.trace(&scene, &rays, Query::Closest) {
            Ok(hits) => hits.iter().zip(&rays).for_each(|(hit, (ray, _))| {
                let lowest = brute::closest(&triangles, ray, u32::MAX).primitive;
                tally.check(hit.primitive == lowest, || format!("{ray:?}: {hit:?}, but {lowest} is the lowest id"));
            }),
            Err(refusal) => tally.refuse(&refusal, rays.len()),
        }
    }
    tally.row()
}

/// The same triangles several times: whatever the rounding, copies are met at one distance.
fn duplicates(trial: &Trial<'_>) -> Row {
    let options = trial.options();
    let mut tally = Tally::new(TIES, "duplicates", Promise::Ties);
    let once = shapes::soup(200, 0.4, options.seed);
    let count = once.len() as u32;
    // In another order each time, so that neighbours in the list are no neighbours in space.
    // Strides without a factor of 200, so that each copy has every triangle.
    let copies = [1, 3, 7, 9, 11].map(|stride| (0..count).map(move |i| (i * stride + 37) % count));
    let order: Vec<u32> = copies.into_iter().flatten().collect();
    let triangles: Vec<_> = order.iter().map(|&i| once[i as usize]).collect();
    let mut lowest = vec![u32::MAX; once.len()];
    order.iter().zip(0..).for_each(|(&i, id)| lowest[i as usize] = lowest[i as usize].min(id));
    let mut rays = RayMaker::new(&once, options.seed).mixed(options.rays() / 10);
    rays.iter_mut().for_each(|(_, origin)| *origin = u32::MAX);
    if let Some(scene) = built(tree::build(&triangles, options.builder), &mut tally) {
        match trial.trace(&scene, &rays, Query::Closest) {
            Ok(hits) => hits.iter().zip(&rays).filter(|(hit, _)| hit.is_hit()).for_each(|(hit, (ray, _))| {
                let first = order.get(hit.primitive as usize).map_or(u32::MAX, |&i| lowest[i as usize]);
                tally.check(hit.primitive == first, || format!("{ray:?}: {hit:?}, a copy of {first}"));
            }),
            Err(refusal) => tally.refuse(&refusal, rays.len()),
        }
    }
    tally.row()
}
