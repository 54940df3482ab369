//! Polygons become triangles that cover them, and nothing else.

use super::{corners, good};
use glam::{DVec2, DVec3, Vec3};
use proptest::prelude::*;
use rt_scene::obj::Loaded;

/// A text of one polygon.
fn text(polygon: &[DVec3]) -> String {
    let vertices: String = polygon.iter().map(|p| format!("v {} {} {}\n", p.x, p.y, p.z)).collect();
    let indices: String = (1..=polygon.len()).map(|i| format!(" {i}")).collect();
    format!("{vertices}f{indices}\n")
}

fn flat(polygon: &[[f64; 2]]) -> Vec<DVec3> {
    polygon.iter().map(|&[x, y]| DVec3::new(x, y, 0.0)).collect()
}

/// Newell's normal; its length is twice the area.
fn normal(polygon: &[DVec3]) -> DVec3 {
    let at = |i: usize| polygon[i % polygon.len()] - polygon[0];
    (0..polygon.len()).map(|i| at(i).cross(at(i + 1))).sum()
}

/// The triangles cover the polygon exactly: all turn as it does, and together they have its area.
fn assert_covers(loaded: &Loaded, polygon: &[DVec3], tolerance: f64) {
    let wanted = normal(polygon);
    let triangles = corners(loaded);
    assert_eq!(triangles.len(), polygon.len() - 2);
    let mut covered = 0.0;
    for triangle in &triangles {
        let area = normal(&triangle.map(|p| p.as_dvec3())).dot(wanted) / wanted.length();
        assert!(area >= -tolerance * wanted.length(), "{triangle:?} is turned over in {polygon:?}");
        covered += area;
    }
    assert!((covered / wanted.length() - 1.0).abs() < tolerance, "{covered} of {}: {polygon:?}", wanted.length());
}

#[test]
fn convex_polygons_become_fans_in_file_order() {
    let mut text = String::new();
    for i in 0..7 {
        text += &format!("v {i} {} 0\n", i * i);
    }
    text += "f 1 2 3 4 5 6 7\nf 7 6 5\n";
    let corner = |i: usize| Vec3::new((i - 1) as f32, ((i - 1) * (i - 1)) as f32, 0.0);
    let fan = [[1, 2, 3], [1, 3, 4], [1, 4, 5], [1, 5, 6], [1, 6, 7], [7, 6, 5]];
    let loaded = good(text);
    assert_eq!(corners(&loaded), fan.map(|t| t.map(corner)));
    assert_eq!(loaded.warnings, [""; 0]);
}

#[test]
fn notches_stay_open_in_whatever_corner_they_are() {
    let arrow = flat(&[[0.0, 0.0], [2.0, 4.0], [4.0, 0.0], [2.0, 1.0]]);
    let cross = flat(&[
        [1.0, 0.0],
        [2.0, 0.0],
        [2.0, 1.0],
        [3.0, 1.0],
        [3.0, 2.0],
        [2.0, 2.0],
        [2.0, 3.0],
        [1.0, 3.0],
        [1.0, 2.0],
        [0.0, 2.0],
        [0.0, 1.0],
        [1.0, 1.0],
    ]);
    // Twice round the first corner: every triangle of the fan turns the right way.
    let spiral = flat(&[
        [0.0, 0.0],
        [4.0, 0.0],
        [4.0, 4.0],
        [-4.0, 4.0],
        [-4.0, -4.0],
        [6.0, -4.0],
        [6.0, 6.0],
        [-6.0, 6.0],
        [-6.0, -6.0],
        [-5.0, -6.0],
        [-5.0, 5.0],
        [5.0, 5.0],
        [5.0, -3.0],
        [-3.0, -3.0],
        [-3.0, 3.0],
        [3.0, 3.0],
        [3.0, 1.0],
    ]);
    for polygon in [arrow, cross, spiral] {
        for first in 0..polygon.len() {
            let mut polygon = polygon.clone();
            polygon.rotate_left(first);
            for _ in 0..2 {
                let loaded = good(text(&polygon));
                assert_covers(&loaded, &polygon, 1e-6);
                assert_eq!(loaded.warnings, [""; 0]);
                polygon.reverse();
            }
        }
    }
}

