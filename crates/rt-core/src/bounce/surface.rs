//! Points on triangles from which rays leave without meeting the surface again.

use super::exact::{Sums, rsqrt, two_product, two_sum};
use crate::Triangle;
use crate::scale::{exponent, pow2, scaled, usual_exponent, usual_power};
use glam::{Vec3, Vec3Swizzles};

/// A triangle as its points are computed: in a unit of its own, so that the same numbers are computed whatever the unit
/// of the scene.
///
/// # Why nothing is lost
///
/// Coordinates are given ones times 2^−exponent, the largest, S, is in [½, 1). Those below 2⁻³⁸ are rounded to
/// multiples of 2⁻⁶⁰, which moves no vertex by more than 2⁻⁶⁰. Weights are multiples of 2⁻²⁴. So edges are multiples of
/// 2⁻⁶¹, what products leave over one of 2⁻¹²², and no number anywhere is so small that devices, which may take
/// denormal numbers for zero, would differ.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    vertices: [Vec3; 3],
    exponent: i32,
    normal: Vec3,
}

/// Coordinates below it are rounded.
const COARSE: f32 = pow2(-38) as f32;

/// Added and taken away again, it leaves a number below [`COARSE`] rounded to a multiple of 2⁻⁶⁰.
const GRID: f32 = 1.5 * pow2(-37) as f32;

/// A normal's components below it are taken for 0: far less than the error of the larger ones.
const LEAST_NORMAL: f32 = pow2(-30) as f32;

/// How far along the normal a point is moved, in units in which S is in [½, 1).
///
/// With `u = 2⁻²⁴`: a point is off its triangle's plane by at most `√3 · 20 u²` for the sum of three exact products and
/// `√3 · 2⁻⁶⁰` for the grid, and by `√3 · u²/2` for the sum of the steps: 2⁻⁴²·⁸. Rounding moves each coordinate by up
/// to `2⁻²³ S` in the direction of the normal's component as computed: where that has the wrong sign, it is wrong by at
/// most 2⁻²¹, the error of the normal, so by `√3 · 2⁻⁴⁴` away from the normal. Together that is less than 2⁻⁴¹·⁸. A
/// neighbour in the same plane must be left behind too: the reference test finds its `t` with an error of about
/// `2⁻⁴⁹ S / cos`, `cos` between ray and normal, while the true `t` is at most `−(2⁻⁴⁰ − 2⁻⁴¹·⁸) / cos`. Beside the
/// rounding of coordinates, 2⁻²⁴, it is nothing.
const CLEARANCE: f32 = pow2(-40) as f32;

/// Half a step between numbers, relative to them, and a little more, for the rounding of what it is added to.
const HALF_STEP: f32 = 1.001 / 16_777_216.0;

/// Below it a coordinate is taken for 0, in units in which S is in [½, 1): less than [`CLEARANCE`] along a component of
/// the normal of 2⁻²⁰, which is not missed.
const LEAST_COORDINATE: f32 = pow2(-60) as f32;

/// Least exponent of triangles whose points have no denormal coordinate.
pub const LEAST_EXPONENT: i32 = -60;

/// Greatest exponent of triangles whose points are all within single precision.
pub const GREATEST_EXPONENT: i32 = 127;

/// Half a step between denormal numbers, 2⁻¹⁵⁰, and a little more.
const HALF_DENORMAL: f64 = 1.001 * pow2(-150);

impl Surface {
    /// The surface of a triangle whose given coordinates are those of `triangle` times 2^`scale_exponent`.
    ///
    /// `None` for a triangle without area, as far as single precision can tell, or with vertices that are not finite.
    #[must_use]
    pub fn new(triangle: &Triangle, scale_exponent: i32) -> Option<Self> {
        if !triangle.is_finite() {
            return None;
        }
        let vertices = triangle.vertices();
        let local = exponent(largest(&vertices));
        let vertices = vertices.map(|p| on_grid(times_power(p, -local)));
        let (normal, has_area) = unit_normal(&vertices);
        has_area.then_some(Self { vertices, exponent: local + scale_exponent, normal })
    }

    /// The same without a choice on the way, and whether it is right: it is for triangles with an area whose
    /// coordinates are far from the ends of single precision.
    #[inline(always)]
    pub(super) fn usual(vertices: [Vec3; 3], scale_exponent: i32) -> (Self, bool) {
        let largest = largest(&vertices);
        let local = usual_exponent(largest);
        let exponent = local + scale_exponent;
        let vertices = vertices.map(|p| on_grid(p * usual_power(-local)));
        let (normal, has_area) = unit_normal(&vertices);
        let is_usual = has_area
            & vertices.iter().fold(true, |all, p| all & (p.x.abs() < 2.0) & (p.y.abs() < 2.0) & (p.z.abs() < 2.0))
            & (local > -126)
            & (local <= 126)
            & (LEAST_EXPONENT..=GREATEST_EXPONENT).contains(&exponent);
        (Self { vertices, exponent, normal }, is_usual)
    }

    /// Unit normal: that of the side from which the vertices run against the clock.
    #[must_use]
    pub const fn normal(&self) -> Vec3 {
        self.normal
    }

