//! `cost.png`: estimated beside measured cost of every pixel's primary rays, on one scale.

use super::canvas::{Align, Canvas, Rgb};
use super::scale::{significant, tick_label, ticks};
use crate::ReportError;
use rt_balance::report::StreamRun;
use rt_core::Task;
use std::path::Path;

/// Estimated and measured cost of a picture's primary rays, gathered wave by wave.
///
/// Held at the resolution in which it is shown, so that a wave of a huge picture takes time for its own pixels alone
/// and the map no more memory than a screen.
#[derive(Debug)]
pub struct CostMap {
    /// Width and height of the picture in pixels.
    picture: [u32; 2],
    /// Rays per pixel.
    samples: u32,
    /// Width and height of the map in cells: the picture's pixels, or fewer where those are too many.
    size: [u32; 2],
    /// Row by row from the upper left.
    cells: Vec<Cell>,
    /// Nanoseconds per ray of each task, and its number of pixels.
    estimated: Vec<(f32, u32)>,
    measured: Vec<(f32, u32)>,
}

/// Predicted seconds of each task, after one scale that makes their total the measured one: before a device has traced
/// its first launches its prices come from sparse samples, which are more expensive than what follows.
#[must_use]
pub fn scaled_estimate(run: &StreamRun) -> Vec<f64> {
    let known = || run.predicted_s.iter().zip(&run.measured_s).filter(|(p, m)| p.is_finite() && m.is_finite());
    let (predicted, measured) = known().fold((0.0, 0.0), |(p, m), pair| (p + pair.0, m + pair.1));
    let scale = if predicted > 0.0 && measured > 0.0 { measured / predicted } else { 1.0 };
    run.predicted_s.iter().map(|seconds| seconds * scale).collect()
}

/// A part of the map: sums over those of its pixels whose cost is known, in nanoseconds per ray, and a task it belongs
/// to.
#[derive(Clone, Copy, Debug)]
struct Cell {
    estimated: Mean,
    measured: Mean,
    task: u32,
}

#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    sum: f32,
    known: u32,
}

impl Mean {
    fn add(&mut self, cost: f32) {
        if cost.is_finite() {
            self.sum += cost;
            self.known += 1;
        }
    }

    /// NaN where nothing is known.
    fn value(self) -> f32 {
        self.sum / self.known as f32
    }
}

/// Share of the known values that the colours tell apart, without a unit; the most expensive ones share the last
/// colour, so that a few outliers (a launch that was interrupted) do not darken all the rest.
const SHOWN_SHARE: f64 = 0.995;

/// Least mean area of a task on the picture, in pixels, for its outline to be drawn: outlines then cover about a
/// tenth of it.
const OUTLINED_AREA: f64 = 40.0 * 40.0;

/// A panel's longer side is at most this many pixels, so that both fit on a screen.
const LARGEST_PANEL: u32 = 880;

/// Images smaller than this are enlarged by a whole factor: two titles need this room.
const SMALLEST_PANEL: u32 = 420;

/// Room for a panel's title, in pixels, however narrow the image is.
const NARROWEST_SLOT: u32 = 240;

const MARGIN: u32 = 28;
const TITLES: u32 = 78;
const LEGEND: u32 = 92;
const BAR_HEIGHT: u32 = 16;

const PAPER: Rgb = [255; 3];
const INK: Rgb = [34; 3];
const FAINT: Rgb = [102; 3];
const UNKNOWN: Rgb = [160; 3];

/// The number of cells' tasks where there is none.
pub(crate) const NO_TASK: u32 = u32::MAX;

impl CostMap {
    /// An empty map of a picture of `size` pixels with `samples` rays in each.
    #[must_use]
    pub fn new(size: [u32; 2], samples: u32) -> Self {
        let longer = size[0].max(size[1]);
        let fit = |side: u32| {
            if longer > LARGEST_PANEL {
                (u64::from(side) * u64::from(LARGEST_PANEL)).div_ceil(u64::from(longer)) as u32
            } else {
                side
            }
        };
        let cells = size.map(fit);
        let empty = Cell { estimated: Mean::default(), measured: Mean::default(), task: NO_TASK };
        Self {
            picture: size,
            samples: samples.max(1),
            size: cells,
            cells: vec![empty; cells[0] as usize * cells[1] as usize],
            estimated: Vec::new(),
            measured: Vec::new(),
        }
    }

