//! Every builder and precision against testing every triangle.

mod common;

use common::{Model, closest, grid, icosphere, nasty_rays, scene_of, soup};
use rt_bvh::Builder;
use rt_core::{Precision, Ray};

/// Compares bits, so that a NaN or a −0 would show.
fn bits(hit: rt_core::Hit) -> [u32; 4] {
    [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive]
}

fn agrees(model: &Model, rays: &[Ray], name: &str) {
    let expected: Vec<_> = rays.iter().map(|ray| model.brute(ray, u32::MAX)).collect();
    for &builder in Builder::ALL {
        let scene = scene_of(model, builder);
        for precision in [Precision::Robust, Precision::Double] {
            for ((ray, got), want) in rays.iter().zip(closest(&scene, precision, rays)).zip(&expected) {
                assert_eq!(bits(got), bits(*want), "{name}, {builder}, {precision:?}: {ray:?}\n{got:?}\n{want:?}");
            }
        }
    }
}

// Fails when the far distance of a box is not padded, when a filtered edge function's bound is 18·u² instead of 18·u,
// and when a child at exactly the limit is passed by.
#[test]
fn hits_are_those_of_every_triangle() {
    for (name, model) in [
        ("soup", soup(300, 0.3, 1)),
        ("small soup", soup(2_000, 0.03, 2)),
        ("grid", grid(20, 3)),
        ("icosphere", icosphere(3)),
        ("one", soup(1, 1.0, 4)),
        ("two", soup(2, 1.0, 5)),
    ] {
        agrees(&model, &nasty_rays(&model, 2_000, 6), name);
    }
}
