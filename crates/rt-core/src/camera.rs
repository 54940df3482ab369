//! A pinhole camera and the rays it sends, addressable by number.

use crate::{Ray, random};
use alloc::sync::Arc;
use core::fmt;
use glam::Vec3;

/// A pinhole camera: where it stands, what it looks at, which way is up, and its vertical field of view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    eye: Vec3,
    forward: Vec3,
    /// Half the image's width and height at distance 1, along the image axes, for a square image.
    right: Vec3,
    up: Vec3,
}

impl Camera {
    /// A camera at `eye` that looks at `target`, with a vertical field of view in degrees.
    ///
    /// # Errors
    /// When a coordinate is not finite, `eye` equals `target`, `up` is zero or along the view, or the field of view
    /// is not between 0 and 180 degrees (both exclusive).
    pub fn look_at(eye: Vec3, target: Vec3, up: Vec3, fov_degrees: f32) -> Result<Self, CameraError> {
        if !(eye.is_finite() && target.is_finite() && up.is_finite()) {
            return Err(CameraError::NotFinite);
        }
        if !(fov_degrees > 0.0 && fov_degrees < 180.0) {
            return Err(CameraError::FieldOfView(fov_degrees));
        }
        // In double precision, so that scenes measured in nanometres or light years work alike.
        let forward = (target.as_dvec3() - eye.as_dvec3()).try_normalize().ok_or(CameraError::NoDirection)?;
        let up = up.as_dvec3().try_normalize().ok_or(CameraError::NoUp)?;
        let right = forward.cross(up);
        if right.length() < 1e-6 {
            return Err(CameraError::NoUp);
        }
        let right = right.normalize();
        let half = libm::tan(f64::from(fov_degrees).to_radians() / 2.0);
        Ok(Self {
            eye,
            forward: forward.as_vec3(),
            right: (right * half).as_vec3(),
            up: (right.cross(forward) * half).as_vec3(),
        })
    }

    /// Where the camera stands.
    #[must_use]
    pub const fn eye(&self) -> Vec3 {
        self.eye
    }

    /// Unit vector along the view.
    #[must_use]
    pub const fn forward(&self) -> Vec3 {
        self.forward
    }

    /// Half the image's width and height at distance 1 for a square image, as vectors to its right and upwards.
    #[must_use]
    pub const fn image_axes(&self) -> [Vec3; 2] {
        [self.right, self.up]
    }

    /// The ray through image position `(x, y)` in `[0, 1]²`, `(0, 0)` the upper left corner, of an image `aspect`
    /// times as wide as high.
    ///
    /// The direction is not normalised: its component along the view is 1, so `t` is the depth. Only multiplications
    /// and additions, so that a device can make the very same bits.
    #[must_use]
    pub fn ray(&self, x: f32, y: f32, aspect: f32) -> Ray {
        let across = (2.0 * x - 1.0) * aspect;
        let upward = 1.0 - 2.0 * y;
        Ray::new(self.eye, self.forward + self.right * across + self.up * upward)
    }
}

/// Why [`Camera::look_at`] refused its arguments.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum CameraError {
    /// A coordinate is NaN or infinite.
    NotFinite,
    /// Eye and target are one point.
    NoDirection,
    /// The up vector is zero or along the view.
    NoUp,
    /// The field of view, in degrees, is not between 0 and 180.
    FieldOfView(f32),
}

impl fmt::Display for CameraError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite => write!(f, "eye, target and up must be finite"),
            Self::NoDirection => write!(f, "eye and target are the same point: move one of them"),
            Self::NoUp => write!(f, "up is zero or along the view: choose another up vector"),
            Self::FieldOfView(fov) => write!(f, "field of view {fov} is not between 0 and 180 degrees"),
        }
    }
}

impl core::error::Error for CameraError {}