    /// Adds the tasks of a wave: what each was estimated to take and took, in seconds; NaN where that is not known.
    ///
    /// Ray `i` of the wave belongs to `pixels[i / samples]`, as in [`rt_core::CameraRays`]: `x | y << 16`. Pixels
    /// outside the picture are left out. Tasks are numbered on from those of the waves before.
    pub fn add_wave(&mut self, pixels: &[u32], tasks: &[Task], estimated_s: &[f64], measured_s: &[f64]) {
        let per_ray = |task: &Task, seconds: f64| (seconds * 1e9 / f64::from(task.rays.max(1))) as f32;
        for ((task, &estimated), &measured) in tasks.iter().zip(estimated_s).zip(measured_s) {
            let (estimated, measured) = (per_ray(task, estimated), per_ray(task, measured));
            let number = self.estimated.len() as u32;
            let last = task.first.saturating_add(task.rays).div_ceil(self.samples) as usize;
            let first = ((task.first / self.samples) as usize).min(last);
            let own = pixels.get(first..last.min(pixels.len())).unwrap_or_default();
            for &pixel in own {
                if let Some(cell) = self.cell_of(pixel) {
                    cell.estimated.add(estimated);
                    cell.measured.add(measured);
                    cell.task = number;
                }
            }
            self.estimated.push((estimated, own.len() as u32));
            self.measured.push((measured, own.len() as u32));
        }
    }

    /// The cell that a pixel belongs to.
    fn cell_of(&mut self, pixel: u32) -> Option<&mut Cell> {
        let at = [pixel & 0xffff, pixel >> 16];
        let place = |axis: usize| {
            let inside = at[axis] < self.picture[axis];
            inside.then(|| u64::from(at[axis]) * u64::from(self.size[axis]) / u64::from(self.picture[axis]))
        };
        let (x, y) = (place(0)?, place(1)?);
        self.cells.get_mut((y * u64::from(self.size[0]) + x) as usize)
    }

    /// Width and height in cells.
    pub(crate) const fn size(&self) -> [u32; 2] {
        self.size
    }

    /// The number of each cell's task, row by row; [`NO_TASK`] where there is none.
    pub(crate) fn tasks(&self) -> impl Iterator<Item = u32> {
        self.cells.iter().map(|cell| cell.task)
    }

