//! Cutting an image into waves that fit the memory.

use super::MAX_SIDE;
use rt_core::morton;
use std::error::Error;
use std::fmt;
use std::ops::Range;
use std::sync::Arc;

/// A part of an image whose paths are traced together.
#[derive(Clone, Debug)]
pub struct Wave {
    /// Number of the first pixel on the Z-curve through the whole image.
    pub first: u32,
    /// The pixels, consecutive on the curve, each `x | y << 16`.
    pub pixels: Arc<[u32]>,
}

impl Wave {
    /// The whole of an image.
    ///
    /// # Errors
    /// When a side of the image is 0 or more than [`MAX_SIDE`].
    pub fn whole(size: [u32; 2]) -> Result<Self, ImageSizeError> {
        check(size)?;
        Ok(Self { first: 0, pixels: morton::pixel_order(size[0], size[1]).into() })
    }
}

/// An image cut into waves: consecutive parts of the Z-curve. Each is made when it is asked for, so that their number
/// does not cost memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Waves {
    size: [u32; 2],
    count: u64,
    /// Samples of each pixel in all.
    samples: u32,
    /// Most rays of a wave.
    most: u64,
}

impl Waves {
    /// Waves of so few pixels that `samples` rays for each pixel at `bytes_per_ray` bytes stay within `memory_limit`
    /// bytes.
    ///
    /// They are as equal in size as can be, since the tail of every wave leaves devices idle. A wave has at least one
    /// pixel, whatever the limit, and its rays can be numbered in 32 bits.
    ///
    /// # Errors
    /// When a side of the image is 0 or more than [`MAX_SIDE`].
    pub fn new(size: [u32; 2], samples: u32, bytes_per_ray: u64, memory_limit: u64) -> Result<Self, ImageSizeError> {
        check(size)?;
        let most = memory_limit / bytes_per_ray.max(1);
        Ok(Self { size, count: 1, samples, most }.of(samples))
    }

    /// The same image in as many waves as some of its samples need: those of a pass, in which each pixel has `samples`
    /// rays.
    #[must_use]
    pub fn of(self, samples: u32) -> Self {
        let in_memory = self.most / u64::from(samples.max(1));
        // Paths go by their numbers among those of all samples.
        let numbered = u64::from(u32::MAX) / u64::from(self.samples.max(1));
        let most = in_memory.min(numbered).max(1);
        Self { count: pixels(self.size).div_ceil(most), ..self }
    }

    /// The same image in more waves: at least `count`, if it has so many pixels.
    #[must_use]
    pub fn split(self, count: u64) -> Self {
        Self { count: self.count.max(count.min(self.pixels())), ..self }
    }

    /// Number of pixels of the image.
    #[must_use]
    pub fn pixels(&self) -> u64 {
        pixels(self.size)
    }

    /// Number of waves, at least 1.
    #[must_use]
    pub const fn count(&self) -> u64 {
        self.count
    }

    /// Greatest number of pixels in a wave.
    #[must_use]
    pub fn largest(&self) -> u64 {
        pixels(self.size).div_ceil(self.count)
    }

    /// All waves in order.
    pub fn iter(&self) -> impl Iterator<Item = Wave> {
        (0..self.count).map(|number| self.wave(number))
    }

    /// Wave `number`; empty beyond the last.
    #[must_use]
    pub fn wave(&self, number: u64) -> Wave {
        let Range { start, end } = self.range(number);
        let [width, height] = self.size;
        // An image of the largest size has 2³² pixels, so that the number of a first one fits.
        Wave { first: start as u32, pixels: morton::pixels_in(width, height, start..end).into() }
    }

    /// The places of a wave's pixels on the curve.
    fn range(&self, number: u64) -> Range<u64> {
        // Sizes differ by at most one pixel.
        let start = |number: u64| (u128::from(number) * u128::from(pixels(self.size)) / u128::from(self.count)) as u64;
        start(number)..start(number + 1)
    }
}

fn pixels([width, height]: [u32; 2]) -> u64 {
    u64::from(width) * u64::from(height)
}

fn check(size: [u32; 2]) -> Result<(), ImageSizeError> {
    if size.iter().all(|side| (1..=MAX_SIDE).contains(side)) { Ok(()) } else { Err(ImageSizeError { size }) }
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
    use proptest::prelude::*;

    proptest! {
        /// Guards: waves cover the Z-curve once, in order, within the limit. Fails when the count is rounded down.
        #[test]
        fn waves_cover_the_image_in_order_within_the_limit(
            width in 1..70_u32, height in 1..70_u32, samples in 0..9_u32, bytes in 0..99_u64, limit in 0..200_000_u64,
        ) {
            let waves = Waves::new([width, height], samples, bytes, limit).unwrap();
            let all: Vec<Wave> = waves.iter().collect();
            prop_assert_eq!(all.iter().flat_map(|w| w.pixels.to_vec()).collect::<Vec<_>>(), morton::pixel_order(width, height));
            let mut next = 0;
            for wave in &all {
                prop_assert_eq!(wave.first, next);
                next += wave.pixels.len() as u32;
            }
            let per_pixel = u64::from(samples.max(1)) * bytes.max(1);
            prop_assert!(all.iter().all(|w| w.pixels.len() == 1 || w.pixels.len() as u64 * per_pixel <= limit));
            let sizes = || all.iter().map(|w| w.pixels.len());
            prop_assert!(sizes().max().unwrap() - sizes().min().unwrap() <= 1);
            prop_assert_eq!(waves.largest(), sizes().max().unwrap() as u64);
            // Cut finer they cover the same, and none is larger.
            let finer = waves.split(2 * waves.count());
            prop_assert!(finer.count() >= waves.count() && finer.largest() <= waves.largest());
            let pixels = finer.iter().flat_map(|w| w.pixels.to_vec()).collect::<Vec<_>>();
            prop_assert_eq!(pixels, morton::pixel_order(width, height));
            // As few as possible.
            let most = (limit / per_pixel).max(1);
            prop_assert_eq!(waves.count(), u64::from(width * height).div_ceil(most));
            // A pass of one of many samples is no reason for waves of all of them. Fails when it is cut like these.
            let one = waves.of(1);
            prop_assert_eq!(one.count(), u64::from(width * height).div_ceil((limit / bytes.max(1)).max(1)));
            prop_assert_eq!(one.of(samples), waves);
        }
    }

    #[test]
    fn rays_of_a_wave_can_be_numbered_and_bad_sizes_are_refused() {
        let waves = Waves::new([3, 1], u32::MAX / 2, 1, u64::MAX).unwrap();
        assert_eq!(waves.iter().map(|w| w.pixels.len()).collect::<Vec<_>>(), [1, 2]);
        // Fails when the paths of a pass are numbered among its own samples.
        assert_eq!(waves.of(1), waves);
        for size in [[0, 5], [5, 0], [MAX_SIDE + 1, 1]] {
            let error = Waves::new(size, 1, 1, 1).unwrap_err();
            assert!(error.to_string().contains("choose"), "{error}");
            assert!(Wave::whole(size).is_err());
        }
    }

    /// Fails when waves are held, or the whole order is made for one of them.
    #[test]
    fn the_largest_image_costs_no_memory_before_it_is_traced() {
        let waves = Waves::new([MAX_SIDE; 2], 1, 256, 1 << 20).unwrap();
        assert_eq!((waves.count(), waves.largest()), (1 << 20, 1 << 12));
        let last = waves.range(waves.count() - 1);
        assert_eq!(last, (1 << 32) - (1 << 12)..1 << 32);
        assert_eq!(waves.iter().nth(3).unwrap().first, 3 << 12);
    }
}