    /// Where a ray begins that leaves on the side of `normal`, which is [`Surface::normal`] or its opposite: a
    /// single-precision point strictly on that side. `weights` are those of the vertices, multiples of 2⁻²⁴ whose sum
    /// is 1.
    ///
    /// The idea is that of M. Pharr, W. Jakob and G. Humphreys, *Physically Based Rendering*, 4th edition (2023),
    /// section 6.8: move the computed point along the normal by a bound of its error, then round every coordinate
    /// away from the surface. We deviate in computing the point in twice the precision, so that the bound is 2¹⁶ times
    /// smaller and all that a ray's origin moves in the end is the rounding to single precision.
    ///
    /// A coordinate beyond single precision becomes infinite.
    #[must_use]
    pub fn origin(&self, weights: [f32; 3], normal: Vec3) -> Vec3 {
        // Scaling back is exact, but for scenes so small that coordinates become denormal.
        let least =
            if self.exponent < LEAST_EXPONENT { (HALF_DENORMAL * pow2((-self.exponent).min(200))) as f32 } else { 0.0 };
        times_power(self.point(weights, normal, least), self.exponent)
    }

    /// The same for a surface of [`Surface::usual`].
    #[inline(always)]
    pub(super) fn usual_origin(&self, weights: [f32; 3], normal: Vec3) -> Vec3 {
        self.point(weights, normal, 0.0) * usual_power(self.exponent)
    }

    /// The point in the triangle's own unit; `least` is what scaling it back may lose.
    #[inline(always)]
    fn point(&self, weights: [f32; 3], normal: Vec3, least: f32) -> Vec3 {
        let Sums { high, low } = mean(weights, self.vertices);
        let away = (high.abs() * HALF_STEP + Vec3::splat(least)).copysign(normal);
        let step = normal * CLEARANCE + Vec3::select(normal.cmpeq(Vec3::ZERO), Vec3::ZERO, away);
        let rounded = high + (low + step);
        let near_zero = rounded.abs().cmplt(Vec3::splat(LEAST_COORDINATE));
        Vec3::select(near_zero, Vec3::ZERO, rounded)
    }
}

/// The largest coordinate's magnitude.
#[inline(always)]
fn largest([a, b, c]: &[Vec3; 3]) -> f32 {
    a.abs().max(b.abs()).max(c.abs()).max_element()
}

/// `v` times 2^`exponent`, rounded once.
fn times_power(v: Vec3, exponent: i32) -> Vec3 {
    if (-126..=127).contains(&exponent) {
        v * usual_power(exponent)
    } else {
        // Beyond single precision.
        scaled(v, pow2(exponent))
    }
}

#[inline(always)]
fn on_grid(c: Vec3) -> Vec3 {
    let grid = Vec3::splat(GRID);
    Vec3::select(c.abs().cmplt(Vec3::splat(COARSE)), (c + grid) - grid, c)
}

/// Three exact products, summed to twice the precision: after T. Ogita, S. M. Rump and S. Oishi, *Accurate Sum and Dot
/// Product*, SIAM J. Sci. Comput. 26-6 (2005). Off by 20 u² of the largest coordinate, u = 2⁻²⁴.
#[inline(always)]
fn mean(weights: [f32; 3], vertices: [Vec3; 3]) -> Sums {
    let [u, v, w] = weights.map(Vec3::splat);
    let a = two_product(u, vertices[0]);
    let b = two_product(v, vertices[1]);
    let c = two_product(w, vertices[2]);
    let ab = two_sum(a.high, b.high);
    let abc = two_sum(ab.high, c.high);
    two_sum(abc.high, (abc.low + ab.low) + ((a.low + b.low) + c.low))
}

/// The unit normal of a triangle, whose components are 0 or at least [`LEAST_NORMAL`], and whether it has an area at
/// all.
///
/// Edges are exact sums of two numbers. Their cross product is right to some 2⁻⁴⁴ of the edges' lengths, so the normal
/// to 2⁻²² or so for every triangle but needles of an angle below 2⁻²².
#[inline(always)]
fn unit_normal([a, b, c]: &[Vec3; 3]) -> (Vec3, bool) {
    let area = cross(two_sum(*b, -*a), two_sum(*c, -*a));
    let largest = area.abs().max_element();
    // To [1, 2): then no square that counts is denormal. What is not 0 has no exponent below −122.
    let n = area * usual_power(1 - usual_exponent(largest));
    let unit = n * rsqrt((n.x * n.x + n.y * n.y) + n.z * n.z);
    let unit = Vec3::select(unit.abs().cmplt(Vec3::splat(LEAST_NORMAL)), Vec3::ZERO, unit);
    (unit, largest != 0.0)
}

/// The cross product of two edges.
#[inline(always)]
fn cross(ab: Sums, ac: Sums) -> Vec3 {
    let turned =
        |s: Sums| (Sums { high: s.high.yzx(), low: s.low.yzx() }, Sums { high: s.high.zxy(), low: s.low.zxy() });
    let ((a, b), (c, d)) = (turned(ab), turned(ac));
    let p = two_product(a.high, d.high);
    let q = two_product(b.high, c.high);
    let s = two_sum(p.high, -q.high);
    let small = (a.high * d.low + a.low * d.high) - (b.high * c.low + b.low * c.high);
    s.high + (s.low + ((p.low - q.low) + small))
}
