//! Meshes that break builders, and what is said about them.

mod common;

use common::{Model, Random, closest, grid, nasty_rays, scene_of, soup, with};
use glam::Vec3;
use rt_bvh::{
    BuildError, BuildOptions, Builder, InvalidTriangles, MOST_STEPS, Mesh, PlocQuality, TreeStats, build, build_with,
};
use rt_core::{Hit, MAX_DEPTH, Precision, Ray};

/// Triangles whose boxes all have their centre at the origin.
fn equal_centroids(count: usize) -> Model {
    let mut random = Random::new(1);
    let mut model = Model::default();
    for _ in 0..count {
        let p = random.point();
        model.push([p, -p, Vec3::new(-p.x, p.y, p.z)]);
    }
    model
}

/// Triangles nested in each other, each smaller than the last by the same factor.
fn nested(count: usize, factor: f32) -> Model {
    let mut model = Model::default();
    let mut size = 1.0;
    for _ in 0..count {
        model.push([Vec3::ZERO, Vec3::new(size, size, 0.0), Vec3::new(0.0, size, size)]);
        size *= factor;
    }
    model
}

// Fails (by never ending, or by its depth) when a range without a plane is not halved, when depth is not bounded, and
// when clustering is not kept from equal centroids.
#[test]
fn no_mesh_makes_a_builder_slow_or_a_tree_deep() {
    let line = |i: u32| Vec3::splat(i as f32);
    let mut equal = Model::default();
    let mut colinear = Model::default();
    let mut regular = Model::default();
    for i in 0..20_000 {
        let corner = Vec3::new((i % 141) as f32, (i / 141) as f32, 0.0);
        regular.push([corner, corner + Vec3::X, corner + Vec3::Y]);
        equal.push([Vec3::ZERO, Vec3::X, Vec3::Y]);
        colinear.push([line(i), line(i) + Vec3::X, line(i) + Vec3::Y]);
    }
    let mut teapot = soup(5_000, 0.1, 2);
    teapot.push([Vec3::splat(1e12), Vec3::splat(2e12), Vec3::new(1e12, 0.0, 0.0)]);
    for (name, model) in [
        ("equal triangles", equal),
        ("equal centroids", equal_centroids(20_000)),
        ("nested", nested(2_000, 0.96)),
        ("nested by halves", nested(140, 0.5)),
        ("colinear", colinear),
        ("regular", regular),
        ("teapot in a stadium", teapot),
        ("grid", grid(40, 3)),
    ] {
        for &builder in Builder::ALL {
            let built = build(model.mesh(), &with(builder)).expect("finite mesh");
            let stats = TreeStats::of(&built.scene);
            let kept = built.report.triangles - built.report.dropped_degenerate;
            assert!(stats.depth <= MAX_DEPTH && stats.largest_leaf <= 4, "{name}, {builder}: {stats:?}");
            assert_eq!(built.scene.triangles().len(), kept as usize, "{name}, {builder}");
            assert!(built.report.builder == builder || built.report.fallback.is_some(), "{name}, {builder}");
        }
    }
}

/// The corners of the triangle with a number.
type Corners<'a> = &'a dyn Fn(u32) -> [Vec3; 3];

