//! A frame in passes of more and more samples, so that it can be looked at, and stopped, before it is done.

use crate::{Film, Part, RenderError, Renderer, Session};
use rt_scene::streams::{Paths, Samples, Waves};
use std::time::{Duration, Instant};

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

    /// One, then two, four, and so on: so there is soon something to see, and few passes in the end.
    #[must_use]
    pub const fn doubling(all: u32) -> Self {
        Self { all, done: 0, last: 0, first: 1 }
    }

    /// Samples of the passes so far.
    #[must_use]
    pub const fn done(&self) -> u32 {
        self.done
    }

    /// The next pass, if there is one and `most` samples are not too few for it; the first is made in any case.
    pub fn next(&mut self, most: u32) -> Option<Samples> {
        let left = self.all - self.done;
        let size = if self.done == 0 { self.first } else { 2 * self.last };
        // A small rest would be a pass of its own.
        let size = if left < 2 * size { left } else { size };
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
        let (mut number, mut most) = (0, u32::MAX);
        while let Some(samples) = passes.next(most) {
            let begin = Instant::now();
            for wave in self.waves.iter() {
                let mut sums = film.sums_of(&wave.pixels);
                let part = Part { paths: self.paths, frame: self.number, number, wave: &wave, samples };
                renderer.part(session, part, &mut sums)?;
                film.take(&wave.pixels, &sums);
                number += 1;
            }
            shown(film, passes.done())?;
            most = self.end.map_or(u32::MAX, |end| fitting(end, begin.elapsed(), samples.count));
        }
        Ok(())
    }
}

/// How many samples can be made until `end`, if so many took so long.
fn fitting(end: Instant, took: Duration, samples: u32) -> u32 {
    let left = end.saturating_duration_since(Instant::now()).as_secs_f64();
    (left / took.as_secs_f64().max(1e-9) * f64::from(samples)) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(mut passes: Passes, most: u32) -> Vec<u32> {
        std::iter::from_fn(|| passes.next(most)).map(|samples| samples.count).collect()
    }

    /// Mutants: samples that are made twice or never; a last pass of a few; nothing at all where little fits.
    #[test]
    fn passes_double_and_cover_all_samples_once() {
        assert_eq!(counts(Passes::doubling(16), u32::MAX), [1, 2, 4, 9]);
        assert_eq!(counts(Passes::doubling(1), u32::MAX), [1]);
        assert_eq!(counts(Passes::whole(16), u32::MAX), [16]);
        assert_eq!(counts(Passes::doubling(16), 0), [1]);
        assert_eq!(counts(Passes::doubling(10), 3), [1, 2, 3, 3, 1]);
        for all in 1..200 {
            let mut passes = Passes::doubling(all);
            let mut next = 0;
            while let Some(Samples { first, count }) = passes.next(u32::MAX) {
                assert_eq!(first, next);
                next += count;
            }
            assert_eq!((next, passes.done()), (all, all));
        }
    }
}
