//! Several hits of a ray and masks, against testing every triangle.

mod common;

use common::{Model, cube, grid, icosphere, nasty_rays, scene_of, soup, trace_all};
use proptest::prelude::*;
use rt_bvh::{Builder, Stack, trace_several};
use rt_core::intersect::hit;
use rt_core::{Hit, Precision, Query, Ray, Scene, StreamSpec, TestCounts};
use std::num::NonZero;

const ALL: u32 = u32::MAX;

fn several(most: u32, mask: u32) -> StreamSpec {
    let query = Query::All { most: NonZero::new(most).expect("a place") };
    StreamSpec { mask, ..StreamSpec::new(query, Precision::Robust, true) }
}

fn traced(scene: &Scene, spec: StreamSpec, rays: &[Ray]) -> Vec<(Vec<Hit>, TestCounts)> {
    let mut out = Vec::new();
    let mut stack = Stack::for_scene(scene);
    let rays = rays.iter().map(|&ray| (ray, u32::MAX));
    trace_several(scene, &mut stack, spec, rays, |hits, counts| out.push((hits.to_vec(), counts)));
    out
}

/// Every hit, in order.
fn brute(model: &Model, ray: &Ray, shows: impl Fn(u32) -> bool) -> Vec<Hit> {
    let ids = (0..model.indices.len() as u32).filter(|&id| shows(id));
    let mut hits: Vec<Hit> = ids.filter_map(|id| hit(ray, &model.triangle(id), id)).collect();
    hits.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.primitive.cmp(&b.primitive)));
    hits
}

/// For comparing bits, so that a −0 shows.
fn bits(hits: &[Hit]) -> Vec<[u32; 4]> {
    hits.iter().map(|hit| [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive]).collect()
}

/// Asserts that lists of any length, whatever the mask, are those of brute force.
fn assert_brute(model: &Model, masks: &[u32], rays: &[Ray], name: &str) {
    for &builder in Builder::ALL {
        let scene = Scene::clone(&scene_of(model, builder)).with_masks(masks.to_vec()).expect("as many");
        for mask in [ALL, 0b01, 0b10] {
            let expected: Vec<Vec<Hit>> =
                rays.iter().map(|ray| brute(model, ray, |id| masks[id as usize] & mask != 0)).collect();
            for (precision, most) in
                [(Precision::Robust, 1), (Precision::Robust, 3), (Precision::Robust, 64), (Precision::Double, 3)]
            {
                let spec = StreamSpec { precision, ..several(most, mask) };
                for ((ray, all), (hits, _)) in rays.iter().zip(&expected).zip(traced(&scene, spec, rays)) {
                    let mut first = all.clone();
                    first.resize(most as usize, Hit::MISS);
                    assert_eq!(bits(&hits), bits(&first), "{name}, {builder}, {precision:?}, {most}, {mask}: {ray:?}");
                }
            }
        }
    }
}

/// One in three primitives has the one bit, one the other, one both.
fn masks(model: &Model) -> Vec<u32> {
    (0..model.indices.len() as u32).map(|id| [0b01, 0b10, 0b11][(id % 3) as usize]).collect()
}

// Mutants: the limit of the first place instead of the last; a limit before all places are taken; ties in the order in
// which they were met; a place lost or taken twice; primitives that share no bit with the ray.
#[test]
fn several_hits_are_those_of_every_triangle() {
    for (name, model) in [
        ("soup", soup(300, 0.5, 1)),
        ("grid", grid(12, 3)),
        ("icosphere", icosphere(2)),
        ("cube", cube(4)),
        ("one", soup(1, 1.0, 4)),
        // Ties wherever there is a hit.
        ("thrice", soup(60, 0.8, 5).repeated(3)),
    ] {
        assert_brute(&model, &masks(&model), &nasty_rays(&model, 400, 6), name);
    }
}

// Fails when the list with one place is more than the nearest hit, or takes other tests; and when a scene with masks
// costs a stream that sees all of it anything.
#[test]
fn one_place_without_masks_is_the_nearest_hit_in_as_many_tests() {
    let model = soup(800, 0.2, 7);
    let rays = nasty_rays(&model, 1_000, 8);
    let plain = scene_of(&model, Builder::default());
    let masked = Scene::clone(&plain).with_masks(masks(&model)).expect("as many");
    for precision in [Precision::Robust, Precision::Double, Precision::Fast] {
        let spec = StreamSpec::new(Query::Closest, precision, true);
        let nearest = trace_all(&plain, spec, &rays);
        let list = traced(&plain, StreamSpec { precision, ..several(1, ALL) }, &rays);
        for ((hit, counts), (hits, list_counts)) in nearest.iter().zip(&list) {
            assert_eq!((bits(&[*hit]), counts), (bits(hits), list_counts), "{precision:?}");
        }
        assert_eq!(trace_all(&masked, spec, &rays), nearest);
        // Its nearest alone, where one hit is asked for.
        let of_many = trace_all(&plain, StreamSpec { precision, ..several(5, ALL) }, &rays);
        assert_eq!(of_many, nearest);
    }
}

// Fails when an any-hit ray ends with what its mask hides, or passes by what it shows.
#[test]
fn any_hit_is_one_that_the_mask_shows() {
    let model = soup(300, 0.5, 9);
    let masks = masks(&model);
    let rays = nasty_rays(&model, 1_000, 10);
    let scene = Scene::clone(&scene_of(&model, Builder::default())).with_masks(masks.clone()).expect("as many");
    for mask in [ALL, 0b01, 0b10, 0b100] {
        let spec = StreamSpec { mask, ..StreamSpec::new(Query::Any, Precision::Robust, false) };
        for (ray, (hit, counts)) in rays.iter().zip(trace_all(&scene, spec, &rays)) {
            let all = brute(&model, ray, |id| masks[id as usize] & mask != 0);
            assert_eq!(hit.is_hit(), !all.is_empty(), "{mask}: {ray:?}");
            assert!(!hit.is_hit() || all.contains(&hit), "{mask}: {ray:?}: {hit:?}");
            assert_eq!(counts, TestCounts::default(), "nobody asked for them");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    // Mutants: as above, in meshes that nobody thought of: coordinates from a few values make many ties.
    #[test]
    fn any_mesh_mask_and_number_of_places_agree_with_brute_force(
        corners in prop::collection::vec(prop::array::uniform9(-3i8..=3), 1..40),
        bits_of in prop::collection::vec(0u32..8, 40),
        aims in prop::collection::vec((prop::array::uniform3(-4i8..=4), prop::array::uniform3(-3i8..=3)), 1..30),
        most in 1u32..9,
        mask in 0u32..8,
    ) {
        let point = |p: &[i8]| glam::Vec3::new(p[0].into(), p[1].into(), p[2].into());
        let mut model = Model::default();
        corners.iter().for_each(|c| model.push([point(&c[..3]), point(&c[3..6]), point(&c[6..])]));
        let masks = &bits_of[..model.indices.len()];
        let scene = Scene::clone(&scene_of(&model, Builder::Sah)).with_masks(masks.to_vec()).expect("as many");
        let rays: Vec<Ray> = aims.iter().map(|(o, d)| Ray::new(point(o), point(d))).collect();
        for (ray, (hits, _)) in rays.iter().zip(traced(&scene, several(most, mask), &rays)) {
            let mut expected = brute(&model, ray, |id| masks[id as usize] & mask != 0);
            expected.resize(most as usize, Hit::MISS);
            prop_assert_eq!(bits(&hits), bits(&expected), "{:?}", ray);
        }
    }
}
