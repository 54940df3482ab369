//! What a kernel on a device without double precision needs from the host: prepared rays, and finished hits.
//!
//! Such a kernel tests the same boxes as [`crate::trace()`], bit for bit, since divisions and scalings are made here,
//! on the host. It decides which triangle is hit; t, u and v are recomputed here from ray and triangle.

mod bounce;
mod camera;

pub use bounce::KernelBounce;
pub use camera::KernelCamera;

use super::slabs::Frame;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use rt_core::intersect::{Shear, shear_axes};
use rt_core::{Aabb, Hit, Ray, Scene};

/// A ray as kernels read it, in local coordinates; distances are in units of a direction whose largest component is in
/// [1, 2). 64 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct KernelRay {
    /// Where `t = 0`.
    pub origin: Vec3,
    /// Smallest accepted distance; finite.
    pub tmin: f32,
    /// One over the direction, whose small components are raised to 2⁻⁶⁰.
    pub reciprocal: Vec3,
    /// Largest accepted distance; finite.
    pub tmax: f32,
    /// The two shear factors, each as a sum of two numbers.
    pub shear: [f32; 4],
    /// One over the dominant component of the direction, as a sum of two numbers.
    pub depth: [f32; 2],
    /// The primitive that the ray starts on and must not hit; `u32::MAX`: none.
    pub excluded: u32,
    /// The dominant axis, or [`KernelRay::MISS`] or [`KernelRay::HOST`].
    pub kind: u32,
}

impl KernelRay {
    /// The ray hits nothing: it is invalid. It costs no test.
    pub const MISS: u32 = 4;
    /// The ray's numbers are so large or small that only the host may trace it.
    pub const HOST: u32 = 8;

    const fn of_kind(kind: u32) -> Self {
        Self {
            origin: Vec3::ZERO,
            tmin: 0.0,
            reciprocal: Vec3::ONE,
            tmax: 0.0,
            shear: [0.0; 4],
            depth: [0.0; 2],
            excluded: u32::MAX,
            kind,
        }
    }
}

/// Prepares rays for a scene's kernel and finishes its hits.
#[derive(Debug)]
pub struct KernelIo<'a> {
    scene: &'a Scene,
    frame: Frame,
    /// Whether no coordinate is greater than 1, which error bounds of kernels count with. It may be where the scene's
    /// smallest coordinates could not be scaled down.
    normalised: bool,
}

/// Smallest and largest distance across the scene, in local units, for which single-precision products in a kernel's
/// error bounds neither vanish nor overflow: the bounds of the filter on processors, but that kernels may flush
/// denormal numbers to zero: 3 · 2⁻¹²⁶ in an edge function, far below the filter's margin of 5·u²·m² for m from 2⁻³⁶
/// on.
const REACH: [f64; 2] = [1.0 / (1_u64 << 36) as f64, (1_u64 << 60) as f64];

/// Smallest exponent of the factor from local to given distances. A kernel leaves distances below 2⁻²⁴ to the host, so
/// that those it decides on stay normal numbers when they are scaled.
const LEAST_EXPONENT: i32 = -100;

/// Largest exponent of a given distance.
const GREATEST_EXPONENT: i32 = 125;

impl<'a> KernelIo<'a> {
    /// For rays and hits of `scene`.
    #[must_use]
    pub fn new(scene: &'a Scene) -> Self {
        let Aabb { min, max } = scene.bounds();
        let normalised = scene.triangles().is_empty() || (min.cmpge(Vec3::NEG_ONE) & max.cmple(Vec3::ONE)).all();
        Self { scene, frame: Frame::of(scene), normalised }
    }

    /// The scene's box, in local coordinates, as a kernel needs it beside the rays.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.scene.bounds()
    }

    /// The ray as kernels read it.
    #[must_use]
    pub fn prepare(&self, ray: &Ray, excluded: u32) -> KernelRay {
        let Some(local) = self.frame.localize(ray) else {
            return KernelRay::of_kind(KernelRay::MISS);
        };
        let reach = f64::from(local.reach);
        let scale = exponent_of(local.t_scale);
        let range = [ray.tmin, ray.tmax].map(|t| exactly_scaled(t, local.t_unscale));
        let ([Some(tmin), Some(tmax)], true, true, true) = (
            range,
            self.normalised,
            (REACH[0]..=REACH[1]).contains(&reach),
            scale >= LEAST_EXPONENT && scale + exponent_of(reach) < GREATEST_EXPONENT,
        ) else {
            return KernelRay::of_kind(KernelRay::HOST);
        };
        let [x, y, z] = shear_axes(ray.direction);
        let [shear_x, shear_y] = [x, y].map(|axis| in_two(ray.direction[axis], ray.direction[z]));
        KernelRay {
            origin: local.origin,
            tmin,
            reciprocal: local.slabs.reciprocal(),
            tmax,
            shear: [shear_x[0], shear_x[1], shear_y[0], shear_y[1]],
            depth: in_two(1.0, local.direction[z]),
            excluded,
            kind: z as u32,
        }
    }

    /// The hit of `ray` with the triangle at `slot` of the leaf order: the bits that [`crate::trace()`] reports for
    /// that pair. `None` where there is none, which a sound kernel never claims.
    #[must_use]
    pub fn finish(&self, ray: &Ray, slot: u32) -> Option<Hit> {
        let triangle = self.scene.triangles().get(slot as usize).filter(|_| ray.is_valid())?;
        let shear = Shear::new(ray, self.scene.scale_exponent(), f64::INFINITY);
        shear.hit(triangle, [ray.tmin, ray.tmax], self.scene.primitives().get(slot as usize))
    }
}

