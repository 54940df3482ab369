//! Numbers of far-apart magnitudes in one scene: nothing is rounded away, and nothing is hit that is not there.

use super::{built, judge_nearest};
use crate::report::Row;
use crate::suite::{Exam, Stopped};
use crate::tally::Tally;
use crate::trial::Trial;
use crate::{Promise, rays, shapes};
use glam::Vec3;
use rt_core::{Ray, Triangle, random};

pub(super) const NAME: &str = "magnitudes";

/// How far from what a ray starts, in units of `near`'s own measure, and how far it passes beside, in the same.
const DISTANCES: [f32; 4] = [0.5, 3.0, 100.0, 1e4];
const ASIDE: [f32; 4] = [0.0, 0.0, 1e-3, 0.5];

pub(super) fn run(trial: &Trial<'_>, rows: &mut Vec<Row>) -> Result<(), Stopped> {
    let options = trial.options();
    let seed = options.seed;
    let scenes: [(&str, Vec<Triangle>, Option<f32>); 3] = [
        ("10⁻³⁰ beside 3·10³⁸", shapes::far_apart(150, seed), None),
        ("size 10⁻¹⁴ from afar", shapes::tiny_and_far(60, seed), Some(5.0)),
        ("terrain without data", shapes::no_data(12, seed), None),
    ];
    for (i, (name, triangles, unit)) in scenes.into_iter().enumerate() {
        trial.advance(i as f64 / 3.0)?;
        let mut tally = Tally::new(NAME, name, Promise::Agreement);
        let rays = (0..options.sample()).filter_map(|i| near(&triangles, unit, seed, i)).collect();
        if let Some(exam) = built(Exam::with_rays(name.to_owned(), triangles, rays, options), &mut tally) {
            judge_nearest(trial, &exam, &mut tally);
        }
        rows.push(tally.row());
    }
    Ok(())
}

/// A ray at or beside a random triangle, from near by as the triangle measures it, or in multiples of `unit`; `None`
/// where its numbers would overflow.
fn near(triangles: &[Triangle], unit: Option<f32>, seed: u32, index: u32) -> Option<(Ray, u32)> {
    let triangle = &triangles[random::below(triangles.len() as u32, seed, index, 20) as usize];
    let [a, b, c] = triangle.vertices();
    let [u, v] = random::pair(seed, index, 21);
    let point = match index % 5 {
        0 => a,
        1 => a + (b - a) * u,
        _ => a + (b - a) * (u * (1.0 - v)) + (c - a) * (v * 0.5),
    };
    let size = unit.unwrap_or((b - a).abs().max((c - a).abs()).max_element());
    let [from, aside] = [22, 23].map(|dimension| rays::sphere(random::pair(seed, index, dimension)));
    let origin = point + from * (size * DISTANCES[index as usize / 5 % 4]);
    let target = point + aside * (size * ASIDE[index as usize / 20 % 4]);
    let ray = Ray::new(origin, target - origin);
    (ray.is_valid() && ray.direction != Vec3::ZERO).then_some((ray, u32::MAX))
}
