//! Meshes that nobody meant: random bits, indices that lead nowhere, vertices that are not numbers.

use crate::Promise;
use crate::reference::{Reference, Verdict};
use crate::report::Row;
use crate::suite::Stopped;
use crate::tally::Tally;
use crate::trial::{Refusal, Trial};
use glam::Vec3;
use rt_bvh::{BuildError, BuildOptions, Built, InvalidTriangles, Mesh};
use rt_core::{Hit, MAX_DEPTH, Query, Ray, Triangle, random};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

pub(super) const NAME: &str = "garbage";

/// The longest a build of some hundred triangles may take: ten thousand times what it takes.
const PATIENCE: Duration = Duration::from_secs(30);

/// Rays on each mesh.
const RAYS: u32 = 64;

/// Of so many meshes one is traced on the device, where opening a scene takes long.
const TRACED: u32 = 4;

/// Kinds of garbage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// Any 32 bits as coordinate.
    Bits,
    /// Any finite number, whatever its magnitude.
    Finite,
    /// Few different numbers, so that triangles degenerate and coincide; NaN, infinities and subnormals among them.
    Poor,
    /// Indices that lead nowhere.
    Indices,
}

const KINDS: [(Kind, &str); 4] = [
    (Kind::Bits, "random bits"),
    (Kind::Finite, "random finite bits"),
    (Kind::Poor, "special values"),
    (Kind::Indices, "wild indices"),
];

/// What [`Kind::Poor`] draws from.
const POOR: [f32; 10] = [0.0, -0.0, 1.0, -1.0, 1e-45, f32::MIN_POSITIVE, f32::MAX, f32::MIN, f32::NAN, f32::INFINITY];

fn word(seed: u32, index: u32, dimension: u32) -> u32 {
    random::pcg3d([seed, index, dimension])[0]
}

fn coordinate(kind: Kind, seed: u32, index: u32, dimension: u32) -> f32 {
    let bits = word(seed, index, dimension);
    match kind {
        Kind::Bits => f32::from_bits(bits),
        // Clearing one bit of the exponent leaves a finite number of any other magnitude.
        Kind::Finite | Kind::Indices => f32::from_bits(bits & !(1 << (23 + bits % 8))),
        Kind::Poor => POOR[bits as usize % POOR.len()],
    }
}

fn mesh(kind: Kind, seed: u32, number: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let seed = word(seed, number, 99);
    let vertices = 1 + word(seed, 0, 98) % 200;
    let triangles = 1 + word(seed, 1, 98) % 200;
    let vertex = |i| Vec3::from([0, 1, 2].map(|axis| coordinate(kind, seed, i, axis)));
    let index = |i: u32, corner: u32| {
        let bits = word(seed, i, 10 + corner);
        if kind == Kind::Indices && bits & 7 == 0 { bits } else { (bits >> 3) % vertices }
    };
    let corners = |i| [0, 1, 2].map(|corner| index(i, corner));
    ((0..vertices).map(vertex).collect(), (0..triangles).map(corners).collect())
}

/// What became of a build.
enum Outcome {
    Built(Box<Built>),
    Refused(BuildError),
    Panicked,
    Hung,
}

/// Builds on a thread of its own, which is left behind if it hangs.
fn build(positions: Arc<[Vec3]>, indices: Arc<[[u32; 3]]>, options: BuildOptions) -> Outcome {
    let (send, receive) = channel();
    let work = move || {
        let mesh = Mesh { positions: &positions, indices: &indices };
        let result = catch_unwind(AssertUnwindSafe(|| rt_bvh::build(mesh, &options)));
        let outcome = match result {
            Ok(Ok(built)) => Outcome::Built(Box::new(built)),
            Ok(Err(error)) => Outcome::Refused(error),
            Err(_) => Outcome::Panicked,
        };
        // Nobody waits any more after a hang.
        let _ = send.send(outcome);
    };
    let Ok(_detached) = std::thread::Builder::new().name("rt-verify-build".to_owned()).spawn(work) else {
        return Outcome::Hung;
    };
    match receive.recv_timeout(PATIENCE) {
        Ok(outcome) => outcome,
        Err(RecvTimeoutError::Timeout) => Outcome::Hung,
        Err(RecvTimeoutError::Disconnected) => Outcome::Panicked,
    }
}

pub(super) fn run(trial: &Trial<'_>, rows: &mut Vec<Row>) -> Result<(), Stopped> {
    let meshes = (trial.options().rays() / 500).clamp(20, 5_000);
    for (k, (kind, name)) in KINDS.into_iter().enumerate() {
        let mut tally = Tally::new(NAME, name, Promise::AnyMesh);
        let mut refused = 0;
        // What is only built says nothing about a tracer that builds its own trees.
        let every = if trial.walks_our_trees { 1 } else { TRACED };
        for number in (0..meshes).step_by(every as usize) {
            trial.advance((k as f64 + f64::from(number) / f64::from(meshes)) / KINDS.len() as f64)?;
            let fault = one(trial, kind, number, &mut refused);
            tally.check(fault.is_none(), || format!("mesh {number}: {}", fault.unwrap_or_default()));
        }
        tally.note(format!("{refused} of {meshes} refused with a reason"));
        rows.push(tally.row());
    }
    Ok(())
}

