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
    /// Samples of each pixel, but for those that are ahead.
    samples: u32,
    ahead: Ahead,
}

/// The pixels that have the samples of a pass which has not come to all of them.
#[derive(Clone, Debug, Default)]
struct Ahead {
    samples: u32,
    /// A bit for each pixel, row by row.
    words: Vec<u64>,
    count: usize,
}

impl Ahead {
    fn has(&self, place: usize) -> bool {
        self.words.get(place / 64).is_some_and(|word| word >> (place % 64) & 1 == 1)
    }

    /// Adds a pixel of so many.
    fn add(&mut self, place: usize, pixels: usize) {
        if !self.has(place) {
            self.words.resize(pixels.div_ceil(64), 0);
            self.words[place / 64] |= 1 << (place % 64);
            self.count += 1;
        }
    }
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
        let sums = memory::filled(Vec3::ZERO, pixels, "the picture")?;
        Ok(Self { size, sums, samples: 0, ahead: Ahead::default() })
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
        (self.samples, self.ahead) = (0, Ahead::default());
    }

    /// Takes the sums of some pixels, each `x | y << 16`, in place of those that were there; they are of so many
    /// samples. What comes with the same number belongs to one pass, which is whole when it has come to every pixel.
    pub fn take(&mut self, pixels: &[u32], sums: &[Vec3], samples: u32) {
        if self.ahead.samples != samples {
            self.ahead = Ahead { samples, ..Ahead::default() };
        }
        for (&pixel, &sum) in pixels.iter().zip(sums) {
            let place = self.place(pixel);
            self.sums[place] = sum;
            self.ahead.add(place, self.sums.len());
        }
        if self.ahead.count == self.sums.len() {
            (self.samples, self.ahead) = (samples, Ahead::default());
        }
    }

    /// How many samples every pixel has: those of the passes that are whole.
    #[must_use]
    pub const fn samples(&self) -> u32 {
        self.samples
    }

    /// How many samples some pixels have already, and which share of all pixels those are; `None` between passes.
    #[must_use]
    pub fn ahead(&self) -> Option<(u32, f64)> {
        let Ahead { samples, count, .. } = self.ahead;
        (count > 0).then(|| (samples, count as f64 / self.sums.len() as f64))
    }

    /// How many samples a pixel has, by its place row by row.
    #[must_use]
    pub fn samples_at(&self, place: usize) -> u32 {
        if self.ahead.has(place) { self.ahead.samples } else { self.samples }
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

    /// The factor that makes the means of the pixels' samples pleasantly bright.
    #[must_use]
    pub fn exposure(&self) -> f32 {
        let mean = |(place, &sum)| sum * (1.0 / self.samples_at(place).max(1) as f32);
        exposure(|| self.sums.iter().enumerate().map(mean))
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Mutants: a pixel that comes twice counted twice; a pass that is whole with all pixels but one; bits of the pass
    /// before.
    #[test]
    fn a_pass_is_whole_when_it_has_come_to_every_pixel() {
        let mut film = Film::new([3, 2]).unwrap();
        let pixels: Vec<u32> = (0..6).map(|i| (i % 3) | ((i / 3) << 16)).collect();
        let told = |film: &Film| (film.samples(), film.ahead(), (0..6).map(|i| film.samples_at(i)).collect::<Vec<_>>());
        film.take(&pixels[..3], &[Vec3::ONE; 3], 1);
        film.take(&pixels[2..5], &[Vec3::ONE; 3], 1);
        assert_eq!(told(&film), (0, Some((1, 5.0 / 6.0)), vec![1, 1, 1, 1, 1, 0]));
        film.take(&pixels[5..], &[Vec3::ONE], 1);
        assert_eq!(told(&film), (1, None, vec![1; 6]));
        // As bright with a part of the next pass, which has four samples in all.
        let bright = film.exposure();
        film.take(&pixels[4..], &[Vec3::splat(4.0); 2], 4);
        assert_eq!(told(&film), (1, Some((4, 1.0 / 3.0)), vec![1, 1, 1, 1, 4, 4]));
        assert_eq!(film.exposure(), bright);
        film.clear();
        assert_eq!(told(&film), (0, None, vec![0; 6]));
    }
}
