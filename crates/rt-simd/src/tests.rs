//! Kernels of every level against the traversal of single rays and against testing every triangle.

use crate::{Isa, Kernel, Scratch};
use glam::Vec3;
use proptest::prelude::*;
use rt_bvh::{BlockTree, BuildOptions, InvalidTriangles, Mesh, Stack, build};
use rt_core::{Coherence, Hit, Precision, Query, Ray, Scene, StreamSpec, Triangle, random};
use rt_verify::shapes;
use std::collections::HashMap;
use std::sync::Arc;

pub(crate) fn kernels() -> Vec<Kernel> {
    Isa::available().into_iter().filter_map(Kernel::new).collect()
}

/// For comparing bits, so that a NaN or a −0 shows.
pub(crate) fn bits(hit: &Hit) -> [u32; 4] {
    [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive]
}

pub(crate) fn scene_of(triangles: &[Triangle]) -> Arc<Scene> {
    let positions: Vec<Vec3> = triangles.iter().flat_map(|t| t.vertices()).collect();
    let indices: Vec<_> = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let options = BuildOptions { invalid: InvalidTriangles::Drop, ..BuildOptions::default() };
    build(Mesh { positions: &positions, indices: &indices }, &options).expect("valid").scene
}

/// Hits of single rays over the two-wide tree.
pub(crate) fn expected(scene: &Scene, query: Query, rays: &[Ray], excluded: &[u32]) -> Vec<Hit> {
    let spec = StreamSpec { query, precision: Precision::Robust, ..StreamSpec::default() };
    let mut hits = Vec::with_capacity(rays.len());
    let none = std::iter::repeat(&u32::MAX);
    let rays = rays.iter().copied().zip(excluded.iter().chain(none).copied());
    rt_bvh::trace(scene, &mut Stack::for_scene(scene), spec, rays, |hit, _| hits.push(hit));
    hits
}

/// The nearest hits among all triangles, each tested by the definition in the coordinates of the file.
fn brute(triangles: &[Triangle], rays: &[Ray], excluded: &[u32]) -> Vec<Hit> {
    let nearest = |(i, ray): (usize, &Ray)| {
        let mut best = Hit::MISS;
        for (id, triangle) in (0..).zip(triangles) {
            if excluded.get(i) != Some(&id)
                && let Some(hit) = rt_core::intersect::hit(ray, triangle, id)
                && hit.is_before(&best)
            {
                best = hit;
            }
        }
        best
    };
    rays.iter().enumerate().map(nearest).collect()
}

/// Asserts that every kernel finds the hits of the definition and of single rays: the same bits for nearest hits, and
/// for any hit one where there is one, which is a hit of its triangle.
fn assert_alike(triangles: &[Triangle], rays: &[Ray], excluded: &[u32], name: &str) {
    let scene = &*scene_of(triangles);
    let tree = BlockTree::new(scene).expect("few blocks");
    let mut scratch = Scratch::default();
    let want = brute(triangles, rays, excluded);
    for (i, (alone, want)) in expected(scene, Query::Closest, rays, excluded).iter().zip(&want).enumerate() {
        assert_eq!(bits(alone), bits(want), "{name}, single rays: ray {i}, {:?}\n{alone:?}\n{want:?}", rays[i]);
    }
    let mut hits = vec![Hit::MISS; rays.len()];
    let slots: HashMap<u32, usize> = (0..scene.triangles().len()).map(|s| (scene.primitives().get(s), s)).collect();
    let orders = [
        (Coherence::Coherent, 0),
        (Coherence::Coherent, 8),
        (Coherence::Coherent, 64),
        (Coherence::Incoherent, 2),
        (Coherence::Incoherent, 64),
        (Coherence::Unknown, 3),
    ];
    for kernel in kernels() {
        for (order, few) in orders {
            hits.fill(Hit { t: -1.0, u: 7.0, v: 7.0, primitive: 7 });
            kernel.trace_in(order, few, &tree, &mut scratch, Query::Closest, (rays, excluded, &mut hits));
            for (i, (got, want)) in hits.iter().zip(&want).enumerate() {
                let same = bits(got) == bits(want);
                assert!(same, "{name}, {}, {order:?}, {few}: ray {i}, {:?}\n{got:?}\n{want:?}", kernel.isa(), rays[i]);
            }
            kernel.trace_in(order, few, &tree, &mut scratch, Query::Any, (rays, excluded, &mut hits));
            for (i, (got, want)) in hits.iter().zip(&want).enumerate() {
                let context = || {
                    format!(
                        "{name}, {}, {order:?}, {few}, any: ray {i}, {:?}\n{got:?}\n{want:?}",
                        kernel.isa(),
                        rays[i]
                    )
                };
                assert_eq!(got.is_hit(), want.is_hit(), "{}", context());
                if got.is_hit() {
                    let triangle = scene.triangles()[slots[&got.primitive]];
                    let shear = rt_core::intersect::Shear::new(&rays[i], scene.scale_exponent(), f64::INFINITY);
                    let right = shear.hit(&triangle, [rays[i].tmin, rays[i].tmax], got.primitive);
                    assert_eq!(right.as_ref().map(bits), Some(bits(got)), "{}", context());
                    assert_ne!(excluded.get(i), Some(&got.primitive), "{}", context());
                } else {
                    assert_eq!(bits(got), bits(&Hit::MISS), "{}", context());
                }
            }
        }
    }
}

