//! What a picture is gathered on.

use crate::light::exposure;
use crate::memory::{self, NoMemory};
use glam::Vec3;
use rayon::iter::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};

/// Sums of radiance over the samples of each pixel, row by row.
#[derive(Clone, Debug)]
pub struct Film {
    size: [u32; 2],
    samples: u32,
    sums: Vec<Vec3>,
}

impl Film {
    /// Bytes that each pixel of a picture takes for as long as it is rendered.
    pub const BYTES_PER_PIXEL: u64 = size_of::<Vec3>() as u64;

    /// A black picture.
    ///
    /// # Errors
    /// When there is no memory for it.
    pub fn new(size: [u32; 2], samples: u32) -> Result<Self, NoMemory> {
        let pixels = size[0] as usize * size[1] as usize;
        Ok(Self { size, samples, sums: memory::filled(Vec3::ZERO, pixels, "the picture")? })
    }

    /// Takes the sums of some pixels, each `x | y << 16`, which were black.
    pub fn take(&mut self, pixels: &[u32], sums: &[Vec3]) {
        let width = self.size[0] as usize;
        for (pixel, &sum) in pixels.iter().zip(sums) {
            self.sums[(pixel >> 16) as usize * width + (pixel & 0xffff) as usize] = sum;
        }
    }

    /// Width and height in pixels.
    #[must_use]
    pub const fn size(&self) -> [u32; 2] {
        self.size
    }

    /// The sums, row by row.
    #[must_use]
    pub fn sums(&self) -> &[Vec3] {
        &self.sums
    }

    /// What the sums are to be multiplied with, so that the picture is pleasantly bright.
    #[must_use]
    pub fn scale(&self) -> f32 {
        let mean = 1.0 / self.samples as f32;
        mean * exposure(|| self.sums.iter().map(|&sum| sum * mean))
    }
}

/// Sums of radiance over the samples of each pixel of a wave, in its order.
#[derive(Debug)]
pub(crate) struct WaveSums {
    samples: u32,
    sums: Vec<Vec3>,
}

/// Rays shaded at once: enough to occupy every core, few enough that their 20 bytes each do not count as memory.
const SHADE_BATCH: usize = 1 << 18;

impl WaveSums {
    pub(crate) fn new(pixels: usize, samples: u32) -> Result<Self, NoMemory> {
        Ok(Self { samples, sums: memory::filled(Vec3::ZERO, pixels, "the pixels of a wave")? })
    }

    /// Adds what `shade` returns for `0..count`, in that order: the number of a path in the wave, and its radiance.
    ///
    /// Shading runs on all cores, adding does not, so that sums are the same bits on every machine.
    pub(crate) fn add_all(&mut self, count: usize, shade: impl Fn(usize) -> Option<(u32, Vec3)> + Sync) {
        for first in (0..count).step_by(SHADE_BATCH) {
            let batch = first..count.min(first + SHADE_BATCH);
            let shaded: Vec<Option<(u32, Vec3)>> = batch.into_par_iter().with_min_len(1024).map(&shade).collect();
            for (path, radiance) in shaded.into_iter().flatten() {
                self.sums[(path / self.samples) as usize] += radiance;
            }
        }
    }

    pub(crate) fn into_sums(self) -> Vec<Vec3> {
        self.sums
    }
}
