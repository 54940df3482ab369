//! A frame in passes of more and more samples, so that it can be looked at, and stopped, before it is done.

use crate::{Film, Part, RenderError, Renderer, Session};
use rt_scene::streams::{Paths, Samples, Waves};
use std::time::{Duration, Instant};

/// How long a pass takes at least, but for the first: fewer passes have rays that are closer together, and more time
/// for tracing them.
const PASS: Duration = Duration::from_secs(2);

/// How often people like to see a picture that is rendered.
pub const SHOW_EVERY: Duration = Duration::from_secs(1);

/// Most of the time that showing the picture may take while it is rendered: one part in so many.
const MOST_SHOWN: u32 = 32;

/// Least paths of a wave that a pass is cut into: each is some streams of its own, which cost something, and however
/// slow the pass before was, it may have been for another reason than its rays.
const LEAST_PATHS: u64 = 1 << 14;

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
    /// Its parts that fit the memory; a pass of some of the samples has fewer.
    pub waves: &'a Waves,
    /// When it is to be done, however many samples there are then.
    pub end: Option<Instant>,
    /// How often it is to be shown meanwhile, about; less often where showing it takes long.
    pub show_every: Duration,
}

impl Frame<'_> {
    /// Renders the frame to `film`, which is black. `shown` gets it after each pass, and now and then while a pass
    /// goes through it: then some pixels have the samples of that pass already.
    ///
    /// # Errors
    /// As for [`Renderer::part`], and those of `shown`. Parts that were not finished are not on the film.
    pub fn render<E: From<RenderError>>(
        &self,
        renderer: &Renderer<'_>,
        session: &mut Session<'_>,
        mut passes: Passes,
        film: &mut Film,
        shown: &mut dyn FnMut(&Film) -> Result<(), E>,
    ) -> Result<(), E> {
        let (mut number, mut worthwhile, mut most) = (0, 0, u32::MAX);
        let (mut pace, mut shows) = (Pace::default(), Shows::begin(self.show_every));
        while let Some(samples) = passes.next(worthwhile, most) {
            let (begin, mut traced, mut setup) = (Instant::now(), Duration::ZERO, Duration::ZERO);
            let paths = self.waves.pixels() * u64::from(samples.count);
            let pieces = shows.pieces(pace.expected(samples.count), paths);
            let waves = self.waves.of(samples.count).split(pieces);
            for wave in waves.iter() {
                let begin = Instant::now();
                let mut sums = film.sums_of(&wave.pixels);
                let part = Part { paths: self.paths, frame: self.number, number, wave: &wave, samples };
                setup += renderer.part(session, part, &mut sums)?;
                film.take(&wave.pixels, &sums, passes.done());
                number += 1;
                traced += begin.elapsed();
                // What the first pass has not come to is black.
                let is_whole = film.ahead().is_none();
                if is_whole || (pieces > 1 && shows.is_due()) {
                    shows.time(|| shown(film))?;
                }
            }
            pace = Pace { traced: traced.saturating_sub(setup), samples: samples.count };
            worthwhile = pace.fitting(PASS);
            let left = |end: Instant| end.saturating_duration_since(Instant::now());
            let whole = Pace { traced: begin.elapsed().saturating_sub(setup), ..pace };
            most = self.end.map_or(u32::MAX, |end| whole.fitting(left(end)));
        }
        Ok(())
    }
}

/// How fast samples come.
#[derive(Clone, Copy, Debug, Default)]
struct Pace {
    traced: Duration,
    samples: u32,
}

impl Pace {
    /// How long so many samples will take; nothing before any was made.
    fn expected(self, samples: u32) -> Duration {
        self.traced.mul_f64(f64::from(samples) / f64::from(self.samples.max(1)))
    }

    /// How many samples can be made in `time`.
    fn fitting(self, time: Duration) -> u32 {
        (time.as_secs_f64() / self.traced.as_secs_f64().max(1e-9) * f64::from(self.samples)) as u32
    }
}

/// When a picture was shown.
#[derive(Clone, Copy, Debug)]
struct Shows {
    every: Duration,
    last: Instant,
    /// How long the last one took.
    took: Duration,
}

impl Shows {
    fn begin(every: Duration) -> Self {
        Self { every, last: Instant::now(), took: Duration::ZERO }
    }

    fn every(&self) -> Duration {
        self.every.max(self.took * MOST_SHOWN)
    }

    /// Into how many waves a pass of so many paths is cut that will take so long.
    fn pieces(&self, expected: Duration, paths: u64) -> u64 {
        let pieces = (expected.as_secs_f64() / self.every().as_secs_f64()).round() as u64;
        pieces.min(paths / LEAST_PATHS).max(1)
    }

    /// Whether it is to be shown again. Parts are not of one length, and one that is a little too short must not make
    /// the picture wait for the next.
    fn is_due(&self) -> bool {
        self.last.elapsed() >= self.every().mul_f64(0.6)
    }

    fn time<T>(&mut self, show: impl FnOnce() -> T) -> T {
        let begin = Instant::now();
        let shown = show();
        (self.last, self.took) = (Instant::now(), begin.elapsed());
        shown
    }
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

    /// Fails when a pass is cut before anything is known of how long it takes, or into nothing but ends of streams, or
    /// showing may take all of the time.
    #[test]
    fn passes_are_cut_into_parts_of_a_second_unless_showing_is_expensive() {
        let seconds = |time: u64| Duration::from_secs(time);
        let shows = |took: Duration| Shows { took, ..Shows::begin(seconds(1)) };
        let many = 1 << 30;
        assert_eq!(shows(Duration::ZERO).pieces(Pace::default().expected(9), many), 1);
        let pace = Pace { traced: seconds(2), samples: 4 };
        assert_eq!((pace.expected(10), pace.fitting(seconds(3))), (seconds(5), 6));
        assert_eq!([0, 1, 5, 60].map(|time| shows(Duration::ZERO).pieces(seconds(time), many)), [1, 1, 5, 60]);
        assert_eq!([1, 5, 60].map(|time| shows(Duration::from_millis(250)).pieces(seconds(time), many)), [1, 1, 8]);
        assert_eq!(
            [0, 1, 2, 3].map(|waves| shows(Duration::ZERO).pieces(seconds(60), waves * LEAST_PATHS)),
            [1, 1, 2, 3]
        );
    }
}
