//! Trades: one quantity against another for many settings, and the front of those that no other beats in both.

use super::axes::{LogAxis, frame, place};
use super::canvas::Rgb;
use super::sheet::{
    Align, BLUE, FAINT, GREEN, INK, Look, ORANGE, PALE, PURPLE, Place, SKY, Sheet, VERMILION, YELLOW, text_room,
};
use crate::ReportError;

/// Everything a chart shows.
#[derive(Clone, Debug)]
pub struct Chart {
    /// What is drawn.
    pub title: String,
    /// In rows of [`Chart::columns`].
    pub panels: Vec<Panel>,
    /// Panels in a row, 3 or 4.
    pub columns: usize,
}

/// Two quantities, both on logarithmic axes.
#[derive(Clone, Debug)]
pub struct Panel {
    /// What was measured.
    pub title: String,
    /// Titles of the axes, with units.
    pub axes: [String; 2],
    /// The settings. A name has one colour in all panels.
    pub series: Vec<Series>,
    /// A point from elsewhere to compare with, and its name.
    pub reference: Option<([f64; 2], String)>,
    /// Values of the second quantity that are there without the first, drawn as lines across, and their names.
    pub levels: Vec<(f64, String)>,
    /// Whether more is better, of each quantity; `None` to draw no front.
    pub front: Option<[bool; 2]>,
}

/// Settings that belong together, such as one estimator's fractions.
#[derive(Clone, Debug)]
pub struct Series {
    /// What they have in common.
    pub name: String,
    /// In order; those that are not positive and finite are left out.
    pub points: Vec<[f64; 2]>,
    /// The interval of each point's second quantity, drawn as a bar; empty to draw none.
    pub intervals: Vec<[f64; 2]>,
}

const COLOURS: [Rgb; 9] = [BLUE, ORANGE, GREEN, VERMILION, PURPLE, SKY, YELLOW, FAINT, INK];

/// Sizes in pixels.
const WIDTH: f64 = 1200.0;
const MARGIN: f64 = 28.0;
const GUTTER: f64 = 30.0;
const AXIS: f64 = 52.0;
const LEGEND: f64 = 22.0;
/// Room above, right of and below a panel's axes.
const ABOVE: f64 = 56.0;
const RIGHT: f64 = 19.0;
const BELOW: f64 = 54.0;
/// What stands in the legend for settings without a line.
const OTHER_SETTINGS: &str = "other settings (in the table)";
/// Least room between labels of lines across.
const APART: f64 = 14.0;

/// Draws the chart as an SVG document.
///
/// # Errors
/// When there is no panel.
pub fn to_svg(chart: &Chart) -> Result<String, ReportError> {
    if chart.panels.is_empty() {
        return Err(ReportError::Nothing("a chart without panels"));
    }
    let names = names(chart);
    let any_others = chart.panels.iter().any(|panel| panel.series.len() > MOST_LINES);
    let entries: Vec<&str> = names.iter().copied().chain(any_others.then_some(OTHER_SETTINGS)).collect();
    let places = legend_places(&entries);
    let legend_rows = places.last().map_or(0.0, |place| place.1 + 1.0);
    let top = 54.0 + LEGEND * legend_rows + 10.0;
    let columns = chart.columns.clamp(3, 4);
    let width = (WIDTH - 2.0 * MARGIN - (columns - 1) as f64 * GUTTER) / columns as f64;
    let side = width - AXIS - RIGHT;
    let height = ABOVE + side + BELOW;
    let rows = chart.panels.len().div_ceil(columns);
    let mut sheet = Sheet::new(WIDTH, top + rows as f64 * height);
    sheet.text(chart.title.as_str(), (MARGIN, 30.0), Look::title());
    for (index, (name, (x, row))) in names.iter().zip(&places).enumerate() {
        let y = 58.0 + LEGEND * row;
        sheet.dot((x + 5.0, y), 4.5, COLOURS[index % COLOURS.len()]);
        sheet.text(*name, (x + 16.0, y), Look { size: 12.5, ..Look::default() });
    }
    if let Some((x, row)) = places.get(names.len()) {
        let y = 58.0 + LEGEND * row;
        sheet.dot((x + 5.0, y), 2.5, OTHERS);
        sheet.text(OTHER_SETTINGS, (x + 16.0, y), Look { size: 12.5, ..Look::default() });
    }
    for (index, panel) in chart.panels.iter().enumerate() {
        let left = MARGIN + (index % columns) as f64 * (width + GUTTER);
        panel.draw(&mut sheet, (left, top + (index / columns) as f64 * height), side, &names);
    }
    Ok(sheet.to_svg())
}

/// Names of the series that are drawn as lines, in the order in which they first appear.
fn names(chart: &Chart) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for series in chart.panels.iter().flat_map(|panel| panel.lined().into_iter().map(move |index| &panel.series[index]))
    {
        if !names.contains(&series.name.as_str()) {
            names.push(&series.name);
        }
    }
    names
}

