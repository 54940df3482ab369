//! The first pass over a mesh: checks it, leaves out what cannot be hit, and normalises the rest.
//!
//! # Normalising loses nothing
//!
//! Coordinates are divided by a power of two, as a rule the one that brings the largest into [½, 1). Where the smallest
//! would become subnormal and lose bits, the power is the nearest that keeps them all. There is always one, for 1 does:
//! coordinates are single-precision numbers as they come. The largest is then above 1, at most 2¹²⁸ in the worst case.
//! Builders, which need not be exact, see all boxes in the first unit, where no area overflows.

use super::{BuildError, reserved, zeroed};
use crate::parallel::each;
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
}

/// Triangles that a thread looks at, at a time.
const CHUNK: usize = 1 << 13;

/// What some triangles of a mesh are like.
#[derive(Clone, Copy)]
struct Census {
    kept: usize,
    degenerate: u32,
    invalid: u32,
    first_invalid: Option<u32>,
    /// Of the coordinates of those kept, along each axis: the largest magnitude, and the least but 0.
    largest: Vec3,
    least: Vec3,
}

impl Census {
    const NOTHING: Self =
        Self { kept: 0, degenerate: 0, invalid: 0, first_invalid: None, largest: Vec3::ZERO, least: Vec3::MAX };

    /// Of triangles from the one with number `first` on.
    fn take(positions: &[Vec3], first: u32, triangles: &[[u32; 3]]) -> Result<Self, BuildError> {
        let mut census = Self::NOTHING;
        for (id, indices) in (first..).zip(triangles) {
            if let Some(&index) = indices.iter().find(|&&index| index as usize >= positions.len()) {
                return Err(BuildError::IndexOutOfRange { triangle: id, index, vertices: positions.len() });
            }
            let triangle = corners(positions, indices);
            if !triangle.is_finite() {
                census.first_invalid.get_or_insert(id);
                census.invalid += 1;
            } else if !has_area(&triangle) {
                census.degenerate += 1;
            } else {
                for size in triangle.vertices().map(Vec3::abs) {
                    census.largest = census.largest.max(size);
                    census.least = census.least.min(Vec3::select(size.cmpeq(Vec3::ZERO), Vec3::MAX, size));
                }
                census.kept += 1;
            }
        }
        Ok(census)
    }

    /// Of these triangles and some behind them.
    fn with(self, other: &Self) -> Self {
        Self {
            kept: self.kept + other.kept,
            degenerate: self.degenerate + other.degenerate,
            invalid: self.invalid + other.invalid,
            first_invalid: self.first_invalid.or(other.first_invalid),
            largest: self.largest.max(other.largest),
            least: self.least.min(other.least),
        }
    }
}

/// A triangle whose indices are in range.
#[inline]
pub(super) fn corners(positions: &[Vec3], indices: &[u32; 3]) -> Triangle {
    let [a, b, c] = indices.map(|index| positions[index as usize]);
    Triangle::new(a, b, c)
}

/// A triangle in a unit of 2 to the power of `exponent`.
#[inline]
pub(super) fn normalised(triangle: &Triangle, exponent: i32) -> Triangle {
    let [a, b, c] = triangle.vertices().map(|p| scaled(p, pow2(-exponent)));
    Triangle::new(a, b, c)
}

/// Whether rays can hit a triangle.
#[inline]
pub(super) fn is_kept(triangle: &Triangle) -> bool {
    triangle.is_finite() && has_area(triangle)
}

/// Some triangles, and where those that are kept belong.
struct Part<'a> {
    first: u32,
    indices: &'a [[u32; 3]],
    /// How many are kept of all in front.
    before: u32,
    triangles: &'a mut [Triangle],
    primitives: &'a mut [u32],
    references: &'a mut [Reference],
}

impl Part<'_> {
    fn fill(self, positions: &[Vec3], normal_exponent: i32, scale_exponent: i32) {
        let all = self.triangles.len() == self.indices.len();
        let given = (self.first..).zip(self.indices).map(|(id, indices)| (id, corners(positions, indices)));
        let kept = given.filter(|(_, triangle)| all || is_kept(triangle));
        let places = self.triangles.iter_mut().zip(self.primitives).zip(self.references);
        for ((position, (id, triangle)), ((place, primitive), reference)) in (self.before..).zip(kept).zip(places) {
            *place = normalised(&triangle, scale_exponent);
            *primitive = id;
            let seen = if scale_exponent == normal_exponent { *place } else { normalised(&triangle, normal_exponent) };
            *reference = Reference::new(seen.bounds(), position);
        }
    }
}

