//! Coordinates with more digits than single precision holds.

use super::{corners, good};
use glam::DVec3;
use proptest::prelude::*;
use rt_scene::obj::Loaded;

/// A text of triangles with these corners, `digits` behind the point.
fn text(points: &[DVec3], digits: usize) -> String {
    let vertices: String =
        points.iter().map(|p| format!("v {:.digits$} {:.digits$} {:.digits$}\n", p.x, p.y, p.z)).collect();
    let faces: String = (1..points.len() - 1).map(|i| format!("f {i} {} {}\n", i + 1, i + 2)).collect();
    vertices + &faces
}

/// The corners in the coordinates of the file.
fn in_file(loaded: &Loaded) -> Vec<[DVec3; 3]> {
    corners(loaded).iter().map(|triangle| triangle.map(|p| p.as_dvec3() + loaded.model.offset)).collect()
}

#[test]
fn a_small_square_far_from_zero_keeps_its_digits() {
    let text = "v 500000.000 5412345.250 100\nv 500000.100 5412345.250 100\nv 500000.100 5412345.350 100\n\
        v 500000.000 5412345.350 100\nf 1 2 3 4\n";
    let loaded = good(text);
    let [a, b, c] = in_file(&loaded)[0];
    assert!((b - a - DVec3::new(0.1, 0.0, 0.0)).abs().max_element() < 1e-8, "{a} {b}");
    assert!((c - b - DVec3::new(0.0, 0.1, 0.0)).abs().max_element() < 1e-8, "{b} {c}");
    assert!((a - DVec3::new(500_000.0, 5_412_345.25, 100.0)).abs().max_element() < 1e-8, "{a}");
    assert!((0.01..0.26).contains(&loaded.moved), "{}", loaded.moved);
    // The third coordinate is a whole number: nothing moves there.
    assert_eq!(loaded.model.offset.z, 0.0);
    assert_eq!(loaded.warnings, [""; 0]);
}

#[test]
fn nothing_is_subtracted_without_need() {
    // Numbers that single precision holds, however far away; digits near 0; a thing without extent.
    for text in [
        "v 5412345.5 0 0\nv 5412346 0 0\nv 5412345.5 1 0\nf 1 2 3\n",
        "v 16777216 0 0\nv 16777218 0 0\nv 16777216 2 0\nf 1 2 3\n",
        "v 0.1 0.2 0.3\nv 1.7 0.4 0.1\nv 0.3 0.9 0.7\nf 1 2 3\n",
        "v 10.1 0.2 0.3\nv 11.7 0.4 0.1\nv 10.3 0.9 0.7\nf 1 2 3\n",
        "v 0.1 0.1 0.1\nf 1 1 1\n",
        "v 1e-45 2e-45 0\nv 3e-45 0 0\nv 0 4.1e-45 0\nf 1 2 3\n",
        "v 3e38 0 0\nv 3.00001e38 0 0\nv 3e38 1e33 0\nf 1 2 3\n",
        // A vertex that no face uses.
        "v 5412345.123 5412345.123 0\nv 0.1 0 0\nv 1 0 0\nv 0 1 0\nf 2 3 4\n",
    ] {
        let loaded = good(text);
        assert_eq!((loaded.model.offset, loaded.moved), (DVec3::ZERO, 0.0), "{text}");
    }
}

#[test]
fn what_is_far_from_the_rest_is_named() {
    let mut points: Vec<DVec3> =
        (0..400).map(|i| DVec3::new(5e6 + 0.37 * f64::from(i % 20), 0.41 * f64::from(i / 20), 0.1)).collect();
    let plain = good(text(&points, 3));
    assert!(plain.model.offset.x != 0.0 && plain.warnings.is_empty());
    points.extend([DVec3::new(0.001, 0.0, 0.0), DVec3::new(0.004, 0.0, 0.0)]);
    let loaded = good(text(&points, 3));
    assert_eq!(loaded.model.offset, plain.model.offset);
    assert_eq!(loaded.warnings.len(), 1);
    assert!(loaded.warnings[0].starts_with("test.obj: 2 vertices are so far from the rest"), "{:?}", loaded.warnings);
}

proptest! {
    /// Guards: vertices are where the file says, to a millionth of the extent, wherever that is, and so are rays in
    /// single precision. Fails when coordinates are read in single precision, when the offset is the rounded middle,
    /// when it is that of another axis, and when `MOVED_AT_MOST` is a hundred times larger.
    #[test]
    fn vertices_stay_where_the_file_says(
        middle in [-1e8..1e8_f64, -1e8..1e8_f64, -1e4..1e4_f64], exponent in -2..5_i32,
        spread in prop::collection::vec([-0.5..0.5_f64, -0.5..0.5_f64, -0.5..0.5_f64], 3..40),
    ) {
        let extent = 10_f64.powi(exponent);
        let points: Vec<DVec3> = spread.iter().map(|p| DVec3::from(middle) + DVec3::from(*p) * extent).collect();
        let digits = (5 - exponent) as usize;
        let loaded = good(text(&points, digits));
        let exact: Vec<DVec3> =
            points.iter().map(|p| DVec3::from(p.to_array().map(|x| format!("{x:.digits$}").parse::<f64>().unwrap()))).collect();
        let size = exact.iter().fold(DVec3::MIN, |a, &b| a.max(b)) - exact.iter().fold(DVec3::MAX, |a, &b| a.min(b));
        prop_assume!(size.max_element() > 0.1 * extent);
        for (triangle, found) in in_file(&loaded).iter().enumerate() {
            for (corner, found) in found.iter().enumerate() {
                let off = (*found - exact[triangle + corner]).abs().max_element();
                prop_assert!(off <= size.max_element() / 1_048_576.0, "{off} of {size}");
            }
        }
        let offset = loaded.model.offset;
        let unit = 2_f64.powf(size.max_element().log2().floor());
        prop_assert_eq!((offset / unit).fract(), DVec3::ZERO);
        // A point of the file is placed where the vertex is, and one in single precision without any rounding.
        prop_assert_eq!(loaded.model.place(exact[0]), corners(&loaded)[0][0]);
        let ray = (exact[0] + 8.0 * extent * DVec3::from(spread[1])).as_vec3().as_dvec3();
        let placed = loaded.model.place(ray).as_dvec3() + offset;
        prop_assert!(placed == ray || offset.cmpeq(DVec3::ZERO).any(), "{placed} instead of {ray}");
    }
}
