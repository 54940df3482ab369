//! What a kernel needs to make rays that leave surfaces itself.

use super::camera::{BIAS, direction_exponents};
use super::{KernelIo, REACH};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use rt_core::BounceRays;
use rt_core::bounce::{Aim, GREATEST_EXPONENT, LEAST_EXPONENT};

/// How rays leave surfaces, as the kernel of `bounce.wgsl` reads it. 96 bytes.
///
/// The kernel makes the bits of [`KernelIo::prepare`], or a ray of kind [`super::KernelRay::HOST`] where it cannot be
/// sure of them.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct KernelBounce {
    /// Unit vector to the middle of the disc that rays go to; 0 where there is none.
    pub middle: Vec3,
    /// 1 where rays go to a disc, 0 where they go about the normal.
    pub disc: u32,
    /// A radius of the disc.
    pub tangent: Vec3,
    /// Seed of the directions.
    pub seed: u32,
    /// Another radius.
    pub bitangent: Vec3,
    /// Consecutive paths whose rays spread evenly: a group.
    pub samples: u32,
    /// [`rt_core::bounce::Scatter::dimension`].
    pub dimension: u32,
    /// Word at which the table of paths begins.
    pub paths: u32,
    /// How many rays to make.
    pub count: u32,
    /// Largest accepted distance.
    pub tmax: f32,
    /// Exponents, as stored in single precision, of the largest coordinate of triangles that the kernel may take on.
    pub coordinates: [u32; 2],
    /// The same of the largest component of directions.
    pub exponents: [u32; 2],
    /// 0: kernels hide results from their compiler behind it.
    pub zero: u32,
    /// Word at which the departures begin.
    pub departures: u32,
    /// [`rt_core::bounce::Scatter::first_group`].
    pub first_group: u32,
    unused: [u32; 5],
}

/// Exponent of 1 as [`KernelIo::bounce`] counts them: 1 is in [2⁻¹, 2⁰) times 2.
const UNIT: i32 = BIAS - 1;

/// Greatest exponent of a distance across the scene from a point of it: local coordinates are less than 1.
const REACH_EXPONENT: i32 = 1;

/// Greatest radius of a disc that a kernel aims at, as a tangent: all but light from everywhere.
const GREATEST_RADIUS: f32 = 1024.0;

/// Least component of a disc's vectors that is not 0: products with points of the disc, at least 2⁻⁴⁹, and all that
/// sums of them leave over, are then multiples of 2⁻¹¹².
const LEAST_COMPONENT: f32 = 1.0 / (1_u64 << 40) as f32;

impl KernelIo<'_> {
    /// How the rays of a stream leave this scene's surfaces; `None` where the host must prepare the rays.
    #[must_use]
    pub fn bounce(&self, rays: &BounceRays) -> Option<KernelBounce> {
        let bounds = self.scene.bounds();
        // The reach is at least half of it.
        let extent = f64::from(bounds.extent().max_element());
        if !self.normalised || !core::ptr::eq(self.scene, &**rays.surfaces.scene()) || extent < 2.0 * REACH[0] {
            return None;
        }
        let exponents = direction_exponents(self.scene.scale_exponent(), REACH_EXPONENT)?;
        // Exponents in given coordinates and, as denormal numbers may be taken for 0, in local ones.
        let scale = self.scene.scale_exponent();
        let least = LEAST_EXPONENT.max(LEAST_EXPONENT - scale);
        let greatest = (GREATEST_EXPONENT - scale).min(0);
        if least > greatest {
            return None;
        }
        let (disc, [middle, tangent, bitangent]) = match rays.scatter.aim {
            Aim::Cosine => (0, [Vec3::ZERO; 3]),
            Aim::Disc { middle, radii: [tangent, bitangent] } => (1, [middle, tangent, bitangent]),
        };
        (disc == 0 || is_plain([middle, tangent, bitangent])).then_some(KernelBounce {
            middle,
            disc,
            tangent,
            seed: rays.scatter.seed,
            bitangent,
            samples: rays.scatter.samples.max(1),
            dimension: rays.scatter.dimension(),
            paths: 0,
            count: rays.len(),
            tmax: f32::MAX,
            coordinates: [least, greatest].map(|exponent| (exponent + UNIT) as u32),
            exponents,
            zero: 0,
            departures: 0,
            first_group: rays.scatter.first_group,
            unused: [0; 5],
        })
    }
}

/// Whether no sum or product that directions to the disc are made of vanishes or overflows, nor do directions.
fn is_plain([middle, tangent, bitangent]: [Vec3; 3]) -> bool {
    let vectors = [middle, tangent, bitangent];
    let large_enough = |c: f32| c == 0.0 || c.abs() >= LEAST_COMPONENT;
    let across = |radius: Vec3| {
        radius.length() <= GREATEST_RADIUS && radius.dot(middle).abs() <= radius.length() * (1.0 / 262_144.0)
    };
    vectors.iter().all(|v| v.to_array().into_iter().all(large_enough))
        && (0.99..1.01).contains(&middle.length())
        && across(tangent)
        && across(bitangent)
}
