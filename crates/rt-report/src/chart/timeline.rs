//! `timeline.svg`: a Gantt chart with one panel per stream and one row per device.

use super::bars::{self, Bar};
use super::canvas::Rgb;
use super::scale::{duration, tick_label, ticks, time_unit};
use super::sheet::{Align, BLUE, FAINT, Look, ORANGE, PALE, SKY, Sheet, VERMILION};
use crate::output::write_atomically;
use crate::table::{grouped, longest, percent};
use crate::{Provenance, ReportError};
use rt_balance::report::{ActivityKind, StreamRun};
use std::path::Path;

/// Most panels of a picture: a browser still scrolls through these. The longest streams are kept.
const MOST_PANELS: usize = 16;

/// Sizes in pixels.
const WIDTH: f64 = 1200.0;
const MARGIN: f64 = 24.0;
const LEFT: f64 = 236.0;
const RIGHT: f64 = WIDTH - 116.0;
const HEADER: f64 = 58.0;
const PANEL_TITLE: f64 = 46.0;
const PANEL_AXIS: f64 = 48.0;
const ROW: f64 = 26.0;
/// Width of a letter of a panel's title at most, with some room behind the title.
const NAME_LETTER: f64 = 10.0;
/// Height of a panel's rows where there are so many devices that each must be thinner than [`ROW`].
const MOST_ROWS_HEIGHT: f64 = 640.0;
/// Rows thinner than this have no room for a name.
const READABLE_ROW: f64 = 13.0;

/// Bars narrower than this, in pixels, are drawn together.
const THIN: f64 = 1.0;
/// Widest such group, in pixels: narrow enough to show where a row is denser.
const GROUP: f64 = 3.0;

const ESTIMATE: Rgb = ORANGE;
const LAUNCH: [Rgb; 2] = [BLUE, SKY];
const MAKESPAN: Rgb = VERMILION;
const IDLE: Rgb = PALE;

/// Writes the chart of a run, its streams below one another in the order given.
///
/// # Errors
/// When the file cannot be written.
pub fn write_svg(path: &Path, runs: &[StreamRun], provenance: &Provenance) -> Result<(), ReportError> {
    let svg = provenance.in_svg(&draw(runs));
    write_atomically(path, |out| out.write_all(svg.as_bytes()))
}

/// The chart of a run as an SVG document.
#[must_use]
pub fn draw(runs: &[StreamRun]) -> String {
    let shown = longest(runs, MOST_PANELS);
    let panels: Vec<Panel<'_>> = shown.iter().map(|run| Panel::new(run)).collect();
    let height = HEADER + panels.iter().map(Panel::height).sum::<f64>() + MARGIN;
    let mut sheet = Sheet::new(WIDTH, height);
    header(&mut sheet, shown.len(), runs.len());
    let mut top = HEADER;
    for panel in &panels {
        panel.draw(&mut sheet, top);
        top += panel.height();
    }
    sheet.to_svg()
}

fn header(sheet: &mut Sheet, shown: usize, all: usize) {
    let title = match all {
        0 => "Timeline: nothing was traced".to_owned(),
        _ if shown < all => format!("Timeline: the {shown} longest of {all} streams"),
        1 => "Timeline".to_owned(),
        _ => format!("Timeline of {all} streams"),
    };
    sheet.text(title, (MARGIN, 32.0), Look::title());
    // From the right, each as wide as its words.
    let mut x = WIDTH - MARGIN;
    for (label, colors) in
        [("makespan", &[MAKESPAN][..]), ("idle", &[IDLE]), ("launches", &LAUNCH), ("estimation", &[ESTIMATE])]
    {
        x -= 7.0 * label.len() as f64;
        sheet.text(label, (x, 32.0), Look::default());
        for color in colors.iter().rev() {
            x -= 16.0;
            let (top, bottom) = if label == "makespan" { (22.0, 42.0) } else { (26.0, 38.0) };
            let right = if label == "makespan" { x + 2.0 } else { x + 12.0 };
            sheet.rectangle((x, top), (right, bottom), *color);
        }
        x -= 22.0;
    }
}

/// One stream.
struct Panel<'a> {
    run: &'a StreamRun,
    rows: Vec<Vec<Bar<'a>>>,
    /// Seconds since the balancer was made.
    start_s: f64,
    /// Length of the time axis.
    span_s: f64,
    row: f64,
}

impl<'a> Panel<'a> {
    fn new(run: &'a StreamRun) -> Self {
        let rows = bars::rows(run);
        let (start_s, end_s) = bars::extent(run);
        let row = ROW.min(MOST_ROWS_HEIGHT / rows.len().max(1) as f64);
        // An axis needs some length, however short the run.
        Self { run, rows, start_s, span_s: (end_s - start_s).max(1e-9), row }
    }

    fn height(&self) -> f64 {
        PANEL_TITLE + self.row * self.rows.len() as f64 + PANEL_AXIS + self.errors().count() as f64 * 18.0
    }