/// What a mesh is like.
pub(super) struct Survey {
    /// Of [`CHUNK`] triangles each.
    parts: Vec<Census>,
    all: Census,
    pub primitive_count: u32,
    /// Of the unit in which the largest coordinate is below 1, and of the one that loses no bit.
    normal_exponent: i32,
    pub scale_exponent: i32,
}

impl Survey {
    /// Looks at a mesh and checks it.
    pub(super) fn of(mesh: Mesh<'_>, invalid: InvalidTriangles) -> Result<Self, BuildError> {
        let Mesh { positions, indices } = mesh;
        let count = indices.len();
        let primitive_count = u32::try_from(count).map_err(|_| BuildError::TooManyTriangles { triangles: count })?;
        let chunks = (0..primitive_count).step_by(CHUNK).zip(indices.chunks(CHUNK));
        let counted = each(chunks.collect(), |(first, indices)| Census::take(positions, first, indices));
        let parts = counted.into_iter().collect::<Result<Vec<Census>, _>>()?;
        let all = parts.iter().fold(Census::NOTHING, Census::with);
        if let (InvalidTriangles::Refuse, Some(first)) = (invalid, all.first_invalid) {
            return Err(BuildError::NotFinite { first, triangles: all.invalid });
        }
        let normal_exponent = exponent(all.largest.max_element());
        let kept = || indices.iter().map(|indices| corners(positions, indices)).filter(is_kept);
        let scale_exponent = lossless_exponent(normal_exponent, all.least.min_element(), kept);
        Ok(Self { parts, all, primitive_count, normal_exponent, scale_exponent })
    }

    /// How many triangles rays can hit.
    pub(super) const fn kept(&self) -> usize {
        self.all.kept
    }
}

pub(super) fn gather(mesh: Mesh<'_>, invalid: InvalidTriangles) -> Result<Gathered, BuildError> {
    let Mesh { positions, indices } = mesh;
    let Survey { parts, all, primitive_count, normal_exponent, scale_exponent } = Survey::of(mesh, invalid)?;

    let mut triangles = zeroed(all.kept, "the triangles")?;
    let mut primitives = zeroed(all.kept, "the ids of triangles")?;
    let mut references = zeroed(all.kept, "the boxes of triangles")?;
    let mut rests = (&mut triangles[..], &mut primitives[..], &mut references[..]);
    let mut before = 0;
    let mut jobs = reserved(parts.len(), "the parts of the mesh")?;
    let chunks = (0..primitive_count).step_by(CHUNK).zip(indices.chunks(CHUNK));
    for ((first, indices), Census { kept, .. }) in chunks.zip(parts) {
        let (triangles, rest) = rests.0.split_at_mut(kept);
        rests.0 = rest;
        let (primitives, rest) = rests.1.split_at_mut(kept);
        rests.1 = rest;
        let (references, rest) = rests.2.split_at_mut(kept);
        rests.2 = rest;
        jobs.push(Part { first, indices, before, triangles, primitives, references });
        before += kept as u32;
    }
    each(jobs, |part| part.fill(positions, normal_exponent, scale_exponent));
    Ok(Gathered {
        triangles,
        primitives,
        references,
        scale_exponent,
        exact_references: scale_exponent == normal_exponent,
        primitive_count,
        dropped_degenerate: all.degenerate,
        dropped_invalid: all.invalid,
    })
}

/// The exponent nearest to `normal`, which brings the largest coordinate below 1, that loses no bit of any coordinate;
/// `least` is the smallest magnitude but zero.
fn lossless_exponent<T: Iterator<Item = Triangle>>(normal: i32, least: f32, triangles: impl FnOnce() -> T) -> i32 {
    // Exponent of the least normal number as `exponent` counts, and of the least number.
    const NORMAL: i32 = -125;
    const LEAST: i32 = -149;
    if exponent(least) - normal >= NORMAL {
        return normal;
    }
    let vertices = triangles().flat_map(|triangle| triangle.vertices());
    let coordinates = vertices.flat_map(|p| p.to_array()).filter(|&x| x != 0.0);
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
