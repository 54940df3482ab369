//! Spawned rays from outside: they leave the surface, come from where they say, and depend on nothing but their number.

use glam::{DVec3, Vec3};
use proptest::prelude::*;
use rt_bvh::{BuildOptions, Mesh, build};
use rt_core::bounce::{Aim, Surfaces};
use rt_core::{BounceRays, Hit, Ray, RaySource, Triangle, intersect};
use rt_scene::streams::{Paths, Spawner, Sun, Wave, Waves};
use rt_scene::{Model, builtin};
use std::sync::Arc;

/// A sphere by repeated subdivision of an icosahedron: closed, and convex as long as rounding is finer than its bends.
fn sphere(subdivisions: u32, radius: f32, centre: Vec3) -> Model {
    let g = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let mut points: Vec<DVec3> = (0..12)
        .map(|i| {
            let [a, b] = [if i & 1 == 0 { 1.0 } else { -1.0 }, if i & 2 == 0 { g } else { -g }];
            [DVec3::new(0.0, a, b), DVec3::new(a, b, 0.0), DVec3::new(b, 0.0, a)][i / 4].normalize()
        })
        .collect();
    // The faces of an icosahedron are the triples of vertices at the least distance from each other.
    let near = |a: &DVec3, b: &DVec3| a.distance(*b) < 1.1;
    let mut faces = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(&points[a], &points[b]) && near(&points[b], &points[c]) && near(&points[a], &points[c]) {
                    faces.push([a, b, c]);
                }
            }
        }
    }
    assert_eq!(faces.len(), 20);
    for _ in 0..subdivisions {
        let mut finer = Vec::new();
        for [a, b, c] in faces {
            let mut middle = |a: usize, b: usize| {
                let point = (points[a] + points[b]).normalize();
                points.iter().position(|p| p.distance(point) < 1e-9).unwrap_or_else(|| {
                    points.push(point);
                    points.len() - 1
                })
            };
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        faces = finer;
    }
    let place = |p: &DVec3| (*p * f64::from(radius) + centre.as_dvec3()).as_vec3();
    Model {
        positions: points.iter().map(place).collect(),
        indices: faces.into_iter().map(|f| f.map(|i| i as u32)).collect(),
        palette: vec![Vec3::ONE],
        ..Model::default()
    }
}

fn surfaces(model: &Model) -> Arc<Surfaces> {
    let mesh = Mesh { positions: &model.positions, indices: &model.indices };
    Arc::new(Surfaces::new(build(mesh, &BuildOptions::default()).expect("valid").scene))
}

/// A spawner for rays that are not a camera's.
fn spawner<'a>(surfaces: &'a Arc<Surfaces>, rays: &'a RaySource, hits: &'a [Hit]) -> Spawner<'a> {
    Spawner { surfaces, rays, hits, seed: 3, samples: 1, first_group: 0, bounce: 0 }
}

/// Each ray, and the primitive that it starts on.
fn made(rays: &BounceRays) -> Vec<(Ray, u32)> {
    (0..rays.len()).map(|i| rays.ray(i)).collect()
}

/// The diffuse rays of a spawner.
fn diffuse(spawner: &Spawner<'_>) -> BounceRays {
    let [rays] = spawner.streams([Aim::Cosine]);
    rays
}

/// The numbers of the rays' paths.
fn paths(rays: &BounceRays) -> Vec<u32> {
    rays.departures.iter().map(|from| from.path).collect()
}

fn triangles(model: &Model) -> Vec<Triangle> {
    (0..model.indices.len() as u32).filter_map(|i| model.triangle(i)).collect()
}

/// Whether every vertex lies on or below every face's plane, in exact enough arithmetic.
fn is_convex(model: &Model, centre: Vec3) -> bool {
    triangles(model).iter().all(|t| {
        let a = t.a.as_dvec3();
        let mut n = t.area_normal();
        if n.dot(a - centre.as_dvec3()) < 0.0 {
            n = -n;
        }
        model.positions.iter().all(|p| n.dot(p.as_dvec3() - a) <= 1e-12 * n.length() * n.length().sqrt())
    })
}

/// The nearest hit of all triangles but `origin`.
fn nearest(triangles: &[Triangle], ray: &Ray, origin: u32) -> Option<Hit> {
    let others = triangles.iter().zip(0..).filter(|(_, i)| *i != origin);
    others.filter_map(|(t, i)| intersect::hit(ray, t, i)).reduce(|a, b| if b.is_before(&a) { b } else { a })
}