#[test]
fn holes_may_be_cut_in_by_an_edge_there_and_back() {
    let keyhole = flat(&[
        [0.0, 0.0],
        [4.0, 0.0],
        [4.0, 4.0],
        [0.0, 4.0],
        [0.0, 0.0],
        [1.0, 1.0],
        [1.0, 3.0],
        [3.0, 3.0],
        [3.0, 1.0],
        [1.0, 1.0],
    ]);
    let loaded = good(text(&keyhole));
    assert_covers(&loaded, &keyhole, 1e-6);
    assert_eq!(loaded.warnings, [""; 0]);
    let centre = Vec3::new(2.0, 2.0, 0.0);
    for [a, b, c] in corners(&loaded) {
        let side = |p: Vec3, q: Vec3| (q - p).cross(centre - p).z;
        assert!(side(a, b) <= 0.0 || side(b, c) <= 0.0 || side(c, a) <= 0.0, "the hole is closed");
    }
}

#[test]
fn corners_on_straight_edges_stay_corners() {
    // A neighbour that uses such a corner would else leave a crack.
    let polygon =
        flat(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 1.0], [0.0, 4.0], [0.0, 2.0]]);
    for first in 0..polygon.len() {
        let mut polygon = polygon.clone();
        polygon.rotate_left(first);
        let loaded = good(text(&polygon));
        assert_covers(&loaded, &polygon, 1e-6);
        let with_area = corners(&loaded).into_iter().filter(|&[a, b, c]| (b - a).cross(c - a).length() > 0.0);
        let used: Vec<Vec3> = with_area.flatten().collect();
        // The fan may leave out what is straight beside its own first corner.
        let missing = polygon.iter().filter(|p| !used.contains(&p.as_vec3())).count();
        assert!(missing <= 1, "{missing} corners are not used, first {first}");
    }
}

