//! Boxes as builders compute with them.

use super::gather::Reference;
use glam::{Vec3A, Vec4};
use rt_core::Aabb;

/// A box in two SIMD words, whose fourth lanes mean nothing.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub min: Vec4,
    pub max: Vec4,
}

impl Bounds {
    pub(super) const EMPTY: Self = Self { min: Vec4::MAX, max: Vec4::MIN };

    #[inline]
    pub(super) fn add(&mut self, other: &Self) {
        *self = self.union(other);
    }

    #[inline]
    pub(super) fn union(&self, other: &Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    #[inline]
    pub(super) fn half_area(&self) -> f32 {
        let e = Vec3A::from_vec4(self.max - self.min);
        e.x * (e.y + e.z) + e.y * e.z
    }

    pub(super) fn aabb(&self) -> Aabb {
        Aabb { min: self.min.truncate(), max: self.max.truncate() }
    }
}

impl From<&Aabb> for Bounds {
    #[inline]
    fn from(bounds: &Aabb) -> Self {
        Self { min: bounds.min.extend(0.0), max: bounds.max.extend(0.0) }
    }
}

impl From<&Reference> for Bounds {
    #[inline]
    fn from(reference: &Reference) -> Self {
        let [min, max] = reference.corners();
        Self { min, max }
    }
}