/// A random unit vector and two numbers for every index.
fn random_vector(seed: u32, i: u32) -> Vec3 {
    let [a, b] = rt_core::random::pair(seed, i, 100);
    let (z, angle) = (2.0 * a - 1.0, 2.0 * std::f32::consts::PI * b);
    let r = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(r * angle.cos(), r * angle.sin(), z)
}

/// Rays from outside at a convex model, or from its centre, with their hits.
fn seen(model: &Model, centre: Vec3, radius: f32, rays: u32, outside: bool) -> (RaySource, Vec<Hit>) {
    let all = triangles(model);
    let ray = |i| {
        let target = centre + random_vector(1, i) * radius * 0.7;
        let from = if outside { centre + random_vector(2, i) * radius * 3.0 } else { centre };
        Ray::new(from, target - from)
    };
    let rays: Arc<[Ray]> = (0..rays).map(ray).collect();
    let hits = rays.iter().map(|ray| nearest(&all, ray, u32::MAX).unwrap_or(Hit::MISS)).collect();
    (RaySource::Explicit { rays, origins: None }, hits)
}

#[test]
fn rays_that_leave_a_sphere_outwards_hit_nothing() {
    let mut spawned = 0;
    for (subdivisions, radius, offset) in
        [(2, 1e-10, 0.0), (2, 1e-3, 0.0), (3, 1.0, 0.0), (2, 1e10, 0.0), (0, 1.0, 1e6), (0, 3.0, 1e6), (1, 1e4, 1e6)]
    {
        let centre = Vec3::new(offset, -offset, offset * 0.7);
        let model = sphere(subdivisions, radius, centre);
        assert!(is_convex(&model, centre), "radius {radius}, offset {offset}");
        let all = triangles(&model);
        let (rays, hits) = seen(&model, centre, radius, 15_000, true);
        let out = made(&diffuse(&spawner(&surfaces(&model), &rays, &hits)));
        assert!(out.len() > 10_000);
        spawned += out.len();
        let count = |with: bool| {
            let own = |o: &u32| if with { u32::MAX } else { *o };
            out.iter().filter(|(r, o)| nearest(&all, r, own(o)).is_some()).count()
        };
        assert_eq!(count(false), 0, "radius {radius}, offset {offset}: neighbours");
        // Even the triangle that a ray starts on is never met.
        assert_eq!(count(true), 0, "radius {radius}, offset {offset}: own triangle");
    }
    assert!(spawned > 90_000);
}

#[test]
fn rays_inside_a_sphere_cross_it_to_the_other_side() {
    for (subdivisions, radius, offset) in [(1, 1e-10, 0.0), (3, 1.0, 0.0), (2, 1e10, 0.0), (1, 1e4, 1e6)] {
        let centre = Vec3::splat(offset);
        let model = sphere(subdivisions, radius, centre);
        let all = triangles(&model);
        let (rays, hits) = seen(&model, centre, radius, 10_000, false);
        assert!(hits.iter().all(Hit::is_hit));
        let out = made(&diffuse(&Spawner { bounce: 3, ..spawner(&surfaces(&model), &rays, &hits) }));
        assert_eq!(out.len(), 10_000);
        for &(ref ray, origin) in &out {
            assert_eq!(intersect::hit(ray, &all[origin as usize], origin), None, "own triangle");
        }
        // A point so close to an edge that rounding it to single precision takes it outside may escape. Its share is
        // about the rounding step (2⁻²⁴ of the offset) over the size of a face.
        let lost = out.iter().filter(|(r, o)| nearest(&all, r, *o).is_none()).count();
        assert!(lost <= if offset > 0.0 { 5 } else { 0 }, "radius {radius}, offset {offset}: {lost}");
    }
}

