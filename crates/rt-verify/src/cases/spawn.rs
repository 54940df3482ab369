//! A ray that leaves a surface does not hit it.

use crate::closed::{Closed, Solid};
use crate::report::Row;
use crate::suite::Stopped;
use crate::tally::Tally;
use crate::trial::{Refusal, Session, Trial};
use crate::{Promise, rays, tree};
use glam::Vec3;
use rayon::prelude::*;
use rt_core::bounce::{Aim, Surfaces};
use rt_core::{Aabb, Query, Ray, RaySource, Triangle, random};
use rt_scene::Model;
use rt_scene::streams::Spawner;
use std::ops::Range;
use std::sync::Arc;

pub(super) const NAME: &str = "self-hits";

/// Rays made and traced at once.
const BATCH: u32 = 1 << 17;

/// Lines on convex surfaces: solid and offset. A sphere far from the origin is not convex after rounding, a box is.
const CONVEX: [(Solid, f32); 4] = [(Solid::Sphere, 0.0), (Solid::Sphere, 1.0), (Solid::Box, 0.0), (Solid::Box, 1e6)];

/// A surface, and what a spawned ray must not hit.
struct Surface {
    model: Model,
    bounds: Aabb,
    /// Nothing at all can be hit from outside; otherwise the triangle that is left must not be.
    convex: bool,
}

impl Surface {
    fn of(triangles: &[Triangle], convex: bool) -> Self {
        let positions: Vec<Vec3> = triangles.iter().flat_map(Triangle::vertices).collect();
        let indices = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        Self::new(Model { positions, indices, ..Model::default() }, convex)
    }

    fn new(model: Model, convex: bool) -> Self {
        Self { bounds: model.bounds(), model, convex }
    }

    /// A ray from around the surface towards a random triangle; from outside where the surface is convex.
    fn ray(&self, seed: u32, index: u32) -> Ray {
        let chosen = random::below(self.model.indices.len() as u32, seed, index, 20);
        let [x, y] = random::pair(seed, index, 21);
        let target = self.model.triangle(chosen).map_or(Vec3::ZERO, |t| t.a * 0.25 + t.b * 0.25 + t.c * 0.5);
        let (middle, reach) = (self.bounds.min.midpoint(self.bounds.max), self.bounds.extent().length());
        let from = middle + rays::sphere([x, y]) * reach * if self.convex { 1.0 } else { 0.4 };
        Ray::new(from, if from == target { Vec3::X } else { target - from })
    }
}

pub(super) fn run(trial: &Trial<'_>, rows: &mut Vec<Row>) -> Result<(), Stopped> {
    let models = &trial.suite.models;
    let lines = (CONVEX.len() + models.len()) as f64;
    // All lines together trace 50 times fewer than there are rays at closed surfaces in all 24 lines, so 10⁷ for
    // 1.6·10⁸.
    let each = (f64::from(trial.options().rays()) * 1.5 / lines) as u32 + 1;
    for (i, (solid, offset)) in CONVEX.into_iter().enumerate() {
        let closed = Closed::solid(solid, Vec3::new(offset, -offset, offset));
        let surface = Surface::of(&closed.triangles, true);
        let what = format!("{}, offset {}", solid.name(), super::watertight::number(offset));
        rows.push(line(trial, &surface, what, each, i as f64 / lines, 1.0 / lines)?);
    }
    for (i, model) in models.iter().enumerate() {
        let surface = Surface::new(model.clone(), false);
        let start = (CONVEX.len() + i) as f64 / lines;
        rows.push(line(trial, &surface, model.source.clone(), each, start, 1.0 / lines)?);
    }
    Ok(())
}

fn line(trial: &Trial<'_>, surface: &Surface, what: String, each: u32, start: f64, share: f64) -> Result<Row, Stopped> {
    let mut tally = Tally::new(NAME, what, Promise::SelfHits);
    let triangles: Vec<Triangle> =
        (0..surface.model.indices.len() as u32).filter_map(|i| surface.model.triangle(i)).collect();
    let scene = tree::build(&triangles, trial.options().builder).map_err(Refusal::Broken);
    match scene.and_then(|scene| Ok((trial.open(&scene)?, Arc::new(Surfaces::new(scene))))) {
        Ok((mut session, surfaces)) => {
            for first in (0..each).step_by(BATCH as usize) {
                trial.advance(start + share * f64::from(first) / f64::from(each))?;
                let count = BATCH.min(each - first);
                if let Err(refusal) = batch(trial, &mut session, (surface, &surfaces), first..first + count, &mut tally)
                {
                    tally.refuse(&refusal, count as usize);
                    break;
                }
            }
        }
        Err(refusal) => tally.refuse(&refusal, each as usize),
    }
    Ok(tally.row())
}

/// Rays towards the surface, then rays from where they hit: once with the primitive that they leave left out, as a path
/// tracer sends them, and once without that help.
fn batch(
    trial: &Trial<'_>,
    session: &mut Session,
    (surface, surfaces): (&Surface, &Arc<Surfaces>),
    numbers: Range<u32>,
    tally: &mut Tally,
) -> Result<(), Refusal> {
    let seed = trial.options().seed;
    let first = numbers.start;
    let rays: Vec<Ray> = numbers.into_par_iter().map(|i| surface.ray(seed, i)).collect();
    let hits = session.trace(&rays.iter().map(|ray| (*ray, u32::MAX)).collect::<Vec<_>>(), Query::Closest)?;
    let source = RaySource::Explicit { rays: rays.into(), origins: None };
    let seed = seed.wrapping_add(first);
    let spawner = Spawner { surfaces, rays: &source, hits: &hits, seed, samples: 1, first_group: 0, bounce: 0 };
    let [spawned] = spawner.streams([Aim::Cosine]);
    let pairs: Vec<(Ray, u32)> = (0..spawned.len()).into_par_iter().map(|i| spawned.ray(i)).collect();
    let alone: Vec<(Ray, u32)> = pairs.iter().map(|(ray, _)| (*ray, u32::MAX)).collect();
    for (rays, how) in [(&pairs, "left out"), (&alone, "not left out")] {
        let hits = session.trace(rays, Query::Closest)?;
        for ((hit, (ray, _)), (_, origin)) in hits.iter().zip(rays).zip(&pairs) {
            let clean = if surface.convex { !hit.is_hit() } else { hit.primitive != *origin };
            tally.check(clean, || format!("{ray:?} from primitive {origin}, {how}: {hit:?}"));
        }
    }
    Ok(())
}
