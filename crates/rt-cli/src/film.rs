//! What a picture is gathered on, and how it becomes a file.

use crate::memory;
use crate::shade::exposure;
use anyhow::Result;
use glam::Vec3;
use rayon::iter::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};
use rt_report::image;
use std::path::Path;

/// Sums of radiance over the samples of each pixel, row by row.
#[derive(Clone, Debug)]
pub(crate) struct Film {
    size: [u32; 2],
    samples: u32,
    sums: Vec<Vec3>,
}

/// Rays shaded at once: enough to occupy every core, few enough that their 20 bytes each do not count as memory.
const SHADE_BATCH: usize = 1 << 18;

impl Film {
    /// Bytes that each pixel of a picture takes for as long as it is rendered.
    pub(crate) const BYTES_PER_PIXEL: u64 = size_of::<Vec3>() as u64;

    /// A black picture.
    pub(crate) fn new(size: [u32; 2], samples: u32) -> Result<Self> {
        let pixels = size[0] as usize * size[1] as usize;
        Ok(Self { size, samples, sums: memory::filled(Vec3::ZERO, pixels, "the picture")? })
    }

    /// Makes it black again.
    pub(crate) fn clear(&mut self) {
        self.sums.fill(Vec3::ZERO);
    }

    /// Adds what `shade` returns for `0..count`, in that order: a pixel (`x | y << 16`) and its radiance.
    ///
    /// Shading runs on all cores, adding does not, so that sums are the same bits on every machine.
    pub(crate) fn add_all(&mut self, count: usize, shade: impl Fn(usize) -> Option<(u32, Vec3)> + Sync) {
        let width = self.size[0] as usize;
        for first in (0..count).step_by(SHADE_BATCH) {
            let batch = first..count.min(first + SHADE_BATCH);
            let shaded: Vec<Option<(u32, Vec3)>> = batch.into_par_iter().with_min_len(1024).map(&shade).collect();
            for (pixel, radiance) in shaded.into_iter().flatten() {
                self.sums[(pixel >> 16) as usize * width + (pixel & 0xffff) as usize] += radiance;
            }
        }
    }

    /// Writes the picture, exposed so that it is pleasantly bright.
    pub(crate) fn write_png(&self, path: &Path) -> Result<()> {
        let mean = 1.0 / self.samples as f32;
        let exposure = exposure(|| self.sums.iter().map(|&sum| sum * mean));
        Ok(image::write_png(path, self.size, &self.sums, mean * exposure)?)
    }
}