/// What is wrong with how one mesh was treated.
fn one(trial: &Trial<'_>, kind: Kind, number: u32, refused: &mut u32) -> Option<String> {
    let seed = trial.options().seed;
    let (positions, indices) = mesh(kind, seed, number);
    let finite = positions.iter().all(|p| p.is_finite());
    let in_range = indices.iter().flatten().all(|&i| (i as usize) < positions.len());
    let used_finite = finite || !in_range || indices.iter().flatten().all(|&i| positions[i as usize].is_finite());
    let (positions, indices): (Arc<[Vec3]>, Arc<[[u32; 3]]>) = (positions.into(), indices.into());
    let builders = rt_bvh::Builder::ALL;
    let options =
        |invalid| BuildOptions { builder: builders[number as usize % builders.len()], invalid, max_leaf: number % 9 };
    // By default such meshes are refused, with the reason.
    match build(Arc::clone(&positions), Arc::clone(&indices), options(InvalidTriangles::Refuse)) {
        Outcome::Built(_) if !in_range => return Some("an index that leads nowhere was accepted".to_owned()),
        Outcome::Built(_) if !used_finite => return Some("a vertex that is not finite was accepted".to_owned()),
        Outcome::Refused(BuildError::IndexOutOfRange { .. }) if !in_range => *refused += 1,
        Outcome::Refused(BuildError::NotFinite { .. }) if !used_finite => *refused += 1,
        Outcome::Refused(error) => return Some(format!("refused for a wrong reason: {error}")),
        Outcome::Panicked => return Some("the build panicked".to_owned()),
        Outcome::Hung => return Some(format!("the build took more than {} s", PATIENCE.as_secs())),
        Outcome::Built(_) => {}
    }
    // On request they are left out; the rest is traced.
    let triangles = in_range.then(|| indices.iter().map(|corners| corners.map(|i| positions[i as usize])));
    let triangles: Vec<Triangle> = triangles.into_iter().flatten().map(|[a, b, c]| Triangle::new(a, b, c)).collect();
    match build(positions, indices, options(InvalidTriangles::Drop)) {
        Outcome::Built(built) if built.scene.depth() > MAX_DEPTH => Some(format!("depth {}", built.scene.depth())),
        Outcome::Built(built) if number.is_multiple_of(TRACED) => trace(trial, kind, number, *built, &triangles),
        Outcome::Built(_) => None,
        Outcome::Refused(_) if !in_range => None,
        Outcome::Refused(error) => Some(format!("refused, though triangles may be dropped: {error}")),
        Outcome::Panicked => Some("the build panicked".to_owned()),
        Outcome::Hung => Some(format!("the build took more than {} s", PATIENCE.as_secs())),
    }
}

/// Rays of the same garbage, some of them at triangles. Each answer must be the right one; of tracers that do not
/// promise that, a miss, or a hit within the ray's limits on a triangle that exists.
fn trace(trial: &Trial<'_>, kind: Kind, number: u32, built: Built, triangles: &[Triangle]) -> Option<String> {
    let seed = word(trial.options().seed, number, 97);
    let rays: Vec<(Ray, u32)> = (0..RAYS)
        .map(|i| {
            let number = |dimension| coordinate(kind, seed, i, dimension);
            let origin = Vec3::new(number(0), number(1), number(2));
            let mut ray = Ray::new(origin, Vec3::new(number(3), number(4), number(5)));
            if i & 6 == 0
                && let Some(triangle) = triangles.get(word(seed, i, 8) as usize % triangles.len().max(1))
            {
                ray.direction = triangle.a * 0.25 + triangle.b * 0.5 + triangle.c * 0.25 - origin;
            }
            (if i & 1 == 0 { ray } else { ray.with_range(number(6), number(7)) }, u32::MAX)
        })
        .collect();
    let verdicts = if trial.exact { Reference::new(triangles).resolve_all(&rays) } else { Vec::new() };
    let count = built.scene.primitive_count();
    let scene = built.scene;
    for query in [Query::Closest, Query::Any] {
        let hits = match trial.trace(&scene, &rays, query) {
            Ok(hits) => hits,
            Err(Refusal::Unsupported(_)) => return None,
            Err(Refusal::OutOfMemory(reason) | Refusal::Broken(reason)) => return Some(reason),
        };
        let sane = |hit: &Hit, ray: &Ray| {
            *hit == Hit::MISS
                || (ray.is_valid()
                    && hit.primitive < count
                    && ray.tmin <= hit.t
                    && hit.t <= ray.tmax
                    && hit.t.is_finite())
        };
        if let Some((hit, (ray, _))) = hits.iter().zip(&rays).find(|(hit, (ray, _))| !sane(hit, ray)) {
            return Some(format!("{query:?}: {ray:?}: {hit:?}"));
        }
        let right = |hit: &Hit, verdict: &Verdict| match query {
            Query::Closest | Query::All { .. } => verdict.is_right(hit),
            Query::Any => verdict.right().is_some() == hit.is_hit(),
        };
        let judged = hits.iter().zip(&verdicts).zip(&rays);
        if let Some(((hit, verdict), (ray, _))) = judged.into_iter().find(|((hit, verdict), _)| !right(hit, verdict)) {
            return Some(format!("{query:?}: {ray:?}: {hit:?}, but {verdict}"));
        }
    }
    None
}