/// Rays of every kind that is known to break traversals, aimed at vertices, edges and insides of triangles.
pub(crate) fn hard_rays(triangles: &[Triangle], count: u32, seed: u32) -> Vec<Ray> {
    let bounds = triangles.iter().fold(rt_core::Aabb::EMPTY, |all, t| all.union(t.bounds()));
    let (middle, size) = (bounds.min * 0.5 + bounds.max * 0.5, bounds.max * 0.5 - bounds.min * 0.5);
    let point = |i: u32, d: u32| {
        let ([x, y], [z, _]) = (random::pair(seed, i, d), random::pair(seed, i, d + 1));
        middle + size * (2.0 * Vec3::new(x, y, z) - 1.0)
    };
    let target = |i: u32, d: u32| {
        let [a, b, c] = triangles[random::below(triangles.len() as u32, seed, i, d) as usize].vertices();
        let [x, y] = random::pair(seed, i, d + 1);
        match (random::pair(seed, i, d + 2)[0] * 5.0) as u32 {
            0 => a,
            1 => a + (b - a) * 0.5,
            2 => a + (b - a) * x,
            3 => (a + b + c) / 3.0,
            _ => a + (b - a) * (x * (1.0 - y)) + (c - a) * y,
        }
    };
    (0..count)
        .map(|i| {
            let from = match i % 5 {
                0 => middle + 3.0 * (point(i, 10) - middle),
                1 => middle,
                2 => target(i, 20),
                3 => middle + 1e5 * (point(i, 10) - middle),
                _ => point(i, 10),
            };
            let to = if i % 9 == 0 { point(i, 30) } else { target(i, 40) };
            let mut direction = to - from;
            match i % 11 {
                0 => {
                    direction = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z][i as usize / 11 % 6]
                }
                1 => direction.x = 0.0,
                2 => (direction.y, direction.z) = (-0.0, 0.0),
                3 => direction *= 1e-20,
                4 => direction *= 1e25,
                5 => direction *= 1e-38,
                _ => {}
            }
            let from = if i % 11 == 0 { to - direction * 2.0 * size.max_element() } else { from };
            let tmin = [0.0, 1e-4, -2.0, f32::NEG_INFINITY, f32::MIN][i as usize % 5];
            let tmax = [f32::INFINITY, 1.0, f32::MAX, 0.999][i as usize / 3 % 4];
            let mut ray = Ray::new(from, direction).with_range(tmin, tmax);
            match i % 101 {
                0 => ray.direction = Vec3::ZERO,
                1 => ray.origin.x = f32::NAN,
                2 => ray.tmax = f32::NAN,
                3 => ray.tmin = f32::INFINITY,
                4 => ray.origin.y = f32::INFINITY,
                5 => ray.direction.z = f32::NEG_INFINITY,
                6 => ray = ray.with_range(2.0, 1.0),
                7 => ray.direction.y = f32::NAN,
                8 => ray.origin *= 1e30,
                _ => {}
            }
            ray
        })
        .collect()
}

