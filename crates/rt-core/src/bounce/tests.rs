//! Directions and points: their properties, as far as one triangle shows them.

use super::*;
use crate::{Aabb, Child, Node, SceneParts};
use alloc::vec;
use alloc::vec::Vec;
use glam::DVec3;

fn unit_vector(i: u32) -> Vec3 {
    // Among them the axes, and vectors near them.
    let [a, b, c] = random::pcg3d([i, 9, 0]);
    let component = |bits: u32| match bits % 5 {
        0 => 0.0,
        1 => (random::unit(bits) - 0.5) * 1e-8,
        _ => random::unit(bits) * 2.0 - 1.0,
    };
    DVec3::new(component(a).into(), component(b).into(), component(c).into()).normalize_or(DVec3::Z).as_vec3()
}

/// Fails with a sign that is always 1.
#[test]
fn basis_is_orthonormal() {
    for n in (0..20_000).map(unit_vector) {
        let (t, b) = basis(n);
        let [n, t, b] = [n, t, b].map(|v| v.as_dvec3());
        for (dot, expected) in [(t.dot(t), 1.0), (b.dot(b), 1.0), (t.dot(b), 0.0), (t.dot(n), 0.0), (b.dot(n), 0.0)] {
            assert!((dot - expected).abs() < 1e-6, "{n}: {dot}");
        }
    }
}

/// Directions are of unit length and leave the surface. Fails without the half step in `disc`.
#[test]
fn directions_leave_the_surface() {
    for i in 0..200_000 {
        let n = unit_vector(i);
        let [a, b] = random::pair(1, i, 3);
        let last = 1.0 - 1.0 / 16_777_216.0;
        let uniform = [[a, b], [0.0, b], [a, last], [0.0, 0.0], [last, 0.0]][i as usize % 5];
        let d = Aim::Cosine.direction(n, uniform).as_dvec3();
        assert!((d.length() - 1.0).abs() < 6e-7, "{}", d.length());
        assert!(d.dot(n.as_dvec3()) > 3e-4, "{n} {uniform:?}: {}", d.dot(n.as_dvec3()));
    }
}

#[test]
fn moments_are_those_of_a_cosine() {
    // E[cos] = 2/3, E[cos²] = 1/2, E[x] = E[y] = E[xy] = 0, E[x²] = 1/4. Each has a variance below 1/4, so that six
    // standard deviations of the mean of n are below 3 / √n.
    const N: u32 = 200_000;
    let n = DVec3::new(0.6, -0.48, 0.64).normalize().as_vec3();
    let (t, b) = basis(n);
    let mut sums = [0.0; 6];
    for i in 0..N {
        let d = Aim::Cosine.direction(n, random::pair(3, i, 1));
        let (x, y, z) = (f64::from(d.dot(t)), f64::from(d.dot(b)), f64::from(d.dot(n)));
        for (sum, value) in sums.iter_mut().zip([z, z * z, x, y, x * y, x * x]) {
            *sum += value / f64::from(N);
        }
    }
    for (mean, expected) in sums.into_iter().zip([2.0 / 3.0, 0.5, 0.0, 0.0, 0.0, 0.25]) {
        assert!((mean - expected).abs() < 3.0 / libm::sqrt(f64::from(N)), "{mean} instead of {expected}");
    }
}

fn vertex(i: u32, corner: u32, scale: f32, offset: f32) -> Vec3 {
    let [x, y, z] = random::pcg3d([i, corner, 11]).map(|w| random::unit(w) * 2.0 - 1.0);
    let snap = |c: f32| if i.is_multiple_of(3) && c.abs() < 0.5 { 0.0 } else { c };
    Vec3::new(snap(x), snap(y), snap(z)) * scale + Vec3::splat(offset * scale)
}

