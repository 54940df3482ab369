//! The definition of a hit, and the double-precision test that meets it.
//!
//! # The definition
//!
//! Rays and triangles are taken as the exact numbers that they are. With `a`, `b`, `c` the vertices relative to the
//! origin and `d` the direction, let `U = d · (b × c)`, `V = d · (c × a)`, `W = d · (a × b)`, the signed volumes of J.
//! Plücker's line coordinates, and `D = U + V + W`.
//!
//! * The ray's *line* meets the triangle where U, V and W are all ≥ 0 or all ≤ 0, and not all zero. So edges and
//!   vertices belong to a triangle, and to each triangle that has them; a triangle without area, or seen exactly
//!   edge-on, is never met.
//! * It meets it at `t = a · (b × c) / D`, *rounded once* to single precision, to nearest and to even where that is a
//!   draw. A distance that would vanish becomes the least number of its sign instead of 0: a surface behind the origin
//!   stays there. So `t` is 0 exactly where the origin lies in the triangle.
//! * That is a *hit* where `tmin ≤ t ≤ tmax`, both included, and `t` is finite. So an origin in a triangle hits it at
//!   `t = 0` where `tmin` is 0 or less.
//! * Of several hits the nearest counts: the one with the least rounded `t`, then the one with the lowest primitive id.
//! * `u = V / D` and `v = W / D` are rounded quotients of numbers that are right to 2⁻²⁴ of D. They are the same bits
//!   on every device, but not part of what is exact.
//!
//! This makes a hit a function of ray and triangle alone, whatever tree, device or precision finds it, and all shared
//! edges watertight: the volume of an edge is the same number in both of its triangles but for the sign, and so for any
//! fan around a vertex. It says nothing of gaps that the file itself leaves: a vertex that was rounded off the edge it
//! should lie on (a T-junction) makes a gap or an overlap, and rays through a real gap miss. One that lies on the edge
//! exactly makes none.
//!
//! # How it is met
//!
//! After S. Woop, C. Benthin and I. Wald, *Watertight Ray/Triangle Intersection*, JCGT 2-1 (2013): [`Shear`] turns the
//! ray into the axis where its direction is largest; the edge functions of the sheared vertices are −U, −V and −W
//! divided by the direction's largest component. They are computed in double precision, with a bound on their error.
//! Where that does not settle a sign, or leaves the rounding of `t` open, the module `exact` decides in exact
//! arithmetic, as J. R. Shewchuk's adaptive predicates (1997) do; only what is in doubt, for rays aimed at edges are
//! many. An edge function of a hit that has the other sign by rounding is then taken for 0, which is no farther from
//! the exact one. Kernels may decide clear cases more cheaply still.
//!
//! Every number below, and every comparison of two, scales exactly under powers of two. So the test gives the same bits
//! in the coordinates of the scene's file and in those of the normalised tree.
//!
//! # The bound on edge functions
//!
//! Let ε = 2⁻⁵³, and X, Y, Z bound the computed |x|, |y|, |z| of the sheared vertices; S = X + Y and R = Z + S/2.
//!
//! * A coordinate relative to the origin is off by ε of itself, as its operands are exact. For the product of a shear
//!   factor (|s| ≤ 1, off by ε of itself) and z that makes 3.01·ε·Z. The coordinate relative to the origin is at
//!   most |x| + |z|, and the last difference is off by ε·|x|. So a sheared coordinate is off by less than ε·(2·X +
//!   4.01·Z).
//! * The two products of an edge function and their difference are off by 4·ε·X·Y, and errors of the factors change it
//!   by 2·ε·(X·(2·Y + 4.01·Z) + Y·(2·X + 4.01·Z)) + 2·ε²·(2·X + 4.01·Z)·(2·Y + 4.01·Z). With X·Y ≤ S²/4 all that is
//!   less than 8.02·ε·R·S + 32.2·ε²·R².
//! * `ERROR` is 9·ε·R·(S + 5·ε·R), which has room for its own rounding.
//!
//! # The bound on distances
//!
//! Where all edge functions have one sign, their mean of the z lies among the z. Changing each by at most E moves the
//! mean by at most 3·E·(spread of the z) / |D|. Rounding adds less than 9.1·ε·Z: 4 in the weighted sum, 2 in D, one
//! each in the quotient, in the reciprocal of the direction's component, and in the product with it. The code counts 4
//! and 12.
//!
//! # Range
//!
//! Given coordinates are multiples of 2⁻¹⁴⁹ below 2¹²⁸. A tree's are those times 2^−k with −148 ≤ k ≤ 128
//! ([`crate::SCALE_EXPONENTS`]): triangles again in single precision, origins in double precision. So coordinates are
//! multiples of 2⁻²⁷⁷ below 2²⁷⁶. What exact arithmetic makes of them is at most three of them multiplied (multiples of
//! 2⁻⁸³¹ below 2⁸³⁴), or a direction, two of them and a distance (multiples of 2⁻⁹⁸¹ below 2⁹⁶²), in both cases with
//! all terms: double precision neither overflows nor meets a subnormal number. In the sheared test products may vanish,
//! where a shear factor is below 2⁻²⁰⁰; that changes nothing, as the bound is at least 45·ε²·R², above 2⁻⁶⁵⁷.

