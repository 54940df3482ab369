//! A frame in passes of more and more samples, so that it can be looked at, and stopped, before it is done.

use crate::{Film, Part, RenderError, Renderer, Session};
use rt_scene::streams::{Paths, Samples, Waves};
use std::time::{Duration, Instant};

/// How long a pass takes at least, but for the first: fewer passes have rays that are closer together, and more time
/// for tracing them.
const PASS: Duration = Duration::from_secs(2);

/// How many samples of each pixel come next: a plan that knows no clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Passes {
    /// Samples of each pixel in all.
    all: u32,
    done: u32,
    /// Those of the last pass.
    last: u32,
    /// Most samples of the first pass.
    first: u32,
}

impl Passes {
    /// All of them at one go.
    #[must_use]
    pub const fn whole(all: u32) -> Self {
        Self { all, done: 0, last: 0, first: all }
    }

    /// One, then at least two, four, and so on: so there is soon something to see, and few passes in the end.
    #[must_use]
    pub const fn doubling(all: u32) -> Self {
        Self { all, done: 0, last: 0, first: 1 }
    }

    /// Samples of the passes so far.
    #[must_use]
    pub const fn done(&self) -> u32 {
        self.done
    }

    /// The next pass, if there is one: of `worthwhile` samples if that is more than twice the last, and `most` if that
    /// is less. The first pass heeds neither.
    pub fn next(&mut self, worthwhile: u32, most: u32) -> Option<Samples> {
        let left = self.all - self.done;
        let size = if self.done == 0 { self.first } else { self.last.saturating_mul(2).max(worthwhile) };
        // A small rest would be a pass of its own.
        let size = if left / 2 < size { left } else { size };
        let count = if self.done == 0 { size } else { size.min(most) };
        if count == 0 {
            return None;
        }
        let samples = Samples { first: self.done, count };
        (self.done, self.last) = (self.done + count, count);
        Some(samples)
    }
}

/// A frame that is rendered pass by pass.
#[derive(Debug)]
pub struct Frame<'a> {
    /// Its paths.
    pub paths: &'a Paths,
    /// Its number.
    pub number: u32,
    /// Its parts that fit the memory.
    pub waves: &'a Waves,
    /// When it is to be done, however many samples there are then.
    pub end: Option<Instant>,
}

impl Frame<'_> {
    /// Renders the frame to `film`, which is black. After each pass `shown` is told how many samples of each pixel are
    /// on it.
    ///
    /// # Errors
    /// As for [`Renderer::part`], and those of `shown`. The film is unusable then; what `shown` made of it is not.
    pub fn render<E: From<RenderError>>(
        &self,
        renderer: &Renderer<'_>,
        session: &mut Session<'_>,
        mut passes: Passes,
        film: &mut Film,
        shown: &mut dyn FnMut(&Film, u32) -> Result<(), E>,
    ) -> Result<(), E> {
        let (mut number, mut worthwhile, mut most) = (0, 0, u32::MAX);
        while let Some(samples) = passes.next(worthwhile, most) {
            let begin = Instant::now();
            for wave in self.waves.iter() {
                let mut sums = film.sums_of(&wave.pixels);
                let part = Part { paths: self.paths, frame: self.number, number, wave: &wave, samples };
                renderer.part(session, part, &mut sums)?;
                film.take(&wave.pixels, &sums);
                number += 1;
            }
            worthwhile = fitting(PASS, begin.elapsed(), samples.count);
            shown(film, passes.done())?;
            let left = |end: Instant| end.saturating_duration_since(Instant::now());
            most = self.end.map_or(u32::MAX, |end| fitting(left(end), begin.elapsed(), samples.count));
        }
        Ok(())
    }
}

/// How many samples can be made in `time`, if so many took so long.
fn fitting(time: Duration, took: Duration, samples: u32) -> u32 {
    (time.as_secs_f64() / took.as_secs_f64().max(1e-9) * f64::from(samples)) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(mut passes: Passes, worthwhile: u32, most: u32) -> Vec<u32> {
        std::iter::from_fn(|| passes.next(worthwhile, most)).map(|samples| samples.count).collect()
    }

    /// Mutants: samples that are made twice or never; a last pass of a few; nothing at all where little fits.
    #[test]
    fn passes_grow_and_cover_all_samples_once() {
        assert_eq!(counts(Passes::doubling(16), 0, u32::MAX), [1, 2, 4, 9]);
        assert_eq!(counts(Passes::doubling(16), 3, u32::MAX), [1, 3, 6, 6]);
        assert_eq!(counts(Passes::doubling(16), u32::MAX, u32::MAX), [1, 15]);
        assert_eq!(counts(Passes::doubling(1), 9, u32::MAX), [1]);
        assert_eq!(counts(Passes::whole(16), 0, u32::MAX), [16]);
        assert_eq!(counts(Passes::doubling(16), 0, 0), [1]);
        assert_eq!(counts(Passes::doubling(10), 0, 3), [1, 2, 3, 3, 1]);
        assert_eq!(counts(Passes::doubling(10), 8, 3), [1, 3, 3, 3]);
        for all in 1..200 {
            let mut passes = Passes::doubling(all);
            let mut next = 0;
            while let Some(Samples { first, count }) = passes.next(all % 7, u32::MAX) {
                assert_eq!(first, next);
                next += count;
            }
            assert_eq!((next, passes.done()), (all, all));
        }
    }
}
