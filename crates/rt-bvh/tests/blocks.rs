//! The layout for processors, over every builder's trees.

mod common;

use common::{Model, cube, grid, icosphere, soup, with};
use glam::Vec3;
use proptest::prelude::*;
use rt_bvh::{BlockTree, BuildOptions, Builder, InvalidTriangles, build};

/// Asserts that trees of all builders, with small leaves and large ones, are sound.
fn assert_sound(model: &Model, name: &str) {
    for &builder in Builder::ALL {
        for max_leaf in [1, 4, 11] {
            let options = BuildOptions { max_leaf, invalid: InvalidTriangles::Drop, ..with(builder) };
            let scene = build(model.mesh(), &options).expect("valid mesh").scene;
            let tree = BlockTree::new(&scene).expect("few blocks");
            let checked = tree.check(&scene);
            assert!(checked.is_ok(), "{name}, {builder}, {max_leaf}: {checked:?}");
            assert_eq!(tree.bounds(), scene.bounds());
        }
    }
}

#[test]
fn every_builders_trees_collapse() {
    for (name, model) in [
        ("none", Model::default()),
        ("one", soup(1, 1.0, 4)),
        ("two", soup(2, 1.0, 5)),
        ("nine", soup(9, 1.0, 5)),
        ("soup", soup(2_000, 0.1, 1)),
        ("grid", grid(24, 3)),
        ("icosphere", icosphere(3)),
        ("cube", cube(6)),
        ("all alike", soup(1, 1.0, 6).repeated(300)),
        ("nested", Model::of(&soup_of_nested(300))),
        ("huge", soup(100, 0.3, 11).map(|p| p * libm::ldexpf(1.0, 100))),
    ] {
        assert_sound(&model, name);
    }
}

/// Triangles each of which holds all that come after it in its box.
fn soup_of_nested(count: usize) -> Vec<rt_core::Triangle> {
    (0..count)
        .map(|i| {
            let size = libm::powf(0.9, i as f32);
            rt_core::Triangle::new(Vec3::splat(-size), size * Vec3::new(1.0, 1.0, -1.0), Vec3::splat(size))
        })
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    // Fails when an absent child of the root is taken for a leaf, and when triangles of a merged leaf are counted
    // twice.
    #[test]
    fn trees_of_few_triangles_are_sound(count in 0_usize..70, size in 0.01_f32..2.0, seed in any::<u32>()) {
        assert_sound(&soup(count, size, seed), "random");
    }
}
