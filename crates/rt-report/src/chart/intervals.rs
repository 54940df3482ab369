//! `compare.svg`: how long several ways take, relative to one of them, each with its interval.

use super::scale::ticks;
use super::sheet::{Align, BLUE, FAINT, GRID, INK, Look, ORANGE, PALE, Sheet, text_room};

/// Everything the chart shows.
#[derive(Clone, Debug)]
pub struct Chart {
    /// What is drawn.
    pub title: String,
    /// What the lengths are relative to.
    pub note: String,
    /// From top to bottom.
    pub rows: Vec<Row>,
    /// Differences below this share are noise; drawn as a band about 1.
    pub noise: Option<f64>,
}

/// One way.
#[derive(Clone, Debug)]
pub struct Row {
    /// What it is called.
    pub label: String,
    /// Its time over that of the way that all are compared with.
    pub ratio: f64,
    /// The interval of that, if it was measured more than once.
    pub interval: Option<[f64; 2]>,
    /// Whether it is the one to look at.
    pub is_advised: bool,
}

/// Sizes in pixels. The width is such that text stays readable where a page on a phone scrolls the chart.
const WIDTH: f64 = 760.0;
const MARGIN: f64 = 20.0;
const HEADER: f64 = 66.0;
const ROW: f64 = 27.0;
const FOOTER: f64 = 34.0;
/// The column of numbers at the right.
const NUMBERS: f64 = 150.0;
/// The least width of the plot, however long the labels are.
const LEAST_PLOT: f64 = 220.0;

/// The axis goes no further: what takes longer is drawn at its end, and its number says how long.
const LONGEST: f64 = 2.0;

/// Most ticks of the axis.
const TICKS: u32 = 6;

/// The chart as an SVG document.
#[must_use]
pub fn to_svg(chart: &Chart) -> String {
    let height = HEADER + ROW * chart.rows.len() as f64 + FOOTER;
    let mut sheet = Sheet::new(WIDTH, height);
    sheet.text(chart.title.as_str(), (MARGIN, 24.0), Look { size: 17.0, bold: true, ..Look::default() });
    sheet.text(chart.note.as_str(), (MARGIN, 46.0), Look { color: FAINT, ..Look::default() });
    let labels = chart.rows.iter().map(|row| text_room(&row.label, Look::default().size)).fold(0.0, f64::max);
    let right = WIDTH - MARGIN - NUMBERS;
    let left = (MARGIN + labels + 10.0).min(right - LEAST_PLOT);
    let axis = Axis::of(chart, left, right);
    let (top, bottom) = (HEADER, height - FOOTER);
    if let Some(noise) = chart.noise {
        sheet.rectangle((axis.at(1.0 - noise), top), (axis.at(1.0 + noise), bottom), PALE);
    }
    for tick in axis.ticks() {
        let x = axis.at(tick);
        sheet.rectangle((x - 0.5, top), (x + 0.5, bottom), GRID);
        sheet.text(format!("{:.0}%", 100.0 * tick), (x, bottom + 14.0), Look::axis(Align::Center));
    }
    sheet.rectangle((axis.at(1.0) - 0.75, top), (axis.at(1.0) + 0.75, bottom), INK);
    for (index, row) in chart.rows.iter().enumerate() {
        row.draw(&mut sheet, &axis, top + ROW * (index as f64 + 0.5));
    }
    sheet.to_svg()
}

impl Row {
    fn draw(&self, sheet: &mut Sheet, axis: &Axis, y: f64) {
        let color = if self.is_advised { ORANGE } else { BLUE };
        let look = Look { bold: self.is_advised, ..Look::default() };
        sheet.text(self.label.as_str(), (MARGIN, y), look);
        // That of the way itself that all are compared with has no width.
        let interval = self.interval.filter(|[low, high]| low < high);
        let percent = |ratio: f64| 100.0 * ratio;
        let numbers = match interval {
            Some([low, high]) => format!("{:.1}% [{:.1}–{:.1}]", percent(self.ratio), percent(low), percent(high)),
            None => format!("{:.1}%", percent(self.ratio)),
        };
        sheet.text(numbers, (WIDTH - MARGIN, y), Look { align: Align::Right, ..look });
        if let Some(ends) = interval {
            let [from, to] = ends.map(|end| axis.at(end));
            sheet.line([(from, y), (to, y)], 2.0, color);
            for end in [from, to] {
                sheet.line([(end, y - 5.0), (end, y + 5.0)], 2.0, color);
            }
        }
        let at = axis.at(self.ratio);
        if self.ratio > LONGEST {
            sheet.polygon(vec![(at - 9.0, y - 6.0), (at + 3.0, y), (at - 9.0, y + 6.0)], color);
        } else {
            sheet.dot((at, y), 5.0, color);
        }
    }
}

