//! The paper's Figure 1: tracing time against task size, cost-initialised queues over regular ones.
//!
//! After M. Rincón-Nigro and Z. Deng, *Cost-based Workload Balancing for Ray Tracing on Multi-GPU Systems* (2013),
//! whose figure draws coloured bars over background bars without saying which is which in so many words. Here the
//! background is always the regular queue and the colour the cost-initialised one, narrower, so that both are seen
//! whichever is longer; the estimation stands on top of the tracing it initialises. The regular static queue is drawn
//! twice.

use super::canvas::Rgb;
use super::scale::{tick_label, ticks, time_unit};
use super::sheet::{Align, BLUE, FAINT, GREEN, GRID, INK, Look, ORANGE, PURPLE, SKY, Sheet, VERMILION, text_room};
use crate::output::write_atomically;
use crate::{Provenance, ReportError};
use std::path::Path;

/// Everything the figure shows.
#[derive(Clone, Debug)]
pub struct Figure {
    /// What is drawn.
    pub title: String,
    /// How it was measured: one line each.
    pub notes: Vec<String>,
    /// Two to a row, such as a scene's primary and diffuse rays.
    pub panels: Vec<Panel>,
}

/// One scene and kind of rays.
#[derive(Clone, Debug)]
pub struct Panel {
    /// What was traced.
    pub title: String,
    /// In order of task size.
    pub groups: Vec<Group>,
}

/// The bars of one task size; all lengths in seconds.
#[derive(Clone, Debug)]
pub struct Group {
    /// The task size, such as `1024`.
    pub label: String,
    /// Static queues dealt as contiguous blocks, regular.
    pub blocks: Bar,
    /// Static queues dealt in turn, regular.
    pub round_robin: Bar,
    /// Static queues, cost-initialised.
    pub static_cost: Bar,
    /// Central queue, first come first served.
    pub central: Bar,
    /// Central queue, cost-initialised.
    pub central_cost: Bar,
    /// Hybrid queue that knows no costs.
    pub hybrid: Bar,
    /// Hybrid queue, cost-initialised.
    pub hybrid_cost: Bar,
    /// Permuted regions, a rival that knows no costs.
    pub permuted: Bar,
    /// Work stealing with lifelines, a rival that knows no costs.
    pub lifelines: Bar,
}

/// A measured time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bar {
    /// Median of the whole time, in seconds.
    pub median_s: f64,
    /// The whisker: ends of the interval of the median, in seconds.
    pub interval_s: [f64; 2],
    /// Part of the median that was spent on estimation, in seconds.
    pub estimate_s: f64,
}

pub(super) const BLOCKS: Rgb = [0xdd; 3];
pub(super) const ROUND_ROBIN: Rgb = [0xb4; 3];
const ESTIMATION: Rgb = PURPLE;

/// Sizes in pixels.
const WIDTH: f64 = 1200.0;
const MARGIN: f64 = 28.0;
const GUTTER: f64 = 40.0;
const AXIS: f64 = 52.0;
const PLOT: f64 = 236.0;
const PANEL: f64 = 46.0 + PLOT + 58.0;
const NOTE: f64 = 17.0;
const LEGEND: f64 = 24.0;

/// Share of a group's width that one queue's bars take, and of one rival's: three and two of them, and gaps.
const SLOT: f64 = 0.24;
const RIVAL: f64 = 0.06;
/// Share of a slot that the coloured bar covers.
const FRONT: f64 = 0.5;

/// Writes the figure as SVG and as PNG.
///
/// # Errors
/// When there is nothing to draw or a file cannot be written.
pub fn write(svg: &Path, png: &Path, figure: &Figure, provenance: &Provenance) -> Result<(), ReportError> {
    let sheet = draw(figure)?;
    let text = provenance.in_svg(&sheet.to_svg());
    write_atomically(svg, |out| out.write_all(text.as_bytes()))?;
    sheet.write_png(png)
}

/// The figure as an SVG document.
///
/// # Errors
/// When there is nothing to draw.
pub fn to_svg(figure: &Figure) -> Result<String, ReportError> {
    Ok(draw(figure)?.to_svg())
}

fn draw(figure: &Figure) -> Result<Sheet, ReportError> {
    if figure.panels.is_empty() {
        return Err(ReportError::Nothing("a figure without panels"));
    }
    let rows = figure.panels.len().div_ceil(2);
    let top = 52.0 + NOTE * figure.notes.len() as f64 + MEANINGS.len() as f64 * LEGEND + 14.0;
    let mut sheet = Sheet::new(WIDTH, top + rows as f64 * PANEL + 8.0);
    sheet.text(figure.title.as_str(), (MARGIN, 30.0), Look::title());
    let mut y = 56.0;
    for note in &figure.notes {
        sheet.text(note.as_str(), (MARGIN, y), Look { color: FAINT, size: 12.5, ..Look::default() });
        y += NOTE;
    }
    legend(&mut sheet, y + 8.0);
    let width = (WIDTH - 2.0 * MARGIN - GUTTER) / 2.0;
    for (index, panel) in figure.panels.iter().enumerate() {
        let left = MARGIN + (index % 2) as f64 * (width + GUTTER);
        panel.draw(&mut sheet, left, top + (index / 2) as f64 * PANEL, width);
    }
    Ok(sheet)
}

