//! One look at the numbers of a model, and the plan that follows from it.

mod plan;

pub use plan::Plan;

use crate::Model;
use crate::frame::frame;
use crate::memory;
use crate::progress::{LoadStage, Meter, Watch, unwatched};
use rt_core::{Aabb, Triangle};
use serde::Serialize;
use std::hash::{DefaultHasher, Hash, Hasher};

/// Height over longest edge, without a unit, below which a triangle counts as a sliver.
///
/// An area that is computed in single precision from edges of such a triangle has a relative error of about
/// `2⁻²³ / aspect`: at `2⁻¹²` half of its digits are gone.
pub const SLIVER_ASPECT: f64 = 1.0 / 4096.0;

/// Height over the diagonal of the scene, without a unit, below which single precision can decide nothing about a
/// triangle. Far outliers such as a ground to the horizon do not count for the diagonal: few rays start there.
///
/// Seen from a ray `D` away, `D` up to the diagonal, a sheared vertex is off by about `4 · 2⁻²⁴ D`, and the edge
/// function of an edge of length `L` by twice that times `L`. The largest value that it takes inside a triangle of
/// height `h` is `L h`.
pub const FILTER_RESOLUTION: f64 = 1.0 / 2_097_152.0;

/// What a single pass over a model found. Lengths are in units of the model, ratios have none.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Scan {
    /// Number of triangles.
    pub triangles: u64,
    /// Triangles with a vertex that is not finite or does not exist.
    pub non_finite: u64,
    /// Finite triangles without area.
    pub degenerate: u64,
    /// Triangles with area whose height is less than [`SLIVER_ASPECT`] of their longest edge.
    pub slivers: u64,
    /// Least height over longest edge of the triangles with area; `None` (null) where there are none.
    pub thinnest_aspect: Option<f64>,
    /// Triangles with area whose height is less than [`FILTER_RESOLUTION`] of the diagonal: nearly every test of one
    /// needs double precision.
    pub unresolved: u64,
    /// Triangles with area that have the same three corners, in any order, as one before them; `None` (null) where
    /// there was no memory to find out.
    pub duplicates: Option<u64>,
    /// Smallest coordinates of the finite triangles; `None` (null) where there are none.
    pub min: Option<[f32; 3]>,
    /// Largest coordinates of the finite triangles; `None` (null) where there are none.
    pub max: Option<[f32; 3]>,
    /// Longest edge of the bounds.
    pub extent: f64,
    /// Largest absolute coordinate over the extent; `None` (null) where the extent is 0.
    pub offset_ratio: Option<f64>,
    /// Number of colours that a triangle may have.
    pub colours: u64,
}

impl Scan {
    /// Scans `model`, in little more than linear time.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        Self::watched(model, &mut unwatched).expect("nobody stops it")
    }

    /// Scans `model` as [`Scan::new`] does; `None` when `watch` breaks.
    pub fn watched(model: &Model, watch: &mut Watch<'_>) -> Option<Self> {
        let total = 2 * model.indices.len() as u64;
        let mut meter = Meter::begin(LoadStage::Scanning, total, watch).ok()?;
        let mut bounds = Aabb::EMPTY;
        let mut scan = Self {
            triangles: model.indices.len() as u64,
            non_finite: 0,
            degenerate: 0,
            slivers: 0,
            thinnest_aspect: None,
            unresolved: 0,
            duplicates: Some(0),
            min: None,
            max: None,
            extent: 0.0,
            offset_ratio: None,
            colours: if model.colour_of.is_empty() { 1 } else { model.palette.len() as u64 },
        };
        scan.non_finite = scan.triangles;
        for (number, triangle) in finite(model) {
            meter.at(number.into()).ok()?;
            scan.non_finite -= 1;
            bounds = bounds.union(triangle.bounds());
        }
        if bounds.is_empty() {
            return Some(scan);
        }
        (scan.min, scan.max) = (Some(bounds.min.to_array()), Some(bounds.max.to_array()));
        let edges = bounds.max.as_dvec3() - bounds.min.as_dvec3();
        scan.extent = edges.max_element();
        let largest = f64::from(bounds.min.abs().max(bounds.max.abs()).max_element());
        scan.offset_ratio = (scan.extent > 0.0).then(|| largest / scan.extent);
        let (low, high) = frame(model).unwrap_or_default();
        let unresolved = FILTER_RESOLUTION * (high - low).length();
        let mut fingerprints = memory::list(model.indices.len()).ok();
        let mut thinnest = f64::INFINITY;
        for (number, triangle) in finite(model) {
            meter.at(scan.triangles + u64::from(number)).ok()?;
            let Some((height, longest)) = height(&triangle) else {
                scan.degenerate += 1;
                continue;
            };
            let aspect = height / longest;
            thinnest = thinnest.min(aspect);
            scan.slivers += u64::from(aspect < SLIVER_ASPECT);
            scan.unresolved += u64::from(height < unresolved);
            if let Some(fingerprints) = &mut fingerprints {
                fingerprints.push(fingerprint(&triangle));
            }
        }
        scan.duplicates = fingerprints.map(repeated);
        scan.thinnest_aspect = thinnest.is_finite().then_some(thinnest);
        Some(scan)
    }

    /// Number of triangles that a ray can hit.
    #[must_use]
    pub const fn valid(&self) -> u64 {
        self.triangles - self.non_finite - self.degenerate
    }
}

/// Every triangle whose vertices exist and are finite, with its number.
fn finite(model: &Model) -> impl Iterator<Item = (u32, Triangle)> {
    let numbers = 0..u32::try_from(model.indices.len()).unwrap_or(u32::MAX);
    numbers.filter_map(|i| Some((i, model.triangle(i)?))).filter(|(_, triangle)| triangle.is_finite())
}

