//! A ray in the coordinates of the tree, and the conservative ray–box test.
//!
//! The slab method of T. Kay and J. Kajiya, *Ray Tracing Complex Scenes* (1986). T. Ize, *Robust BVH Ray Traversal*
//! (JCGT 2-2, 2013) makes it conservative by enlarging the far distance in every test. We instead move the ray's
//! origin once per ray, away from each box plane, so that the test itself costs nothing more than the plain one.
//!
//! # Why the test is conservative
//!
//! Let u = 2⁻²⁴, o and d the origin and direction, p a plane of axis k, and M_k the greatest distance along k from o to
//! a plane of the scene's box (M the greatest of the three). Directions are scaled so that the largest component is in
//! [1, 2): so a point of the scene at distance t has |t| ≤ M and |t·d_k| ≤ M_k.
//!
//! * Components of d smaller than `SMALLEST` = 2⁻⁶⁰ are replaced by it. This moves points of the ray by at
//!   most 2⁻⁶⁰·M, and leaves no zero to divide by, hence no NaN in any comparison below.
//! * The distance to a plane, `(p − o′) · (1/d)`, has three roundings: its error is at most 3.01·u·(M_k + pad)/|d_k|.
//! * A hit's t was rounded to single precision: at most u·|t| ≤ u·M_k/|d_k|.
//! * The reference test's own errors are of the order 2⁻⁵⁰·M.
//!
//! With o′ = o ± pad, pad = 8·u·M_k + 2⁻⁴¹·M + 4·u·|o_k|, the last term paying for the rounding of o ± pad itself, the
//! computed near distance is at most the true one less 4.8·u·M_k/|d_k|, and the far distance is above the true one by
//! as much: more than the sum of the errors. This holds for any sign of t.
//!
//! # Why the test is monotone
//!
//! Rounding is monotone, so a box that contains another has a computed near distance that is not greater and a far
//! distance that is not smaller.

use crate::scale::{exponent, pow2, scaled};
use glam::{Vec3, Vec3A};
use rt_core::{Aabb, Node, Ray, Scene};

/// Smallest magnitude of a direction's component, where the largest is at least 1: the reciprocal times any distance in
/// a scene stays finite, and the error is far below the padding.
const SMALLEST: f32 = 1.0 / (1_u64 << 60) as f32;

/// Unit roundoff of single precision.
pub(super) const U: f32 = 1.0 / (1 << 24) as f32;

/// A valid ray in local coordinates. Distances are in units of a direction whose largest component is in [1, 2), unless
/// they are said to be given ones.
#[derive(Clone, Copy, Debug)]
pub(super) struct LocalRay {
    /// As given.
    pub given: Ray,
    pub origin: Vec3,
    /// The given direction times a power of two. Not clamped; components may have underflowed.
    pub direction: Vec3,
    /// Greatest distance along an axis from the origin to a plane of the scene's box.
    pub reach: f32,
    /// Given distances are the reference test's times this; it knows local origins and given directions.
    pub scale: f64,
    /// Given distances are local ones times this.
    pub t_scale: f64,
    /// Local distances are given ones times this.
    pub t_unscale: f64,
    pub slabs: Slabs,
}

/// What the box test knows of a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slabs {
    /// The origin, moved up: for the lower planes of boxes.
    up: Vec3A,
    /// The origin, moved down: for the upper planes.
    down: Vec3A,
    reciprocal: Vec3A,
    /// Where the ray begins.
    tmin: f32,
}

/// What all rays of a batch have in common.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    bounds: Aabb,
    /// Local lengths are given ones times this.
    unscale: f64,
    scale: f64,
    scale_exponent: i32,
}

impl Frame {
    pub(super) fn of(scene: &Scene) -> Self {
        let scale_exponent = scene.scale_exponent();
        Self { bounds: scene.bounds(), unscale: pow2(-scale_exponent), scale: pow2(scale_exponent), scale_exponent }
    }

    /// The ray in local coordinates; `None` when it is invalid, or starts unreachably far away.
    #[inline]
    pub(super) fn localize(&self, ray: &Ray) -> Option<LocalRay> {
        if !ray.is_valid() {
            return None;
        }
        let origin = scaled(ray.origin, self.unscale);
        if !origin.is_finite() {
            return None;
        }
        // One less than `exponent`, for [1, 2) rather than [½, 1).
        let direction_exponent = exponent(ray.direction.abs().max_element()) - 1;
        let direction = scaled(ray.direction, pow2(-direction_exponent));
        let t_unscale = pow2(direction_exponent - self.scale_exponent);
        let low = (self.bounds.min - origin).abs();
        let high = (self.bounds.max - origin).abs();
        let reaches = low.max(high);
        let reach = reaches.max_element();
        // 2⁻⁴¹ is u · 2⁻¹⁷.
        let pad = (reaches * 8.0 + origin.abs() * 4.0 + reach * (1.0 / (1 << 17) as f32)) * U;
        let clamped = direction.abs().max(Vec3::splat(SMALLEST)).copysign(direction);
        let slabs = Slabs {
            up: Vec3A::from(origin + pad),
            down: Vec3A::from(origin - pad),
            reciprocal: Vec3A::from(clamped.recip()),
            tmin: (f64::from(ray.tmin) * t_unscale) as f32,
        };
        Some(LocalRay {
            given: *ray,
            origin,
            direction,
            reach,
            scale: self.scale,
            t_scale: pow2(self.scale_exponent - direction_exponent),
            t_unscale,
            slabs,
        })
    }
}

impl LocalRay {
    /// The local distance of a given one. Not exact when it underflows, which the padding covers.
    #[inline]
    pub(super) fn local_distance(&self, t: f32) -> f32 {
        (f64::from(t) * self.t_unscale) as f32
    }
}

impl Slabs {
    /// Where the ray enters each child of a node that has two; `None` for one it does not enter before `limit`.
    #[inline(always)]
    pub(super) fn enter_children(&self, node: &Node, limit: f32) -> [Option<f32>; 2] {
        // Corner by corner; the fourth word of each slice is ignored.
        let words: &[f32; 16] = bytemuck::cast_ref(node);
        [
            self.enter_corners(Vec3A::from_slice(&words[0..4]), Vec3A::from_slice(&words[3..7]), limit),
            self.enter_corners(Vec3A::from_slice(&words[6..10]), Vec3A::from_slice(&words[9..13]), limit),
        ]
    }

    /// Where the ray enters a box that is not empty; `None` if it does not before `limit`.
    #[inline]
    pub(super) fn enter(&self, bounds: &Aabb, limit: f32) -> Option<f32> {
        self.enter_corners(bounds.min.into(), bounds.max.into(), limit)
    }

    #[inline(always)]
    fn enter_corners(&self, min: Vec3A, max: Vec3A, limit: f32) -> Option<f32> {
        let lower = (min - self.up) * self.reciprocal;
        let upper = (max - self.down) * self.reciprocal;
        let near = greater(lower.min(upper).max_element(), self.tmin);
        let far = lesser(lower.max(upper).min_element(), limit);
        (near <= far).then_some(near)
    }
}

/// The greater of two numbers that are not NaN: one instruction.
#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The lesser of two numbers that are not NaN: one instruction.
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}