/// What colours mean, in rows.
const MEANINGS: [&[(Rgb, &str)]; 3] = [
    &[
        (ORANGE, "static distributed queues, cost-initialised (LPT)"),
        (BLUE, "central queue, cost-initialised"),
        (VERMILION, "hybrid queue, cost-initialised"),
    ],
    &[
        (ESTIMATION, "estimation, before it"),
        (BLOCKS, "background: regular (static: contiguous blocks)"),
        (ROUND_ROBIN, "regular, static, round robin"),
    ],
    &[(GREEN, "permuted regions (2019)"), (SKY, "stealing with lifelines (2011)")],
];

fn legend(sheet: &mut Sheet, top: f64) {
    for (row, entries) in MEANINGS.iter().enumerate() {
        let y = top + LEGEND * row as f64;
        let mut x = MARGIN;
        for (color, label) in *entries {
            sheet.rectangle((x, y - 6.0), (x + 14.0, y + 6.0), *color);
            sheet.text(*label, (x + 20.0, y), Look { size: 12.5, ..Look::default() });
            x += 20.0 + text_room(label, 12.5) + 22.0;
        }
        if row + 1 == MEANINGS.len() {
            whisker(sheet, x + 6.0, [y - 7.0, y + 7.0], INK);
            sheet.text("interval of the median", (x + 18.0, y), Look { size: 12.5, ..Look::default() });
        }
    }
}

/// A line with caps between two heights.
fn whisker(sheet: &mut Sheet, x: f64, [high, low]: [f64; 2], color: Rgb) {
    sheet.line([(x, high), (x, low)], 1.0, color);
    for y in [high, low] {
        sheet.line([(x - 3.0, y), (x + 3.0, y)], 1.0, color);
    }
}

impl Panel {
    /// The longest bar or whisker, in seconds.
    fn longest(&self) -> f64 {
        let bars = self.groups.iter().flat_map(|g| {
            [g.blocks, g.round_robin, g.static_cost, g.central, g.central_cost, g.hybrid, g.hybrid_cost]
                .into_iter()
                .chain([g.permuted, g.lifelines])
        });
        let ends = bars.flat_map(|bar| [bar.median_s, bar.interval_s[1]]).filter(|s| s.is_finite());
        ends.fold(0.0, f64::max)
    }

    fn draw(&self, sheet: &mut Sheet, left: f64, top: f64, width: f64) {
        let longest = self.longest();
        let (factor, unit) = time_unit(longest.max(1e-9));
        sheet.text(self.title.as_str(), (left, top + 12.0), Look { size: 15.0, bold: true, ..Look::default() });
        sheet.text(format!("time, {unit}"), (left, top + 33.0), Look::axis(Align::Left));
        let (from, to) = (left + AXIS, left + width);
        let (upper, lower) = (top + 46.0, top + 46.0 + PLOT);
        // A little air above the longest bar.
        let y = |seconds: f64| lower - seconds / (longest.max(1e-9) * 1.04) * PLOT;
        let ticks = ticks(longest.max(1e-9) * factor, 6);
        let step = ticks.get(1).copied().unwrap_or(1.0);
        for &tick in &ticks {
            let height = y(tick / factor);
            sheet.rectangle((from, height - 0.5), (to, height + 0.5), GRID);
            sheet.text(tick_label(tick, step), (from - 8.0, height), Look::axis(Align::Right));
        }
        let group_width = (to - from) / self.groups.len().max(1) as f64;
        for (index, group) in self.groups.iter().enumerate() {
            let middle = from + (index as f64 + 0.5) * group_width;
            group.draw(sheet, middle, group_width, lower, &y);
            sheet.text(group.label.as_str(), (middle, lower + 15.0), Look::axis(Align::Center));
        }
        sheet.rectangle((from, upper), (from + 1.0, lower), FAINT);
        sheet.rectangle((from, lower), (to, lower + 1.0), FAINT);
        sheet.text("task size, rays", ((from + to) / 2.0, lower + 34.0), Look::axis(Align::Center));
    }
}