/// Height over the longest edge, and the length of that edge; `None` without area.
fn height(triangle: &Triangle) -> Option<(f64, f64)> {
    let [a, b, c] = triangle.vertices().map(|p| p.as_dvec3());
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    let height = triangle.area_normal().length() / longest;
    (height > 0.0).then_some((height, longest))
}

/// The same for triangles with the same corners in any order, and, but for one pair of a million triangles in 10⁷
/// models, for no others.
fn fingerprint(triangle: &Triangle) -> u64 {
    let mut hasher = DefaultHasher::new();
    sorted_corners(triangle).hash(&mut hasher);
    hasher.finish()
}

/// Number of entries that are the same as an earlier one.
fn repeated(mut fingerprints: Vec<u64>) -> u64 {
    fingerprints.sort_unstable();
    fingerprints.windows(2).filter(|pair| pair[0] == pair[1]).count() as u64
}

/// The corners in an order that does not depend on theirs.
fn sorted_corners(triangle: &Triangle) -> [[u32; 3]; 3] {
    // Adding zero makes the two zeros one.
    let mut corners = triangle.vertices().map(|p| p.to_array().map(|x| (x + 0.0).to_bits()));
    corners.sort_unstable();
    corners
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use proptest::prelude::*;

    fn soup(corners: &[[Vec3; 3]]) -> Model {
        let indices = (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        Model { positions: corners.concat(), indices, ..Model::default() }
    }

    #[test]
    fn every_kind_of_triangle_is_counted_once() {
        let [o, x, y, z] = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let mut model = soup(&[
            [o, x, y],
            [y, -o, x],                            // the same again
            [o, x, z],                             // another
            [o, x, x],                             // no area
            [o, x, x * 0.5],                       // no area
            [o, x, Vec3::new(0.5, 1e-4, 0.0)],     // a sliver
            [o, x, Vec3::new(0.5, 1e-7, 0.0)],     // beyond single precision
            [o, x, Vec3::new(f32::NAN, 0.0, 0.0)], // not finite
            [o, x, Vec3::new(0.0, f32::INFINITY, 0.0)],
        ]);
        model.indices.push([0, 1, 1_000_000]); // leads nowhere
        let scan = Scan::new(&model);
        assert_eq!((scan.triangles, scan.non_finite, scan.degenerate), (10, 3, 2));
        assert_eq!((scan.slivers, scan.unresolved, scan.duplicates), (2, 1, Some(1)));
        assert!((scan.thinnest_aspect.unwrap() / 1e-7 - 1.0).abs() < 1e-6);
        assert_eq!((scan.min, scan.max), (Some([0.0; 3]), Some([1.0; 3])));
        assert_eq!((scan.extent, scan.offset_ratio, scan.valid()), (1.0, Some(1.0), 5));
        assert_eq!(scan.colours, 1);
    }

    #[test]
    fn models_without_triangles_or_extent_are_scanned() {
        let empty = Scan::new(&Model::default());
        assert_eq!((empty.triangles, empty.min, empty.offset_ratio, empty.thinnest_aspect), (0, None, None, None));
        let point = Scan::new(&soup(&[[Vec3::ONE; 3]]));
        assert_eq!((point.degenerate, point.extent, point.offset_ratio, point.valid()), (1, 0.0, None, 0));
        let huge = Scan::new(&soup(&[[Vec3::MIN, Vec3::MAX, Vec3::new(f32::MAX, f32::MIN, 0.0)]]));
        assert!(huge.extent.is_finite() && huge.thinnest_aspect.is_some());
    }

    proptest! {
        /// Guards: counts do not depend on scale, order or winding. Fails when the corners are not sorted, and when
        /// the height is compared with an absolute number.
        #[test]
        fn counts_are_invariant(
            points in prop::collection::vec([-4..4_i32, -4..4_i32, -4..4_i32], 3..30),
            shuffle in any::<u32>(), exponent in -60..=60_i32,
        ) {
            let scale = libm::ldexpf(1.0, exponent);
            let p = |i: usize| Vec3::from(points[i % points.len()].map(|x| x as f32));
            let corners: Vec<_> = (0..points.len()).map(|i| [p(i), p(i + 1), p(i * i)]).collect();
            let base = Scan::new(&soup(&corners));
            let mut others: Vec<_> = corners.iter().map(|t| t.map(|p| p * scale)).collect();
            others.rotate_left(shuffle as usize % points.len());
            for (i, t) in others.iter_mut().enumerate() {
                t.rotate_left((shuffle as usize + i) % 3);
                if i % 2 == 0 {
                    t.swap(0, 1);
                }
            }
            let scan = Scan::new(&soup(&others));
            let counts = |s: &Scan| (s.triangles, s.non_finite, s.degenerate, s.slivers, s.unresolved, s.duplicates);
            prop_assert_eq!(counts(&scan), counts(&base));
            prop_assert_eq!(scan.extent, base.extent * f64::from(scale));
            // And the duplicates are those that comparing all pairs finds.
            let sorted = |t: &[Vec3; 3]| { let mut t = t.map(|p| p.to_array().map(|x| x as i32)); t.sort_unstable(); t };
            let with_area = |t: &&[Vec3; 3]| (t[1] - t[0]).cross(t[2] - t[0]) != Vec3::ZERO;
            let mut keys: Vec<_> = corners.iter().filter(with_area).map(sorted).collect();
            let all = keys.len();
            keys.sort_unstable();
            keys.dedup();
            prop_assert_eq!(base.duplicates, Some((all - keys.len()) as u64));
        }
    }
}