/// A ray starts on its own side of the exact plane, near the point that was hit, at every scale. Fails when
/// `Surface::origin` leaves out the clearance, or rounds to nearest.
#[test]
fn origins_are_on_their_side_of_the_plane() {
    let mut tried = 0;
    for i in 0..40_000 {
        let scale = [1.0, 1e-30, 1e30, 1e-3, 1e-37, 3e37][i as usize % 6];
        let offset = if i % 4 == 0 { 1e5 } else { 0.0 };
        let offset = if scale > 1e30 { 0.0 } else { offset };
        let triangle =
            Triangle::new(vertex(i, 0, scale, offset), vertex(i, 1, scale, offset), vertex(i, 2, scale, offset));
        let [a, b, c] = triangle.vertices().map(|p| p.as_dvec3());
        let exact = triangle.area_normal();
        let size = f64::from(scale) * f64::from(scale);
        let Some(surface) = Surface::new(&triangle, 0) else { continue };
        // Slivers of a rounding step have no plane that single precision could keep to either side of.
        if exact.length() < 1e-5 * size {
            continue;
        }
        tried += 1;
        let exact = exact / exact.length();
        assert!(exact.dot(surface.normal().as_dvec3()) > 1.0 - 1e-6, "{i}");
        assert!(
            (exact - surface.normal().as_dvec3()).length() < 5e-7,
            "{i} {triangle:?} {:?} {exact}",
            surface.normal()
        );
        let [u, v] = random::pair(4, i, 1);
        let [u, v] = if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] };
        let hit = Hit { t: 1.0, u, v, primitive: 0 };
        for behind in [false, true] {
            let from = Departure::new(&hit, behind, 0).expect("a hit");
            let origin = from.origin(&surface).as_dvec3();
            let height = (origin - a).dot(exact) * if behind { -1.0 } else { 1.0 };
            assert!(height > 0.0, "{i}, {scale:e}, {offset}: {:e}", height / f64::from(scale));
            let point = a * (1.0 - f64::from(u) - f64::from(v)) + b * f64::from(u) + c * f64::from(v);
            let largest = a.abs().max(b.abs()).max(c.abs()).max_element();
            assert!((origin - point).length() < 6e-7 * largest, "{i}: {:e}", (origin - point).length() / largest);
        }
    }
    assert!(tried > 30_000);
}