/// The `e` with 2^e ≤ x < 2^(e + 1), for a positive `x` that is not denormal.
const fn exponent_of(x: f64) -> i32 {
    (x.to_bits() >> 52) as i32 - 1023
}

/// `t · factor`, a power of two, if both are 0 or normal, or the latter beyond every distance; overflow gives the
/// largest number.
fn exactly_scaled(t: f32, factor: f64) -> Option<f32> {
    let scaled = f64::from(t) * factor;
    let largest = f64::from(f32::MAX);
    (t == 0.0 || !t.is_subnormal() && scaled.abs() >= f64::from(f32::MIN_POSITIVE))
        .then(|| scaled.clamp(-largest, largest) as f32)
}

/// `a / b` as the sum of two single-precision numbers: the quotient rounded, and the quotient of what it left over,
/// rounded. Off by at most half a unit in the second one's last place, 2⁻⁴⁹ of the quotient, and so defined that
/// devices without double precision can make the same bits.
///
/// Double precision has more than twice as many bits as single, and two more: so quotients that are rounded twice are
/// rounded right (S. A. Figueroa, *When is Double Rounding Innocuous?*, 1995). The rest is exact, and its own bits fit
/// single precision.
fn in_two(a: f32, b: f32) -> [f32; 2] {
    let [a, b] = [a, b].map(f64::from);
    let quotient = (a / b) as f32;
    // Adding zero turns −0 into +0.
    [quotient, ((a - b * f64::from(quotient)) / b) as f32 + 0.0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BuildOptions, Mesh, build};
    use alloc::sync::Arc;

    fn scene() -> Arc<Scene> {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p * 3.0);
        build(Mesh { positions: &positions, indices: &[[0, 1, 2]] }, &BuildOptions::default()).expect("valid").scene
    }

    #[test]
    fn ordinary_rays_go_to_the_kernel_and_extreme_ones_to_the_host() {
        let scene = scene();
        let io = KernelIo::new(&scene);
        let ray = Ray::new(Vec3::new(0.5, 0.5, 2.0), Vec3::new(0.1, 0.0, -3.0));
        let prepared = io.prepare(&ray, 7);
        assert_eq!((prepared.kind, prepared.excluded, prepared.tmax), (2, 7, f32::MAX));
        let factor = f64::from(prepared.shear[0]) + f64::from(prepared.shear[1]);
        assert!((factor - f64::from(0.1_f32) / -3.0).abs() < 1e-15);
        let kind = |ray: Ray| io.prepare(&ray, u32::MAX).kind;
        assert_eq!(kind(Ray::new(ray.origin, Vec3::ZERO)), KernelRay::MISS);
        assert_eq!(kind(Ray::new(Vec3::splat(1e30), ray.direction)), KernelRay::HOST);
        assert_eq!(kind(Ray::new(ray.origin, ray.direction * 1e35)), KernelRay::HOST);
        assert_eq!(kind(ray.with_range(1e-44, 1.0)), KernelRay::HOST);
    }

    #[test]
    fn finished_hits_are_those_of_the_traversal() {
        let scene = scene();
        let ray = Ray::new(Vec3::new(0.5, 0.7, 2.0), Vec3::new(0.01, 0.02, -3.0));
        let mut expected = Hit::MISS;
        let rays = core::iter::once((ray, u32::MAX));
        let mut stack = crate::Stack::for_scene(&scene);
        crate::trace(&scene, &mut stack, rt_core::StreamSpec::default(), rays, |hit, _| expected = hit);
        assert!(expected.is_hit());
        assert_eq!(KernelIo::new(&scene).finish(&ray, 0), Some(expected));
        assert_eq!(KernelIo::new(&scene).finish(&ray, 1), None);
    }
}