mod exact;

use crate::scale::pow2;
use crate::{Hit, Ray, Triangle};
use glam::{DVec3, Vec3, Vec3Swizzles as _};

/// A ray prepared for [`Shear::hit`].
#[derive(Clone, Copy, Debug)]
pub struct Shear {
    origin: DVec3,
    direction: Vec3,
    /// Axes in which the triangle is looked at (0, 1) and the ray's dominant axis (2).
    axes: [usize; 3],
    /// `direction[axes[0]] / direction[axes[2]]`, the same for axis 1, and the given distance of a unit along axis 2.
    factors: DVec3,
    /// Edge functions beyond this have their sign for certain, whatever the triangle.
    doubt: f64,
    scale_exponent: i32,
}

/// Where a line meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intersection {
    /// About the distance, in units of the given direction.
    pub t: f64,
    /// How far the exact distance may be from `t`, unless both are beyond single precision.
    pub error: f64,
    /// Weight of the second vertex.
    pub u: f64,
    /// Weight of the third vertex.
    pub v: f64,
}

/// The least positive number in single precision.
const LEAST: f32 = f32::from_bits(1);

/// Unit roundoff of double precision, ε.
pub const EPSILON: f64 = f64::EPSILON / 2.0;

/// Factor of the bound on edge functions.
pub const ERROR: f64 = 9.0 * EPSILON;

/// Factor of the bound on edge functions of whatever triangle within a reach m: its X and Y are at most 2·m and Z is at
/// most m, so R ≤ 3·m and the bound at most 108.1·ε·m². The rest is for the rounding of m in single precision.
const ERROR_WITHIN_REACH: f64 = 128.0 * EPSILON;

/// How many times the bound on edge functions their sum must be for weights to be right to 2⁻²⁴: each is off by that
/// bound.
pub const CLEAR: f64 = (1 << 26) as f64;

/// The axis of the largest component, and the two others in cyclic order before it: `[x, y, dominant]`.
#[inline]
#[must_use]
pub fn shear_axes(direction: Vec3) -> [usize; 3] {
    let d = direction.abs();
    if d.x >= d.y && d.x >= d.z {
        [1, 2, 0]
    } else if d.y >= d.z {
        [2, 0, 1]
    } else {
        [0, 1, 2]
    }
}

impl Shear {
    /// Prepares a valid ray for finite triangles whose coordinates are given ones times 2^−`scale_exponent` (in
    /// [`crate::SCALE_EXPONENTS`]), none lost.
    ///
    /// `reach` is the greatest distance along an axis from the origin to any vertex it will be asked about, in the
    /// triangles' unit; +∞ where that is not known. It only saves time.
    #[inline]
    #[must_use]
    pub fn new(ray: &Ray, scale_exponent: i32, reach: f64) -> Self {
        let axes = shear_axes(ray.direction);
        let d = ray.direction.as_dvec3();
        let z = d[axes[2]];
        Self {
            origin: ray.origin.as_dvec3() * pow2(-scale_exponent),
            direction: ray.direction,
            axes,
            factors: DVec3::new(d[axes[0]] / z, d[axes[1]] / z, pow2(scale_exponent) / z),
            doubt: ERROR_WITHIN_REACH * reach * reach,
            scale_exponent,
        }
    }

    /// The hit with a triangle: [`Shear::intersect`] and [`Shear::resolve`].
    #[inline]
    #[must_use]
    pub fn hit(&self, triangle: &Triangle, limits: [f32; 2], primitive: u32) -> Option<Hit> {
        self.resolve(&self.intersect(triangle)?, triangle, limits, primitive)
    }

    /// Whether the whole line meets the triangle, which is exact, and about where.
    #[inline]
    #[must_use]
    pub fn intersect(&self, triangle: &Triangle) -> Option<Intersection> {
        // One by one: closures of arrays are called where nothing optimises across crates.
        let [a, b, c] = triangle.vertices();
        let (a, b, c) = (self.project(a), self.project(b), self.project(c));
        let u = c.x * b.y - c.y * b.x;
        let v = a.x * c.y - a.y * c.x;
        let w = b.x * a.y - b.y * a.x;
        let (least, greatest) = (lesser(lesser(u, v), w), greater(greater(u, v), w));
        if least < -self.doubt && greatest > self.doubt {
            return None;
        }
        let largest = |[x, y, z]: [f64; 3]| greater(greater(x.abs(), y.abs()), z.abs());
        let depths = [a.z, b.z, c.z];
        let (size, depth) = (largest([a.x, b.x, c.x]) + largest([a.y, b.y, c.y]), largest(depths));
        let reach = depth + 0.5 * size;
        let error = ERROR * reach * (size + 5.0 * EPSILON * reach);
        if least < -error && greatest > error {
            return None;
        }
        let edges = [u, v, w];
        if !(least > error || greatest < -error) || (u + v + w).abs() <= CLEAR * error {
            return self.settle(triangle, edges, depths, error);
        }
        Some(self.measure(edges, depths, error))
    }