#[test]
fn nothing_comes_of_nothing() {
    let hit = Hit { t: 1.0, u: 0.25, v: 0.25, primitive: 0 };
    assert_eq!(Departure::new(&Hit::MISS, false, 0), None);
    assert_eq!(Departure::new(&Hit { u: f32::NAN, ..hit }, false, 0), None);
    assert_eq!(Departure::new(&Hit { v: 1e9, ..hit }, false, 0), None);
    let none = |a, b, c| assert!(Surface::new(&Triangle::new(a, b, c), 0).is_none());
    none(Vec3::ZERO, Vec3::X, Vec3::X);
    none(Vec3::ZERO, Vec3::X, Vec3::NAN);
    none(Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
    // Weights that rounding made a little too large stay on the triangle.
    let edge = Departure::new(&Hit { u: 1.0, v: 1e-7, ..hit }, true, 0).expect("a hit");
    assert_eq!(edge.weights, [ONE | Departure::BEHIND, 0]);
}

/// Triangles of a scene and given ones make the same rays, bit for bit.
#[test]
fn the_unit_of_the_scene_does_not_matter() {
    for i in 0..2000 {
        let triangle = Triangle::new(vertex(i, 0, 1.0, 0.0), vertex(i, 1, 1.0, 0.0), vertex(i, 2, 1.0, 0.0));
        let from = Departure { weights: [ONE / 3, ONE / 5], primitive: 0, path: i };
        let origin = |triangle: &Triangle, exponent| {
            Surface::new(triangle, exponent).map(|surface| from.origin(&surface).to_array().map(f32::to_bits))
        };
        let given = origin(&triangle, 0);
        for exponent in [-40, -3, 5, 50] {
            assert_eq!(origin(&triangle.scaled(libm::ldexpf(1.0, exponent)), -exponent), given);
        }
    }
}

fn one_leaf(triangles: Vec<Triangle>) -> Scene {
    let count = triangles.len() as u32;
    let bounds = triangles.iter().fold(Aabb::EMPTY, |bounds, triangle| bounds.union(triangle.bounds()));
    let mut root = Node::EMPTY;
    root.set(0, bounds, Child::Leaf { first: 0, count });
    let primitives = (0..count).collect();
    let parts = SceneParts { nodes: vec![root], triangles, primitives, scale_exponent: 0, primitive_count: count };
    Scene::new(parts).expect("a good tree")
}

/// Rays are the same bits one by one and side by side, of usual triangles and of those that are not. Mutants: a block
/// with one unusual triangle that is made nonetheless; the side forgotten; the rest after the last block left out.
#[test]
fn rays_are_the_same_one_by_one_and_side_by_side() {
    let flat = Triangle::new(Vec3::ZERO, Vec3::X, Vec3::X * 2.0);
    for scale in [1.0, 1e-3, 1e-30, 1e-37, 3e37] {
        let mut triangles: Vec<Triangle> = (0..50)
            .map(|i| Triangle::new(vertex(i, 0, scale, 0.0), vertex(i, 1, scale, 0.0), vertex(i, 2, scale, 0.0)))
            .collect();
        // Among them a few that are not usual, so that there are blocks of both kinds.
        triangles[47] = flat;
        triangles[48] = Triangle::new(Vec3::splat(1e-40), Vec3::X * 3e-39, Vec3::Y * 2e-39);
        let surfaces = Arc::new(Surfaces::new(Arc::new(one_leaf(triangles))));
        for (i, aim) in
            [Aim::Cosine, Aim::Disc { middle: Vec3::Y, radii: [Vec3::X * 0.1, Vec3::Z * 0.1] }].into_iter().enumerate()
        {
            let departure = |ray: u32| {
                let [a, b, c] = random::pcg3d([ray, i as u32, 21]);
                let rare = if ray.is_multiple_of(67) { 50 } else { 47 };
                let u = a % (ONE + 1);
                let side = if c % 2 == 0 { Departure::BEHIND } else { 0 };
                Departure { weights: [u | side, b % (ONE + 1 - u)], primitive: c / 2 % rare, path: ray * 3 }
            };
            let scatter = Scatter { aim, seed: 5, samples: 4, first_group: 9, bounce: 1 };
            let source =
                BounceRays { surfaces: Arc::clone(&surfaces), departures: (0..300).map(departure).collect(), scatter };
            for (first, count) in [(0, 300), (5, 16), (7, 40), (0, 3), (299, 1), (10, 0)] {
                let mut rays = vec![Ray::new(Vec3::ZERO, Vec3::ZERO); count];
                let mut origins = vec![0; count];
                source.rays(first, &mut rays, &mut origins);
                are_those_of(&source, &rays, &origins, first..);
            }
            let numbers: Vec<u32> = (0..100).map(|i| i * 3 % 300).collect();
            let (mut rays, mut origins) = (vec![Ray::new(Vec3::ZERO, Vec3::ZERO); 100], vec![0; 100]);
            source.rays_of(&numbers, &mut rays, &mut origins);
            are_those_of(&source, &rays, &origins, numbers);
            let primitives: Vec<u32> = (0..60).rev().collect();
            let mut normals = [Vec3::ONE; 60];
            surfaces.normals(&primitives, &mut normals);
            let alone: Vec<Vec3> = primitives.iter().map(|&primitive| surfaces.normal(primitive)).collect();
            assert_eq!(normals[..], alone);
            let mut directions = [Vec3::ZERO; 60];
            scatter.directions(&normals, &primitives, &mut directions);
            for ((&normal, &path), &direction) in normals.iter().zip(&primitives).zip(&directions) {
                let alone = scatter.direction(normal, path);
                assert_eq!(direction.to_array().map(f32::to_bits), alone.to_array().map(f32::to_bits));
            }
        }
    }
}

fn are_those_of(source: &BounceRays, rays: &[Ray], origins: &[u32], numbers: impl IntoIterator<Item = u32>) {
    for ((ray, &origin), number) in rays.iter().zip(origins).zip(numbers) {
        let (alone, primitive) = source.ray(number);
        let bits = |ray: &Ray| [ray.origin, ray.direction].map(|v| v.to_array().map(f32::to_bits));
        assert_eq!((bits(ray), origin), (bits(&alone), primitive), "ray {number}");
    }
}
