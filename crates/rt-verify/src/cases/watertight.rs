//! No ray gets out of a closed surface.

use crate::closed::{Closed, Solid, Target};
use crate::report::Row;
use crate::suite::Stopped;
use crate::tally::Tally;
use crate::trial::{Refusal, Session, Trial};
use crate::{Promise, shapes, tree};
use glam::Vec3;
use rayon::prelude::*;
use rt_core::{Query, Ray, Triangle, random};

pub(super) const SOLIDS: &str = "watertight";
pub(super) const PARTS: &str = "closed parts";

/// How far from the origin the surfaces are, in units of their radius (of 16 to 64 radii more at the last, where the
/// number format has no finer steps).
const OFFSETS: [f32; 6] = [0.0, 1.0, 1e3, 1e5, 1e6, 1e7];

/// Rays made and traced at once.
const BATCH: u32 = 1 << 17;

/// Closed parts of one scene that are tried.
const MOST_PARTS: usize = 6;

/// A closed surface, resident on the device.
struct Resident {
    name: String,
    closed: Closed,
    session: Result<Session, Refusal>,
}

impl Resident {
    fn new(trial: &Trial<'_>, name: String, closed: Closed) -> Self {
        let scene = tree::build(&closed.triangles, trial.options().builder).map_err(Refusal::Broken);
        let session = scene.and_then(|scene| trial.open(&scene));
        Self { name, closed, session }
    }

    /// Sends rays `first .. first + count` and counts those that get out.
    fn count(&mut self, target: Target, seed: u32, first: u32, count: u32, tally: &mut Tally) {
        // Closest and any hit in turn: they are different kernels.
        let query = if first / BATCH % 4 == 3 { Query::Any } else { Query::Closest };
        let closed = &self.closed;
        let escapes: Vec<_> =
            (first..first + count).into_par_iter().map(|index| closed.ray(target, seed, index)).collect();
        let rays: Vec<_> = escapes.iter().map(|escape| (escape.ray, u32::MAX)).collect();
        match self.session.as_mut().map_err(|refusal| refusal.clone()).and_then(|s| s.trace(&rays, query)) {
            Ok(hits) => {
                for (hit, escape) in hits.iter().zip(&escapes) {
                    // Any hit will do for the any-hit query, the nearest one must be on this side.
                    let kept = hit.is_hit() && (query == Query::Any || hit.t <= escape.latest);
                    tally.check(kept, || format!("{}: {:?} gets out: {hit:?}", self.name, escape.ray));
                }
            }
            Err(refusal) => tally.refuse(&refusal, rays.len()),
        }
    }
}

/// A line for each offset and target, over all solids.
pub(super) fn solids(trial: &Trial<'_>, rows: &mut Vec<Row>) -> Result<(), Stopped> {
    let each = trial.options().rays().div_ceil(Solid::ALL.len() as u32);
    let steps = OFFSETS.len() * Target::ALL.len();
    for (i, offset) in OFFSETS.into_iter().enumerate() {
        let place = Vec3::new(offset, -offset, offset);
        let mut residents =
            Solid::ALL.map(|solid| Resident::new(trial, solid.name().to_owned(), Closed::solid(solid, place)));
        for (j, target) in Target::ALL.into_iter().enumerate() {
            let what = format!("{}, offset {}", target.name(), number(offset));
            let mut tally = Tally::new(SOLIDS, what, Promise::Watertight);
            for (k, resident) in residents.iter_mut().enumerate() {
                let mut batches = (0..each).step_by(BATCH as usize);
                batches.try_for_each(|first| {
                    let part = (k as f64 + f64::from(first) / f64::from(each)) / Solid::ALL.len() as f64;
                    trial.advance(((i * Target::ALL.len() + j) as f64 + part) / steps as f64)?;
                    resident.count(target, trial.options().seed, first, BATCH.min(each - first), &mut tally);
                    Ok(())
                })?;
            }
            rows.push(tally.row());
        }
    }
    rows.push(junctions(trial));
    Ok(())
}

/// A cube whose faces are cut unlike each other, so that vertices of one lie on edges of the next: rays from inside at
/// those.
fn junctions(trial: &Trial<'_>) -> Row {
    let options = trial.options();
    let mut tally = Tally::new(SOLIDS, "vertices on edges", Promise::Watertight);
    let ray = |i: u32| {
        let unit = |dimension| Vec3::from(random::pcg3d([options.seed, i, dimension]).map(random::unit));
        let from = unit(40) - 0.5;
        // A point of one of the cube's twelve edges, a vertex of the finest face's there, or any point beside one.
        let steps = random::pcg3d([options.seed, i, 41]);
        let axis = i as usize % 3;
        let mut at = Vec3::ZERO;
        at[axis] = if i.is_multiple_of(2) { (steps[0] % 9) as f32 / 4.0 - 1.0 } else { 2.0 * unit(42).x - 1.0 };
        at[(axis + 1) % 3] = if steps[1].is_multiple_of(2) { 1.0 } else { -1.0 };
        at[(axis + 2) % 3] = if steps[2].is_multiple_of(2) { 1.0 } else { -1.0 };
        (Ray::new(from, at - from), u32::MAX)
    };
    let rays: Vec<_> = (0..options.rays() / 4).map(ray).collect();
    let scene = tree::build(&shapes::junctions(), options.builder).map_err(Refusal::Broken);
    match scene.and_then(|scene| trial.trace(&scene, &rays, Query::Closest)) {
        Ok(hits) => hits.iter().zip(&rays).for_each(|(hit, (ray, _))| {
            tally.check(hit.is_hit(), || format!("{ray:?} gets out of a cube"));
        }),
        Err(refusal) => tally.refuse(&refusal, rays.len()),
    }
    tally.row()
}

/// A line for each scene, over its largest closed parts and all targets.
pub(super) fn parts(trial: &Trial<'_>, rows: &mut Vec<Row>) -> Result<(), Stopped> {
    let models = &trial.suite.models;
    for (i, model) in models.iter().enumerate() {
        let mut tally = Tally::new(PARTS, model.source.clone(), Promise::Watertight);
        let triangles: Vec<Triangle> = (0..model.indices.len() as u32).filter_map(|i| model.triangle(i)).collect();
        let seed = trial.options().seed;
        let parts = Closed::parts(&triangles, MOST_PARTS, seed);
        let sizes: Vec<String> = parts.iter().map(|part| part.triangles.len().to_string()).collect();
        tally.note(match &sizes[..] {
            [] => "no part of the scene is closed".to_owned(),
            sizes => format!("parts of {} triangles", sizes.join(", ")),
        });
        let count = parts.len() * Target::ALL.len();
        for (j, part) in parts.into_iter().enumerate() {
            let mut resident = Resident::new(trial, format!("part {j}"), part);
            let each = (trial.options().rays() / count as u32).max(1);
            for target in Target::ALL {
                trial.advance((i as f64 + j as f64 / sizes.len() as f64) / models.len() as f64)?;
                for first in (0..each).step_by(BATCH as usize) {
                    resident.count(target, seed, first, BATCH.min(each - first), &mut tally);
                }
            }
        }
        rows.push(tally.row());
    }
    Ok(())
}

/// A power of ten as people write it.
pub(super) fn number(x: f32) -> String {
    if x == 0.0 || (0.1..1000.0).contains(&x) { format!("{x}") } else { format!("{x:e}") }
}