    /// [`Shear::intersect`] where rounding may have chosen the sign of an edge function: exact arithmetic decides it,
    /// and no more, unless the triangle is seen edge-on.
    #[cold]
    #[inline(never)]
    fn settle(&self, triangle: &Triangle, edges: [f64; 3], depths: [f64; 3], error: f64) -> Option<Intersection> {
        let [u, v, w] = edges;
        if (u + v + w).abs() <= CLEAR * error {
            return exact::intersect(self, triangle);
        }
        let edges = exact::signed(self, triangle, edges, error)?;
        Some(self.measure(edges, depths, error))
    }

    /// Where the line meets the triangle, from edge functions of one sign, each off by at most `error`.
    #[inline]
    fn measure(&self, [u, v, w]: [f64; 3], [x, y, z]: [f64; 3], error: f64) -> Intersection {
        let determinant = u + v + w;
        let t = (u * x + v * y + w * z) / determinant * self.factors.z;
        let (least, greatest) = (lesser(lesser(x, y), z), greater(greater(x, y), z));
        let (depth, spread) = (greater(greatest, -least), greatest - least);
        let error = (4.0 * error / determinant.abs() * spread + 12.0 * EPSILON * depth) * self.factors.z.abs();
        Intersection { t, error, u: v / determinant, v: w / determinant }
    }

    /// The hit of an intersection with this `triangle`, whose distance is settled to the last bit if it can lie within
    /// the inclusive `limits`; `None` outside of them.
    #[inline]
    #[must_use]
    pub fn resolve(&self, met: &Intersection, triangle: &Triangle, limits: [f32; 2], primitive: u32) -> Option<Hit> {
        let (low, high) = (round_distance(met.t - met.error), round_distance(met.t + met.error));
        // Rounding is monotone, so the exact distance is rounded to something between these two.
        if high < limits[0] || low > limits[1] {
            return None;
        }
        let t = if low == high { low } else { exact::distance(self, triangle) };
        hit_at(t, met, limits, primitive)
    }

    /// The vertex relative to the origin: sheared in x and y, plain distance along the dominant axis in z.
    #[inline]
    fn project(&self, point: Vec3) -> DVec3 {
        let p = point.as_dvec3() - self.origin;
        let z = p[self.axes[2]];
        DVec3::new(p[self.axes[0]] - self.factors.x * z, p[self.axes[1]] - self.factors.y * z, z)
    }
}

impl Intersection {
    /// The hit where `t` is taken as it is: for tests that promise no more. `None` outside the inclusive `limits`.
    #[inline]
    #[must_use]
    pub fn rounded(&self, limits: [f32; 2], primitive: u32) -> Option<Hit> {
        hit_at(round_distance(self.t), self, limits, primitive)
    }
}

/// The limits are compared with the rounded `t`, so that a caller's own comparison agrees with ours.
#[inline]
fn hit_at(t: f32, met: &Intersection, limits: [f32; 2], primitive: u32) -> Option<Hit> {
    // Adding zero turns −0 into +0.
    let (u, v) = (met.u as f32 + 0.0, met.v as f32 + 0.0);
    (limits[0] <= t && t <= limits[1] && t.is_finite()).then_some(Hit { t, u, v, primitive })
}

/// A distance in single precision. One that would vanish becomes the least number of its sign, and −0 becomes 0.
#[inline]
#[must_use]
pub fn round_distance(t: f64) -> f32 {
    let rounded = t as f32 + 0.0;
    if rounded == 0.0 && t != 0.0 { if t > 0.0 { LEAST } else { -LEAST } } else { rounded }
}

/// The lesser number; one instruction, unlike `f64::min`, which must care for NaN.
#[inline]
fn lesser(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

#[inline]
fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// The hit of one ray with one triangle: what the host recomputes for shading from (ray, primitive id).
///
/// `None` for a miss, for an invalid ray, and for a triangle that is not finite. Bit-identical to what the kernels
/// report for that pair.
#[must_use]
pub fn hit(ray: &Ray, triangle: &Triangle, primitive: u32) -> Option<Hit> {
    if !ray.is_valid() || !triangle.is_finite() {
        return None;
    }
    Shear::new(ray, 0, f64::INFINITY).hit(triangle, [ray.tmin, ray.tmax], primitive)
}

/// Whether a finite triangle has an area, however small: exact.
#[must_use]
pub fn has_area(triangle: &Triangle) -> bool {
    let [a, b, c] = triangle.vertices().map(|p| p.as_dvec3());
    let (p, q) = (b - a, c - a);
    let [left, right] = [p.yzx() * q.zxy(), p.zxy() * q.yzx()];
    // Off by 3.01·ε of each product and by ε of the difference.
    let clear = (left - right).abs().cmpgt((left.abs() + right.abs()) * (5.0 * EPSILON));
    clear.any() || exact::has_area(triangle)
}

#[cfg(test)]
mod tests;