/// The primary rays of an image or a part of it, made on demand from their number.
///
/// Ray `i` belongs to pixel `pixels[i / samples]`, so with `pixels` in Z-curve order a contiguous range of rays is a
/// compact region of the screen. An image may be made of several of these with some of each pixel's samples: the rays
/// are the same as those of one with all of them.
#[derive(Clone, Debug)]
pub struct CameraRays {
    /// The camera.
    pub camera: Camera,
    /// Size of the whole image in pixels.
    pub size: [u32; 2],
    /// Pixels to cover, each `x | y << 16`, in the order of the rays.
    pub pixels: Arc<[u32]>,
    /// Rays per pixel, at least 1.
    pub samples: u32,
    /// Number of the first of them among all of the pixel.
    pub first_sample: u32,
    /// Rays per pixel of the whole image. A single one goes through the pixel's centre.
    pub all_samples: u32,
    /// Seed of the positions inside a pixel.
    pub seed: u32,
}

impl CameraRays {
    /// Number of rays; saturates at `u32::MAX`.
    #[must_use]
    pub fn len(&self) -> u32 {
        u32::try_from(self.pixels.len() as u64 * u64::from(self.samples)).unwrap_or(u32::MAX)
    }

    /// Whether there is no ray.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Ray number `index`, which must be below [`CameraRays::len`].
    #[must_use]
    pub fn ray(&self, index: u32) -> Ray {
        let mut ray = [Ray::new(Vec3::ZERO, Vec3::ZERO)];
        self.rays(index, &mut ray);
        ray[0]
    }

    /// As many rays as there is room for, from number `first` on, which must all be below [`CameraRays::len`]. What
    /// they have in common is computed once.
    pub fn rays(&self, first: u32, rays: &mut [Ray]) {
        let raster = self.raster();
        if self.is_centred() {
            let pixels = &self.pixels[first as usize..][..rays.len()];
            rays.iter_mut().zip(pixels).for_each(|(ray, &pixel)| *ray = self.through(raster, pixel, [0.5, 0.5]));
            return;
        }
        let (mut pixel, mut sample) = ((first / self.samples) as usize, first % self.samples);
        for ray in rays {
            let here = self.pixels[pixel];
            *ray = self.through(raster, here, self.place(here, sample));
            sample += 1;
            if sample == self.samples {
                (pixel, sample) = (pixel + 1, 0);
            }
        }
    }

    /// The rays with these numbers, which must all be below [`CameraRays::len`], in as many places. What they have in
    /// common is computed once.
    pub fn rays_of(&self, numbers: &[u32], rays: &mut [Ray]) {
        let raster = self.raster();
        for (ray, &number) in rays.iter_mut().zip(numbers) {
            let pixel = self.pixels[(number / self.samples) as usize];
            let place = if self.is_centred() { [0.5, 0.5] } else { self.place(pixel, number % self.samples) };
            *ray = self.through(raster, pixel, place);
        }
    }

    /// Where one of the samples lies in a pixel.
    fn place(&self, pixel: u32, sample: u32) -> [f32; 2] {
        random::spread_pair(self.seed, pixel, 0, self.first_sample + sample)
    }

    /// The ray through a place in a pixel.
    #[inline(always)]
    fn through(&self, raster: Raster, pixel: u32, [dx, dy]: [f32; 2]) -> Ray {
        let Raster { pixel: [width, height], aspect } = raster;
        let (x, y) = ((pixel & 0xffff) as f32, (pixel >> 16) as f32);
        self.camera.ray((x + dx) * width, (y + dy) * height, aspect)
    }

    /// Whether there is one ray for each pixel of the image, through its centre.
    #[must_use]
    pub const fn is_centred(&self) -> bool {
        self.all_samples <= 1
    }

    /// The number of a ray's path among those of the whole image's samples of these pixels: pixel by pixel, and for
    /// each sample by sample.
    #[must_use]
    pub const fn path(&self, ray: u32) -> u32 {
        if self.samples == self.all_samples {
            return ray;
        }
        ray / self.samples * self.all_samples + self.first_sample + ray % self.samples
    }

    /// The factors from pixels to image positions.
    #[must_use]
    pub fn raster(&self) -> Raster {
        let [width, height] = self.size.map(|n| n as f32);
        Raster { pixel: [1.0 / width, 1.0 / height], aspect: width / height }
    }
}