/// Where each entry of the legend stands: its left end, and its row.
fn legend_places(names: &[&str]) -> Vec<(f64, f64)> {
    let (mut x, mut row) = (MARGIN, 0.0);
    let place = |name: &&str| {
        let room = 16.0 + text_room(name, 12.5) + 18.0;
        if x > MARGIN && x + room > WIDTH - MARGIN {
            (x, row) = (MARGIN, row + 1.0);
        }
        let place = (x, row);
        x += room;
        place
    };
    names.iter().map(place).collect()
}

impl Series {
    fn usable(&self) -> impl Iterator<Item = [f64; 2]> {
        self.points.iter().copied().filter(is_shown)
    }

    /// Both ends of the bars of points that are shown.
    fn bars(&self) -> impl Iterator<Item = [[f64; 2]; 2]> {
        let ends = |([x, _], [low, high]): (&[f64; 2], &[f64; 2])| [[*x, *low], [*x, *high]];
        self.points.iter().zip(&self.intervals).map(ends).filter(|ends| ends.iter().all(is_shown))
    }
}

/// Whether logarithmic axes have a place for it.
fn is_shown(point: &[f64; 2]) -> bool {
    point.iter().all(|v| *v > 0.0 && v.is_finite())
}

/// Most lines of a panel: more cannot be followed. Of the others the points are shown, in one grey.
const MOST_LINES: usize = 5;

/// Points of settings that have no line.
pub(crate) const OTHERS: Rgb = [0xb4; 3];

impl Panel {
    /// The series that are drawn as lines: those with most points on the front, else the first ones.
    fn lined(&self) -> Vec<usize> {
        let points: Vec<[f64; 2]> = self.series.iter().flat_map(Series::usable).collect();
        let best = self.front.map_or_else(Vec::new, |more| front(&points, more));
        let on_front = |index: &usize| self.series[*index].usable().filter(|point| best.contains(point)).count();
        let mut order: Vec<usize> = (0..self.series.len()).collect();
        order.sort_by_key(|index| std::cmp::Reverse(on_front(index)));
        order.truncate(MOST_LINES);
        order.sort_unstable();
        order
    }

    /// Draws the panel, whose axes are `side` pixels long.
    fn draw(&self, sheet: &mut Sheet, (left, top): Place, side: f64, names: &[&str]) {
        sheet.text(self.title.as_str(), (left, top + 12.0), Look { size: 15.0, bold: true, ..Look::default() });
        let (from, upper) = (left + AXIS, top + ABOVE);
        let reference = self.reference.as_ref().map(|(point, _)| *point);
        let all = || self.series.iter().flat_map(Series::usable).chain(reference);
        let levels = || self.levels.iter().filter(|(value, _)| *value > 0.0 && value.is_finite());
        if all().next().is_none() {
            sheet.text("nothing to show", (from, upper + side / 2.0), Look::axis(Align::Left));
            return;
        }
        let x = LogAxis::over(all().map(|point| point[0]), from, from + side);
        let bars = self.series.iter().flat_map(Series::bars).flatten().map(|end| end[1]);
        let heights = all().map(|point| point[1]).chain(levels().map(|level| level.0)).chain(bars);
        let y = LogAxis::over(heights, upper + side, upper);
        frame(sheet, &x, &y, [1.0; 2], [&self.axes[0], &self.axes[1]]);
        if let Some(more) = self.front {
            let points: Vec<[f64; 2]> = self.series.iter().flat_map(Series::usable).collect();
            let line: Vec<_> = front(&points, more).into_iter().map(|point| place(&x, &y, point)).collect();
            sheet.line(line, 7.0, PALE);
        }
        for ((value, name), label) in levels().zip(label_heights(levels().map(|level| y.at(level.0)))) {
            let height = y.at(*value);
            sheet.line([(from, height), (from + side, height)], 1.0, FAINT);
            sheet.text(name.as_str(), (from + side, label), Look::axis(Align::Right));
        }
        let lined = self.lined();
        // Those without a line first, so that they hide none.
        let order = self.series.iter().enumerate().filter(|(index, _)| !lined.contains(index));
        for (_, series) in order {
            for point in series.usable() {
                sheet.dot(place(&x, &y, point), 2.5, OTHERS);
            }
        }
        let mut ends = Vec::new();
        for series in lined.iter().map(|&index| &self.series[index]) {
            let index = names.iter().position(|name| *name == series.name).unwrap_or(0);
            let color = COLOURS[index % COLOURS.len()];
            for bar in series.bars() {
                sheet.line(bar.map(|end| place(&x, &y, end)), 2.0, color);
            }
            let places: Vec<_> = series.usable().map(|point| place(&x, &y, point)).collect();
            for &place in &places {
                sheet.dot(place, 4.0, color);
            }
            ends.extend(places.last().map(|&end| (end, &series.name)));
            sheet.line(places, 1.2, color);
        }
        let heights = label_heights(ends.iter().map(|((_, height), _)| *height));
        for (((px, _), name), height) in ends.into_iter().zip(heights) {
            // On the side where there is room.
            let (align, shift) = if px > from + side / 2.0 { (Align::Right, -8.0) } else { (Align::Left, 8.0) };
            sheet.text(name.as_str(), (px + shift, height), Look { size: 12.0, align, ..Look::default() });
        }
        if let Some((point, name)) = &self.reference {
            let (px, py) = place(&x, &y, *point);
            for (dx, dy) in [(5.0, 5.0), (5.0, -5.0)] {
                sheet.line([(px - dx, py - dy), (px + dx, py + dy)], 1.8, INK);
            }
            // On the side where there is room.
            let (align, shift) = if px > from + side / 2.0 { (Align::Right, -9.0) } else { (Align::Left, 9.0) };
            sheet.text(name.as_str(), (px + shift, py - 10.0), Look { size: 12.0, align, ..Look::default() });
        }
    }
}

