//! Proptest strategies for triangles and rays.

use glam::Vec3;
use proptest::collection::vec;
use proptest::prelude::*;
use rt_core::{Ray, Triangle};
use rt_verify::rays::{Aim, RayMaker};
use rt_verify::shapes;

/// A coordinate: mostly from a small lattice, so that edges, planes and corners coincide.
pub fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![3 => (-8_i8..=8).prop_map(|n| f32::from(n) / 4.0), 1 => -2.0_f32..2.0, 1 => Just(-0.0_f32)]
}

/// A point of such coordinates.
pub fn point() -> impl Strategy<Value = Vec3> {
    [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from)
}

/// A triangle of such points, sometimes without area.
pub fn triangle() -> impl Strategy<Value = Triangle> {
    [point(), point(), point()].prop_map(|[a, b, c]| Triangle::new(a, b, c))
}

/// Up to some hundred triangles of one of the shapes that make trouble; sometimes none.
pub fn triangles() -> impl Strategy<Value = Vec<Triangle>> {
    let seed = any::<u32>();
    prop_oneof![
        3 => vec(triangle(), 0..40),
        1 => (1_u32..200, 0.01_f32..1.0, seed).prop_map(|(n, size, seed)| shapes::soup(n, size, seed)),
        1 => (1_u32..12, prop_oneof![Just(0.0_f32), 0.01_f32..0.5], seed).prop_map(|(n, h, s)| shapes::grid(n, h, s)),
        1 => (0_u32..3).prop_map(shapes::icosphere),
        1 => (1_u32..150, prop_oneof![Just(1e-5_f32), Just(1e-3_f32)], seed).prop_map(|(n, w, s)| shapes::needles(n, w, s)),
        1 => (1_u32..6, 2_u32..6).prop_map(|(side, n)| shapes::layers(side, n)),
        1 => (13_u32..150, seed).prop_map(|(n, seed)| shapes::mixed_scales(n, seed)),
        1 => (3_u32..90).prop_map(shapes::fan),
        // Duplicates, and duplicates that begin at another vertex.
        1 => (vec(triangle(), 1..12), vec((any::<prop::sample::Index>(), 0_usize..3), 1..20)).prop_map(repeat),
    ]
}

fn repeat((mut triangles, again): (Vec<Triangle>, Vec<(prop::sample::Index, usize)>)) -> Vec<Triangle> {
    for (index, turn) in again {
        let mut corners = index.get(&triangles).vertices();
        corners.rotate_left(turn);
        triangles.push(Triangle::new(corners[0], corners[1], corners[2]));
    }
    triangles
}

/// Triangles and rays aimed at them in every way, each ray with the primitive it starts on (`u32::MAX`: none).
pub fn scene() -> impl Strategy<Value = (Vec<Triangle>, Vec<(Ray, u32)>)> {
    let aimed = (prop::sample::select(&Aim::ALL[..]), any::<u32>(), limits());
    let free = (point(), point(), limits()).prop_filter("a direction", |(_, d, _)| *d != Vec3::ZERO);
    (triangles(), vec(aimed, 1..40), vec(free, 0..20)).prop_map(|(triangles, aimed, free)| {
        let maker = RayMaker::new(&triangles, 0);
        let aimed = aimed.into_iter().map(|(aim, index, [tmin, tmax])| {
            let (ray, origin) = maker.ray(aim, index);
            (ray.with_range(tmin, tmax), origin)
        });
        let free = free.into_iter().map(|(o, d, [tmin, tmax])| (Ray::new(o, d).with_range(tmin, tmax), u32::MAX));
        let rays = aimed.chain(free).collect();
        (triangles, rays)
    })
}

/// `tmin` and `tmax`: mostly the half line, sometimes segments, also before the origin.
pub fn limits() -> impl Strategy<Value = [f32; 2]> {
    prop_oneof![
        4 => Just([0.0, f32::INFINITY]),
        1 => (coordinate(), coordinate()).prop_map(|(a, b)| [a.min(b), a.max(b)]),
        1 => coordinate().prop_map(|tmin| [tmin, f32::INFINITY]),
    ]
}

/// Rays that must miss whatever the scene.
pub fn invalid_ray() -> impl Strategy<Value = Ray> {
    let poison = prop::sample::select(&[f32::NAN, f32::INFINITY, f32::NEG_INFINITY][..]);
    (point(), point(), poison, 0_usize..9).prop_map(|(origin, direction, poison, place)| {
        let mut ray = Ray::new(origin, if direction == Vec3::ZERO { Vec3::X } else { direction });
        match place {
            0..=2 => ray.origin[place] = poison,
            3..=5 => ray.direction[place - 3] = poison,
            6 => ray.direction = Vec3::new(0.0, -0.0, 0.0),
            7 => ray = ray.with_range(1.0, 0.5),
            _ => ray.tmin = f32::NAN,
        }
        ray
    })
}
