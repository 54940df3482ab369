//! What a picture is gathered on.

use crate::light::exposure;
use crate::memory::{self, NoMemory};
use glam::Vec3;
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use std::ops::Range;

/// Sums of radiance over the samples of each pixel, row by row.
#[derive(Clone, Debug)]
pub struct Film {
    size: [u32; 2],
    sums: Vec<Vec3>,
}

impl Film {
    /// Bytes that each pixel of a picture takes for as long as it is rendered.
    pub const BYTES_PER_PIXEL: u64 = size_of::<Vec3>() as u64;

    /// A black picture.
    ///
    /// # Errors
    /// When there is no memory for it.
    pub fn new(size: [u32; 2]) -> Result<Self, NoMemory> {
        let pixels = size[0] as usize * size[1] as usize;
        Ok(Self { size, sums: memory::filled(Vec3::ZERO, pixels, "the picture")? })
    }

    /// The sums of some pixels, each `x | y << 16`, so far.
    #[must_use]
    pub fn sums_of(&self, pixels: &[u32]) -> Vec<Vec3> {
        pixels.iter().map(|&pixel| self.sums[self.place(pixel)]).collect()
    }

    fn place(&self, pixel: u32) -> usize {
        (pixel >> 16) as usize * self.size[0] as usize + (pixel & 0xffff) as usize
    }

    /// Begins another picture.
    pub fn clear(&mut self) {
        self.sums.fill(Vec3::ZERO);
    }

    /// Takes the sums of some pixels, each `x | y << 16`, in place of those that were there.
    pub fn take(&mut self, pixels: &[u32], sums: &[Vec3]) {
        for (&pixel, &sum) in pixels.iter().zip(sums) {
            let place = self.place(pixel);
            self.sums[place] = sum;
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

    /// The factor that makes the mean of so many samples pleasantly bright.
    #[must_use]
    pub fn exposure(&self, samples: u32) -> f32 {
        let mean = 1.0 / samples as f32;
        exposure(|| self.sums.iter().map(|&sum| sum * mean))
    }
}

/// Radiance of each path of a part.
#[derive(Debug)]
pub(crate) struct Radiance(Vec<Vec3>);

/// Rays that one core shades at a time.
const CHUNK: usize = 1 << 14;

impl Radiance {
    /// Of so many paths, black.
    pub(crate) fn new(paths: usize) -> Result<Self, NoMemory> {
        Ok(Self(memory::filled(Vec3::ZERO, paths, "the paths of a wave")?))
    }

    /// Adds what the rays `0..count` bring: `shade` is given some of them and where it goes. `path` says the place in
    /// the part of a ray's path; the rays go by their paths, one or none for each.
    pub(crate) fn add_all(
        &mut self,
        count: usize,
        path: impl Fn(usize) -> usize,
        shade: impl Fn(Range<usize>, &mut Lit<'_>) + Sync,
    ) {
        for_paths(&mut self.0, count, path, |range, first, radiance| shade(range, &mut Lit { first, radiance }));
    }

    /// Adds that of `samples` paths each to the sums of pixels, path by path: so that sums are the same bits on every
    /// machine, and in whatever parts the samples came.
    pub(crate) fn add_to(self, sums: &mut [Vec3], samples: usize) {
        for (sum, paths) in sums.iter_mut().zip(self.0.chunks(samples.max(1))) {
            paths.iter().for_each(|&radiance| *sum += radiance);
        }
    }
}

/// The radiance of some neighbouring paths.
pub(crate) struct Lit<'a> {
    /// Place of the first in the part.
    first: usize,
    radiance: &'a mut [Vec3],
}

impl Lit<'_> {
    /// Adds to the path at a place of the part.
    pub(crate) fn add(&mut self, path: usize, radiance: Vec3) {
        self.radiance[path - self.first] += radiance;
    }
}

/// Calls `each`, on all cores, with some of the rays `0..count`, the place of the first one's path, and the `values` of
/// the paths from there to that of the next rays. The rays go by their paths, whose places `path` tells.
pub(crate) fn for_paths<T: Send>(
    values: &mut [T],
    count: usize,
    path: impl Fn(usize) -> usize,
    each: impl Fn(Range<usize>, usize, &mut [T]) + Sync,
) {
    let mut chunks = Vec::with_capacity(count.div_ceil(CHUNK));
    let (mut rest, mut first) = (values, 0);
    for begin in (0..count).step_by(CHUNK) {
        let end = count.min(begin + CHUNK);
        let next = if end < count { path(end) } else { first + rest.len() };
        let (own, others) = rest.split_at_mut(next - first);
        chunks.push((begin..end, first, own));
        (rest, first) = (others, next);
    }
    chunks.into_par_iter().for_each(|(rays, first, values)| each(rays, first, values));
}