/// A hundred thousand triangles of the kinds that make clustering or reinsertion quadratic. Work is counted, not time.
/// Fails when a pass that joins few clusters is not replaced, when a search for a better place has no end, and when
/// ties all break the same way.
#[test]
fn no_hundred_thousand_triangles_make_a_builder_slow() {
    let made = |count, corners: Corners<'_>| {
        let mut model = Model::default();
        (0..count).for_each(|i| model.push(corners(i)));
        model
    };
    let triangle = [Vec3::X, Vec3::new(-0.5, 0.866, 0.0), Vec3::new(-0.5, -0.866, 0.0)];
    let sized = |i: u32| 1.0 + i as f32 * 1e-5;
    let series = |i: u32| libm::powf(1.0 + 1e-4, i as f32);
    let kinds: [(&str, Corners<'_>); 6] = [
        ("nested", &|i| triangle.map(|p| p * sized(i))),
        ("equal", &|_| triangle),
        ("collinear", &|i| triangle.map(|p| p + Vec3::splat(i as f32))),
        ("geometric series", &|i| triangle.map(|p| p * series(i) + Vec3::X * (series(i) * 1e4))),
        ("interleaved", &|i| triangle.map(|p| p * sized(i) + Vec3::X * (i % 7) as f32)),
        ("nested elsewhere", &|i| triangle.map(|p| p * sized(i) + Vec3::Y * sized(i) * 1e-3)),
    ];
    for &builder in Builder::ALL {
        // Those that try to move many nodes visit 256 for each of them in the worst case, which takes seconds.
        let thorough = matches!(builder, Builder::SahSlow | Builder::Ploc(PlocQuality::Slow | PlocQuality::VerySlow));
        let (count, most) = if thorough { (20_000, MOST_STEPS) } else { (100_000, 20.0) };
        for (name, corners) in kinds {
            let model = made(count, corners);
            let built = build(model.mesh(), &with(builder)).expect("finite mesh");
            let stats = TreeStats::of(&built.scene);
            assert!(stats.depth <= MAX_DEPTH && stats.largest_leaf <= 4, "{name}, {builder}: {stats:?}");
            let steps = built.report.steps as f64 / (f64::from(count) * f64::from(count).log2());
            println!("{name}, {builder}: {steps:.2} steps, {:?}", built.report.fallback);
            assert!(steps < most, "{name}, {builder}: {steps} steps for a triangle and a halving");
        }
    }
}

// Fails when a builder tells nothing, tells less than before, or more than there is.
#[test]
fn building_tells_how_far_it_is() {
    let model = soup(50_000, 0.01, 3);
    for &builder in Builder::ALL {
        let (mut words, mut last) = (0, 0);
        build_with(model.mesh(), &with(builder), &mut |placed, all| {
            assert!(last <= placed && placed <= all && all == 50_000, "{builder}: {placed} of {all}");
            (words, last) = (words + 1, placed);
            true
        })
        .expect("finite mesh");
        assert!(words >= 3, "{builder}: {words} words of progress");
    }
}

#[test]
fn building_stops_when_it_is_told_to() {
    let model = soup(50_000, 0.01, 4);
    for &builder in Builder::ALL {
        let mut words = 0;
        let stopped = build_with(model.mesh(), &with(builder), &mut |_, _| {
            words += 1;
            words < 3
        });
        assert_eq!((stopped.err(), words), (Some(BuildError::Cancelled), 3), "{builder}");
    }
}

#[test]
fn hits_in_such_meshes_are_those_of_every_triangle() {
    for model in [equal_centroids(1_000), nested(1_000, 0.96), nested(100, 0.5)] {
        let rays = nasty_rays(&model, 500, 4);
        let expected: Vec<_> = rays.iter().map(|ray| model.brute(ray, u32::MAX)).collect();
        for &builder in Builder::ALL {
            let scene = scene_of(&model, builder);
            for precision in [Precision::Robust, Precision::Double] {
                for ((got, want), ray) in closest(&scene, precision, &rays).iter().zip(&expected).zip(&rays) {
                    assert_eq!(got, want, "{builder}, {precision:?}: {ray:?}");
                }
            }
        }
    }
}

// Fails when the order of leaves decides between equal distances, or a tie is passed by.
#[test]
fn ties_go_to_the_lowest_id() {
    let once = soup(200, 0.4, 5);
    let mut model = once.clone();
    // Three copies of each triangle, the last ones in reverse.
    model.indices.extend(once.indices.iter().rev().chain(&once.indices));
    let rays = nasty_rays(&once, 2_000, 6);
    let expected = closest(&scene_of(&once, Builder::Sah), Precision::Robust, &rays);
    for &builder in Builder::ALL {
        let scene = scene_of(&model, builder);
        for precision in [Precision::Robust, Precision::Double] {
            assert_eq!(closest(&scene, precision, &rays), expected, "{builder}, {precision:?}");
        }
        for hit in closest(&scene, Precision::Fast, &rays) {
            assert!(!hit.is_hit() || hit.primitive < 200, "{builder}: {hit:?}");
        }
    }
}

#[test]
fn empty_meshes_make_empty_scenes() {
    let degenerate = Model { positions: vec![Vec3::ONE; 3], indices: vec![[0, 1, 2]; 5] };
    for model in [Model::default(), degenerate] {
        for &builder in Builder::ALL {
            let built = build(model.mesh(), &with(builder)).expect("nothing wrong with it");
            assert_eq!(built.report.dropped_degenerate as usize, model.indices.len());
            assert_eq!(built.scene.primitive_count() as usize, model.indices.len());
            assert_eq!(TreeStats::of(&built.scene).leaves, 0);
            for precision in [Precision::Robust, Precision::Fast, Precision::Double] {
                let hits = closest(&built.scene, precision, &[Ray::new(Vec3::ZERO, Vec3::ONE)]);
                assert_eq!(hits, [Hit::MISS]);
            }
        }
    }
}