/// Where labels stand, those of lines across and of ends of lines: above them, and so far apart that they can be read.
fn label_heights(lines: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut lowest_first: Vec<(usize, f64)> = lines.map(|line| line - 8.0).enumerate().collect();
    lowest_first.sort_by(|a, b| b.1.total_cmp(&a.1));
    let (mut free, mut heights) = (f64::INFINITY, vec![0.0; lowest_first.len()]);
    for (index, wanted) in lowest_first {
        heights[index] = wanted.min(free);
        free = heights[index] - APART;
    }
    heights
}

/// The points that no other beats in both quantities, by the first one; `more` says of each whether more is better.
fn front(points: &[[f64; 2]], more: [bool; 2]) -> Vec<[f64; 2]> {
    let sign = more.map(|more| if more { -1.0 } else { 1.0 });
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| {
        (sign[0] * a[0]).total_cmp(&(sign[0] * b[0])).then((sign[1] * a[1]).total_cmp(&(sign[1] * b[1])))
    });
    let mut best = f64::INFINITY;
    sorted.retain(|point| {
        let better = sign[1] * point[1] < best;
        best = best.min(sign[1] * point[1]);
        better
    });
    sorted
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Mutants: `sign` forgotten in the second quantity; points that tie in the first kept twice; `<=` for `<`.
        #[test]
        fn the_front_is_what_nothing_beats(
            points in prop::collection::vec((0_u8..9, 0_u8..9), 0..30), more: [bool; 2],
        ) {
            let points: Vec<[f64; 2]> = points.into_iter().map(|(a, b)| [f64::from(a), f64::from(b)]).collect();
            let beats = |a: &[f64; 2], b: &[f64; 2]| {
                let no_worse = |i: usize| if more[i] { a[i] >= b[i] } else { a[i] <= b[i] };
                a != b && no_worse(0) && no_worse(1)
            };
            let front = front(&points, more);
            for point in &points {
                let beaten = points.iter().any(|other| beats(other, point));
                prop_assert_eq!(front.contains(point), !beaten, "{:?} {:?}", point, front);
            }
            prop_assert!(front.windows(2).all(|pair| pair[0][0] != pair[1][0]));
        }
    }

    /// Mutants: the highest first; `free` never moved.
    #[test]
    fn labels_of_neighbouring_lines_do_not_overlap() {
        assert_eq!(label_heights([100.0, 98.0, 200.0, 99.0].into_iter()), [92.0, 64.0, 192.0, 78.0]);
    }

    #[test]
    fn odd_points_are_left_out_and_long_legends_wrap() {
        let series = |i: usize| Series {
            name: format!("a rather long name of series {i}"),
            points: vec![[1.0, 2.0], [f64::NAN, 1.0], [-1.0, 1.0], [3.0, f64::INFINITY]],
            intervals: vec![[1.0, 40.0], [1.0, 2.0]],
        };
        let panel = Panel {
            title: "t".to_owned(),
            axes: ["x".to_owned(), "y".to_owned()],
            series: (0..12).map(series).collect(),
            reference: Some(([1.0, 1.0], "paper".to_owned())),
            levels: vec![(0.5, "a level".to_owned()), (f64::NAN, "no level".to_owned())],
            front: Some([false, false]),
        };
        let empty = Panel { series: Vec::new(), reference: None, ..panel.clone() };
        let chart = Chart { title: String::new(), panels: vec![panel, empty], columns: 3 };
        let svg = to_svg(&chart).unwrap();
        assert_eq!(
            svg.matches("<circle").count(),
            12 + 5 + 1,
            "a dot for each series, the legend, and the others' entry"
        );
        // Only lines have labels, beside those of the legend.
        assert_eq!(svg.matches(">a rather long name of series 4<").count(), 2);
        assert!(!svg.contains("series 5<") && svg.contains("other settings"), "{svg}");
        assert!(svg.contains("paper") && svg.contains("a level") && !svg.contains("no level"));
        assert!(svg.contains("nothing to show"));
        // Axis ticks reach what bars reach. Fails when only the points make the axis.
        assert!(svg.contains(">20<"));
        assert!(legend_places(&names(&chart)).iter().all(|(x, _)| *x < WIDTH - MARGIN));
        assert!(to_svg(&Chart { panels: Vec::new(), ..chart }).is_err());
    }
}