impl Group {
    fn draw(&self, sheet: &mut Sheet, middle: f64, width: f64, lower: f64, y: &dyn Fn(f64) -> f64) {
        let slot = SLOT * width;
        let gap = 0.03 * width;
        let mut pair = |left: f64, back: [(Bar, Rgb); 2], front: Bar, color: Rgb| {
            for (half, (bar, color)) in back.iter().enumerate() {
                let from = left + half as f64 * slot / 2.0;
                sheet.rectangle((from, y(bar.median_s)), (from + slot / 2.0, lower), *color);
            }
            let from = left + slot * (1.0 - FRONT) / 2.0;
            let (trace, total) = (y(front.median_s - front.estimate_s), y(front.median_s));
            sheet.rectangle((from, trace), (from + slot * FRONT, lower), color);
            sheet.rectangle((from, total), (from + slot * FRONT, trace), ESTIMATION);
            let edge = slot * (1.0 - FRONT) / 4.0;
            // Halves of one bar share a whisker.
            let whiskers = if back[0].0 == back[1].0 { &back[..1] } else { &back[..] };
            for ((bar, _), x) in whiskers.iter().zip([left + edge, left + slot - edge]) {
                whisker(sheet, x, bar.interval_s.map(y), FAINT);
            }
            whisker(sheet, left + slot / 2.0, front.interval_s.map(y), INK);
        };
        let fixed = [(self.blocks, BLOCKS), (self.round_robin, ROUND_ROBIN)];
        let start = middle - (3.0 * (slot + gap) + 2.0 * RIVAL * width) / 2.0;
        pair(start, fixed, self.static_cost, ORANGE);
        pair(start + slot + gap, [(self.central, BLOCKS); 2], self.central_cost, BLUE);
        pair(start + 2.0 * (slot + gap), [(self.hybrid, BLOCKS); 2], self.hybrid_cost, VERMILION);
        for (nth, (bar, color)) in [(self.permuted, GREEN), (self.lifelines, SKY)].into_iter().enumerate() {
            let left = start + 3.0 * (slot + gap) + nth as f64 * RIVAL * width;
            sheet.rectangle((left, y(bar.median_s)), (left + RIVAL * width, lower), color);
            whisker(sheet, left + RIVAL * width / 2.0, bar.interval_s.map(y), INK);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bar(median_s: f64, estimate_s: f64) -> Bar {
        Bar { median_s, interval_s: [median_s * 0.9, median_s * 1.1], estimate_s }
    }

    fn group(scale: f64) -> Group {
        let whole = |s: f64| bar(s * scale, 0.0);
        Group {
            label: "64".to_owned(),
            blocks: whole(2.0),
            round_robin: whole(1.2),
            static_cost: bar(1.1 * scale, 0.05 * scale),
            central: whole(1.5),
            central_cost: bar(1.3 * scale, 0.05 * scale),
            hybrid: whole(1.05),
            hybrid_cost: bar(1.04 * scale, 0.05 * scale),
            permuted: whole(1.2),
            lifelines: whole(1.1),
        }
    }

    /// Upper and lower ends, in pixels, of the rectangles of a colour.
    fn ends(svg: &str, color: Rgb) -> Vec<[f64; 2]> {
        let color = format!("#{:02X}{:02X}{:02X}", color[0], color[1], color[2]);
        let rectangles = svg.lines().filter(|line| line.contains("<rect") && line.contains(&color));
        let field = |line: &str, name: &str| -> f64 {
            line.split(&format!(" {name}=\"")).nth(1).unwrap().split('"').next().unwrap().parse().unwrap()
        };
        rectangles.map(|line| [field(line, "y"), field(line, "y") + field(line, "height")]).collect()
    }

    // Mutants: the estimation drawn from the ground; `y` not scaled by the longest bar.
    #[test]
    fn the_estimation_stands_on_the_tracing() {
        let panel = Panel { title: "a scene".to_owned(), groups: vec![group(1.0)] };
        let figure = Figure { title: String::new(), notes: Vec::new(), panels: vec![panel] };
        let svg = to_svg(&figure).unwrap();
        // The first of each colour is the legend's.
        let ([trace, _], [total, foot]) = (ends(&svg, ORANGE)[1], ends(&svg, ESTIMATION)[1]);
        // Places are rounded to hundredths of a pixel.
        assert!((foot - trace).abs() < 0.03, "{foot} {trace}");
        let per_second = PLOT / (2.2 * 1.04);
        assert!((trace - total - 0.05 * per_second).abs() < 0.03, "{trace} {total}");
        let [blocks, _] = ends(&svg, BLOCKS)[1];
        assert!((trace - blocks - 0.95 * per_second).abs() < 0.03, "{trace} {blocks}");
    }

    #[test]
    fn odd_times_draw_something_and_no_panel_is_refused() {
        for scale in [0.0, 1e-9, 1e9, f64::NAN, f64::INFINITY] {
            let panels = vec![Panel { title: "odd".to_owned(), groups: vec![group(scale); 3] }; 3];
            assert!(to_svg(&Figure { title: String::new(), notes: Vec::new(), panels }).unwrap().contains("odd"));
        }
        let none = Panel { title: "empty".to_owned(), groups: Vec::new() };
        let figure = Figure { title: String::new(), notes: Vec::new(), panels: vec![none] };
        assert!(to_svg(&figure).is_ok());
        assert!(to_svg(&Figure { panels: Vec::new(), ..figure }).is_err());
    }
}
