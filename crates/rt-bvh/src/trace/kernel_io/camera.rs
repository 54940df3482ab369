//! What a kernel needs to make camera rays itself.

use super::{GREATEST_EXPONENT, KernelIo, LEAST_EXPONENT, REACH, exponent_of};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use rt_core::{CameraRays, Ray};

/// A camera as the kernel of `camera.wgsl` reads it. 112 bytes.
///
/// The kernel makes the bits of [`KernelIo::prepare`], or a ray of kind [`super::KernelRay::HOST`] where it cannot be
/// sure of them.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct KernelCamera {
    /// Where all rays start, in local coordinates.
    pub origin: Vec3,
    /// Rays per pixel.
    pub samples: u32,
    /// Along the view, in given coordinates, as are the image's axes.
    pub forward: Vec3,
    /// Seed of the positions inside a pixel.
    pub seed: u32,
    /// Half the image's width, for a square image.
    pub right: Vec3,
    /// Word at which the table of the rays' numbers begins.
    pub numbers: u32,
    /// Half the image's height.
    pub up: Vec3,
    /// How many rays to make.
    pub count: u32,
    /// [`rt_core::Raster::pixel`].
    pub pixel: [f32; 2],
    /// [`rt_core::Raster::aspect`].
    pub aspect: f32,
    /// Largest accepted distance.
    pub tmax: f32,
    /// Exponents, as stored in single precision, of the largest component of directions that the kernel may take on.
    pub exponents: [u32; 2],
    /// 0: kernels hide results from their compiler behind it.
    pub zero: u32,
    /// Word at which the pixels begin.
    pub pixels: u32,
    /// Number of the first of a pixel's rays among its samples.
    pub first_sample: u32,
    /// Not 0 if rays go through the centres of their pixels.
    pub is_centred: u32,
    unused: [u32; 2],
}

/// Exponents within which no product of the kernel's vanishes or overflows that matters to the direction: beside a
/// largest component of 2⁻⁶³, what a device drops as denormal is below a half unit of everything that it takes on.
const EXPONENTS: [i32; 2] = [-63, 63];

/// As single precision stores it.
pub(super) const BIAS: i32 = 127;

/// Exponents, as stored in single precision, of the largest component of directions that a kernel may take on, where
/// distances have at most the exponent `reach`; `None` if there is none.
pub(super) fn direction_exponents(scene: i32, reach: i32) -> Option<[u32; 2]> {
    // Where s is the scene's exponent and d the direction's, `prepare` asks that LEAST_EXPONENT ≤ s − d, and that
    // s − d + the reach's exponent < GREATEST_EXPONENT.
    let least = (scene + reach - GREATEST_EXPONENT + 1).max(EXPONENTS[0]);
    let greatest = (scene - LEAST_EXPONENT).min(EXPONENTS[1]);
    (least <= greatest).then(|| [least, greatest].map(|exponent| (exponent + BIAS) as u32))
}

impl KernelIo<'_> {
    /// The camera of a stream; `None` where the host must prepare the rays.
    #[must_use]
    pub fn camera(&self, rays: &CameraRays) -> Option<KernelCamera> {
        if !self.normalised {
            return None;
        }
        let local = self.frame.localize(&Ray::new(rays.camera.eye(), rays.camera.forward()))?;
        let reach = f64::from(local.reach);
        let exponents = direction_exponents(local.scale_exponent, exponent_of(reach))?;
        let raster = rays.raster();
        let counted = rays.samples > 0 && raster.aspect.is_finite() && raster.pixel.iter().all(|side| side.is_finite());
        if !(REACH[0]..=REACH[1]).contains(&reach) || !counted {
            return None;
        }
        let [right, up] = rays.camera.image_axes();
        Some(KernelCamera {
            origin: local.origin,
            samples: rays.samples,
            forward: rays.camera.forward(),
            seed: rays.seed,
            right,
            numbers: 0,
            up,
            count: rays.len(),
            pixel: raster.pixel,
            aspect: raster.aspect,
            tmax: f32::MAX,
            exponents,
            zero: 0,
            pixels: 0,
            first_sample: rays.first_sample,
            is_centred: rays.is_centred().into(),
            unused: [0; 2],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BuildOptions, Mesh, build};
    use alloc::sync::Arc;
    use rt_core::{Camera, Scene};

    fn scene(size: f32) -> Arc<Scene> {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p * size);
        build(Mesh { positions: &positions, indices: &[[0, 1, 2]] }, &BuildOptions::default()).expect("valid").scene
    }

    fn rays(eye: f32, samples: u32) -> CameraRays {
        let camera = Camera::look_at(Vec3::splat(eye), Vec3::ZERO, Vec3::Y, 40.0).expect("valid");
        CameraRays {
            camera,
            size: [4, 4],
            pixels: (0..16).map(|i| (i % 4) | ((i / 4) << 16)).collect(),
            samples,
            first_sample: 0,
            all_samples: samples,
            seed: 1,
        }
    }

    /// Where the host may not prepare a single ray for the kernel, the kernel makes none. Fails when the reach is not
    /// looked at.
    #[test]
    fn extreme_places_are_left_to_the_host() {
        for (size, eye, made) in
            [(1.0, 1.0, true), (1e30, 1e30, true), (1e-30, 1e-30, true), (1.0, 1e30, false), (1e-30, 1.0, false)]
        {
            let scene = scene(size);
            let io = KernelIo::new(&scene);
            assert_eq!(io.camera(&rays(eye, 1)).is_some(), made, "{size:e} {eye:e}");
            let prepared = (0..16).map(|i| io.prepare(&rays(eye, 1).ray(i), u32::MAX));
            assert_eq!(prepared.into_iter().any(|ray| ray.kind < super::super::KernelRay::MISS), made);
        }
        let scene = scene(1.0);
        assert!(KernelIo::new(&scene).camera(&CameraRays { size: [0, 4], ..rays(1.0, 1) }).is_none());
        assert!(KernelIo::new(&scene).camera(&rays(1.0, 0)).is_none());
    }
}
