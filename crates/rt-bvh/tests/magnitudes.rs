//! Hits are exact where numbers of far-apart magnitudes meet: in scenes, between scene and ray, and at a ray's limits.

mod common;

use common::{Model, Random, closest, in_words, nasty_rays, scene_of, soup};
use glam::Vec3;
use rt_bvh::{Builder, Stack, WideTree, trace_wide};
use rt_core::{Hit, Precision, Ray, Scene, StreamSpec};

fn bits(hit: Hit) -> [u32; 4] {
    [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive]
}

/// The hits of every builder, precision, layout and set of instructions are those of every triangle in the coordinates
/// of the file.
fn assert_brute(model: &Model, rays: &[Ray], name: &str) -> Vec<Hit> {
    let expected: Vec<_> = rays.iter().map(|ray| model.brute(ray, u32::MAX)).collect();
    let compare = |found: Vec<Hit>, how: &str| {
        assert_eq!(found.len(), rays.len());
        for ((ray, got), want) in rays.iter().zip(found).zip(&expected) {
            assert_eq!(bits(got), bits(*want), "{name}, {how}: {ray:?}\n{got:?}\n{want:?}");
        }
    };
    for &builder in Builder::ALL {
        let scene = scene_of(model, builder);
        for precision in [Precision::Robust, Precision::Double] {
            compare(closest(&scene, precision, rays), &format!("{builder}, {precision:?}"));
        }
        compare(in_wide_tree(&scene, rays), &format!("{builder}, wide"));
        for (isa, hits) in in_words(&scene, rays) {
            compare(hits, &format!("{builder}, {isa}"));
        }
    }
    expected
}

fn free(rays: &[Ray]) -> impl Iterator<Item = (Ray, u32)> {
    rays.iter().map(|ray| (*ray, u32::MAX))
}

fn in_wide_tree(scene: &Scene, rays: &[Ray]) -> Vec<Hit> {
    let (mut hits, tree) = (Vec::new(), WideTree::new(scene));
    tree.check().expect("sound");
    trace_wide(&tree, &mut Stack::default(), StreamSpec::default(), free(rays), |hit, _| hits.push(hit));
    hits
}

fn model(triangles: &[[[f32; 3]; 3]]) -> Model {
    let mut model = Model::default();
    triangles.iter().for_each(|corners| model.push(corners.map(Vec3::from)));
    model
}

// A ray that passes a triangle of size 10⁻¹⁴ at 4.84 units, in a scene that a far triangle makes large: boxes are
// padded by so much that the ray enters the small one's. Fails when double precision or a box decides.
#[test]
fn a_tiny_triangle_is_no_phantom() {
    let [a, b, c, d] = [[-50.0, -50.0, -2.0], [50.0, -50.0, -2.0], [50.0, 50.0, -2.0], [-50.0, 50.0, -2.0]];
    let tiny = [
        [7.592_685e-15, 5.969_877e-15, 9.176_923e-15],
        [6.896_301_7e-15, 5.003_564_2e-15, 7.708_381e-16],
        [4.884_492e-15, 2.128_31e-15, 1.326_963e-15],
    ];
    let far = [[1e7, 0.0, -1e7], [0.0, 1e7, -1e7], [1e7, 1e7, -1e7]];
    let model = model(&[[a, b, c], [a, c, d], tiny, far]);
    let ray = Ray::new(Vec3::new(2.519_853_6, 4.099_721, 700.0), Vec3::new(-7.190_050_4e-5, 8.654_81e-5, -1.0));
    let hit = assert_brute(&model, &[ray], "phantom")[0];
    assert_eq!((hit.primitive, hit.t), (1, 702.0));
}

/// A plane in two triangles, `size` in extent, before which lies a small square of `detail`, in two triangles as well.
fn plane_and_detail(size: f32, detail: f32) -> Model {
    let corner = |x: f32, y: f32| [x * size, y * size, -1.0];
    let [a, b, c, d] = [[0.0; 2], [detail, 0.0], [detail, detail], [0.0, detail]].map(|[x, y]| [x, y, 0.0]);
    model(&[[corner(-1.0, -1.0), corner(1.0, -1.0), corner(0.0, 1.0)], [a, b, c], [a, c, d]])
}

