//! Packets against single rays: the same hits and the same counts, bit for bit.

mod common;

use common::{Model, Random, cube, grid, icosphere, nasty_rays, scene_of, soup};
use glam::Vec3;
use rt_bvh::{Builder, PacketWalk, ReducedTree, Stack, count, trace, walk_packets};
use rt_core::{Hit, Precision, Query, Ray, ReducedWalk, Scene, StreamSpec, TestCounts, Walk};

type Answers = Vec<(Hit, TestCounts)>;

/// What may be asked of a packet: every kernel.
fn walks(trees: &[ReducedTree]) -> Vec<PacketWalk<'_>> {
    let mut walks = Vec::new();
    for query in [Query::Closest, Query::Any] {
        for precision in [Precision::Robust, Precision::Fast, Precision::Double] {
            for counts in [true, false] {
                walks.push(PacketWalk::Trace(StreamSpec::new(query, precision, counts)));
            }
        }
    }
    walks.extend([ReducedWalk::LeafAsHit, ReducedWalk::Unshortened].map(PacketWalk::Reduced));
    walks.extend(trees.iter().map(PacketWalk::Tree));
    walks
}

/// The trees of those reduced walks that have one.
fn trees(scene: &Scene) -> Vec<ReducedTree> {
    let walks = [ReducedWalk::LeafPlane, ReducedWalk::Truncated];
    walks.into_iter().filter_map(|walk| ReducedTree::for_walk(scene, walk)).collect()
}

/// Ray by ray.
fn alone(scene: &Scene, walk: PacketWalk<'_>, rays: &[(Ray, u32)]) -> Answers {
    let mut out = Vec::with_capacity(rays.len());
    let sink = |hit, counts| out.push((hit, counts));
    let (stack, rays) = (&mut Stack::default(), rays.iter().copied());
    match walk {
        PacketWalk::Trace(spec) => trace(scene, stack, spec, rays, sink),
        PacketWalk::Reduced(walk) => count(scene, stack, Walk::Reduced(walk), Precision::Robust, rays, sink),
        PacketWalk::Tree(tree) => tree.count(scene, stack, rays, sink),
    }
    out
}

/// In packets, by each way to walk them that the processor has.
fn together(scene: &Scene, walk: PacketWalk<'_>, rays: &[(Ray, u32)]) -> Vec<Answers> {
    let mut portable = Vec::with_capacity(rays.len());
    let sink = |hit, counts| portable.push((hit, counts));
    walk_packets(scene, &mut Stack::default(), walk, rays.iter().copied(), sink);
    let mut all = vec![portable];
    #[cfg(target_arch = "x86_64")]
    if ["avx2", "bmi1", "bmi2", "lzcnt", "popcnt"].iter().all(|feature| has(feature)) {
        let mut wide = Vec::with_capacity(rays.len());
        let sink = |hit, counts| wide.push((hit, counts));
        // SAFETY: the processor has every feature that the function is compiled for.
        unsafe { rt_bvh::walk_packets_avx2(scene, &mut Stack::default(), walk, rays.iter().copied(), sink) };
        all.push(wide);
    }
    all
}

#[cfg(target_arch = "x86_64")]
fn has(feature: &str) -> bool {
    match feature {
        "avx2" => is_x86_feature_detected!("avx2"),
        "bmi1" => is_x86_feature_detected!("bmi1"),
        "bmi2" => is_x86_feature_detected!("bmi2"),
        "lzcnt" => is_x86_feature_detected!("lzcnt"),
        "popcnt" => is_x86_feature_detected!("popcnt"),
        _ => false,
    }
}

/// For comparing bits, so that a NaN or a −0 shows.
fn bits((hit, counts): &(Hit, TestCounts)) -> [u32; 6] {
    [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive, counts.boxes, counts.triangles]
}

fn assert_same(scene: &Scene, rays: &[(Ray, u32)], name: &str) {
    for walk in walks(&trees(scene)) {
        let expected = alone(scene, walk, rays);
        for found in together(scene, walk, rays) {
            assert_eq!(found.len(), rays.len(), "{name}");
            for ((ray, found), expected) in rays.iter().zip(&found).zip(&expected) {
                assert_eq!(bits(found), bits(expected), "{name}: {ray:?}\n{found:?}\n{expected:?}");
            }
        }
    }
}