#[test]
fn bad_meshes_are_refused_with_a_reason() {
    let mut model = soup(10, 0.3, 7);
    model.indices[4][1] = 30;
    let error = build(model.mesh(), &BuildOptions::default()).expect_err("there are 30 vertices");
    assert_eq!(error, BuildError::IndexOutOfRange { triangle: 4, index: 30, vertices: 30 });
    assert_eq!(error.to_string(), "triangle 4 names vertex 30, but there are only 30 vertices");

    let mut model = soup(10, 0.3, 7);
    model.positions[8].y = f32::NAN;
    model.positions[20].z = f32::NEG_INFINITY;
    let error = build(model.mesh(), &BuildOptions::default()).expect_err("two bad triangles");
    assert_eq!(error, BuildError::NotFinite { first: 2, triangles: 2 });
    let drop = BuildOptions { invalid: InvalidTriangles::Drop, ..BuildOptions::default() };
    let built = build(model.mesh(), &drop).expect("dropped");
    assert_eq!((built.report.dropped_invalid, built.scene.triangles().len()), (2, 8));
    let rays = nasty_rays(&soup(10, 0.3, 7), 300, 8);
    let expected: Vec<_> = rays.iter().map(|ray| model.brute(ray, u32::MAX)).collect();
    assert_eq!(closest(&built.scene, Precision::Robust, &rays), expected);

    let no_vertices = Mesh { positions: &[], indices: &[[0, 0, 0]] };
    assert!(matches!(build(no_vertices, &drop), Err(BuildError::IndexOutOfRange { .. })));
}

#[test]
fn leaves_are_as_small_as_asked_for() {
    let model = soup(1_000, 0.1, 9);
    for &builder in Builder::ALL {
        for max_leaf in [0, 1, 2, 8, u32::MAX] {
            let built = build(model.mesh(), &BuildOptions { max_leaf, ..with(builder) }).expect("valid");
            assert!(TreeStats::of(&built.scene).largest_leaf <= max_leaf.max(1), "{builder}, {max_leaf}");
        }
    }
}

// Fails when a product of coordinates overflows or underflows on the way.
#[test]
fn coordinates_may_be_as_large_or_small_as_floats_are() {
    for exponent in [-125, -100, 100, 125] {
        let s = libm::ldexpf(1.0, exponent);
        let model = soup(500, 0.3, 10).map(|p| p * s);
        let rays = nasty_rays(&model, 300, 11);
        let expected: Vec<_> = rays.iter().map(|ray| model.brute(ray, u32::MAX)).collect();
        assert!(expected.iter().filter(|hit| hit.is_hit()).count() > 100, "2^{exponent}");
        for &builder in Builder::ALL {
            assert_eq!(closest(&scene_of(&model, builder), Precision::Robust, &rays), expected, "2^{exponent}");
        }
    }
}

// Fails when a hit need not pass the box test of its own triangle: the reference test has false hits on triangles below
// 2⁻⁵⁰ of their distance, and which of them are found would then depend on what else is in their leaves.
#[test]
fn hits_on_the_tiniest_triangles_do_not_depend_on_the_tree() {
    // All boxes have the same centre, so tiny triangles share a leaf with large ones when leaves may be large.
    let mut model = equal_centroids(20);
    for i in 0..2_000 {
        let size = libm::ldexpf(1.0, -46 - i % 12);
        let tiny = equal_centroids(i as usize % 16 + 1).map(|p| p * size);
        model.push(tiny.triangle(i as u32 % 16).vertices());
    }
    let mut random = Random::new(12);
    let rays: Vec<_> = (0..2_000).map(|_| Ray::new(random.point(), random.direction())).collect();
    let hits = |max_leaf| {
        let built = build(model.mesh(), &BuildOptions { max_leaf, ..BuildOptions::default() }).expect("valid");
        closest(&built.scene, Precision::Double, &rays)
    };
    assert!(hits(1) == hits(u32::MAX));
}
