//! A ray in the coordinates of the tree, and the conservative ray–box test.
//!
//! The slab method of T. Kay and J. Kajiya, *Ray Tracing Complex Scenes* (1986). T. Ize, *Robust BVH Ray Traversal*
//! (JCGT 2-2, 2013) makes it conservative by enlarging the far distance in every test. We instead move the ray's
//! origin once per ray, away from each box plane, so that the test itself costs nothing more than the plain one.
//!
//! # Why the test is conservative
//!
//! Let u = 2⁻²⁴, o and d the origin and direction, p a plane of axis k, and M_k the greatest distance along k from o to
//! a plane of the scene's box; M is the greatest of the three, and at least 2⁻⁴⁰. Directions are scaled so that the
//! largest component is in [1, 2): so a point of the scene at distance t has |t| ≤ M and |t·d_k| ≤ M_k.
//!
//! * Components of d smaller than `SMALLEST` = 2⁻⁶⁰ are replaced by it. This moves points of the ray by at
//!   most 2⁻⁶⁰·M, and leaves no zero to divide by, hence no NaN in any comparison below.
//! * The distance to a plane, `(p − o′) · (1/d)`, has three roundings: its error is at most 3.01·u·(M_k + pad)/|d_k|.
//! * A hit's t was rounded to single precision: at most u·|t| ≤ u·M_k/|d_k|. Where that made it subnormal it may be off
//!   by more, in the tree's unit: limits that are subnormal are moved by a step of given distances, beyond what was
//!   rounded to them.
//!
//! With o′ = o ± pad, pad = 8·u·M_k + 2⁻⁴¹·M + 4·u·|o_k|, the last term paying for the rounding of o to single
//! precision and of o ± pad itself, the computed near distance is at most the true one less 4.8·u·M_k/|d_k|, and the
//! far distance is above the true one by as much: more than the sum of the errors. This holds for any sign of t.
//!
//! Subnormal numbers change distances by less than 2⁻¹²⁵, also where they are flushed to zero; the padding moves them
//! by more than 2⁻⁸³, as M is at least 2⁻⁴⁰. Where M is above 2¹²⁶, or the origin beyond single precision, differences
//! could overflow and then call a near plane an infinite one: such a ray enters every box. Below that only products do,
//! rightly.
//!
//! # Why the test is monotone
//!
//! Rounding is monotone, so a box that contains another has a computed near distance that is not greater and a far
//! distance that is not smaller.

use crate::scale::{exponent, pow2, scaled};
use glam::{Vec3, Vec4, Vec4Swizzles};
use rt_core::{Aabb, Node, Ray, Scene};

/// Smallest magnitude of a direction's component, where the largest is at least 1: the reciprocal times any distance in
/// a scene stays finite, and the error is far below the padding.
const SMALLEST: f32 = 1.0 / (1_u64 << 60) as f32;

/// The reach that rays have at least, so that padding never vanishes.
const LEAST_REACH: f32 = 1.0 / (1_u64 << 40) as f32;

/// The reach from which on differences could overflow.
const GREATEST_REACH: f32 = f32::from_bits((126 + 127) << 23);

/// Unit roundoff of single precision.
pub(super) const U: f32 = 1.0 / (1 << 24) as f32;

/// A valid ray in local coordinates. Distances are in units of a direction whose largest component is in [1, 2), unless
/// they are said to be given ones.
#[derive(Clone, Copy, Debug)]
pub(super) struct LocalRay {
    /// As given.
    pub given: Ray,
    /// Rounded where it is subnormal; infinite where it is beyond single precision.
    pub origin: Vec3,
    /// The given direction times a power of two. Not clamped; components may have underflowed.
    pub direction: Vec3,
    /// Greatest distance along an axis from the origin to a plane of the scene's box, and at least 2⁻⁴⁰.
    pub reach: f32,
    /// [`Scene::scale_exponent`].
    pub scale_exponent: i32,
    /// Given distances are local ones times this.
    pub t_scale: f64,
    /// Local distances are given ones times this.
    pub t_unscale: f64,
    pub slabs: Slabs,
}

/// What the box test knows of a ray: constants for the twelve planes of two boxes, in the order in which a [`Node`]
/// stores them. Three SIMD words of four planes, where three axes would leave a lane of each word idle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slabs {
    /// The origin, moved up for the lower planes of a box and down for its upper planes.
    origin: [Vec4; 3],
    reciprocal: [Vec4; 3],
    /// +∞ for planes through which the ray enters, −∞ for those through which it leaves; grouped as in `enter`.
    entering: [Vec4; 3],
    /// Where the ray begins.
    tmin: f32,
}

/// What all rays of a batch have in common.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    bounds: Aabb,
    /// Local lengths are given ones times this.
    unscale: f64,
    scale_exponent: i32,
}

impl Frame {
    pub(super) fn of(scene: &Scene) -> Self {
        let scale_exponent = scene.scale_exponent();
        Self { bounds: scene.bounds(), unscale: pow2(-scale_exponent), scale_exponent }
    }

