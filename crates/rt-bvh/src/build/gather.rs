//! The first pass over a mesh: checks it, leaves out what cannot be hit, and normalises the rest.

use super::BuildError;
use crate::scale::{exponent, pow2, scaled};
use crate::{InvalidTriangles, Mesh};
use alloc::vec::Vec;
use bytemuck::{Pod, Zeroable};
use glam::{Vec3, Vec4, Vec4Swizzles};
use rt_core::{Aabb, Triangle};

/// What is left of a mesh, in local coordinates.
pub(super) struct Gathered {
    /// The triangles that can be hit.
    pub triangles: Vec<Triangle>,
    /// For each of them, its primitive id.
    pub primitives: Vec<u32>,
    /// For each of them, its box and position, for the builders.
    pub references: Vec<Reference>,
    pub scale_exponent: i32,
    pub primitive_count: u32,
    pub dropped_degenerate: u32,
    pub dropped_invalid: u32,
}

/// A triangle as builders see it: its box, and where it is in [`Gathered::triangles`]. 32 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Reference {
    min: Vec3,
    max: Vec3,
    pub triangle: u32,
    unused: u32,
}

impl Reference {
    fn new(bounds: Aabb, triangle: u32) -> Self {
        Self { min: bounds.min, max: bounds.max, triangle, unused: 0 }
    }

    /// The box's smallest and largest corner. The fourth lanes mean nothing, but are coordinates too: a triangle number
    /// there would be a subnormal, with which processors are slow.
    #[inline]
    pub(super) fn corners(&self) -> [Vec4; 2] {
        let words: &[f32; 8] = bytemuck::cast_ref(self);
        [Vec4::from_slice(&words[0..4]), Vec4::from_slice(&words[2..6]).yzwx()]
    }

    #[cfg(feature = "obvhs")]
    pub(super) fn bounds(&self) -> Aabb {
        Aabb { min: self.min, max: self.max }
    }
}

pub(super) fn gather(mesh: Mesh<'_>, invalid: InvalidTriangles) -> Result<Gathered, BuildError> {
    let count = mesh.indices.len();
    let primitive_count = u32::try_from(count).map_err(|_| BuildError::TooManyTriangles { triangles: count })?;
    let mut triangles = Vec::with_capacity(count);
    let mut primitives = Vec::with_capacity(count);
    let (mut dropped_degenerate, mut dropped_invalid, mut first_invalid) = (0, 0, None);
    let mut largest = Vec3::ZERO;
    for (id, indices) in (0..primitive_count).zip(mesh.indices) {
        let vertex = |index: u32| {
            let vertices = mesh.positions.len();
            mesh.positions.get(index as usize).copied().ok_or(BuildError::IndexOutOfRange {
                triangle: id,
                index,
                vertices,
            })
        };
        let triangle = Triangle::new(vertex(indices[0])?, vertex(indices[1])?, vertex(indices[2])?);
        if !triangle.is_finite() {
            first_invalid.get_or_insert(id);
            dropped_invalid += 1;
        } else if triangle.area_normal() == glam::DVec3::ZERO {
            dropped_degenerate += 1;
        } else {
            let bounds = triangle.bounds();
            largest = largest.max(bounds.max).max(-bounds.min);
            triangles.push(triangle);
            primitives.push(id);
        }
    }
    if let (InvalidTriangles::Refuse, Some(first)) = (invalid, first_invalid) {
        return Err(BuildError::NotFinite { first, triangles: dropped_invalid });
    }
    let scale_exponent = exponent(largest.max_element());
    let factor = pow2(-scale_exponent);
    let mut references = Vec::with_capacity(triangles.len());
    for (position, triangle) in (0..).zip(&mut triangles) {
        *triangle = Triangle::new(scaled(triangle.a, factor), scaled(triangle.b, factor), scaled(triangle.c, factor));
        references.push(Reference::new(triangle.bounds(), position));
    }
    Ok(Gathered {
        triangles,
        primitives,
        references,
        scale_exponent,
        primitive_count,
        dropped_degenerate,
        dropped_invalid,
    })
}
