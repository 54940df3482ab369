//! What traversals count.

mod common;

use common::{closest, count_all, icosphere, nasty_rays, scene_of, soup, trace_all};
use glam::Vec3;
use rt_bvh::Builder;
use rt_core::{Child, Hit, Precision, Query, Ray, ReducedWalk, StreamSpec, TestCounts, Walk};

const UNSHORTENED: Walk = Walk::Reduced(ReducedWalk::Unshortened);
const LEAF_AS_HIT: Walk = Walk::Reduced(ReducedWalk::LeafAsHit);

// Fails when a leaf's tests are counted once per leaf rather than per triangle, and when a reduced walk passes by what
// the full one enters.
#[test]
fn counts_are_consistent() {
    for model in [soup(1_000, 0.1, 1), icosphere(3), soup(1, 1.0, 2), soup(2, 1.0, 3)] {
        let rays = nasty_rays(&model, 2_000, 4);
        for &builder in Builder::ALL {
            let scene = scene_of(&model, builder);
            let spec = StreamSpec::new(Query::Closest, Precision::Robust, true);
            let full = trace_all(&scene, spec, &rays);
            assert_eq!(count_all(&scene, Walk::Full, &rays), full, "{builder}");
            // Counting changes no hit.
            let hits: Vec<_> = full.iter().map(|(hit, _)| *hit).collect();
            assert_eq!(closest(&scene, Precision::Robust, &rays), hits, "{builder}");
            let plain = StreamSpec { counts: false, ..spec };
            assert!(trace_all(&scene, plain, &rays).iter().all(|(_, counts)| *counts == TestCounts::default()));
            let any = trace_all(&scene, StreamSpec { query: Query::Any, ..spec }, &rays);
            let unshortened = count_all(&scene, UNSHORTENED, &rays);
            let leaf_as_hit = count_all(&scene, LEAF_AS_HIT, &rays);
            for i in 0..rays.len() {
                let (hit, exact) = full[i];
                let (none, most) = unshortened[i];
                assert_eq!((none, leaf_as_hit[i].0), (Hit::MISS, Hit::MISS));
                assert!(exact.boxes <= most.boxes && exact.triangles <= most.triangles, "{builder}: {:?}", rays[i]);
                let cut = leaf_as_hit[i].1;
                assert!(cut.boxes <= most.boxes && cut.triangles <= most.triangles, "{builder}: {:?}", rays[i]);
                assert!(any[i].1.triangles <= most.triangles);
                if !hit.is_hit() {
                    // Nothing shortened the ray.
                    assert_eq!((exact, any[i].1), (most, most), "{builder}: {:?}", rays[i]);
                }
                let whole = scene.nodes()[0].child(1) != Child::Absent;
                let per_node = if whole { 2 } else { 1 };
                assert!(exact.boxes >= per_node || !rays[i].is_valid());
                assert_eq!(exact.boxes % per_node, 0);
            }
        }
    }
}

#[test]
fn a_single_leaf_costs_one_box_and_its_triangles() {
    let model = soup(1, 1.0, 5);
    let scene = scene_of(&model, Builder::Sah);
    let [a, b, c] = model.triangle(0).vertices();
    let towards = Ray::new(Vec3::splat(3.0), (a + b + c) / 3.0 - Vec3::splat(3.0));
    let away = Ray::new(Vec3::splat(3.0), Vec3::ONE);
    for (walk, hits) in [(Walk::Full, true), (UNSHORTENED, false), (LEAF_AS_HIT, false)] {
        let answers = count_all(&scene, walk, &[towards, away]);
        assert_eq!(answers[0].1, TestCounts { boxes: 1, triangles: 1 });
        assert_eq!(answers[0].0.is_hit(), hits);
        assert_eq!(answers[1], (Hit::MISS, TestCounts { boxes: 1, triangles: 0 }));
    }
}

// Behind the first leaf entered, a walk that takes it for a hit goes no further.
#[test]
fn a_leaf_taken_for_a_hit_ends_the_ray() {
    let mut model = soup(0, 1.0, 6);
    for i in 0..64 {
        let z = i as f32;
        model.push([Vec3::new(-1.0, -1.0, z), Vec3::new(3.0, -1.0, z), Vec3::new(-1.0, 3.0, z)]);
    }
    let scene = scene_of(&model, Builder::Sah);
    let ray = [Ray::new(Vec3::new(0.1, 0.2, -1.0), Vec3::Z)];
    let cut = count_all(&scene, LEAF_AS_HIT, &ray)[0].1;
    let most = count_all(&scene, UNSHORTENED, &ray)[0].1;
    assert_eq!(most.triangles, 64);
    assert!(cut.triangles <= 4, "{cut:?}");
}
