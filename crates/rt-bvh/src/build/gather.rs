//! The first pass over a mesh: checks it, leaves out what cannot be hit, and normalises the rest.
//!
//! # Normalising loses nothing
//!
//! Coordinates are divided by a power of two, as a rule the one that brings the largest into [½, 1). Where the smallest
//! would become subnormal and lose bits, the power is the nearest that keeps them all. There is always one, for 1 does:
//! coordinates are single-precision numbers as they come. The largest is then above 1, at most 2¹²⁸ in the worst case.
//! Builders, which need not be exact, see all boxes in the first unit, where no area overflows.

use super::{BuildError, reserved};
use crate::scale::{exponent, lowest_bit, pow2, scaled};
use crate::{InvalidTriangles, Mesh};
use alloc::vec::Vec;
use bytemuck::{Pod, Zeroable};
use glam::{Vec3, Vec4, Vec4Swizzles};
use rt_core::intersect::has_area;
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
    /// Whether the references are in the unit of the triangles: if not, their boxes are about right.
    pub exact_references: bool,
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
    let mut triangles = reserved(count, "the triangles")?;
    let mut primitives = reserved(count, "the ids of triangles")?;
    let (mut dropped_degenerate, mut dropped_invalid, mut first_invalid) = (0, 0, None);
    let (mut largest, mut least) = (Vec3::ZERO, Vec3::MAX);
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
        } else if !has_area(&triangle) {
            dropped_degenerate += 1;
        } else {
            for size in triangle.vertices().map(Vec3::abs) {
                largest = largest.max(size);
                least = least.min(Vec3::select(size.cmpeq(Vec3::ZERO), Vec3::MAX, size));
            }
            triangles.push(triangle);
            primitives.push(id);
        }
    }
    if let (InvalidTriangles::Refuse, Some(first)) = (invalid, first_invalid) {
        return Err(BuildError::NotFinite { first, triangles: dropped_invalid });
    }
    let normal_exponent = exponent(largest.max_element());
    let scale_exponent = lossless_exponent(normal_exponent, least.min_element(), &triangles);
    let normalised = |triangle: &Triangle, exponent: i32| {
        let [a, b, c] = triangle.vertices().map(|p| scaled(p, pow2(-exponent)));
        Triangle::new(a, b, c)
    };
    let mut references = reserved(triangles.len(), "the boxes of triangles")?;
    for (position, triangle) in (0..).zip(&mut triangles) {
        references.push(Reference::new(normalised(triangle, normal_exponent).bounds(), position));
        *triangle = normalised(triangle, scale_exponent);
    }
    Ok(Gathered {
        triangles,
        primitives,
        references,
        scale_exponent,
        exact_references: scale_exponent == normal_exponent,
        primitive_count,
        dropped_degenerate,
        dropped_invalid,
    })
}

/// The exponent nearest to `normal`, which brings the largest coordinate below 1, that loses no bit of any coordinate;
/// `least` is the smallest magnitude but zero.
fn lossless_exponent(normal: i32, least: f32, triangles: &[Triangle]) -> i32 {
    // Exponent of the least normal number as `exponent` counts, and of the least number.
    const NORMAL: i32 = -125;
    const LEAST: i32 = -149;
    if exponent(least) - normal >= NORMAL {
        return normal;
    }
    let coordinates = triangles.iter().flat_map(Triangle::vertices).flat_map(|p| p.to_array()).filter(|&x| x != 0.0);
    let lowest = coordinates.map(lowest_bit).min().unwrap_or(0);
    normal.min(lowest - LEAST)
}

#[cfg(test)]
mod tests {
    use super::*;

    // Fails when a bit is lost, when the unit is left further than need be, and when ordinary scenes leave it.
    #[test]
    fn every_coordinate_keeps_all_its_bits() {
        let odd = f32::from_bits(0x3f80_0001);
        for (large, small, expected) in [
            (1.0, 1e-30, 1),
            (3e38, 1.0, 128),
            (f32::MAX, 16.0, 128),
            // Of the small number's 24 bits the lowest is 2⁻²³ of the first.
            (f32::MAX, 4.0 * odd, 128),
            (f32::MAX, 2.0 * odd, 127),
            (f32::MAX, odd, 126),
            (f32::MAX, 1.0 / 4096.0 * odd, 114),
            (3e38, 1e-45, 0),
            (1.0, 1e-45, 0),
            (1e-45, 1e-45, -148),
        ] {
            let corner = |x, y| Vec3::new(x, y, small);
            let positions = [corner(large, 0.0), corner(0.0, large), corner(-large, 0.0)];
            let mesh = Mesh { positions: &positions, indices: &[[0, 1, 2]] };
            let gathered = gather(mesh, InvalidTriangles::Refuse).expect("valid");
            assert_eq!(gathered.scale_exponent, expected, "{large:e} {small:e}");
            assert!(rt_core::SCALE_EXPONENTS.contains(&expected));
            let back = gathered.triangles[0].vertices().map(|p| p.as_dvec3() * pow2(gathered.scale_exponent));
            assert_eq!(back, positions.map(|p| p.as_dvec3()), "{large:e} {small:e}");
            let largest = gathered.references[0].corners().map(|corner| corner.truncate().abs().max_element());
            assert!(largest.into_iter().all(|size| size < 1.0));
        }
    }
}
