//! What holds for both scenes.

use super::{car, yard};
use crate::Model;
use glam::Vec3;
use std::collections::HashSet;

/// A scene and what is known of it.
struct Expected {
    build: fn() -> Model,
    triangles: usize,
    fingerprint: u64,
}

const SCENES: [Expected; 2] = [
    Expected { build: yard, triangles: 213_802, fingerprint: 0xf84f_3d73_f7c4_d17c },
    Expected { build: car, triangles: 234_443, fingerprint: 0x68ae_4d53_447a_138f },
];

/// FNV-1a (G. Fowler, L. C. Noll, K.-P. Vo) over every bit of positions, indices, colours and palette.
fn fingerprint(model: &Model) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut word = |word: u32| {
        for byte in word.to_le_bytes() {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    };
    let mut vector = |v: &Vec3| v.to_array().map(|c| word(c.to_bits()));
    for v in model.positions.iter().chain(&model.palette) {
        vector(v);
    }
    model.indices.iter().flatten().for_each(|&i| word(i));
    model.colour_of.iter().for_each(|&c| word(u32::from(c)));
    hash
}

// Fails when the pieces of wire that do not divide evenly are dropped, or grass is sown one blade too many.
#[test]
fn the_numbers_of_triangles_are_exact() {
    for Expected { build, triangles, .. } in SCENES {
        let model = build();
        assert_eq!((model.indices.len(), model.colour_of.len()), (triangles, triangles), "{}", model.source);
    }
}

// Fails when `libm` is exchanged for the platform's sine, or any constant of a scene changes.
#[test]
fn every_platform_builds_the_same_bits() {
    for Expected { build, fingerprint: expected, .. } in SCENES {
        let model = build();
        assert_eq!(fingerprint(&model), expected, "{}: {:#x}", model.source, fingerprint(&model));
    }
}

// Fails when a flange keeps edges that only move along themselves, or a cut may pass through a vertex.
#[test]
fn no_triangle_is_degenerate() {
    for Expected { build, .. } in SCENES {
        let model = build();
        for i in 0..model.indices.len() as u32 {
            let [a, b, c] = model.triangle(i).expect("valid indices").vertices();
            // In single precision, as a kernel would see it, and in square metres: nothing below 1/1000 mm².
            let area = 0.5 * (b - a).cross(c - a).length();
            assert!(area > 1e-9, "{} triangle {i}: {area} m² {a} {b} {c}", model.source);
        }
    }
}

// Fails when the mirrored half of the car is added unmirrored.
#[test]
fn no_triangle_is_there_twice() {
    for Expected { build, .. } in SCENES {
        let model = build();
        let mut seen = HashSet::new();
        for i in 0..model.indices.len() as u32 {
            let mut corners =
                model.triangle(i).expect("valid indices").vertices().map(|p| p.to_array().map(f32::to_bits));
            corners.sort_unstable();
            assert!(seen.insert(corners), "{} triangle {i} repeats an earlier one", model.source);
        }
    }
}

#[test]
fn colours_positions_and_views_are_valid() {
    for Expected { build, .. } in SCENES {
        let model = build();
        assert!(model.positions.iter().all(|p| p.is_finite()), "{}", model.source);
        assert!(model.palette.iter().all(|c| c.min_element() >= 0.0 && c.max_element() <= 1.0), "{}", model.source);
        assert!(model.colour_of.iter().all(|&c| usize::from(c) < model.palette.len()), "{}", model.source);
        assert!(model.view.expect("a view").camera().is_ok(), "{}", model.source);
        // Every vertex is used: no dust.
        let used: HashSet<u32> = model.indices.iter().flatten().copied().collect();
        assert_eq!(used.len(), model.positions.len(), "{}", model.source);
    }
}

#[test]
fn sizes_are_those_of_a_garden_and_a_car() {
    let size = |model: &Model, within: f32| {
        let near = model.positions.iter().filter(|p| p.abs().max_element() < within);
        near.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)))
    };
    let (low, high) = size(&yard(), 20.0);
    assert!(low.y > -0.2 && (5.0..9.0).contains(&high.y), "the trees are {} m high", high.y);
    let (low, high) = size(&car(), 20.0);
    let [length, height, width] = (high - low).to_array();
    assert!((4.3..4.7).contains(&length) && (1.2..1.4).contains(&height) && (1.85..2.2).contains(&width));
    assert!(low.y >= -0.001);
}
