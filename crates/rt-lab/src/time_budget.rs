//! The time that measuring may take, and the one progress bar that shows how far it is.

use crate::Show;
use std::cell::Cell;
use std::io;
use std::time::{Duration, Instant};

/// A share of the time and of the bar: all of both, or what one trade, scene or stream gets of them.
#[derive(Clone)]
pub(crate) struct TimeBudget<'a> {
    show: &'a dyn Show,
    /// What is measured.
    label: Cell<&'static str>,
    /// Where it begins and ends on the bar, from 0 to 1.
    from: f64,
    to: f64,
    /// When it should have ended; `None`: whenever it has.
    until: Option<Instant>,
    /// Steps that are done, of how many; a step is one measurement.
    done: Cell<u64>,
    steps: u64,
}

impl<'a> TimeBudget<'a> {
    /// From now on, for as long as the budget lasts.
    pub(crate) fn whole(show: &'a dyn Show, budget: Option<Duration>) -> Self {
        let until = budget.map(|budget| Instant::now() + budget);
        Self { show, label: Cell::new(""), from: 0.0, to: 1.0, until, done: Cell::new(0), steps: 1 }
    }

    /// Part `index` of as many parts as there are weights, when the parts before it have ended. It gets its share of
    /// the time that is left: what earlier parts saved or overdrew is shared by all later ones.
    pub(crate) fn part(&self, weights: &[f64], index: usize) -> Self {
        let sum = |range: &[f64]| range.iter().sum::<f64>();
        let place = |index: usize| self.from + (self.to - self.from) * sum(&weights[..index]) / sum(weights);
        let until = self.left().map(|left| Instant::now() + left.mul_f64(weights[index] / sum(&weights[index..])));
        let part =
            Self { from: place(index), to: place(index + 1), until, done: Cell::new(0), steps: 1, ..self.clone() };
        part.show();
        part
    }

    /// One of `count` equal parts.
    pub(crate) fn equal_part(&self, count: usize, index: usize) -> Self {
        self.part(&vec![1.0; count], index)
    }

    /// What the bar says is measured.
    pub(crate) fn label(&self, label: &'static str) {
        self.label.set(label);
        self.show();
    }

    /// The same time for `steps` in each of `rounds` rounds.
    pub(crate) fn with_steps(mut self, steps: usize, rounds: u32) -> Self {
        (self.steps, self.done) = ((steps as u64 * u64::from(rounds)).max(1), Cell::new(0));
        self
    }

    /// A step is done.
    pub(crate) fn step(&self) {
        self.done.set((self.done.get() + 1).min(self.steps));
        self.show();
    }

    fn show(&self) {
        let share = self.done.get() as f64 / self.steps as f64;
        self.show.progress(self.label.get(), self.from + (self.to - self.from) * share);
    }

    /// Time that is left; `None` without a budget.
    pub(crate) fn left(&self) -> Option<Duration> {
        self.until.map(|until| until.saturating_duration_since(Instant::now()))
    }

    /// The rounds that may still be begun, of one that is not counted and `repeat` others. The first two are always
    /// measured; another one only if it would be over in time, were it as long as the longest before it.
    pub(crate) fn rounds(&self, repeat: u32) -> impl Iterator<Item = u32> {
        let (mut begun, mut longest) = (Instant::now(), Duration::ZERO);
        (0..=repeat).take_while(move |&round| {
            longest = longest.max(begun.elapsed());
            begun = Instant::now();
            round < 2 || self.left().is_none_or(|left| left >= longest)
        })
    }

    /// Takes the bar off the screen: tables are printed where it stood.
    pub(crate) fn finish(&self) {
        self.show.finish();
    }

    /// Prints without breaking the bar.
    pub(crate) fn print(&self, text: &str) -> io::Result<()> {
        self.show.print(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Remembers how far the bar is.
    #[derive(Default)]
    struct Bar(Cell<f64>);

    impl Show for Bar {
        fn print(&self, _: &str) -> io::Result<()> {
            Ok(())
        }

        fn note(&self, _: &str) {}

        fn progress(&self, _: &str, done: f64) {
            self.0.set(done);
        }

        fn finish(&self) {}
    }

    /// Mutants: `round < 2` gone; `left` compared with nothing; the share taken of the whole and not of what is left.
    #[test]
    fn parts_share_what_is_left_and_rounds_end_with_it() {
        let hour = Duration::from_secs(3600);
        let bar = Bar::default();
        let whole = TimeBudget::whole(&bar, Some(hour));
        let left = |time: &TimeBudget<'_>| time.left().unwrap().as_secs_f64();
        let near = |found: f64, wanted: f64| assert!((found / wanted - 1.0).abs() < 0.05, "{found}, not {wanted}");
        near(left(&whole.part(&[2.0, 1.0, 1.0], 0)), 1800.0);
        // Nothing was spent before the second part, so it gets half of all.
        near(left(&whole.part(&[2.0, 1.0, 1.0], 1)), 1800.0);
        near(left(&whole.equal_part(3, 2)), 3600.0);
        assert_eq!(whole.rounds(5).collect::<Vec<_>>(), [0, 1, 2, 3, 4, 5]);
        assert_eq!(TimeBudget::whole(&bar, None).rounds(2).count(), 3);
        let spent = TimeBudget::whole(&bar, Some(Duration::ZERO));
        assert_eq!(spent.rounds(5).collect::<Vec<_>>(), [0, 1]);
        assert_eq!(left(&spent.equal_part(2, 0)), 0.0);
    }

    /// Mutants: places of parts by index and not by weight; steps that run beyond their part.
    #[test]
    fn the_bar_moves_within_its_part() {
        let bar = Bar::default();
        let whole = TimeBudget::whole(&bar, None);
        let part = whole.part(&[3.0, 1.0], 1).with_steps(2, 2);
        let places: Vec<f64> = (0..6).map(|_| (part.step(), bar.0.get()).1).collect();
        assert_eq!(places, [0.8125, 0.875, 0.9375, 1.0, 1.0, 1.0]);
        assert!(whole.left().is_none() && part.left().is_none());
    }
}