    /// Devices that dropped out, and why.
    fn errors(&self) -> impl Iterator<Item = (usize, &str)> {
        let devices = self.run.report.devices.iter().enumerate();
        devices.filter_map(|(index, device)| Some((index, device.error.as_deref()?)))
    }

    fn x(&self, seconds: f64) -> f64 {
        LEFT + (seconds - self.start_s) / self.span_s * (RIGHT - LEFT)
    }

    fn draw(&self, sheet: &mut Sheet, top: f64) {
        let report = &self.run.report;
        let mut name = report.kind.clone();
        for (what, number) in [("frame", report.frame), ("wave", report.wave)] {
            if number > 0 {
                name += &format!(", {what} {number}");
            }
        }
        let summary = LEFT.max(MARGIN + NAME_LETTER * name.chars().count() as f64);
        sheet.text(name, (MARGIN, top + 12.0), Look { size: 15.0, bold: true, ..Look::default() });
        sheet.text(self.summary(), (summary, top + 12.0), Look { color: FAINT, ..Look::default() });

        let mut y = top + PANEL_TITLE - 14.0;
        let first = y;
        for (device, bars) in self.rows.iter().enumerate() {
            self.row(sheet, y, device, bars);
            y += self.row;
        }
        let end = self.x(self.start_s + self.span_s);
        sheet.rectangle((end, first - 4.0), (end + 1.5, y + 4.0), MAKESPAN);
        self.axis(sheet, first, y);
        for (index, (device, error)) in self.errors().enumerate() {
            let line = format!("device {device} was lost: {}", shortened(error, 130));
            let at = (LEFT, y + PANEL_AXIS - 10.0 + index as f64 * 18.0);
            sheet.text(line, at, Look { color: MAKESPAN, ..Look::default() });
        }
    }

    fn summary(&self) -> String {
        let report = &self.run.report;
        let estimate = &report.estimate;
        let chosen = (estimate.chosen != estimate.estimator).then(|| format!(": {}", estimate.chosen));
        let mut summary = format!(
            "{} rays in {} tasks, estimator {}{}  ·  makespan {}",
            grouped(u64::from(report.rays)),
            grouped(u64::from(report.tasks)),
            estimate.estimator,
            chosen.unwrap_or_default(),
            duration(report.makespan_s)
        );
        if report.imbalance.is_some() && self.rows.len() > 1 {
            summary += &format!("  ·  imbalance {}", percent(report.imbalance));
        }
        if report.excess.is_some() {
            summary += &format!("  ·  excess {} over the lower bound", percent(report.excess));
        }
        summary
    }