    /// The ray in local coordinates; `None` when it is invalid.
    #[inline(always)]
    pub(super) fn localize(&self, ray: &Ray) -> Option<LocalRay> {
        if !ray.is_valid() {
            return None;
        }
        let origin = scaled(ray.origin, self.unscale);
        // One less than `exponent`, for [1, 2) rather than [½, 1).
        let direction_exponent = exponent(ray.direction.abs().max_element()) - 1;
        let direction = scaled(ray.direction, pow2(-direction_exponent));
        let t_unscale = pow2(direction_exponent - self.scale_exponent);
        let (pad, reach) = self.padding(origin);
        let tmin = if ray.tmin.is_subnormal() { ray.tmin.next_down() } else { ray.tmin };
        let tmin = (f64::from(tmin) * t_unscale) as f32;
        // False for NaN, too.
        let slabs = if reach <= GREATEST_REACH {
            let clamped = direction.abs().max(Vec3::splat(SMALLEST)).copysign(direction);
            Slabs::new([origin + pad, origin - pad], clamped.recip(), tmin)
        } else {
            // All planes are infinitely far behind or ahead.
            Slabs::new([Vec3::INFINITY, Vec3::NEG_INFINITY], Vec3::ONE, tmin)
        };
        Some(LocalRay {
            given: *ray,
            origin,
            direction,
            reach,
            scale_exponent: self.scale_exponent,
            t_scale: pow2(self.scale_exponent - direction_exponent),
            t_unscale,
            slabs,
        })
    }

    /// How far box planes are moved away from a ray's origin, by axis, and the ray's reach.
    #[inline(always)]
    pub(super) fn padding(&self, origin: Vec3) -> (Vec3, f32) {
        let low = (self.bounds.min - origin).abs();
        let high = (self.bounds.max - origin).abs();
        let reaches = low.max(high);
        let reach = reaches.max_element().max(LEAST_REACH);
        // 2⁻⁴¹ is u · 2⁻¹⁷.
        ((reaches * 8.0 + origin.abs() * 4.0 + reach * (1.0 / (1 << 17) as f32)) * U, reach)
    }
}

impl LocalRay {
    /// The local distance that bounds all that are rounded to the given one or less. Not exact when it underflows,
    /// which the padding covers.
    #[inline]
    pub(super) fn local_limit(&self, t: f32) -> f32 {
        let t = if t.is_subnormal() { t.next_up() } else { t };
        (f64::from(t) * self.t_unscale) as f32
    }
}

impl Slabs {
    #[inline]
    fn new(origin: [Vec3; 2], reciprocal: Vec3, tmin: f32) -> Self {
        // 0 where the ray goes up: it enters through the lower plane.
        let down = reciprocal.cmplt(Vec3::ZERO);
        let lower = Vec3::select(down, Vec3::NEG_INFINITY, Vec3::INFINITY);
        Self {
            origin: planes(origin),
            reciprocal: planes([reciprocal; 2]),
            entering: by_box(planes([lower, -lower])),
            tmin,
        }
    }

    /// Where the ray begins, in local distance.
    pub(super) const fn tmin(&self) -> f32 {
        self.tmin
    }

    /// One over the direction, as the box test uses it.
    pub(super) fn reciprocal(&self) -> Vec3 {
        self.reciprocal[0].xyz()
    }

    /// Where the ray enters each child of a node that has two; `None` for one it does not enter before `limit`.
    #[inline(always)]
    pub(super) fn enter_children(&self, node: &Node, limit: f32) -> [Option<f32>; 2] {
        self.enter_two(&node.bounds, limit)
    }

    /// Where the ray enters a box that is not empty; `None` if it does not before `limit`.
    #[inline]
    pub(super) fn enter(&self, bounds: &Aabb, limit: f32) -> Option<f32> {
        self.enter_two(&[*bounds; 2], limit)[0]
    }

    #[inline(always)]
    fn enter_two(&self, bounds: &[Aabb; 2], limit: f32) -> [Option<f32>; 2] {
        let planes: &[f32; 12] = bytemuck::cast_ref(bounds);
        let t = by_box(core::array::from_fn(|i| {
            (Vec4::from_slice(&planes[4 * i..4 * i + 4]) - self.origin[i]) * self.reciprocal[i]
        }));
        // Lanes 0 and 1 belong to the first box, 2 and 3 to the second. A plane that is not of the kind looked for
        // becomes the identity of the maximum or minimum.
        let near: [Vec4; 3] = core::array::from_fn(|i| t[i].min(self.entering[i]));
        let far: [Vec4; 3] = core::array::from_fn(|i| t[i].max(self.entering[i]));
        let near = near[0].max(near[1]).max(near[2]);
        let far = far[0].min(far[1]).min(far[2]);
        let near = near.max(near.yxwz()).max(Vec4::splat(self.tmin));
        let far = far.min(far.yxwz()).min(Vec4::splat(limit));
        let entered = near.cmple(far).bitmask();
        [(entered & 1 != 0).then_some(near.x), (entered & 4 != 0).then_some(near.z)]
    }
}

/// A value for each of the twelve planes of two boxes, given those of a lower and an upper corner.
#[inline]
fn planes([l, u]: [Vec3; 2]) -> [Vec4; 3] {
    [Vec4::new(l.x, l.y, l.z, u.x), Vec4::new(u.y, u.z, l.x, l.y), Vec4::new(l.z, u.x, u.y, u.z)]
}

/// Regroups twelve planes so that the first box has lanes 0 and 1 of each word, and the second lanes 2 and 3.
#[inline(always)]
fn by_box([a, b, c]: [Vec4; 3]) -> [Vec4; 3] {
    [Vec4::new(a.x, a.y, c.x, c.y), b, Vec4::new(a.z, a.w, c.z, c.w)]
}
