//! The reference ray–triangle test, in double precision.
//!
//! After S. Woop, C. Benthin and I. Wald, *Watertight Ray/Triangle Intersection*, JCGT 2-1 (2013): the ray is sheared
//! onto the axis where its direction is largest, and three edge functions decide. A vertex is sheared to the same two
//! numbers in every triangle that uses it and an edge function only changes its sign when the edge is walked the other
//! way, so two triangles that share an edge never both let a ray through.
//!
//! We deviate from the paper in working in double precision throughout. This one function *defines* the hit: every
//! kernel on every device may decide clear cases more cheaply, but reports these `t`, `u`, `v`, so a hit is a function
//! of (ray, triangle) alone. All operations scale exactly under powers of two, so it gives the same bits in the
//! coordinates of the scene's file and in those of the normalised tree.
//!
//! Limit: for a triangle smaller than about 2⁻⁵⁰ of its distance, or a ray in its very plane, double precision is noise
//! too, and a hit can be reported that is not there. Traversal refuses those, since a hit must also pass the box test
//! of its own triangle; who calls [`hit`] on pairs that no traversal reported must expect them.

use crate::{Hit, Ray, Triangle};
use glam::{DVec3, Vec3};

/// A ray prepared for [`Shear::intersect`]: its origin, and the shear that turns its direction into an axis.
#[derive(Clone, Copy, Debug)]
pub struct Shear {
    origin: DVec3,
    /// Axes in which the triangle is looked at (0, 1) and the ray's dominant axis (2).
    axes: [usize; 3],
    /// `direction[axes[0]] / direction[axes[2]]`, the same for axis 1, and `1 / direction[axes[2]]`.
    factors: DVec3,
}

/// Where a line meets a triangle, in double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intersection {
    /// Distance in units of the direction the shear was made from.
    pub t: f64,
    /// Weight of the second vertex.
    pub u: f64,
    /// Weight of the third vertex.
    pub v: f64,
}

/// The least positive number in single precision.
const LEAST: f32 = f32::from_bits(1);

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
    /// Prepares a ray with a finite origin and a finite direction that is not zero.
    #[inline]
    #[must_use]
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        let axes = shear_axes(direction);
        let d = direction.as_dvec3();
        let z = d[axes[2]];
        Self { origin: origin.as_dvec3(), axes, factors: DVec3::new(d[axes[0]] / z, d[axes[1]] / z, 1.0 / z) }
    }

    /// Intersects the whole line with a triangle, edges and vertices included; `None` for a miss and for a triangle
    /// that is seen edge-on or has no area.
    #[inline]
    #[must_use]
    pub fn intersect(&self, triangle: &Triangle) -> Option<Intersection> {
        let [a, b, c] = triangle.vertices().map(|p| self.project(p));
        let u = c.x * b.y - c.y * b.x;
        let v = a.x * c.y - a.y * c.x;
        let w = b.x * a.y - b.y * a.x;
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let determinant = u + v + w;
        if determinant == 0.0 {
            return None;
        }
        let t = (u * a.z + v * b.z + w * c.z) / determinant * self.factors.z;
        Some(Intersection { t, u: v / determinant, v: w / determinant })
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
    /// Rounds to a [`Hit`], with `t` multiplied by `t_scale` first; `None` outside `tmin ≤ t ≤ tmax`.
    ///
    /// The limits are compared with the rounded `t`, so that a caller's own comparison agrees with ours. A distance too
    /// small for single precision becomes the least number of its sign, not 0: a surface behind the origin stays there.
    #[inline]
    #[must_use]
    pub fn to_hit(&self, t_scale: f64, tmin: f32, tmax: f32, primitive: u32) -> Option<Hit> {
        // Adding zero turns −0 into +0.
        let [mut t, u, v] = [self.t * t_scale, self.u, self.v].map(|x| x as f32 + 0.0);
        if t == 0.0 && self.t != 0.0 {
            t = if self.t > 0.0 { LEAST } else { -LEAST };
        }
        (tmin <= t && t <= tmax && t.is_finite()).then_some(Hit { t, u, v, primitive })
    }
}

/// The hit of one ray with one triangle: what the host recomputes for shading from (ray, primitive id).
///
/// `None` for a miss and for an invalid ray. Bit-identical to what the kernels report for that pair.
#[must_use]
pub fn hit(ray: &Ray, triangle: &Triangle, primitive: u32) -> Option<Hit> {
    if !ray.is_valid() {
        return None;
    }
    Shear::new(ray.origin, ray.direction).intersect(triangle)?.to_hit(1.0, ray.tmin, ray.tmax, primitive)
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: Triangle = Triangle::new(Vec3::ZERO, Vec3::X, Vec3::Y);

    #[test]
    fn weights_and_distance_follow_the_conventions() {
        let ray = Ray::new(Vec3::new(0.25, 0.5, 3.0), Vec3::new(0.0, 0.0, -2.0));
        let hit = hit(&ray, &UNIT, 7).expect("the ray points at the triangle");
        assert_eq!(hit, Hit { t: 1.5, u: 0.25, v: 0.5, primitive: 7 });
    }

    #[test]
    fn limits_are_inclusive_and_bad_rays_miss() {
        let ray = Ray::new(Vec3::new(0.25, 0.25, 1.0), Vec3::NEG_Z);
        assert!(hit(&ray.with_range(1.0, 1.0), &UNIT, 0).is_some());
        assert!(hit(&ray.with_range(1.5, 2.0), &UNIT, 0).is_none());
        assert!(hit(&ray.with_range(2.0, 0.0), &UNIT, 0).is_none());
        assert!(hit(&ray.with_range(f32::NAN, 2.0), &UNIT, 0).is_none());
        assert!(hit(&Ray::new(ray.origin, Vec3::ZERO), &UNIT, 0).is_none());
    }

    #[test]
    fn power_of_two_scaling_changes_no_bit_of_u_and_v() {
        let ray = Ray::new(Vec3::new(0.3, 0.1, 1.7), Vec3::new(0.03, 0.07, -1.3));
        let base = hit(&ray, &UNIT, 0).expect("aimed at it");
        for exponent in [-100, -3, 40, 100] {
            let s = libm::ldexpf(1.0, exponent);
            let scaled = Ray::new(ray.origin * s, ray.direction);
            let h = hit(&scaled, &UNIT.scaled(s), 0).expect("scaled");
            assert_eq!((h.t, h.u, h.v), (base.t * s, base.u, base.v), "2^{exponent}");
        }
    }

    /// Fails when a distance that vanishes is rounded to 0, which every limit of 0 accepts.
    #[test]
    fn what_is_behind_stays_behind_at_any_scale() {
        let at = |t: f64| Intersection { t, u: 0.2, v: 0.3 }.to_hit(2.0_f64.powi(-100), 0.0, 1.0, 7);
        assert_eq!(at(-1e-20), None);
        assert_eq!(at(1e-20).map(|hit| hit.t), Some(LEAST));
        assert_eq!(at(0.0).map(|hit| hit.t.to_bits()), Some(0));
        assert_eq!(at(-0.0).map(|hit| hit.t.to_bits()), Some(0));
    }
}
