//! `cost.png`: a row for each kind of rays, estimated beside measured on one scale.

use super::super::canvas::{Align, Canvas, Rgb};
use super::super::scale::{significant, tick_label, ticks};
use super::map::CostMap;
use super::tasks::Origin;
use crate::ReportError;
use std::path::Path;

/// Least mean area of a task on the picture, in pixels, for its outline to be drawn: outlines then cover about a
/// tenth of it.
const OUTLINED_AREA: f64 = 40.0 * 40.0;

/// Maps smaller than this are enlarged by a whole factor: two titles need this room.
const SMALLEST_PANEL: u32 = 420;

/// Room for a panel's title, in pixels, however narrow the map is.
const NARROWEST_SLOT: u32 = 240;

const MARGIN: u32 = 28;
const TITLES: u32 = 104;
const LEGEND: u32 = 84;
const BAR_HEIGHT: u32 = 16;

/// Width of a letter of the font over its size.
const LETTER: f32 = 0.61;

const PAPER: Rgb = [255; 3];
const INK: Rgb = [34; 3];
const FAINT: Rgb = [102; 3];
/// Stripes of what is unknown, which no cost looks like.
const UNKNOWN: [Rgb; 2] = [[186; 3], [140; 3]];
const STRIPE: u32 = 5;

/// Writes the maps below each other. The outlines of tasks are drawn where those are large enough to be seen.
///
/// # Errors
/// When there is no map, the picture is empty, or the file cannot be written.
pub fn write_png(path: &Path, maps: &[CostMap]) -> Result<(), ReportError> {
    let Some(first) = maps.first().filter(|map| !map.size().contains(&0)) else {
        return Err(ReportError::Nothing("a cost map of no pixels"));
    };
    let enlarged = SMALLEST_PANEL.div_ceil(first.size()[0].max(first.size()[1])).max(1);
    let [width, height] = first.size().map(|side| side * enlarged);
    let layout = Layout { enlarged, width, height, slot: width.max(NARROWEST_SLOT) };
    let mut canvas = Canvas::new(layout.whole(), layout.row() * maps.len() as u32, PAPER)?;
    for (row, map) in (0..).zip(maps) {
        layout.draw(&mut canvas, row * layout.row(), map);
    }
    canvas.write_png(path)
}

/// Where everything is, in pixels.
struct Layout {
    /// Pixels of a side of a cell.
    enlarged: u32,
    /// Of one map.
    width: u32,
    height: u32,
    /// Width that a panel takes.
    slot: u32,
}

impl Layout {
    const fn whole(&self) -> u32 {
        3 * MARGIN + 2 * self.slot
    }

    const fn row(&self) -> u32 {
        TITLES + self.height + LEGEND
    }

    fn draw(&self, canvas: &mut Canvas, top: u32, map: &CostMap) {
        let scale = Scale::of(map);
        let mut line = |text: &str, y: u32, size: f32, color: Rgb| {
            let room = (self.whole() - 2 * MARGIN) as f32 / text.chars().count().max(1) as f32 / LETTER;
            canvas.text(text, MARGIN, top + y, size.min(room), Align::Left, color);
        };
        line(&format!("Cost per ray: {}", map.name()), 32, 21.0, INK);
        let not_used = map.not_used().map(|what| format!("not used: {what}"));
        let normalised = map.is_normalised().then(|| "seconds are those of a device of mean speed".to_owned());
        line(&not_used.into_iter().chain(normalised).collect::<Vec<_>>().join("; "), 54, 14.0, FAINT);
        let (origin, means) = (map.origin(), map.means());
        let panels = [(CostMap::name_of_estimate(origin), means.estimated), ("measured", means.measured)];
        for (index, (name, mean)) in panels.into_iter().enumerate() {
            let left = MARGIN + index as u32 * (self.slot + MARGIN);
            let is_estimate = index == 0;
            let mean = mean.filter(|_| !is_estimate || origin != Origin::Nowhere);
            let mean = mean.map(|mean| format!(", mean {} {}", significant(mean * scale.factor), scale.unit));
            let title = format!("{name}{}", mean.unwrap_or_default());
            canvas.text(&title, left, top + TITLES - 10, 15.0, Align::Left, INK);
            if is_estimate && origin == Origin::Nowhere {
                canvas.fill(left, top + TITLES, self.width, self.height, [244; 3]);
                continue;
            }
            self.paint(canvas, [left, top + TITLES], map, &scale, index);
        }
        self.legend(canvas, top + TITLES + self.height, &scale);
    }

    /// Draws one map with its upper left at `corner`.
    fn paint(&self, canvas: &mut Canvas, [left, top]: [u32; 2], map: &CostMap, scale: &Scale, index: usize) {
        let cell = |x: u32, y: u32| (x / self.enlarged, y / self.enlarged);
        let task = |x: u32, y: u32| {
            let (x, y) = cell(x, y);
            map.task_at(x, y)
        };
        let area = f64::from(self.width) * f64::from(self.height) / (map.tasks().len().max(1) as f64);
        for y in 0..self.height {
            for x in 0..self.width {
                let Some(here) = task(x, y) else { continue };
                let (column, row) = cell(x, y);
                let cost = map.costs_at(column, row)[index];
                let color = if cost.is_finite() { scale.color(cost) } else { hatched(x, y) };
                canvas.set(left + x, top + y, color);
                let is_edge = (x + 1 < self.width && task(x + 1, y) != Some(here))
                    || (y + 1 < self.height && task(x, y + 1) != Some(here));
                if is_edge && area >= OUTLINED_AREA {
                    canvas.blend(i64::from(left + x), i64::from(top + y), PAPER, 0.35);
                }
            }
        }
    }