    fn row(&self, sheet: &mut Sheet, top: f64, device: usize, bars: &[Bar<'_>]) {
        let gap = (self.row * 0.12).min(3.0);
        let (top, bottom) = (top + gap, top + self.row - gap);
        let middle = f64::midpoint(top, bottom);
        sheet.rectangle((LEFT, top), (RIGHT, bottom), IDLE);
        for block in blocks(bars, |seconds| self.x(seconds)) {
            sheet.tipped((block.left, top), (block.right, bottom), block.color, block.tip);
        }
        if self.row < READABLE_ROW {
            return;
        }
        let report = self.run.report.devices.get(device);
        let name = report.map_or_else(String::new, |report| format!("{device}  {}", report.name));
        sheet.text(shortened(&name, 29), (MARGIN, middle), Look::default());
        if let Some(report) = report {
            let share = report.busy_s / self.run.report.makespan_s;
            let (note, color) = match report.error {
                Some(_) => ("lost".to_owned(), MAKESPAN),
                None if share.is_finite() => (format!("{} busy", percent(Some(share))), FAINT),
                None => (String::new(), FAINT),
            };
            sheet.text(note, (RIGHT + 12.0, middle), Look { color, ..Look::default() });
        }
    }

    fn axis(&self, sheet: &mut Sheet, top: f64, bottom: f64) {
        let (factor, unit) = time_unit(self.span_s);
        let ticks = ticks(self.span_s * factor, 8);
        let step = ticks.get(1).copied().unwrap_or(1.0);
        for &tick in &ticks {
            let x = self.x(self.start_s + tick / factor);
            sheet.rectangle((x, bottom), (x + 1.0, bottom + 5.0), FAINT);
            let look = Look { align: Align::Center, color: FAINT, ..Look::default() };
            sheet.text(tick_label(tick, step), (x, bottom + 15.0), look);
        }
        let look = Look { color: FAINT, ..Look::default() };
        sheet.text(unit, (RIGHT + 12.0, bottom + 15.0), look);
        sheet.rectangle((LEFT, top), (LEFT + 1.0, bottom + 5.0), FAINT);
        sheet.rectangle((LEFT, bottom), (RIGHT, bottom + 1.0), FAINT);
    }
}

/// A rectangle of the chart: one bar, or several that are too thin to be drawn alone.
struct Block {
    left: f64,
    right: f64,
    color: Rgb,
    /// What it stands for.
    tip: String,
}

/// Turns bars in order of time into rectangles.
fn blocks(bars: &[Bar<'_>], x: impl Fn(f64) -> f64) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    let mut index = 0;
    while let Some(bar) = bars.get(index) {
        let left = x(bar.start_s);
        let is_thin = |bar: &Bar<'_>| x(bar.end_s) - x(bar.start_s) < THIN && bar.activity.kind == ActivityKind::Launch;
        let mut end = index + 1;
        if is_thin(bar) {
            end += bars[end..].iter().take_while(|bar| is_thin(bar) && x(bar.end_s) - left < GROUP).count();
        }
        let group = &bars[index..end];
        let right = group.last().map_or(left, |bar| x(bar.end_s));
        let color = match bar.activity.kind {
            ActivityKind::Estimate => ESTIMATE,
            ActivityKind::Launch if group.len() == 1 => LAUNCH[index % 2],
            ActivityKind::Launch => {
                // As a row of thin bars would look from afar: both blues, paler where the device paused.
                let busy: f64 = group.iter().map(|bar| x(bar.end_s) - x(bar.start_s)).sum();
                mixed(IDLE, mixed(LAUNCH[0], LAUNCH[1], 0.5), (busy / (right - left)).clamp(0.0, 1.0))
            }
        };
        blocks.push(Block { left, right, color, tip: tip(group) });
        index = end;
    }
    blocks
}

/// What some bars stand for, in words.
fn tip(bars: &[Bar<'_>]) -> String {
    let seconds: f64 = bars.iter().map(|bar| bar.end_s - bar.start_s).sum();
    let tasks: usize = bars.iter().map(|bar| bar.activity.tasks.len()).sum();
    let rays: u64 = bars.iter().map(|bar| u64::from(bar.activity.rays)).sum();
    let (took, rays) = (duration(seconds), grouped(rays));
    let tasks = format!("{tasks} task{}", if tasks == 1 { "" } else { "s" });
    match bars {
        [bar] if bar.activity.kind == ActivityKind::Estimate => format!("estimation: {rays} rays walked in {took}"),
        [bar] => {
            let predicted =
                bar.activity.predicted_s.map_or_else(String::new, |s| format!(", predicted {}", duration(s)));
            format!("launch of {tasks}, {rays} rays: {took}{predicted}")
        }
        _ => format!("{} launches of {tasks}, {rays} rays: {took}", bars.len()),
    }
}

fn mixed(a: Rgb, b: Rgb, share_of_b: f64) -> Rgb {
    let mix = |a: u8, b: u8| (f64::from(a) + (f64::from(b) - f64::from(a)) * share_of_b).round() as u8;
    [mix(a[0], b[0]), mix(a[1], b[1]), mix(a[2], b[2])]
}

/// At most `most` characters, at least 1; what is too much is taken from the middle, since devices of one machine often
/// differ at the end of their names.
fn shortened(text: &str, most: usize) -> String {
    let count = text.chars().count();
    if count <= most {
        return text.to_owned();
    }
    let tail = (most - 1) / 3;
    text.chars().take(most - 1 - tail).chain(['…']).chain(text.chars().skip(count - tail)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::samples::{launch, run};
    use super::*;

    #[test]
    fn the_chart_names_devices_and_is_shown_in_pixels() {
        let svg = draw(&[run(2, vec![launch(0, 0.0, 2.0), launch(1, 0.0, 1.0)])]);
        assert!(svg.contains("width=\"1200\""));
        assert!(svg.contains("a &lt;device&gt;"));
        // Fails when charts write numbers otherwise than the tables beside them.
        assert!(svg.contains("imbalance 1.0%") && svg.contains("makespan 2.00 s"), "{svg}");
        assert!(svg.contains("<title>launch of 1 task, 1,024 rays: 2.00 s, predicted 2.00 s</title>"), "{svg}");
    }

    #[test]
    fn odd_runs_draw_something() {
        let mut odd = run(1, vec![launch(0, 1.0, 1.0), launch(0, f64::NAN, f64::INFINITY)]);
        odd.report.makespan_s = f64::NAN;
        odd.report.devices[0].error = Some("unplugged".to_owned());
        assert!(draw(&[odd]).contains("unplugged"));
        assert!(draw(&[run(0, Vec::new())]).ends_with("</svg>\n"));
        assert!(draw(&[]).contains("nothing was traced"));
        assert!(draw(&vec![run(300, vec![launch(299, 0.0, 1.0)]); 40]).contains("16 longest of 40"));
    }

    #[test]
    fn long_names_keep_both_ends() {
        assert_eq!(shortened("AMD EPYC 9654 96-Core, cores 4-7", 16), "AMD EPYC 9…s 4-7");
        assert_eq!(shortened("short", 5), "short");
    }

    // Fails when `blocks` draws every bar alone: 100,000 rectangles of a hundred bytes each.
    #[test]
    fn many_launches_stay_a_small_file() {
        let many = (0..100_000).map(|i| launch(0, f64::from(i) * 2e-5, f64::from(i + 1) * 2e-5)).collect();
        assert!(draw(&[run(1, many)]).len() < 200_000);
    }
}