#[test]
fn polygons_without_a_right_answer_are_named_once() {
    let bow = flat(&[[0.0, 0.0], [4.0, 4.0], [4.0, 0.0], [0.0, 4.0]]);
    let star = flat(&[[0.0, 3.0], [2.0, -3.0], [-3.0, 1.0], [3.0, 1.0], [-2.0, -3.0]]);
    let spike = flat(&[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 9.0], [2.0, -9.0], [0.0, 4.0]]);
    for crossing in [bow, star, spike] {
        let loaded = good(text(&crossing) + "f 1 2 3 \nf 1 2 3 4\n");
        assert_eq!(loaded.model.indices.len(), crossing.len() - 2 + 3);
        let line = crossing.len() + 1;
        assert_eq!(loaded.warnings.len(), 1, "{:?}", loaded.warnings);
        let warning = &loaded.warnings[0];
        assert!(
            warning.starts_with(&format!("test.obj:{line}: ")) && warning.contains("cross themselves"),
            "{warning}"
        );
    }
    let warped = "v 0 0 0\nv 1 0 0\nv 1 1 1\nv 0 1 0\nf 1 2 3\nf 1 2 3 4\nf 2 3 4 1\n";
    let loaded = good(warped);
    assert_eq!(loaded.model.indices[1..3], [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(loaded.warnings.len(), 1);
    assert!(loaded.warnings[0].starts_with("test.obj:6: 2 faces of this file are not plane"), "{:?}", loaded.warnings);
    // Without area there is nothing to be wrong about.
    let nothing =
        "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 1 1 1\nf 1 2 3 2\nf 1 2 2 1 1\nf 1 2 3 1 2\nv 0 1 0\nf 1 2 4 1\nf 1 1 2 4 4\n";
    let loaded = good(nothing);
    assert_eq!((loaded.model.indices.len(), &loaded.warnings[..]), (2 + 2 + 3 + 3 + 2 + 3, &[][..]));
}

/// A plane in space, by two directions at right angles and a point.
fn plane() -> impl Strategy<Value = [DVec3; 3]> {
    let number = || -1.0..1.0_f64;
    ([number(), number(), number()], [number(), number(), number()], [number(), number(), number()])
        .prop_map(|(a, b, c)| [a, b, c].map(DVec3::from))
        .prop_filter("two directions", |[a, b, _]| a.length() > 0.1 && a.cross(*b).length() > 0.1)
        .prop_map(|[a, b, c]| {
            let x = a.normalize();
            [x, a.cross(b).normalize().cross(x), 10.0 * c]
        })
}

/// Corners at rising angles about a point: simple, whatever the distances.
fn star() -> impl Strategy<Value = Vec<DVec2>> {
    prop::collection::vec(0.05..1.0_f64, 4..40).prop_map(|distances| {
        let turn = std::f64::consts::TAU / distances.len() as f64;
        distances.iter().enumerate().map(|(i, r)| DVec2::from_angle(turn * i as f64) * r).collect()
    })
}

/// Teeth of any lengths, on a back.
fn comb() -> impl Strategy<Value = Vec<DVec2>> {
    prop::collection::vec(0.0..5.0_f64, 2..40).prop_map(|lengths| {
        let teeth = lengths.iter().enumerate().flat_map(|(i, length)| {
            let x = i as f64;
            [
                DVec2::new(x, 1.0 + length),
                DVec2::new(x + 0.5, 1.0 + length),
                DVec2::new(x + 0.5, 0.9),
                DVec2::new(x + 1.0, 0.9),
            ]
        });
        let back = [DVec2::new(lengths.len() as f64, 0.0), DVec2::ZERO];
        teeth.chain(back).collect()
    })
}

/// Whole coordinates, so that many corners are in line, or at one place. Along each column the polygon rises.
fn stairs() -> impl Strategy<Value = Vec<DVec2>> {
    prop::collection::vec(0..4_i32, 2..20).prop_map(|heights| {
        let last = heights.len() as f64;
        let top = heights.iter().enumerate().flat_map(|(x, h)| {
            let (x, y) = (x as f64, f64::from(1 + h));
            [DVec2::new(x, y), DVec2::new(x + 1.0, y)]
        });
        let bottom = (0..=heights.len()).rev().map(|x| DVec2::new(x as f64, 0.0));
        assert!(last > 0.0);
        top.chain(bottom).collect()
    })
}

proptest! {
    /// Guards: simple polygons in any plane are covered exactly, from whichever corner they begin, either way round.
    /// Fails when the fan is always taken, when `is_covered_by_fan` does not look for a full turn, when `flatten` drops
    /// the first axis whatever the normal, and when `inside` does not stop at constraint edges.
    #[test]
    fn simple_polygons_are_covered(
        polygon in prop_oneof![star(), comb(), stairs()], [x, y, origin] in plane(),
        first in any::<prop::sample::Index>(), reverse in any::<bool>(), exponent in -8..8_i32,
    ) {
        let mut polygon: Vec<DVec3> = polygon.iter().map(|p| (origin + x * p.x + y * p.y) * 10_f64.powi(exponent)).collect();
        let first = first.index(polygon.len());
        polygon.rotate_left(first);
        if reverse {
            polygon.reverse();
        }
        let loaded = good(text(&polygon));
        prop_assert_eq!(&loaded.warnings[..], &[""; 0]);
        // Rounding to single precision moves corners by a ten-millionth of the distance from 0, some twenty here.
        assert_covers(&loaded, &polygon, 1e-4);
    }

    /// Guards: polygons in the planes of the axes keep their numbers, so that what is straight stays straight and every
    /// corner is used. Fails when triangles are only counted, and when corners in line are dropped.
    #[test]
    fn polygons_on_a_lattice_are_covered_exactly(
        polygon in stairs(), axis in 0..3_usize, reverse in any::<bool>(), first in any::<prop::sample::Index>(),
    ) {
        let mut polygon: Vec<DVec3> = polygon.iter().map(|p| {
            let mut corner = DVec3::splat(3.0);
            (corner[axis], corner[(axis + 1) % 3]) = (p.x, p.y);
            corner
        }).collect();
        let first = first.index(polygon.len());
        polygon.rotate_left(first);
        if reverse {
            polygon.reverse();
        }
        let loaded = good(text(&polygon));
        prop_assert_eq!(&loaded.warnings[..], &[""; 0]);
        assert_covers(&loaded, &polygon, 1e-15);
    }

    /// Guards: whatever the corners, a polygon of n has n − 2 triangles made of its corners. Fails when what Delaunay's
    /// triangulation lacks is not filled up.
    #[test]
    fn any_polygon_has_two_triangles_less_than_corners(
        lattice in prop::collection::vec([0..4_i32, 0..4_i32, 0..2_i32], 4..14),
    ) {
        let polygon: Vec<DVec3> = lattice.iter().map(|p| DVec3::from(p.map(f64::from))).collect();
        let loaded = good(text(&polygon) + "f 1 2 3\n");
        prop_assert_eq!(loaded.model.indices.len(), polygon.len() - 1);
        prop_assert!(corners(&loaded).iter().flatten().all(|p| polygon.contains(&p.as_dvec3())));
    }
}
