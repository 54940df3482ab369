//! Statistics of the built-in scenes that published numbers rest on: they must not drift.

use rayon::prelude::*;
use rt_bvh::{BuildOptions, Mesh, TreeStats};
use rt_core::{StreamSpec, TestCounts};
use rt_scene::{Model, builtin};
use rt_verify::tree;

/// The image that the statistics are of, and the side of its square tiles, in pixels.
const SIZE: [u32; 2] = [1024, 640];
const TILE: u32 = 32;

/// Least coefficient of variation of the tiles' costs: below it there would be nothing to balance.
const LEAST_VARIATION: f64 = 0.8;

#[test]
fn yard_is_uneven() {
    check(&builtin::yard(), 213_802);
}

#[test]
fn car_is_uneven() {
    check(&builtin::car(), 234_443);
}

#[expect(clippy::print_stdout, reason = "caught by the harness")]
fn check(model: &Model, triangles: usize) {
    assert_eq!(model.indices.len(), triangles, "{}", model.source);
    let mesh = Mesh { positions: &model.positions, indices: &model.indices };
    let built = rt_bvh::build(mesh, &BuildOptions::default()).expect("a good mesh");
    let report = built.report;
    assert_eq!((report.dropped_degenerate, report.dropped_invalid, report.fallback), (0, 0, None), "{}", model.source);

    let view = model.view.expect("built-in scenes have a view");
    let camera = view.camera().expect("a good view");
    let [width, height] = SIZE;
    let tiles = (width / TILE) * (height / TILE);
    let cost = |tile: u32| -> f64 {
        let corner = [tile % (width / TILE) * TILE, tile / (width / TILE) * TILE];
        let ray = |i: u32| {
            let [x, y] = [corner[0] + i % TILE, corner[1] + i / TILE].map(|p| p as f32 + 0.5);
            (camera.ray(x / width as f32, y / height as f32, width as f32 / height as f32), u32::MAX)
        };
        let rays: Vec<_> = (0..TILE * TILE).map(ray).collect();
        let (_, counts) = tree::trace(&built.scene, StreamSpec { counts: true, ..StreamSpec::default() }, &rays);
        counts.iter().map(|TestCounts { boxes, triangles }| f64::from(boxes + triangles)).sum()
    };
    let costs: Vec<f64> = (0..tiles).into_par_iter().map(cost).collect();
    let mean = costs.iter().sum::<f64>() / f64::from(tiles);
    let variance = costs.iter().map(|c| (c - mean).powi(2)).sum::<f64>() / f64::from(tiles);
    let variation = variance.sqrt() / mean;
    let per_ray = mean / f64::from(TILE * TILE);
    println!("{}: {per_ray:.1} tests per ray, tiles vary by {variation:.3}", model.source);
    println!("{:?}", TreeStats::of(&built.scene));
    assert!(variation >= LEAST_VARIATION, "{}: tile costs vary by only {variation:.3}", model.source);
}