/// Two triangles over one edge, folded by any angle, flat included.
fn hinge() -> impl Strategy<Value = Model> {
    let coordinate =
        || prop_oneof![4 => -1.0..1.0_f32, 1 => Just(0.0_f32), 1 => prop::sample::select(vec![1.0_f32, -1.0, 0.5])];
    let point = || [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from);
    ([point(), point(), point(), point()], any::<bool>(), -10..=10_i32, prop_oneof![Just(0.0), Just(1e6_f32)]).prop_map(
        |(mut p, flat, scale, offset)| {
            if flat {
                // A fourth point in the same plane: exactly so for an axis plane.
                p = p.map(|p| Vec3::new(p.x, p.y, 0.25));
            }
            let scale = 10_f32.powi(scale);
            let offset = Vec3::splat(offset * scale);
            let indices = vec![[0, 1, 2], [0, 1, 3]];
            Model { positions: p.map(|p| p * scale + offset).to_vec(), indices, ..Model::default() }
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Guards: a spawned ray meets neither its own triangle nor a neighbour in the same plane, at every scale. Fails
    /// when `SurfacePoint::origin` leaves out the clearance or rounds to nearest.
    #[test]
    fn no_self_hits_on_random_triangles(model in hinge(), seed in any::<u32>()) {
        let all = triangles(&model);
        let size = model.bounds().extent().max_element();
        // Where flat, both lie in one plane, so the neighbour must be missed as well.
        let [n, m] = [all[0], all[1]].map(|t| t.area_normal().normalize_or_zero());
        let coplanar = n.cross(m).length() == 0.0 && n != DVec3::ZERO;
        let mut rays = Vec::new();
        let mut hits = Vec::new();
        for i in 0..50 {
            let [a, b] = rt_core::random::pair(seed, i, 7);
            let [u, v] = if a + b > 1.0 { [1.0 - a, 1.0 - b] } else { [a, b] };
            // Some exactly on edges and corners.
            let [u, v] = [[u, v], [u, 0.0], [0.0, v], [u, 1.0 - u], [0.0, 1.0]][i as usize % 5];
            rays.push(Ray::new(Vec3::ZERO, random_vector(seed, i)));
            hits.push(Hit { t: size, u, v, primitive: i % 2 });
        }
        let source = RaySource::Explicit { rays: rays.into(), origins: None };
        let surfaces = surfaces(&model);
        let spawner = Spawner { seed, bounce: 1, ..spawner(&surfaces, &source, &hits) };
        let sun = Sun::new(random_vector(seed, 99), 0.3).unwrap();
        for out in spawner.streams([Aim::Cosine, sun.aim()]) {
            for (&(ref ray, origin), path) in made(&out).iter().zip(paths(&out)) {
                prop_assert_eq!(origin, path % 2);
                prop_assert!((ray.direction.length() - 1.0).abs() < 1e-6);
                prop_assert_eq!((ray.tmin, ray.tmax), (0.0, f32::INFINITY));
                let own = &all[origin as usize];
                // A sliver of one rounding step has no plane that single precision could keep to either side of.
                let thin = own.area_normal().length() < 1e-5 * f64::from(size) * f64::from(size);
                prop_assume!(!thin);
                prop_assert_eq!(intersect::hit(ray, own, 0), None);
                if coplanar {
                    prop_assert_eq!(intersect::hit(ray, &all[1 - origin as usize], 0), None);
                }
            }
        }
    }

    /// Guards: a ray depends on its path alone, not on which others are there. Fails when random numbers are those of
    /// the ray's place in the list of hits or rays.
    #[test]
    fn a_ray_is_the_same_without_the_others(
        lost in prop::collection::vec(any::<bool>(), 400), samples in 1..5_u32, first_group in any::<u32>(), bounce in 0..9_u32,
    ) {
        let model = sphere(0, 1.0, Vec3::ZERO);
        let surfaces = surfaces(&model);
        let (rays, mut hits) = seen(&model, Vec3::ZERO, 1.0, 400, true);
        hits[7] = Hit { primitive: 1000, ..hits[7] };
        let sun = Sun::new(Vec3::new(0.3, 1.0, 0.2), Sun::REAL_RADIUS).unwrap();
        let aims = [Aim::Cosine, sun.aim()];
        let spawner = Spawner { samples, first_group, bounce, ..spawner(&surfaces, &rays, &hits) };
        let fewer: Vec<Hit> = hits.iter().zip(&lost).map(|(hit, lost)| if *lost { Hit::MISS } else { *hit }).collect();
        let some = Spawner { hits: &fewer, ..spawner }.streams(aims);
        for (all, some) in spawner.streams(aims).iter().zip(&some) {
            prop_assert!(paths(all).is_sorted_by(|a, b| a < b) && !paths(all).contains(&7));
            let left = made(all).into_iter().zip(paths(all)).filter(|(_, path)| !lost[*path as usize]);
            prop_assert_eq!(left.collect::<Vec<_>>(), made(some).into_iter().zip(paths(some)).collect::<Vec<_>>());
        }
    }
}

#[test]
fn every_hit_that_can_send_a_ray_does() {
    let model = sphere(1, 1.0, Vec3::ZERO);
    let (rays, hits) = seen(&model, Vec3::ZERO, 1.0, 2000, true);
    let hit: Vec<u32> = (0..2000).filter(|&i| hits[i as usize].is_hit()).collect();
    let sun = Sun::new(Vec3::Y, 0.0).unwrap();
    let [diffuse, shadow] = spawner(&surfaces(&model), &rays, &hits).streams([Aim::Cosine, sun.aim()]);
    assert_eq!(paths(&diffuse), hit);
    let sunny = |i: &u32| {
        let t = model.triangle(hits[*i as usize].primitive).unwrap();
        let n = t.area_normal().normalize();
        // The sphere is seen from outside, so normals point away from its centre.
        (n * n.dot(t.a.as_dvec3()).signum()).y > 1e-6
    };
    assert_eq!(paths(&shadow), hit.iter().copied().filter(sunny).collect::<Vec<_>>());
}

#[test]
fn points_lie_where_the_parent_met_the_surface() {
    let model = sphere(2, 1.0, Vec3::ZERO);
    let (rays, hits) = seen(&model, Vec3::ZERO, 1.0, 2000, true);
    let out = diffuse(&spawner(&surfaces(&model), &rays, &hits));
    for ((ray, _), path) in made(&out).into_iter().zip(paths(&out)) {
        let expected = rays.ray(path).0.at(hits[path as usize].t);
        assert!(ray.origin.distance(expected) < 2e-6, "{} instead of {expected}", ray.origin);
    }
}

#[test]
fn every_bounce_group_and_purpose_has_its_own_numbers() {
    let model = sphere(0, 1.0, Vec3::ZERO);
    let (rays, hits) = seen(&model, Vec3::ZERO, 1.0, 100, true);
    // A sun of half the sky, so that its rays spread like diffuse ones.
    let sun = Sun::new(Vec3::Y, 1.5).unwrap();
    let surfaces = surfaces(&model);
    let directions = |seed, first_group, bounce| {
        let spawner = Spawner { seed, first_group, bounce, ..spawner(&surfaces, &rays, &hits) };
        let [diffuse, shadow] = spawner.streams([Aim::Cosine, sun.aim()]);
        assert!(shadow.len() > 10);
        [diffuse, shadow]
            .map(|out| made(&out).iter().map(|(ray, _)| ray.direction.to_array().map(f32::to_bits)).collect())
    };
    let all: Vec<[Vec<_>; 2]> =
        vec![directions(1, 0, 0), directions(1, 0, 1), directions(1, 0, 2), directions(2, 0, 0), directions(1, 100, 0)];
    let all = all.concat().concat();
    let distinct: std::collections::HashSet<_> = all.iter().collect();
    assert_eq!(distinct.len(), all.len());
}

/// The rays of a picture of the garden, by kind, traced in waves of about `memory` bytes; each with its number on the
/// Z-curve.
fn rays_of_a_picture(memory: u64) -> Vec<Vec<(u64, Ray, u32)>> {
    let size = [37, 20];
    let model = builtin::yard();
    let view = model.view.expect("it has one");
    let camera = view.camera().expect("a camera");
    let surfaces = surfaces(&model);
    let scene = Arc::clone(surfaces.scene());
    let paths = Paths { camera, size, samples: 3, seed: 8, sun: Sun::beside(&view), surfaces };
    let mut all = vec![Vec::new(); 5];
    for wave in Waves::new(size, 3, 256, memory).expect("it has pixels").iter() {
        let mut front = paths.primary(&wave);
        for bounce in 0..2 {
            let rays = (0..front.source.len()).map(|i| front.source.ray(i));
            let mut hits = Vec::new();
            let spec = front.spec(rt_core::Precision::Robust);
            rt_bvh::trace(&scene, &mut rt_bvh::Stack::for_scene(&scene), spec, rays, |hit, _| hits.push(hit));
            let [shadow, diffuse] = paths.follow(&front, &hits);
            for (kind, stream) in [(0, &front), (1, &shadow), (2, &diffuse)] {
                if kind > 0 || bounce == 0 {
                    all[kind + 2 * bounce].extend((0..stream.source.len()).map(|i| {
                        let path = 3 * u64::from(wave.first) + u64::from(stream.path(i));
                        let (ray, origin) = stream.source.ray(i);
                        (path, ray, origin)
                    }));
                }
            }
            front = diffuse;
        }
    }
    all
}

/// Fails when waves number their pixels from 0 for random numbers, or diffuse rays are numbered anew in each bounce.
#[test]
fn rays_do_not_depend_on_the_waves() {
    let whole = rays_of_a_picture(u64::MAX);
    assert!(whole.iter().all(|rays| rays.len() > 200), "{:?}", whole.iter().map(Vec::len).collect::<Vec<_>>());
    assert_eq!(Wave::whole([37, 20]).unwrap().pixels.len(), 740);
    for memory in [0, 5000, 100_000, 300_000] {
        assert!(rays_of_a_picture(memory) == whole, "waves of {memory} bytes send other rays");
    }
}