pub(crate) fn scaled(triangles: &[Triangle], exponent: i32) -> Vec<Triangle> {
    let factor = libm::ldexpf(1.0, exponent);
    triangles.iter().map(|t| t.scaled(factor)).collect()
}

#[test]
fn hard_rays_hit_what_single_rays_hit() {
    let soup = shapes::soup(1_000, 0.3, 1);
    let far = |shift: Vec3| shapes::moved(&shapes::icosphere(3), shift);
    for (name, triangles) in [
        ("none", vec![]),
        ("one", soup[..1].to_vec()),
        ("nine", soup[..9].to_vec()),
        ("soup", soup.clone()),
        ("small soup", shapes::soup(3_000, 0.03, 2)),
        ("grid", shapes::grid(16, 0.2, 3)),
        ("icosphere", shapes::icosphere(4)),
        ("cube", shapes::box_grid(6)),
        ("far", far(Vec3::new(1e6, -1e6, 1e6))),
        ("needles", shapes::needles(500, 1e-6, 4)),
        ("mixed scales", shapes::mixed_scales(500, 5)),
        ("twice", [&soup[..200], &soup[..200]].concat()),
        ("tiny", scaled(&soup[..300], -100)),
        ("huge", scaled(&soup[..300], 100)),
        ("as tiny as can be", scaled(&soup[..300], -135)),
        ("as huge as can be", scaled(&soup[..300], 126)),
        ("a far triangle", [&soup[..100], &scaled(&soup[..1], 90)].concat()),
    ] {
        let rays = if triangles.is_empty() {
            vec![Ray::new(Vec3::ZERO, Vec3::X); 70]
        } else {
            hard_rays(&triangles, 2_000, 6)
        };
        assert_alike(&triangles, &rays, &[], name);
    }
}

// Fails when an exclusion is looked up in another lane.
#[test]
fn exclusions_hold() {
    let triangles = shapes::soup(500, 0.4, 7);
    let (scene, rays) = (scene_of(&triangles), hard_rays(&triangles, 2_000, 8));
    let first = expected(&scene, Query::Closest, &rays, &[]);
    let excluded: Vec<u32> =
        first.iter().enumerate().map(|(i, hit)| if i % 3 == 0 { u32::MAX } else { hit.primitive }).collect();
    assert_alike(&triangles, &rays, &excluded, "exclusions");
}

// Fails when a ray's place in its packet changes what it hits, and when limits are not inclusive.
#[test]
fn any_number_of_rays_and_exact_limits() {
    let triangles = shapes::icosphere(3);
    let scene = scene_of(&triangles);
    let rays = hard_rays(&triangles, 300, 9);
    let mut limited = Vec::new();
    for (ray, hit) in rays.iter().zip(expected(&scene, Query::Closest, &rays, &[])) {
        if hit.is_hit() {
            limited.push(ray.with_range(hit.t, hit.t));
            limited.push(ray.with_range(hit.t.next_up(), f32::INFINITY));
            limited.push(ray.with_range(f32::NEG_INFINITY, hit.t.next_down()));
        }
    }
    assert!(limited.len() > 300);
    assert_alike(&triangles, &limited, &[], "limits");
    for count in [0, 1, 15, 16, 17, 63, 64, 65, 129] {
        assert_alike(&triangles, &rays[..count], &[], "count");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    // Fails when padding is left out, when planes of the wrong octant are taken, and when a doubtful lane is believed.
    #[test]
    fn any_scene_and_any_rays(
        count in 1_u32..200,
        size in 0.01_f32..1.0,
        seed in any::<u32>(),
        shift in prop_oneof![Just(0.0_f32), Just(1e3), Just(-1e6)],
        exponent in -60..60_i32,
    ) {
        let triangles = scaled(&shapes::moved(&shapes::soup(count, size, seed), Vec3::new(shift, 0.0, -shift)), exponent);
        assert_alike(&triangles, &hard_rays(&triangles, 700, seed), &[], "random");
    }
}