/// From ratios to pixels.
struct Axis {
    low: f64,
    high: f64,
    left: f64,
    right: f64,
}

impl Axis {
    fn of(chart: &Chart, left: f64, right: f64) -> Self {
        let noise = chart.noise.unwrap_or(0.0);
        let ends = |row: &Row| row.interval.unwrap_or([row.ratio; 2]);
        let ends = chart.rows.iter().flat_map(ends).chain([1.0 - noise, 1.0 + noise, 0.97, 1.03]);
        let (low, high) = ends
            .filter(|end| end.is_finite())
            .fold((f64::INFINITY, 0.0_f64), |(low, high), end| (low.min(end), high.max(end)));
        let (low, high) = (low.max(0.0), high.min(LONGEST));
        let room = 0.04 * (high - low);
        Self { low: low - room, high: high + room, left, right }
    }

    /// The pixel of a ratio; what lies beyond the axis is at its end.
    fn at(&self, ratio: f64) -> f64 {
        let share = (ratio - self.low) / (self.high - self.low);
        self.left + share.clamp(0.0, 1.0) * (self.right - self.left)
    }

    fn ticks(&self) -> Vec<f64> {
        let steps = ticks(self.high - self.low, TICKS);
        // No finer than whole percents, which labels are written in.
        let step = steps.get(1).copied().unwrap_or(0.1).max(0.01);
        let first = (self.low / step).ceil() as i64;
        (first..).map(|i| i as f64 * step).take_while(|tick| *tick <= self.high).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(rows: Vec<Row>) -> Chart {
        Chart { title: "a <title>".to_owned(), note: "n".to_owned(), rows, noise: Some(0.02) }
    }

    fn row(ratio: f64) -> Row {
        Row { label: "hybrid".to_owned(), ratio, interval: Some([ratio * 0.9, ratio * 1.1]), is_advised: false }
    }

    /// Mutants: an axis that ends with the slowest, however slow; one that leaves the band or 1 out.
    #[test]
    fn all_is_within_the_axis_and_the_slowest_does_not_squash_the_others() {
        let chart = chart(vec![row(1.0), row(1.2), row(30.0), row(f64::NAN)]);
        let axis = Axis::of(&chart, 100.0, 500.0);
        for ratio in [0.0, 0.9, 1.0, 1.02, 30.0, f64::INFINITY] {
            assert!((100.0..=500.0).contains(&axis.at(ratio)), "{ratio}: {}", axis.at(ratio));
        }
        assert!(axis.at(1.32) - axis.at(1.08) > 50.0);
        assert!(axis.at(0.98) > 100.0 && axis.at(1.02) < 500.0);
        let ticks = axis.ticks();
        assert!((2..=8).contains(&ticks.len()) && ticks.iter().any(|tick| (tick - 1.0).abs() < 1e-9), "{ticks:?}");
    }

    #[test]
    fn rows_are_named_and_there_may_be_none() {
        let svg = to_svg(&chart(vec![row(1.0), row(3.0)]));
        assert!(
            svg.contains("a &lt;title&gt;") && svg.contains(">hybrid</text>") && svg.contains("300.0% [270.0–330.0]")
        );
        assert!(to_svg(&Chart { noise: None, ..chart(Vec::new()) }).ends_with("</svg>\n"));
        // Fails when a single time has an interval from it to itself, or none is a reason for an axis without it.
        let once = Chart { noise: None, ..chart(vec![Row { interval: None, ..row(1.5) }]) };
        assert!(to_svg(&once).contains(">150.0%</text>"));
        assert!((100.0..500.0).contains(&Axis::of(&once, 100.0, 500.0).at(1.5)));
    }
}
