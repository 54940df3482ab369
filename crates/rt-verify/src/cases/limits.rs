//! Rays at the ends: of what is valid, of the number format, and of `tmin` and `tmax`.

use super::{built, judge_nearest};
use crate::rays::{Aim, RayMaker};
use crate::report::Row;
use crate::suite::{Exam, Stopped};
use crate::tally::Tally;
use crate::trial::Trial;
use crate::{Promise, shapes, tree};
use glam::Vec3;
use rt_core::{Hit, Query, Ray, Triangle};

pub(super) const INVALID: &str = "invalid rays";
pub(super) const LIMITS: &str = "ends";

/// How much an invalid ray may cost, in units of a valid one.
const PRICE: f64 = 1.1;

/// Rays that must miss whatever the scene, made from a valid one.
fn poisoned(good: Ray) -> Vec<Ray> {
    let mut rays = vec![
        Ray::new(good.origin, Vec3::ZERO),
        Ray::new(good.origin, Vec3::new(0.0, -0.0, 0.0)),
        good.with_range(1.0, 0.5),
        good.with_range(f32::INFINITY, 0.0),
        good.with_range(f32::NAN, f32::INFINITY),
        good.with_range(0.0, f32::NAN),
        good.with_range(0.0, -1.0),
        good.with_range(0.0, f32::NEG_INFINITY),
    ];
    for poison in [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for axis in 0..3 {
            let (mut origin, mut direction) = (good, good);
            origin.origin[axis] = poison;
            direction.direction[axis] = poison;
            rays.extend([origin, direction]);
        }
    }
    rays
}

pub(super) fn invalid(trial: &Trial<'_>, rows: &mut Vec<Row>) -> Result<(), Stopped> {
    trial.advance(0.0)?;
    let options = trial.options();
    let mut misses = Tally::new(INVALID, "miss", Promise::InvalidRays);
    let mut beside = Tally::new(INVALID, "valid neighbours hit", Promise::InvalidRays);
    let mut price = Tally::new(INVALID, "cost", Promise::InvalidRays);
    let triangles = shapes::icosphere(4);
    let Some(scene) = built(tree::build(&triangles, options.builder), &mut misses) else {
        rows.push(misses.row());
        return Ok(());
    };
    let maker = RayMaker::new(&triangles, options.seed);
    let from_inside = |i: u32| Ray { origin: Vec3::ZERO, ..maker.ray(crate::rays::Aim::Interior, i).0 };
    let bad: Vec<_> = (0..options.rays() / 100).flat_map(|i| poisoned(from_inside(i))).map(|r| (r, u32::MAX)).collect();
    let good: Vec<_> = (0..bad.len() as u32).map(|i| (from_inside(i), u32::MAX)).collect();
    // In turn, since devices trace neighbours together.
    let mixed: Vec<_> = bad.iter().zip(&good).flat_map(|(bad, good)| [*bad, *good]).collect();
    for query in [Query::Closest, Query::Any] {
        match trial.trace(&scene, &mixed, query) {
            Ok(hits) => {
                for (pair, rays) in hits.chunks_exact(2).zip(mixed.chunks_exact(2)) {
                    misses.check(pair[0] == Hit::MISS, || format!("{:?}: {:?}", rays[0].0, pair[0]));
                    beside.check(pair[1].is_hit(), || format!("{:?} misses beside {:?}", rays[1].0, rays[0].0));
                }
            }
            Err(refusal) => misses.refuse(&refusal, bad.len()),
        }
    }
    let few = bad.len().min(10_000);
    let counted =
        trial.open(&scene).and_then(|mut session| Ok([session.counts(&bad[..few])?, session.counts(&good[..few])?]));
    match counted {
        Ok(counts) => {
            let [bad, good] = counts.map(|c| c.iter().map(|c| f64::from(c.boxes + c.triangles)).sum::<f64>());
            price.check(bad <= PRICE * good, || format!("{bad} tests, {good} of as many valid rays"));
            price.note(format!("{:.2} of a valid ray's tests", bad / good));
        }
        Err(refusal) => price.refuse(&refusal, 1),
    }
    rows.extend([misses.row(), beside.row(), price.row()]);
    Ok(())
}

