//! Ray streams: camera rays in waves that fit the memory, and the diffuse and shadow rays that follow from their hits.
//!
//! All functions are pure: a ray depends on the seed, the number of the ray it comes from and the bounce, never on
//! threads or chunks. So a caller may cut the hits of a stream into ranges, spawn from them in parallel and append
//! the results in order.

mod spawn;

pub use spawn::{Spawned, Spawner, Sun};

use rt_core::{Camera, CameraRays, morton};
use std::error::Error;
use std::fmt;
use std::sync::Arc;

/// Largest width and height of an image in pixels: a pixel's position is packed into two times 16 bits.
pub const MAX_SIDE: u32 = 1 << 16;

/// The primary rays of the pixels `pixels` (each `x | y << 16`, see [`waves`]) of an image of `size` pixels, `samples`
/// rays for each pixel; 0 samples are treated as 1.
#[must_use]
pub fn primary(camera: Camera, size: [u32; 2], samples: u32, seed: u32, pixels: Arc<[u32]>) -> CameraRays {
    CameraRays { camera, size, pixels, samples: samples.max(1), seed }
}

/// Cuts an image of `size` pixels into waves: consecutive parts of the Z-curve, each of so few pixels that
/// `samples` rays for each pixel at `bytes_per_ray` bytes stay within `memory_limit` bytes.
///
/// The waves are as equal in size as can be, since the tail of every wave leaves devices idle. A wave has at least one
/// pixel, whatever the limit, and its rays can be numbered in 32 bits.
///
/// # Errors
/// When a side of the image is 0 or more than [`MAX_SIDE`].
pub fn waves(
    size: [u32; 2],
    samples: u32,
    bytes_per_ray: u64,
    memory_limit: u64,
) -> Result<Vec<Arc<[u32]>>, ImageSizeError> {
    if size.iter().any(|side| !(1..=MAX_SIDE).contains(side)) {
        return Err(ImageSizeError { size });
    }
    let order = morton::pixel_order(size[0], size[1]);
    let rays = (memory_limit / bytes_per_ray.max(1)).min(u64::from(u32::MAX));
    let most = usize::try_from(rays / u64::from(samples.max(1))).unwrap_or(usize::MAX).max(1);
    let count = order.len().div_ceil(most);
    // Sizes differ by at most one pixel.
    let start = |wave: usize| (wave as u128 * order.len() as u128 / count as u128) as usize;
    Ok((0..count).map(|wave| Arc::from(&order[start(wave)..start(wave + 1)])).collect())
}

/// An image has a side of 0 or of more than [`MAX_SIDE`] pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageSizeError {
    /// Width and height in pixels.
    pub size: [u32; 2],
}

impl fmt::Display for ImageSizeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [width, height] = self.size;
        write!(f, "an image of {width} x {height} pixels: choose a width and a height from 1 to {MAX_SIDE}")
    }
}

impl Error for ImageSizeError {}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use proptest::prelude::*;

    proptest! {
        /// Guards: waves cover the Z-curve once, in order, within the limit. Fails when the count is rounded down.
        #[test]
        fn waves_cover_the_image_in_order_within_the_limit(
            width in 1..70_u32, height in 1..70_u32, samples in 0..9_u32, bytes in 0..99_u64, limit in 0..200_000_u64,
        ) {
            let waves = waves([width, height], samples, bytes, limit).unwrap();
            prop_assert_eq!(waves.concat(), morton::pixel_order(width, height));
            let per_pixel = u64::from(samples.max(1)) * bytes.max(1);
            prop_assert!(waves.iter().all(|w| w.len() == 1 || w.len() as u64 * per_pixel <= limit));
            let sizes = || waves.iter().map(|w| w.len());
            prop_assert!(sizes().max().unwrap() - sizes().min().unwrap() <= 1);
            // As few as possible.
            let most = (limit / per_pixel).max(1);
            prop_assert_eq!(waves.len() as u64, u64::from(width * height).div_ceil(most));
        }
    }

    #[test]
    fn rays_of_a_wave_can_be_numbered_and_bad_sizes_are_refused() {
        let waves = waves([3, 1], u32::MAX / 2, 1, u64::MAX).unwrap();
        assert_eq!(waves.iter().map(|w| w.len()).collect::<Vec<_>>(), [1, 2]);
        for size in [[0, 5], [5, 0], [MAX_SIDE + 1, 1]] {
            let error = super::waves(size, 1, 1, 1).unwrap_err();
            assert!(error.to_string().contains("choose"), "{error}");
        }
    }

    #[test]
    fn waves_together_send_the_rays_of_the_whole_image() {
        let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, Vec3::Y, 40.0).unwrap();
        let rays = |pixels| {
            let rays = primary(camera, [13, 7], 4, 1, pixels);
            (0..rays.len()).map(|i| rays.ray(i)).collect::<Vec<_>>()
        };
        let whole = rays(waves([13, 7], 4, 1, u64::MAX).unwrap().swap_remove(0));
        let parts: Vec<_> = waves([13, 7], 4, 1, 60).unwrap().into_iter().flat_map(rays).collect();
        assert_eq!(whole, parts);
    }
}