// Fails when coordinates lose bits where the scene is normalised.
#[test]
fn details_beside_the_largest_numbers_are_hit() {
    for size in [3.4e38, f32::MAX, 1e30, 1e7] {
        for detail in [1e-3, 1e-5, 1e-7, 1e-20, 1e-37, 1e-44] {
            let model = plane_and_detail(size, detail);
            let mut random = Random::new(3);
            let mut rays = vec![
                Ray::new(Vec3::new(0.7 * detail, 0.2 * detail, 1.0), Vec3::NEG_Z),
                Ray::new(Vec3::new(0.2 * detail, 0.7 * detail, 1.0), Vec3::NEG_Z),
                Ray::new(Vec3::new(0.0, 0.0, 1.0), Vec3::NEG_Z),
                Ray::new(Vec3::new(-detail, 0.0, 1.0), Vec3::NEG_Z),
            ];
            for _ in 0..40 {
                let to = detail * 2.0 * random.point() * Vec3::new(1.0, 1.0, 0.0);
                let from = [detail, 1.0, 1e3, size][random.below(4)] * random.point();
                rays.push(Ray::new(from, to - from));
            }
            let hits = assert_brute(&model, &rays, &format!("{size:e} and {detail:e}"));
            let found = hits[..4].iter().map(|hit| (hit.t, hit.primitive)).collect::<Vec<_>>();
            // With the smallest numbers there are no seven tenths.
            if detail > 1e-40 {
                assert_eq!(found, [(1.0, 1), (1.0, 2), (1.0, 1), (2.0, 0)], "{size:e} and {detail:e}");
            }
        }
    }
}

// A grid of heights in which one cell says "no data", as files of terrain do. Fails as above.
#[test]
fn terrain_with_a_value_for_no_data_is_hit_right() {
    let mut terrain = common::grid(12, 5).map(|p| Vec3::new(p.x * 1e-4, p.y * 1e-4, p.z * 1e-4));
    terrain.positions[77].y = 3.4e38;
    let mut random = Random::new(6);
    let rays: Vec<_> = (0..600)
        .map(|_| {
            let to = terrain.positions[random.below(76)];
            let from = to + 1e-3 * random.direction();
            Ray::new(from, to - from)
        })
        .collect();
    let hits = assert_brute(&terrain, &rays, "terrain");
    assert!(hits.iter().filter(|hit| hit.is_hit()).count() > 300);
}

// Fails when a ray that starts beyond the range of the tree is taken for a miss.
#[test]
fn rays_from_the_ends_of_the_number_range_hit() {
    let mut hits = 0;
    for scale in [1e-37, 1e-20, 1.0, 1e20, 1e37] {
        let model = soup(40, 0.5, 7).map(|p| (p - 0.5) * scale);
        let mut random = Random::new(8);
        let mut rays = Vec::new();
        for distance in [scale, 1e3 * scale, 1.0, 1e10, 1e25, f32::MAX] {
            for i in 0..12 {
                let to = model.positions[random.below(model.positions.len())];
                let axis = i % 3;
                let mut from = to;
                from[axis] = if i % 2 == 0 { distance } else { -distance };
                let mut along = Vec3::ZERO;
                along[axis] = -from[axis];
                rays.push(Ray::new(from, along));
                let from = distance * random.point();
                rays.push(Ray::new(from, to - from));
            }
        }
        let found = assert_brute(&model, &rays, &format!("{scale:e}"));
        hits += found.iter().filter(|hit| hit.is_hit()).count();
    }
    assert!(hits > 200, "{hits}");
}

// Distances that single precision cannot tell from each other are ties. Fails when a limit that was rounded to a
// subnormal number shuts boxes behind it.
#[test]
fn distances_that_all_but_vanish_are_ties_for_the_lowest_id() {
    let least = f32::from_bits(1);
    let mut ties = 0;
    for scale in [1e-30, 1e-8, 1e-7, 1e-6] {
        let model = soup(60, 0.5, 9).map(|p| p * scale);
        let mut random = Random::new(10);
        let rays: Vec<_> = (0..600)
            .map(|i| {
                let from = 2.0 * scale * random.point();
                let to = model.positions[random.below(model.positions.len())];
                let direction = (to - from) * (1.0 / scale) * 1e38;
                let [low, high] = [[0.0, f32::INFINITY], [least; 2], [least, 1.0], [0.0, least]][i % 4];
                Ray::new(from, direction).with_range(low, high)
            })
            .collect();
        let hits = assert_brute(&model, &rays, &format!("vanishing distances, {scale:e}"));
        ties += hits.iter().filter(|hit| hit.is_hit() && hit.t == least).count();
    }
    assert!(ties > 500, "{ties}");
}

// Fails when any of the above does, and when ordinary rays do.
#[test]
fn soups_of_all_magnitudes_are_hit_right() {
    for (seed, range) in [(11, 20), (12, 60), (13, 76)] {
        let mut random = Random::new(seed);
        let mut model = Model::default();
        for _ in 0..60 {
            let size = libm::exp2f(range as f32 * 1.6 * random.signed());
            let centre = random.point() * libm::exp2f(range as f32 * 1.6 * random.signed());
            model.push([0, 1, 2].map(|_| centre + size * random.point()));
        }
        let rays = nasty_rays(&model, 300, seed + 10);
        assert_brute(&model, &rays, &format!("2^±{range}"));
    }
}