/// What turns pixels into image positions without a division: devices need not divide as IEEE 754 says, but multiply
/// so.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Raster {
    /// Width and height of a pixel, the image being 1 wide and 1 high.
    pub pixel: [f32; 2],
    /// Width of the image divided by its height.
    pub aspect: f32,
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;
    use alloc::vec::Vec;

    #[test]
    fn the_centre_looks_at_the_target_and_up_is_up() {
        let camera = Camera::look_at(Vec3::new(0.0, 1.0, 5.0), Vec3::Y, Vec3::Y, 90.0).expect("valid");
        assert!(camera.ray(0.5, 0.5, 2.0).direction.abs_diff_eq(Vec3::NEG_Z, 1e-6));
        assert!(camera.ray(0.5, 0.0, 1.0).direction.abs_diff_eq(Vec3::new(0.0, 1.0, -1.0), 1e-6));
        assert!(camera.ray(1.0, 0.5, 2.0).direction.abs_diff_eq(Vec3::new(2.0, 0.0, -1.0), 1e-6));
    }

    /// Mutants: the sample of the first of several rays is taken for 0; the next pixel's first sample for its second;
    /// all samples gathered for the first.
    #[test]
    fn rays_are_the_same_one_by_one_and_together() {
        let camera = Camera::look_at(Vec3::new(0.0, 1.0, 5.0), Vec3::Y, Vec3::Y, 60.0).expect("valid");
        for samples in [1, 2, 5] {
            let pixels = [0, 1 | 2 << 16, 7, 3 << 16, 5].into();
            let source =
                CameraRays { camera, size: [8, 4], pixels, samples, first_sample: 0, all_samples: samples, seed: 3 };
            let alone: Vec<Ray> = (0..source.len()).map(|i| source.ray(i)).collect();
            assert!(samples == 1 || alone[0].direction != alone[1].direction);
            for first in 0..source.len() {
                for last in first..=source.len() {
                    let mut rays = vec![Ray::new(Vec3::ZERO, Vec3::ZERO); (last - first) as usize];
                    source.rays(first, &mut rays);
                    assert_eq!(rays, alone[first as usize..last as usize], "{samples}: {first}..{last}");
                }
            }
            let some: Vec<u32> = (0..source.len()).rev().step_by(3).collect();
            let mut rays = vec![Ray::new(Vec3::ZERO, Vec3::ZERO); some.len()];
            source.rays_of(&some, &mut rays);
            assert!(some.iter().zip(&rays).all(|(&number, ray)| *ray == alone[number as usize]), "{samples}");
        }
    }

    /// Mutants: a part's samples numbered from 0; a single one of several sent through the centre; paths numbered
    /// within the part.
    #[test]
    fn parts_of_the_samples_are_the_rays_of_the_whole() {
        let camera = Camera::look_at(Vec3::new(0.0, 1.0, 5.0), Vec3::Y, Vec3::Y, 60.0).expect("valid");
        let pixels: Arc<[u32]> = [0, 1 | 2 << 16, 7].into();
        let of = |first_sample, samples| {
            let pixels = Arc::clone(&pixels);
            CameraRays { camera, size: [8, 4], pixels, samples, first_sample, all_samples: 5, seed: 3 }
        };
        let whole = of(0, 5);
        for (first, samples) in [(0, 1), (1, 2), (3, 2), (4, 1), (0, 5)] {
            let part = of(first, samples);
            for ray in 0..part.len() {
                let path = ray / samples * 5 + first + ray % samples;
                assert_eq!((part.path(ray), part.ray(ray)), (path, whole.ray(path)), "{first} {samples} {ray}");
            }
        }
    }

    #[test]
    fn bad_cameras_are_refused_with_a_reason() {
        let look = |eye, target, up, fov| Camera::look_at(eye, target, up, fov).expect_err("invalid");
        assert_eq!(look(Vec3::X, Vec3::X, Vec3::Y, 40.0), CameraError::NoDirection);
        assert_eq!(look(Vec3::ZERO, Vec3::Y, Vec3::Y, 40.0), CameraError::NoUp);
        assert_eq!(look(Vec3::ZERO, Vec3::X, Vec3::Y, 180.0), CameraError::FieldOfView(180.0));
        assert_eq!(look(Vec3::NAN, Vec3::X, Vec3::Y, 40.0), CameraError::NotFinite);
    }
}
