//! Closed surfaces let no ray through, wherever it is aimed.

mod common;

use common::{Model, Random, closest, cube, icosphere, scene_of};
use glam::Vec3;
use rt_bvh::Builder;
use rt_core::{Precision, Ray};

/// A point on the surface that is likely to fall between two triangles: a vertex, a point of an edge, or any point.
fn seam(model: &Model, random: &mut Random, kind: usize) -> (Vec3, Vec3) {
    let triangle = model.triangle(random.below(model.indices.len()) as u32);
    let [a, b, c] = triangle.vertices();
    let normal = triangle.area_normal().normalize().as_vec3();
    let point = match kind % 4 {
        0 => a,
        1 => (a + b) * 0.5,
        2 => b + (c - b) * random.unit(),
        _ => a + (b - a) * (0.5 * random.unit()) + (c - a) * (0.5 * random.unit()),
    };
    (point, normal)
}

/// Whether a point is inside the cube, or well inside the sphere.
fn is_inside(point: Vec3, model: &Model) -> bool {
    let is_cube = model.positions.iter().any(|p| p.length() > 1.5);
    if is_cube { point.abs().max_element() < 1.0 } else { point.length() < 0.99 }
}

/// Rays from inside, at seams and along axes, and rays from outside at seams that face them. Each must hit at t ≈ 1;
/// those along axes anywhere.
fn rays(model: &Model, count: usize, seed: u32) -> Vec<(Ray, bool)> {
    let mut random = Random::new(seed);
    let mut rays = Vec::with_capacity(count);
    while rays.len() < count {
        let kind = rays.len();
        let (point, normal) = seam(model, &mut random, kind);
        let inside = match kind % 3 {
            0 => Vec3::ZERO,
            // On the planes between the cube's cells.
            1 => Vec3::new(0.25, -0.5, 0.125),
            _ => 0.5 * random.point(),
        };
        if kind % 5 == 0 {
            // Along an axis through the point's own coordinates, shrunk towards the middle: vertices line up in cubes.
            let axis = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z][random.below(6)];
            let level = point * (Vec3::ONE - axis.abs());
            // The planes of the cube's own faces are touched edge-on, and not promised.
            if level.length() < 0.95 {
                rays.push((Ray::new(level, axis), false));
            }
        } else if kind % 5 == 1 {
            let outside = 3.0 * random.point();
            // Not at a silhouette, which rounding may miss: just behind the surface the ray is inside.
            let behind = point + 0.05 * (point - outside).normalize();
            if (outside - point).dot(normal * normal.dot(point).signum()) > 0.1 && is_inside(behind, model) {
                rays.push((Ray::new(outside, point - outside), true));
            }
        } else {
            rays.push((Ray::new(inside, point - inside), true));
        }
    }
    rays
}

/// Number of rays that got through.
fn leaks(model: &Model, builder: Builder, precision: Precision, count: usize) -> usize {
    let scene = scene_of(model, builder);
    let aimed = rays(model, count, 1);
    let rays: Vec<_> = aimed.iter().map(|(ray, _)| *ray).collect();
    let hits = closest(&scene, precision, &rays);
    let leaked = |hit: &rt_core::Hit, at_one: bool| !hit.is_hit() || (at_one && (hit.t - 1.0).abs() > 1e-3);
    hits.iter().zip(&aimed).filter(|(hit, (_, at_one))| leaked(hit, *at_one)).count()
}

// Fails when boxes are not padded, when the filter's bound is zero, and when the filter replaces the reference test.
#[test]
fn closed_surfaces_do_not_leak() {
    for model in [icosphere(4), cube(8)] {
        for precision in [Precision::Robust, Precision::Double] {
            assert_eq!(leaks(&model, Builder::Sah, precision, 100_000), 0, "{precision:?}");
        }
        for &builder in Builder::ALL {
            assert_eq!(leaks(&model, builder, Precision::Robust, 10_000), 0, "{builder}");
        }
    }
}

// The fast mode is only worth having if the test above can tell it from the others.
#[test]
fn the_fast_mode_leaks() {
    assert!(leaks(&icosphere(4), Builder::Sah, Precision::Fast, 100_000) > 0);
}

// Fails when the padding does not grow with the origin.
#[test]
fn surfaces_far_from_the_origin_do_not_leak() {
    for (offset, count) in [(1e3, 20_000), (1e5, 20_000), (1e6, 20_000)] {
        let shift = Vec3::new(offset, -offset, 0.5 * offset);
        // At 10⁶ a unit is 16 steps of the format: the cube's vertices stay where they are, and shared.
        let model = cube(8).map(|p| p + shift);
        let scene = scene_of(&model, Builder::Sah);
        let mut random = Random::new(2);
        let rays: Vec<_> = (0..count)
            .map(|kind| {
                let (point, _) = seam(&model, &mut random, kind);
                Ray::new(shift + 0.5 * random.point(), point - shift)
            })
            .collect();
        for precision in [Precision::Robust, Precision::Double] {
            let missed = closest(&scene, precision, &rays).iter().filter(|hit| !hit.is_hit()).count();
            assert_eq!(missed, 0, "{offset}, {precision:?}");
        }
    }
}