    /// Writes the picture: two panels, one scale. The outlines of tasks are drawn where those are large enough to be
    /// seen.
    ///
    /// # Errors
    /// When the picture is empty or the file cannot be written.
    pub fn write_png(&self, path: &Path) -> Result<(), ReportError> {
        if self.cells.is_empty() {
            return Err(ReportError::Nothing("a cost map of no pixels"));
        }
        let enlarged = SMALLEST_PANEL.div_ceil(self.size[0].max(self.size[1])).max(1);
        let [width, height] = self.size.map(|side| side * enlarged);
        let mut scale = Scale::of(&[&self.estimated, &self.measured]);
        scale.unknown |= self.cells.iter().any(|cell| cell.task == NO_TASK);
        let slot = width.max(NARROWEST_SLOT);
        let canvas_width = 3 * MARGIN + 2 * slot;
        let mut canvas = Canvas::new(canvas_width, TITLES + height + LEGEND, PAPER)?;
        canvas.text("Cost per primary ray (estimate scaled to the measured total)", MARGIN, 32, 21.0, Align::Left, INK);
        // Name, costs of the tasks, and what a cell shows.
        type Panel<'a> = (&'a str, &'a [(f32, u32)], fn(&Cell) -> Mean);
        let panels: [Panel<'_>; 2] =
            [("estimated", &self.estimated, |cell| cell.estimated), ("measured", &self.measured, |cell| cell.measured)];
        for (index, (name, costs, mean)) in panels.into_iter().enumerate() {
            let left = MARGIN + index as u32 * (slot + MARGIN);
            canvas.text(&title(name, costs, &scale), left, TITLES - 10, 15.0, Align::Left, INK);
            for y in 0..height {
                for x in 0..width {
                    let cost = mean(self.cell(x / enlarged, y / enlarged)).value();
                    canvas.set(left + x, TITLES + y, scale.color(cost));
                }
            }
            self.outline(&mut canvas, left, enlarged);
        }
        legend(&mut canvas, TITLES + height, canvas_width, &scale);
        canvas.write_png(path)
    }

    fn cell(&self, x: u32, y: u32) -> &Cell {
        &self.cells[y as usize * self.size[0] as usize + x as usize]
    }

    fn outline(&self, canvas: &mut Canvas, left: u32, enlarged: u32) {
        let [width, height] = self.size.map(|side| side * enlarged);
        if f64::from(width) * f64::from(height) / (self.estimated.len().max(1) as f64) < OUTLINED_AREA {
            return;
        }
        let task = |x: u32, y: u32| self.cell(x / enlarged, y / enlarged).task;
        for y in 0..height {
            for x in 0..width {
                let here = task(x, y);
                let edge = x + 1 < width && task(x + 1, y) != here || y + 1 < height && task(x, y + 1) != here;
                if edge {
                    canvas.blend(i64::from(left + x), i64::from(TITLES + y), PAPER, 0.35);
                }
            }
        }
    }
}

fn title(name: &str, costs: &[(f32, u32)], scale: &Scale) -> String {
    let known = || costs.iter().filter(|(cost, _)| cost.is_finite());
    let pixels: u64 = known().map(|&(_, pixels)| u64::from(pixels)).sum();
    if pixels == 0 {
        return format!("{name}: unknown");
    }
    let sum: f64 = known().map(|&(cost, pixels)| f64::from(cost) * f64::from(pixels)).sum();
    format!("{name}, mean {} {}", significant(sum / pixels as f64 * scale.factor), scale.unit)
}

/// From cost to colour.
struct Scale {
    /// Cost of the last colour, in nanoseconds.
    top: f64,
    /// Whether any cost is beyond it.
    clipped: bool,
    /// Whether any cost is unknown.
    unknown: bool,
    /// From nanoseconds to `unit`.
    factor: f64,
    unit: &'static str,
}

impl Scale {
    /// Covers both panels. Starts at 0, so that twice as far along the colours is twice the cost.
    fn of(panels: &[&[(f32, u32)]; 2]) -> Self {
        let all = || panels.iter().flat_map(|costs| costs.iter()).filter(|(_, pixels)| *pixels > 0);
        let mut known: Vec<(f32, u32)> = all().copied().filter(|(cost, _)| cost.is_finite()).collect();
        let unknown = known.is_empty() || all().any(|(cost, _)| !cost.is_finite());
        known.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let pixels: u64 = known.iter().map(|&(_, pixels)| u64::from(pixels)).sum();
        let rank = (pixels as f64 * SHOWN_SHARE) as u64;
        let mut before = 0;
        let shown = known.iter().find(|(_, pixels)| {
            before += u64::from(*pixels);
            before > rank
        });
        let top = shown.or(known.last()).map_or(0.0, |&(cost, _)| f64::from(cost));
        // Something must be at the end of the scale, even if every cost is 0.
        let top = if top > 0.0 { top } else { 1.0 };
        let clipped = known.iter().any(|&(cost, _)| f64::from(cost) > top);
        let (factor, unit) = match top {
            t if t >= 1e7 => (1e-6, "ms"),
            t if t >= 1e4 => (1e-3, "µs"),
            _ => (1.0, "ns"),
        };
        Self { top, clipped, unknown, factor, unit }
    }

