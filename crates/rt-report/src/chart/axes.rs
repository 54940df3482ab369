//! Logarithmic axes: for quantities that span decades.

use super::sheet::{Align, FAINT, GRID, Look, Place, Sheet};

/// A logarithmic axis between two pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct LogAxis {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

/// Room beyond the least and the greatest value, as a factor: points do not lie on the frame.
const ROOM: f64 = 1.3;

/// Most labels along an axis, which has room for them if it is about 300 pixels long.
const MOST_TICKS: usize = 7;

impl LogAxis {
    /// An axis for some values, of which those that are not positive and finite are left out, drawn from pixel `from`
    /// to pixel `to`.
    pub(super) fn over(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Self {
        let (low, high) = values
            .filter(|v| *v > 0.0 && v.is_finite())
            .fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
        let (low, high) = if low <= high { (low / ROOM, high * ROOM) } else { (0.5, 2.0) };
        Self { low, high, from, to }
    }

    /// The pixel of a positive value.
    pub(super) fn at(&self, value: f64) -> f64 {
        self.from + (value / self.low).ln() / (self.high / self.low).ln() * (self.to - self.from)
    }

    /// Ends of the axis, in its values.
    pub(super) const fn ends(&self) -> [f64; 2] {
        [self.low, self.high]
    }

    /// Round values with their labels, written in units of `1 / factor`.
    fn ticks(&self, factor: f64) -> Vec<(f64, String)> {
        let (low, high) = (self.low * factor, self.high * factor);
        let decades = low.log10().floor() as i32..=high.log10().ceil() as i32;
        let of = |digits: &[f64]| -> Vec<f64> {
            let all = decades.clone().flat_map(|decade| digits.iter().map(move |digit| digit * 10_f64.powi(decade)));
            all.filter(|tick| (low..=high).contains(tick)).collect()
        };
        let choices = [&[1.0, 2.0, 3.0, 5.0, 7.0][..], &[1.0, 2.0, 5.0], &[1.0, 3.0], &[1.0]];
        let fits = choices.into_iter().map(of).find(|ticks| ticks.len() <= MOST_TICKS);
        let mut ticks = fits.unwrap_or_else(|| of(&[1.0]));
        // Very many decades: every so many of them.
        let step = ticks.len().div_ceil(MOST_TICKS).max(1);
        ticks = ticks.into_iter().step_by(step).collect();
        ticks.into_iter().map(|tick| (tick / factor, label(tick))).collect()
    }
}

/// A power of ten times a digit, without zeros that say nothing.
fn label(tick: f64) -> String {
    match tick.log10() {
        l if !(-4.0..6.0).contains(&l) => format!("{tick:.0e}"),
        l => format!("{tick:.*}", (-l.floor()).max(0.0) as usize),
    }
}

/// Draws frame, grid, ticks and titles of a plot; `factors` turn values into the units that the titles name.
pub(super) fn frame(sheet: &mut Sheet, x: &LogAxis, y: &LogAxis, factors: [f64; 2], titles: [&str; 2]) {
    for (tick, label) in x.ticks(factors[0]) {
        let at = x.at(tick);
        sheet.rectangle((at - 0.5, y.to), (at + 0.5, y.from), GRID);
        sheet.text(label, (at, y.from + 14.0), Look::axis(Align::Center));
    }
    for (tick, label) in y.ticks(factors[1]) {
        let at = y.at(tick);
        sheet.rectangle((x.from, at - 0.5), (x.to, at + 0.5), GRID);
        sheet.text(label, (x.from - 7.0, at), Look::axis(Align::Right));
    }
    sheet.rectangle((x.from, y.to), (x.from + 1.0, y.from), FAINT);
    sheet.rectangle((x.from, y.from), (x.to, y.from + 1.0), FAINT);
    sheet.text(titles[0], ((x.from + x.to) / 2.0, y.from + 32.0), Look::axis(Align::Center));
    sheet.text(titles[1], (x.from - 44.0, y.to - 16.0), Look::axis(Align::Left));
}

/// The place of a point.
pub(super) fn place(x: &LogAxis, y: &LogAxis, point: [f64; 2]) -> Place {
    (x.at(point[0]), y.at(point[1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    // Mutants: `at` without the logarithm; the room taken from the wrong end.
    #[test]
    fn decades_are_equally_long() {
        let axis = LogAxis::over([1.0, 100.0, -1.0, f64::NAN, f64::INFINITY].into_iter(), 0.0, 300.0);
        let [a, b, c] = [1.0, 10.0, 100.0].map(|v| axis.at(v));
        assert!((b - a - (c - b)).abs() < 1e-9 && a > 0.0 && c < 300.0, "{a} {b} {c}");
        let [low, high] = axis.ends();
        assert!(low < 1.0 && (100.0..1000.0).contains(&high), "{low} {high}");
    }

    #[test]
    fn ticks_are_few_and_short() {
        for values in [[1.0, 1.1], [1e-9, 1e9], [0.02, 0.9], [3e-6, 4e-4]] {
            let ticks = LogAxis::over(values.into_iter(), 0.0, 300.0).ticks(1e2);
            assert!(ticks.len() <= MOST_TICKS && ticks.iter().all(|(_, label)| label.len() <= 7), "{ticks:?}");
        }
        assert_eq!(label(0.02), "0.02");
        assert_eq!(label(500.0), "500");
        assert!(!LogAxis::over(std::iter::empty(), 0.0, 1.0).ticks(1.0).is_empty());
    }
}