pub(super) fn ends(trial: &Trial<'_>, rows: &mut Vec<Row>) -> Result<(), Stopped> {
    trial.advance(0.0)?;
    let mut ahead = Tally::new(LIMITS, "tmin and tmax", Promise::Agreement);
    let mut behind = Tally::new(LIMITS, "before the origin", Promise::Agreement);
    limits(trial, &mut ahead, false);
    limits(trial, &mut behind, true);
    rows.extend([ahead.row(), behind.row()]);
    trial.advance(0.3)?;
    rows.push(at_zero(trial));
    trial.advance(0.5)?;
    rows.extend(subnormal(trial));
    Ok(())
}

/// Triangles at dyadic distances in front of an axis-aligned ray: `t` is exact, so its limits are.
fn limits(trial: &Trial<'_>, tally: &mut Tally, behind: bool) {
    let at = |z: f32| Triangle::new(Vec3::new(-1.0, -1.0, z), Vec3::new(3.0, -1.0, z), Vec3::new(-1.0, 3.0, z));
    let triangles: Vec<_> = [0.0, 2.0, 5.0].map(at).into();
    let Some(scene) = built(tree::build(&triangles, trial.options().builder), tally) else { return };
    let infinity = f32::INFINITY;
    // Where the ray starts, its limits, and the triangle that it must hit.
    let mut cases = Vec::new();
    for (z, length) in [(-1.0_f32, 1.0_f32), (-1.0, 0.25), (-3.0, 8.0)] {
        let t = |plane: f32| (plane - z) / length;
        let [first, second, third] = [t(0.0), t(2.0), t(5.0)];
        cases.extend([
            (z, length, 0.0, infinity, Some(0)),
            (z, length, -0.0, infinity, Some(0)),
            (z, length, 0.0, first, Some(0)),
            (z, length, first, first, Some(0)),
            (z, length, first, infinity, Some(0)),
            (z, length, 0.0, first.next_down(), None),
            (z, length, first.next_up(), infinity, Some(1)),
            (z, length, first.next_up(), second.next_down(), None),
            (z, length, second, third, Some(1)),
            (z, length, second.next_up(), third, Some(2)),
            (z, length, third, infinity, Some(2)),
            (z, length, third.next_up(), infinity, None),
            (z, length, third, f32::MAX, Some(2)),
            (z, length, second, first, None),
            (z, length, infinity, infinity, None),
            (z, length, 0.0, f32::from_bits(1), None),
        ]);
    }
    // On a triangle, a distance of zero of either sign is a distance.
    for (tmin, tmax) in [(0.0, infinity), (-0.0, infinity), (0.0, 0.0), (-0.0, -0.0), (-0.0, 0.0), (0.0, -0.0)] {
        cases.push((2.0, 1.0, tmin, tmax, Some(1)));
    }
    if behind {
        cases = vec![
            (1.0, 1.0, f32::NEG_INFINITY, infinity, Some(0)),
            (1.0, 0.5, -2.0, -2.0, Some(0)),
            (1.0, 1.0, -1.0, -0.0, Some(0)),
            (1.0, 1.0, (-1.0_f32).next_up(), 0.0, None),
            (3.0, 1.0, -2.0, 0.0, Some(1)),
            (9.0, 1.0, f32::MIN, -1.0, Some(0)),
            (9.0, 1.0, f32::NEG_INFINITY, f32::NEG_INFINITY, None),
        ];
    }
    // Inside the triangles and on their edges, along the axis and slanted by exact amounts.
    let rays: Vec<_> = [0.0, 0.25, 1.0]
        .into_iter()
        .flat_map(|x| {
            cases.iter().map(move |&(z, length, tmin, tmax, expected)| {
                let ray = Ray::new(Vec3::new(x, 0.0, z), Vec3::new(0.0, 0.0, length)).with_range(tmin, tmax);
                (ray, expected.unwrap_or(u32::MAX))
            })
        })
        .collect();
    let plain: Vec<_> = rays.iter().map(|(ray, _)| (*ray, u32::MAX)).collect();
    for query in [Query::Closest, Query::Any] {
        match trial.trace(&scene, &plain, query) {
            Ok(hits) => hits.iter().zip(&rays).for_each(|(hit, (ray, expected))| {
                let right = match query {
                    Query::Closest | Query::All { .. } => hit.primitive == *expected,
                    Query::Any => hit.is_hit() == (*expected != u32::MAX),
                };
                tally.check(right, || format!("{query:?}: {ray:?}: {hit:?}, not primitive {}", *expected as i32));
            }),
            Err(refusal) => tally.refuse(&refusal, rays.len()),
        }
    }
}