    /// Viridis (S. van der Walt and N. Smith, matplotlib 2015): evenly spaced to the eye, also without colour vision.
    fn color(&self, cost: f32) -> Rgb {
        if !cost.is_finite() {
            return UNKNOWN;
        }
        let colorous::Color { r, g, b } =
            colorous::VIRIDIS.eval_continuous((f64::from(cost) / self.top).clamp(0.0, 1.0));
        [r, g, b]
    }
}

fn legend(canvas: &mut Canvas, top: u32, width: u32, scale: &Scale) {
    let unknown_width = if scale.unknown { 110 } else { 0 };
    let (left, top) = (MARGIN, top + 22);
    let bar = width - 2 * MARGIN - unknown_width - 90;
    for x in 0..bar {
        let cost = (f64::from(x) + 0.5) / f64::from(bar) * scale.top;
        canvas.fill(left + x, top, 1, BAR_HEIGHT, scale.color(cost as f32));
    }
    let shown_top = scale.top * scale.factor;
    let ticks = ticks(shown_top, 6);
    let step = ticks.get(1).copied().unwrap_or(1.0);
    let end = format!("{}{}", if scale.clipped { "≥ " } else { "" }, significant(shown_top));
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
    let unit = format!("{}/ray", scale.unit);
    canvas.text(&unit, left + bar + 12, top + 13, 14.0, Align::Left, INK);
    if scale.unknown {
        let x = width - MARGIN - 84;
        canvas.fill(x, top, BAR_HEIGHT, BAR_HEIGHT, UNKNOWN);
        canvas.text("unknown", x + BAR_HEIGHT + 8, top + 13, 14.0, Align::Left, INK);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tasks_spread_over_their_pixels() {
        // Two samples a pixel; the third pixel lies outside the image, the fourth has no task.
        let mut map = CostMap::new([2, 2], 2);
        let tasks = [Task { first: 0, rays: 2 }, Task { first: 2, rays: 4 }];
        map.add_wave(&[0, 1, 7, 1 << 16], &tasks, &[2e-9, 8e-9], &[f64::NAN, 4e-9]);
        assert_eq!(map.tasks().collect::<Vec<_>>(), [0, 1, NO_TASK, NO_TASK]);
        let costs = map.cells.iter().map(|cell| (cell.estimated.value(), cell.measured.value()));
        let costs: Vec<(f32, f32)> = costs.collect();
        assert_eq!((costs[0].0, costs[1]), (1.0, (2.0, 1.0)));
        assert!(costs[0].1.is_nan() && costs[2].0.is_nan() && costs[3].1.is_nan());
    }

    /// Fails when a wave's tasks are numbered from 0, or a map is made for each wave.
    #[test]
    fn waves_together_make_the_map_of_the_whole() {
        let size = [90, 50];
        let pixels: Vec<u32> = (0..4500).map(|i| (i % 90) | ((i / 90) << 16)).collect();
        let tasks: Vec<Task> = (0..45).map(|i| Task { first: 100 * i, rays: 100 }).collect();
        let seconds: Vec<f64> = (0..45).map(|i| f64::from(i) * 1e-6).collect();
        let mut whole = CostMap::new(size, 1);
        whole.add_wave(&pixels, &tasks, &seconds, &seconds);
        let mut parts = CostMap::new(size, 1);
        for wave in 0..5 {
            let own = 9 * wave..9 * (wave + 1);
            parts.add_wave(&pixels[900 * wave..900 * (wave + 1)], &tasks[..9], &seconds[own.clone()], &seconds[own]);
        }
        assert!(whole.tasks().eq(parts.tasks()));
        let values = |map: &CostMap| map.cells.iter().map(|cell| cell.measured.value()).collect::<Vec<_>>();
        assert_eq!(values(&whole), values(&parts));
        assert_eq!(whole.estimated, parts.estimated);
    }

    /// Fails when the map is as large as the picture.
    #[test]
    fn a_map_of_a_huge_picture_is_small() {
        let mut map = CostMap::new([65_536, 40_000], 1);
        assert_eq!(map.size(), [880, 538]);
        map.add_wave(&[0, 65_535 | 39_999 << 16], &[Task { first: 0, rays: 2 }], &[4e-9], &[6e-9]);
        let known: Vec<u32> = (0..).zip(map.tasks()).filter(|(_, task)| *task == 0).map(|(at, _)| at).collect();
        assert_eq!(known, [0, 880 * 538 - 1]);
    }

    // Fails when the scale ends at the largest cost, or counts tasks and not their pixels.
    #[test]
    fn an_outlier_does_not_set_the_scale() {
        let scale = Scale::of(&[&[(100.0, 999), (1e9, 1)], &[(f32::NAN, 3), (1e9, 0)]]);
        assert_eq!((scale.top, scale.clipped, scale.unknown, scale.unit), (100.0, true, true, "ns"));
        assert_eq!(scale.color(f32::NAN), UNKNOWN);
        assert_eq!(scale.color(1e9), scale.color(100.0));
    }

    #[test]
    fn any_size_and_any_value_gives_a_picture() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("cost.png");
        for (width, height) in [(1, 1), (3, 2), (1, 2000), (2000, 1), (900, 30)] {
            for value in [0.0, 5.0, 1e9, f64::NAN, f64::INFINITY, -1.0] {
                let mut map = CostMap::new([width, height], 1);
                let pixels: Vec<u32> = (0..width * height).map(|i| (i % width) | ((i / width) << 16)).collect();
                map.add_wave(&pixels, &[Task { first: 0, rays: width * height }], &[value], &[value]);
                map.write_png(&path).unwrap();
            }
        }
        assert!(CostMap::new([0, 5], 1).write_png(&path).is_err());
        CostMap::new([5, 5], 1).write_png(&path).unwrap();
    }
}