    fn legend(&self, canvas: &mut Canvas, top: u32, scale: &Scale) {
        let unknown_width = if scale.has_unknown { 110 } else { 0 };
        let (left, top) = (MARGIN, top + 16);
        let bar = self.whole() - 2 * MARGIN - unknown_width - 90;
        for x in 0..bar {
            let cost = (f64::from(x) + 0.5) / f64::from(bar) * scale.top;
            canvas.fill(left + x, top, 1, BAR_HEIGHT, scale.color(cost as f32));
        }
        let shown_top = scale.top * scale.factor;
        let ticks = ticks(shown_top, 6);
        let step = ticks.get(1).copied().unwrap_or(1.0);
        let end = format!("{}{}", if scale.is_clipped { "≥ " } else { "" }, significant(shown_top));
        let end_width = canvas.text_width(&end, 14.0);
        for tick in ticks {
            let x = (tick / shown_top * f64::from(bar)) as u32;
            let label = tick_label(tick, step);
            // The last label stands for the end of the scale; a tick too near to it would be written over.
            let room = (bar - x) as f32 - end_width / 2.0 - canvas.text_width(&label, 14.0) / 2.0;
            if room < 12.0 {
                continue;
            }
            canvas.fill(left + x, top + BAR_HEIGHT, 1, 5, FAINT);
            let align = if tick == 0.0 { Align::Left } else { Align::Center };
            canvas.text(&label, left + x, top + BAR_HEIGHT + 20, 14.0, align, INK);
        }
        canvas.fill(left + bar - 1, top + BAR_HEIGHT, 1, 5, FAINT);
        canvas.text(&end, left + bar, top + BAR_HEIGHT + 20, 14.0, Align::Center, INK);
        canvas.text(&format!("{}/ray", scale.unit), left + bar + 12, top + 13, 14.0, Align::Left, INK);
        if scale.has_unknown {
            let x = self.whole() - MARGIN - 84;
            for (dx, dy) in (0..BAR_HEIGHT).flat_map(|dx| (0..BAR_HEIGHT).map(move |dy| (dx, dy))) {
                canvas.set(x + dx, top + dy, hatched(dx, dy));
            }
            canvas.text("unknown", x + BAR_HEIGHT + 8, top + 13, 14.0, Align::Left, INK);
        }
    }
}

fn hatched(x: u32, y: u32) -> Rgb {
    UNKNOWN[((x + y) / STRIPE % 2) as usize]
}

/// From cost to colour.
struct Scale {
    /// Cost of the last colour, in nanoseconds.
    top: f64,
    /// Whether any measured cost is beyond it.
    is_clipped: bool,
    /// Whether any cost that is shown is unknown.
    has_unknown: bool,
    /// From nanoseconds to `unit`.
    factor: f64,
    unit: &'static str,
}

impl Scale {
    /// Covers both panels.
    fn of(map: &CostMap) -> Self {
        let top = map.top();
        let (factor, unit) = match top.cost {
            t if t >= 1e7 => (1e-6, "ms"),
            t if t >= 1e4 => (1e-3, "µs"),
            _ => (1.0, "ns"),
        };
        let is_estimated = map.origin() != Origin::Nowhere;
        let has_unknown = map
            .tasks()
            .iter()
            .any(|task| !task.measured_s.is_finite() || (is_estimated && !task.estimated_s.is_finite()));
        Self { top: top.cost, is_clipped: top.is_clipped, has_unknown, factor, unit }
    }

    /// Viridis (S. van der Walt and N. Smith, matplotlib 2015): evenly spaced to the eye, also without colour vision.
    fn color(&self, cost: f32) -> Rgb {
        let colorous::Color { r, g, b } =
            colorous::VIRIDIS.eval_continuous((f64::from(cost) / self.top).clamp(0.0, 1.0));
        [r, g, b]
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::samples::run;
    use super::super::each_ray;
    use super::*;
    use rt_balance::report::StreamRun;
    use rt_core::{Task, Work};

    fn one_task(rays: u32, seconds: f64) -> StreamRun {
        StreamRun {
            tasks: vec![Task { first: 0, rays }],
            work: vec![Work::new(1.0, 1.0, 0.0)],
            kept: vec![0],
            predicted_s: vec![seconds],
            measured_s: vec![seconds],
            device_of: vec![0],
            ..run(1, Vec::new())
        }
    }

    #[test]
    fn any_size_and_any_value_gives_a_picture() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("cost.png");
        for (width, height) in [(1, 1), (3, 2), (1, 2000), (2000, 1), (900, 30)] {
            for value in [0.0, 5.0, 1e9, f64::NAN, f64::INFINITY, -1.0] {
                let mut map = CostMap::new("primary", [width, height]);
                map.add(&one_task(width * height, value), each_ray(|i| (i % width) | ((i / width) << 16)));
                write_png(&path, &[map, CostMap::new("shadow 0", [width, height])]).unwrap();
            }
        }
        assert!(write_png(&path, &[CostMap::new("primary", [0, 5])]).is_err());
        assert!(write_png(&path, &[]).is_err());
    }
}
