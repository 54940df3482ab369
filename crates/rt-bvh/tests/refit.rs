//! Trees that are fitted to triangles which have moved.

use glam::Vec3;
use rt_bvh::{BuildOptions, Builder, Mesh, PlocQuality, Stack, TreeStats, build, refit, trace};
use rt_core::{Hit, Ray, Scene, StreamSpec};

const SIDE: u32 = 24;

/// A sheet with a wave through it; `height` 0 is flat, and `shift` moves it.
fn sheet(height: f32, shift: f32) -> Vec<Vec3> {
    let at = |i: u32| i as f32 / (SIDE - 1) as f32;
    let point = |i: u32| {
        let (x, y) = (at(i % SIDE), at(i / SIDE));
        Vec3::new(x + shift, y, height * (9.0 * x + 5.0 * y).sin())
    };
    (0..SIDE * SIDE).map(point).collect()
}

fn faces() -> Vec<[u32; 3]> {
    let corners = (0..SIDE * SIDE).filter(|i| i % SIDE < SIDE - 1 && i / SIDE < SIDE - 1);
    corners.flat_map(|i| [[i, i + 1, i + SIDE], [i + 1, i + SIDE + 1, i + SIDE]]).collect()
}

fn hits(scene: &Scene, shift: f32) -> Vec<Hit> {
    let ray = |i: u32| {
        let (x, y) = ((i % 40) as f32 / 38.0, (i / 40) as f32 / 38.0);
        (Ray::new(Vec3::new(x + shift, y, 2.0), Vec3::new(0.1, -0.05, -1.0)), u32::MAX)
    };
    let mut found = Vec::new();
    let mut stack = Stack::for_scene(scene);
    trace(scene, &mut stack, StreamSpec::default(), (0..1600).map(ray), |hit, _| found.push(hit));
    found
}

/// Mutants: boxes kept as they were; triangles in the new mesh's order instead of the leaves'; the unit kept.
#[test]
fn hits_are_those_of_a_tree_built_anew() {
    let faces = faces();
    for builder in [Builder::Sah, Builder::Ploc(PlocQuality::Fast)] {
        let options = BuildOptions { builder, ..BuildOptions::default() };
        let first = build(Mesh { positions: &sheet(0.0, 0.0), indices: &faces }, &options).expect("a sheet").scene;
        for (height, shift) in [(0.3, 0.0), (0.01, 1e6), (50.0, -3.0), (0.3, 1e-3)] {
            let moved = sheet(height, shift);
            let mesh = Mesh { positions: &moved, indices: &faces };
            let fitted = refit(&first, mesh, &options).expect("a sheet").expect("the same triangles");
            let anew = build(mesh, &options).expect("a sheet").scene;
            let (fitted_hits, anew_hits) = (hits(&fitted, shift), hits(&anew, shift));
            assert_eq!(fitted_hits, anew_hits);
            assert!(anew_hits.iter().any(Hit::is_hit));
            // Fitted to itself it is what it was.
            let again = refit(&fitted, mesh, &options).expect("a sheet").expect("the same triangles");
            assert_eq!(again.nodes(), fitted.nodes());
        }
    }
}

/// Mutants: as many triangles taken for the same ones; one without area left in the tree, or out of it.
#[test]
fn other_triangles_have_another_tree() {
    let (faces, positions, options) = (faces(), sheet(0.2, 0.0), BuildOptions::default());
    let scene = build(Mesh { positions: &positions, indices: &faces }, &options).expect("a sheet").scene;
    let fitted = |positions: &[Vec3], indices: &[[u32; 3]]| {
        refit(&scene, Mesh { positions, indices }, &options).expect("a mesh").is_some()
    };
    assert!(fitted(&positions, &faces));
    assert!(!fitted(&positions, &faces[1..]));
    let mut flat = faces.clone();
    flat[5] = [0, 0, 1];
    assert!(!fitted(&positions, &flat));
    // The other way round, and one for another.
    let scene = build(Mesh { positions: &positions, indices: &flat }, &options).expect("a sheet").scene;
    let fitted =
        |indices: &[[u32; 3]]| refit(&scene, Mesh { positions: &positions, indices }, &options).expect("a mesh");
    assert!(fitted(&faces).is_none());
    let mut other = faces;
    other[6] = [0, 0, 1];
    assert!(fitted(&other).is_none());
}

/// What is torn apart costs more, and says so.
#[test]
fn a_tree_s_cost_grows_with_what_it_is_fitted_to() {
    let (faces, options) = (faces(), BuildOptions::default());
    let positions = sheet(0.2, 0.0);
    let scene = build(Mesh { positions: &positions, indices: &faces }, &options).expect("a sheet").scene;
    // Neighbours go to opposite ends.
    let torn: Vec<Vec3> = (0..positions.len()).map(|i| positions[i * 331 % positions.len()]).collect();
    let fitted =
        refit(&scene, Mesh { positions: &torn, indices: &faces }, &options).expect("a mesh").expect("the same");
    assert!(TreeStats::of(&fitted).sah_cost > 3.0 * TreeStats::of(&scene).sah_cost);
}
