//! Meshes that make trees deep: whatever the builder, traversal has room, and hits are right.

use super::{built, judge_nearest};
use crate::report::Row;
use crate::suite::{Exam, Stopped};
use crate::tally::Tally;
use crate::trial::{OWN_TREES, Trial};
use crate::{Promise, shapes, tree};
use glam::Vec3;
use rt_bvh::{Builder, Built, MOST_STEPS};
use rt_core::{MAX_DEPTH, Query, Triangle};

pub(super) const NAME: &str = "trees";

/// Triangles with one centroid, and links of a chain.
const EQUAL: u32 = 100_000;
const LINKS: u32 = 2_000;

/// Powers of ten from the smallest to the largest link. A scene is scaled so that its largest coordinate is about 1;
/// what is then below 10⁻³⁸ is subnormal and loses digits, so 30 leave some room.
const DECADES: f32 = 30.0;

/// `count` triangles around one point, each a few percent larger than the one before: greedy clustering joins them one
/// by one.
fn nested(count: u32) -> Vec<Triangle> {
    let size = |i: u32| 10.0_f32.powf(DECADES * (i as f32 / count as f32 - 0.5));
    (0..count).map(|i| around(Vec3::ZERO, size(i), i)).collect()
}

/// A triangle whose corners sum to three times `centre`, exactly where that is the origin.
fn around(centre: Vec3, size: f32, turn: u32) -> Triangle {
    let (x, y) = if turn & 1 == 0 { (Vec3::X, Vec3::Y) } else { (Vec3::Y, Vec3::Z) };
    let (p, q) = (x * size, y * size);
    Triangle::new(centre + p, centre + q, centre - (p + q))
}

/// Triangles at distances that grow by a constant factor: halving the space splits off one at a time.
fn geometric(count: u32) -> Vec<Triangle> {
    let at = |i: u32| 10.0_f32.powf(DECADES * (i as f32 / count as f32 - 0.5));
    (0..count).map(|i| around(Vec3::new(at(i), 0.0, 0.0), 0.01 * at(i), i)).collect()
}

/// Bad meshes, and whether they are so small that the reference can judge.
fn meshes() -> [(&'static str, Vec<Triangle>); 4] {
    let equal = (0..EQUAL).map(|i| around(Vec3::ZERO, 1.0 + (i / 4) as f32 / EQUAL as f32, i)).collect();
    [
        ("equal centroids, 100,000", equal),
        ("copies, 100,000", vec![around(Vec3::ZERO, 1.0, 0); EQUAL as usize]),
        ("nested chain, 2,000", nested(LINKS)),
        ("geometric chain, 2,000", geometric(LINKS)),
    ]
}

pub(super) fn run(trial: &Trial<'_>, rows: &mut Vec<Row>) -> Result<(), Stopped> {
    let meshes = meshes();
    rows.extend(builds(trial, &meshes)?);
    for (i, (name, triangles)) in meshes.iter().enumerate() {
        trial.advance(0.5 + 0.5 * i as f64 / meshes.len() as f64)?;
        rows.push(judged(trial, name, triangles));
    }
    for (name, count) in [("no triangle", 0), ("one triangle", 1), ("two triangles", 2)] {
        let triangles = shapes::soup(count, 1.0, trial.options().seed);
        rows.push(judged(trial, name, &triangles));
    }
    Ok(())
}

/// Lines about the trees of every builder: how deep they are, and what they took.
fn builds(trial: &Trial<'_>, meshes: &[(&str, Vec<Triangle>)]) -> Result<[Row; 2], Stopped> {
    let mut depth = Tally::new(NAME, "depth, every builder", Promise::AnyMesh);
    let mut steps = Tally::new(NAME, "build steps, every builder", Promise::AnyMesh);
    if !trial.walks_our_trees {
        depth.note(OWN_TREES);
        steps.note(OWN_TREES);
        return Ok([depth.row(), steps.row()]);
    }
    let (mut deepest, mut most) = (0, 0.0_f64);
    for (i, (name, triangles)) in meshes.iter().enumerate() {
        let count = triangles.len() as f64;
        for &builder in Builder::ALL {
            trial.advance(0.5 * i as f64 / meshes.len() as f64)?;
            let Some(Built { scene, report }) = built(tree::built(triangles, builder), &mut depth) else { continue };
            deepest = scene.depth().max(deepest);
            depth.check(scene.depth() <= MAX_DEPTH, || format!("{name}, {builder}: depth {}", scene.depth()));
            let took = report.steps as f64 / (count * count.log2());
            most = most.max(took);
            steps.check(took <= MOST_STEPS, || format!("{name}, {builder}: {took:.1} n log₂ n for n triangles"));
        }
    }
    depth.note(format!("deepest {deepest}, room for {MAX_DEPTH}"));
    steps.note(format!("at most {most:.1} n log₂ n for n triangles"));
    Ok([depth.row(), steps.row()])
}

/// A line about the hits on one mesh.
fn judged(trial: &Trial<'_>, name: &'static str, triangles: &[Triangle]) -> Row {
    let options = trial.options();
    let mut tally = Tally::new(NAME, name, Promise::AnyMesh);
    // Nearly every ray meets nearly every triangle, and the reference decides each meeting exactly: half a million of
    // them a second.
    let rays = (600_000 / (triangles.len() as u32 + 1)).clamp(6, options.sample());
    if let Some(exam) = built(Exam::new(name.to_owned(), triangles.to_vec(), rays, options), &mut tally) {
        judge_nearest(trial, &exam, &mut tally);
        match trial.trace(&exam.scene, &[], Query::Closest) {
            Ok(hits) => tally.check(hits.is_empty(), || "hits of no rays".to_owned()),
            Err(refusal) => tally.refuse(&refusal, 1),
        }
    }
    tally.row()
}