/// Rays of a bundle: from near one point to near another, so that they share much of their way.
fn bundles(model: &Model, count: usize, spread: f32, seed: u32) -> Vec<(Ray, u32)> {
    let mut random = Random::new(seed);
    let mut ends = [Vec3::ZERO; 2];
    (0..count)
        .map(|i| {
            if i % 16 == 0 {
                ends = [random.point() * 2.0, random.point()];
            }
            let [from, to] = ends.map(|end| end + random.point() * spread);
            let ray = Ray::new(from, to - from).with_range(random.signed(), 1.0 + random.unit());
            (ray, random.below(model.indices.len().max(1)) as u32)
        })
        .collect()
}

/// Rays whose numbers are the extremes of their type, some of them any bits.
fn extremes(count: usize, seed: u32) -> Vec<(Ray, u32)> {
    const NUMBERS: [f32; 14] = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        0.3,
        -0.7,
        1e-45,
        f32::MIN_POSITIVE,
        1e30,
        f32::MAX,
        f32::MIN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::NAN,
    ];
    let mut random = Random::new(seed);
    let mut ray = |i: usize| {
        // Every other ray is likely to be valid.
        let mut number = |poor: bool| match random.below(16) {
            0 if poor => f32::from_bits((random.unit() * 4e9) as u32),
            _ => NUMBERS[random.below(if poor { NUMBERS.len() } else { 9 })],
        };
        let mut vector = || Vec3::from_array(core::array::from_fn(|_| number(i.is_multiple_of(2))));
        let (origin, direction) = (vector(), vector());
        let limits = vector();
        (Ray { origin, tmin: -limits.x.abs(), direction, tmax: limits.y.abs() }, u32::MAX)
    };
    let mut rays: Vec<_> = (0..count).map(&mut ray).collect();
    // Limits in the wrong order.
    rays.iter_mut().step_by(7).for_each(|(ray, _)| (ray.tmin, ray.tmax) = (ray.tmax, ray.tmin));
    rays
}

fn free(rays: Vec<Ray>) -> Vec<(Ray, u32)> {
    rays.into_iter().map(|ray| (ray, u32::MAX)).collect()
}

// Coherent and incoherent rays over all trees. Mutants: all rays follow the majority; rays left behind are not compared
// with their limits; limits that do not follow hits (of `triangles`, of `part`, of `leaf`); rays that ended stay open;
// a filter without its error; triangles counted for rays that ended; a minority that never comes back.
#[test]
fn packets_are_single_rays() {
    for (name, model) in [
        ("two", soup(2, 1.0, 3)),
        ("nine", soup(9, 1.0, 5)),
        ("soup", soup(600, 0.3, 1)),
        ("sphere", icosphere(3)),
        ("grid", grid(16, 7)),
        ("cube", cube(8)),
        ("tiny", icosphere(2).map(|p| p * 1e-30)),
        ("far", icosphere(2).map(|p| p + Vec3::splat(1e6))),
    ] {
        for &builder in Builder::ALL {
            let scene = scene_of(&model, builder);
            let name = format!("{name}, {builder}");
            assert_same(&scene, &free(nasty_rays(&model, 400, 2)), &name);
            for spread in [0.01, 0.2, 1.0] {
                assert_same(&scene, &bundles(&model, 160, spread, 4), &name);
            }
            assert_same(&scene, &extremes(320, 9), &name);
        }
    }
}

// Any number of rays, with invalid ones anywhere among them. Mutants: an invalid ray shifts the answers of those behind
// it; a last packet that is not full loses rays, or repeats those of the one before.
#[test]
fn every_ray_gets_its_own_answer() {
    let model = soup(200, 0.3, 8);
    let scene = scene_of(&model, Builder::Sah);
    let mut random = Random::new(6);
    for len in 0..70 {
        let mut rays = bundles(&model, len, 0.1, 10 + len as u32);
        for (ray, _) in &mut rays {
            if random.below(3) == 0 {
                ray.direction = Vec3::ZERO;
            }
        }
        assert_same(&scene, &rays, &format!("{len} rays"));
    }
}

// A root without two children has nothing to walk together.
#[test]
fn scenes_of_a_leaf_or_none_are_walked_alone() {
    let aims = soup(10, 1.0, 6);
    for model in [Model::default(), soup(1, 1.0, 4)] {
        let scene = scene_of(&model, Builder::Sah);
        assert_same(&scene, &free(nasty_rays(&aims, 100, 5)), "part");
    }
}