/// Origins exactly on triangles, in them, on their edges and at their corners: with `tmin` at 0 they are hit at 0, and
/// beyond that not. Coordinates are few bits each, so that single precision can say such origins.
fn at_zero(trial: &Trial<'_>) -> Row {
    let options = trial.options();
    let mut tally = Tally::new(LIMITS, "origins on triangles", Promise::Agreement);
    let triangles = shapes::lattice(40, options.seed);
    let maker = RayMaker::new(&triangles, options.seed);
    let ray = |i: u32| {
        let [a, b, c] = triangles[i as usize % triangles.len()].vertices();
        // Multiples of 1/8 of small whole numbers: exact.
        let weights =
            [[2, 3, 3], [4, 0, 4], [8, 0, 0], [1, 1, 6]][i as usize / triangles.len() % 4].map(|w| w as f32 / 8.0);
        let origin = a * weights[0] + b * weights[1] + c * weights[2];
        let ray = Ray::new(origin, maker.ray(Aim::Diffuse, i).0.direction);
        let least = f32::from_bits(1);
        let limits = [[0.0, f32::INFINITY], [-0.0, 0.0], [least, f32::INFINITY], [f32::NEG_INFINITY, 0.0]];
        let [tmin, tmax] = limits[i as usize / 7 % 4];
        (ray.with_range(tmin, tmax), u32::MAX)
    };
    let rays = (0..options.sample()).map(ray).collect();
    if let Some(exam) = built(Exam::with_rays("whole numbers".to_owned(), triangles.clone(), rays, options), &mut tally)
    {
        judge_nearest(trial, &exam, &mut tally);
    }
    tally.row()
}

/// Subnormal directions and subnormal scenes: hits are the reference's.
fn subnormal(trial: &Trial<'_>) -> [Row; 2] {
    let options = trial.options();
    let mut directions = Tally::new(LIMITS, "subnormal directions", Promise::Agreement);
    let triangles = shapes::soup(300, 0.3, options.seed);
    let maker = RayMaker::new(&triangles, options.seed);
    let tiny = |(ray, origin): (Ray, u32)| {
        let direction = ray.direction * 1e-40;
        let direction = if direction == Vec3::ZERO { Vec3::splat(f32::from_bits(1)) } else { direction };
        (Ray::new(ray.origin, direction), origin)
    };
    let rays = maker.mixed(options.sample()).into_iter().map(tiny).collect();
    if let Some(exam) = built(Exam::with_rays("soup".to_owned(), triangles.clone(), rays, options), &mut directions) {
        judge_nearest(trial, &exam, &mut directions);
    }
    let mut vertices = Tally::new(LIMITS, "subnormal vertices", Promise::Agreement);
    let triangles: Vec<_> = triangles.iter().map(|t| t.scaled(1e-40)).collect();
    if let Some(exam) = built(Exam::new("soup".to_owned(), triangles, options.sample(), options), &mut vertices) {
        judge_nearest(trial, &exam, &mut vertices);
    }
    [directions.row(), vertices.row()]
}
