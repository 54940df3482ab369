//! Points on triangles from which rays may leave without meeting the surface again.

use glam::{DVec3, Vec3};
use rt_core::{Hit, Triangle};

/// A point of a surface as a hit describes it, and the side from which it was seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The point, in the triangle's plane up to rounding in double precision.
    pub position: DVec3,
    /// Unit normal of the triangle's plane, against the incoming ray.
    pub normal: DVec3,
    /// Distance along the normal that brings the point to the normal's side of the plane for sure.
    clearance: f64,
}

impl SurfacePoint {
    /// The point of `triangle` with the weights of `hit`, for a ray that came along `incoming`.
    ///
    /// `None` for a miss, for a triangle without area or with vertices that are not finite, and for weights that are no
    /// weights.
    #[inline]
    #[must_use]
    pub fn new(triangle: &Triangle, hit: &Hit, incoming: Vec3) -> Option<Self> {
        // Twice as wide as rounding could ever make them.
        let is_weight = |w: f32| (-0.01..=1.01).contains(&w);
        if !(hit.is_hit() && is_weight(hit.u) && is_weight(hit.v)) {
            return None;
        }
        let normal = triangle.area_normal();
        let normal = normal * (1.0 / normal.length());
        if !normal.is_finite() {
            return None;
        }
        // Windings differ from triangle to triangle, so no branch: it could not be predicted.
        let normal = normal * 1.0_f64.copysign(-normal.dot(incoming.as_dvec3()));
        let (u, v) = (f64::from(hit.u), f64::from(hit.v));
        let [a, b, c] = triangle.vertices().map(|p| p.as_dvec3());
        let position = a * (1.0 - u - v) + b * u + c * v;
        let largest = f64::from(triangle.vertices().map(|p| p.abs().max_element()).into_iter().fold(0.0, f32::max));
        Some(Self { position, normal, clearance: CLEARANCE * largest })
    }

    /// Where a ray that leaves on the normal's side begins: a single-precision point strictly on that side.
    ///
    /// The idea is that of M. Pharr, W. Jakob and G. Humphreys, *Physically Based Rendering*, 4th edition (2023),
    /// section 6.8: move the computed point along the normal by a bound of its error, then round every coordinate
    /// away from the surface. We deviate in computing in double precision, so that the bound is 2²³ times smaller and
    /// all that a ray's origin moves in the end is the rounding to single precision.
    ///
    /// A coordinate beyond single precision becomes infinite.
    #[inline]
    #[must_use]
    pub fn origin(&self) -> Vec3 {
        let point = self.position + self.normal * self.clearance;
        let round = |axis: usize| round_towards(point[axis], self.normal[axis]);
        Vec3::new(round(0), round(1), round(2))
    }
}

/// Clearance in units of the triangle's largest coordinate `S`.
///
/// With `ε = 2⁻⁵³`: the weighted sum of the vertices is off by at most `3 ε (|A| + |B| + |C|)` per axis for its
/// products and sums, `2 ε |A|` for the weight `1 − u − v` and `ε S` for the step along the normal: 12 `ε S`, and along a
/// diagonal normal `√3` times that, 21 `ε S`. A neighbour in the same plane must be left behind too: the reference test
/// finds its `t` with an error of about 16 `ε S / cos`, `cos` between ray and normal, while the clearance makes the true `t`
/// `−clearance / cos`. 2⁻⁴⁷ is 64 `ε`.
const CLEARANCE: f64 = 1.0 / (1_u64 << 47) as f64;

/// A single-precision number that is not on the far side of `x`, seen along `side`, and at most one and a half steps
/// away; the nearest one where `side` is 0.
///
/// A shift by half a step before rounding to nearest does it without a branch, which no processor could predict.
fn round_towards(x: f64, side: f64) -> f32 {
    // Half a step is at most 2⁻²⁴ |x|, or 2⁻¹⁵⁰ among subnormal numbers; the rest outweighs the rounding of the sum.
    const HALF_STEP: f64 = 1.001 / 16_777_216.0;
    const HALF_SUBNORMAL: f64 = 1.001 * f64::from_bits((1023 - 150) << 52);
    let shift = x.abs() * HALF_STEP + HALF_SUBNORMAL;
    (x + if side == 0.0 { 0.0 } else { shift.copysign(side) }) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Guards: rounding never crosses to the wrong side, and moves at most two steps. Fails when the
        /// shift is less than half a step or has no subnormal part.
        #[test]
        fn rounding_keeps_to_its_side(x in any::<f32>().prop_filter("finite", |x| x.is_finite() && x.abs() < 1e38), part in -1.0..1.0_f64, side in -1.0..1.0_f64) {
            let step = f64::from(x.next_up()) - f64::from(x);
            let exact = f64::from(x) + part * step;
            let rounded = f64::from(round_towards(exact, side));
            prop_assert!((rounded - exact) * side >= 0.0);
            prop_assert!((rounded - exact).abs() <= 2.0 * step);
        }
    }

    #[test]
    fn normals_face_the_ray_and_nothing_comes_of_nothing() {
        let triangle = Triangle::new(Vec3::ZERO, Vec3::X, Vec3::Y);
        let hit = Hit { t: 1.0, u: 0.25, v: 0.25, primitive: 0 };
        for (incoming, expected) in [(Vec3::NEG_Z, DVec3::Z), (Vec3::Z, DVec3::NEG_Z)] {
            let point = SurfacePoint::new(&triangle, &hit, incoming).unwrap();
            assert_eq!((point.position, point.normal), (DVec3::new(0.25, 0.25, 0.0), expected));
            let height = point.origin().as_dvec3().dot(expected);
            assert!(height > 0.0 && height < 1e-13, "{height}");
        }
        let none = |triangle: &Triangle, hit: &Hit| assert_eq!(SurfacePoint::new(triangle, hit, Vec3::Z), None);
        none(&triangle, &Hit::MISS);
        none(&triangle, &Hit { u: f32::NAN, ..hit });
        none(&triangle, &Hit { v: 1e9, ..hit });
        none(&Triangle::new(Vec3::ZERO, Vec3::X, Vec3::X), &hit);
        none(&Triangle::new(Vec3::ZERO, Vec3::X, Vec3::NAN), &hit);
    }
}
