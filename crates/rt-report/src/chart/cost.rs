//! `cost.png`: estimated beside measured cost of every pixel's primary rays, on one scale.

use super::canvas::{Align, Canvas, Rgb};
use super::scale::{significant, tick_label, ticks};
use anyhow::{Result, ensure};
use rt_core::Task;
use std::path::Path;

/// What a cost picture shows: an image's pixels, row by row from the upper left.
#[derive(Clone, Copy, Debug)]
pub struct CostPicture<'a> {
    /// Width of the image in pixels.
    pub width: u32,
    /// Height of the image in pixels.
    pub height: u32,
    /// Estimated cost in nanoseconds per ray, scaled to the measured total; NaN where unknown.
    pub estimated: &'a [f32],
    /// Measured cost in nanoseconds per ray; NaN where unknown.
    pub measured: &'a [f32],
    /// The task of each pixel: where given and tasks are large enough to be seen, their outlines are drawn.
    pub task_of: Option<&'a [u32]>,
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

/// Nanoseconds per ray of each pixel, from the seconds of each task: what [`CostPicture`] takes.
///
/// Ray `i` of the stream belongs to `pixels[i / samples]`, as in [`rt_core::CameraRays`]: `x | y << 16`. A pixel shared
/// by tasks gets the last one's. Pixels without a task are NaN.
#[must_use]
pub fn per_pixel(size: [u32; 2], pixels: &[u32], samples: u32, tasks: &[Task], seconds: &[f64]) -> Vec<f32> {
    let costs = tasks.iter().zip(seconds).map(|(task, seconds)| (seconds * 1e9 / f64::from(task.rays.max(1))) as f32);
    spread(size, pixels, samples, tasks, costs, f32::NAN)
}

/// The number of each pixel's task; `u32::MAX` where there is none. See [`per_pixel`].
#[must_use]
pub fn tasks_per_pixel(size: [u32; 2], pixels: &[u32], samples: u32, tasks: &[Task]) -> Vec<u32> {
    spread(size, pixels, samples, tasks, 0.., u32::MAX)
}

fn spread<T: Copy>(
    [width, height]: [u32; 2],
    pixels: &[u32],
    samples: u32,
    tasks: &[Task],
    values: impl Iterator<Item = T>,
    none: T,
) -> Vec<T> {
    let mut image = vec![none; width as usize * height as usize];
    let samples = samples.max(1);
    for (task, value) in tasks.iter().zip(values) {
        let last = task.first.saturating_add(task.rays).div_ceil(samples) as usize;
        let first = ((task.first / samples) as usize).min(last);
        for &pixel in pixels.iter().take(last).skip(first) {
            let (x, y) = (pixel & 0xffff, pixel >> 16);
            if x < width && y < height {
                image[y as usize * width as usize + x as usize] = value;
            }
        }
    }
    image
}

/// Writes the picture: two panels, one scale.
///
/// # Errors
/// When a slice does not have `width · height` entries, the image is empty, or the file cannot be written.
pub fn write_png(path: &Path, picture: &CostPicture<'_>) -> Result<()> {
    let CostPicture { width, height, estimated, measured, task_of } = *picture;
    let pixels = u64::from(width) * u64::from(height);
    ensure!(pixels > 0, "a cost picture of {width} × {height} pixels has nothing to show");
    for length in [estimated.len(), measured.len(), task_of.map_or(pixels as usize, <[u32]>::len)] {
        ensure!(length as u64 == pixels, "{length} costs for a picture of {width} × {height}");
    }

    let view = View::new(width, height);
    let scale = Scale::of(estimated, measured);
    let slot = view.width.max(NARROWEST_SLOT);
    let canvas_width = 3 * MARGIN + 2 * slot;
    let mut canvas = Canvas::new(canvas_width, TITLES + view.height + LEGEND, PAPER)?;
    canvas.text("Cost per primary ray (estimate scaled to the measured total)", MARGIN, 32, 21.0, Align::Left, INK);
    for (index, (name, costs)) in [("estimated", estimated), ("measured", measured)].into_iter().enumerate() {
        let left = MARGIN + index as u32 * (slot + MARGIN);
        canvas.text(&title(name, costs, &scale), left, TITLES - 10, 15.0, Align::Left, INK);
        view.draw(&mut canvas, left, TITLES, costs, &scale);
        if let Some(task_of) = task_of {
            view.outline(&mut canvas, left, TITLES, task_of);
        }
    }
    legend(&mut canvas, TITLES + view.height, canvas_width, &scale);
    canvas.write_png(path)
}

fn title(name: &str, costs: &[f32], scale: &Scale) -> String {
    let mut known = 0_u64;
    let sum: f64 = costs.iter().filter(|cost| cost.is_finite()).inspect(|_| known += 1).map(|&c| f64::from(c)).sum();
    if known == 0 {
        return format!("{name}: unknown");
    }
    format!("{name}, mean {} {}", significant(sum / known as f64 * scale.factor), scale.unit)
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
    fn of(estimated: &[f32], measured: &[f32]) -> Self {
        let all = || estimated.iter().chain(measured);
        let mut known: Vec<f32> = all().copied().filter(|cost| cost.is_finite()).collect();
        let unknown = all().any(|cost| !cost.is_finite());
        let rank = ((known.len() as f64 * SHOWN_SHARE) as usize).min(known.len().saturating_sub(1));
        let top = if known.is_empty() { 0.0 } else { f64::from(*known.select_nth_unstable_by(rank, f32::total_cmp).1) };
        // Something must be at the end of the scale, even if every cost is 0.
        let top = if top > 0.0 { top } else { 1.0 };
        let clipped = known.iter().any(|&cost| f64::from(cost) > top);
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

/// How an image is fitted into a panel.
struct View {
    image: [u32; 2],
    width: u32,
    height: u32,
}

impl View {
    fn new(width: u32, height: u32) -> Self {
        let longer = width.max(height);
        let fit = |side: u32| {
            if longer > LARGEST_PANEL {
                (u64::from(side) * u64::from(LARGEST_PANEL)).div_ceil(u64::from(longer)) as u32
            } else {
                side * SMALLEST_PANEL.div_ceil(longer)
            }
        };
        Self { image: [width, height], width: fit(width), height: fit(height) }
    }

    /// The image's pixels under one of the panel's, at least one: `start..end` along an axis.
    fn source(&self, axis: usize, at: u32) -> std::ops::Range<usize> {
        let panel = u64::from([self.width, self.height][axis]);
        let image = u64::from(self.image[axis]);
        let start = u64::from(at) * image / panel;
        let end = ((u64::from(at) + 1) * image).div_ceil(panel);
        start as usize..end.max(start + 1) as usize
    }

    fn draw(&self, canvas: &mut Canvas, left: u32, top: u32, costs: &[f32], scale: &Scale) {
        for y in 0..self.height {
            for x in 0..self.width {
                let (mut sum, mut known) = (0.0, 0.0);
                for row in self.source(1, y) {
                    for column in self.source(0, x) {
                        let cost = costs[row * self.image[0] as usize + column];
                        if cost.is_finite() {
                            sum += cost;
                            known += 1.0;
                        }
                    }
                }
                canvas.set(left + x, top + y, scale.color(sum / known));
            }
        }
    }

    fn outline(&self, canvas: &mut Canvas, left: u32, top: u32, task_of: &[u32]) {
        let tasks = task_of.iter().filter(|&&task| task != u32::MAX).max().map_or(1.0, |&task| f64::from(task) + 1.0);
        if f64::from(self.width) * f64::from(self.height) / tasks < OUTLINED_AREA {
            return;
        }
        let task = |x: u32, y: u32| task_of[self.source(1, y).start * self.image[0] as usize + self.source(0, x).start];
        for y in 0..self.height {
            for x in 0..self.width {
                let here = task(x, y);
                let edge =
                    x + 1 < self.width && task(x + 1, y) != here || y + 1 < self.height && task(x, y + 1) != here;
                if edge {
                    canvas.blend(i64::from(left + x), i64::from(top + y), PAPER, 0.35);
                }
            }
        }
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
        let pixels = [0, 1, 7, 1 << 16];
        let tasks = [Task { first: 0, rays: 2 }, Task { first: 2, rays: 4 }];
        let costs = per_pixel([2, 2], &pixels, 2, &tasks, &[2e-9, 8e-9]);
        assert_eq!(costs[..2], [1.0, 2.0]);
        assert!(costs[2].is_nan() && costs[3].is_nan());
        assert_eq!(tasks_per_pixel([2, 2], &pixels, 2, &tasks), [0, 1, u32::MAX, u32::MAX]);
    }

    // Fails when the scale ends at the largest cost.
    #[test]
    fn an_outlier_does_not_set_the_scale() {
        let mut costs = vec![100.0; 1000];
        costs[3] = 1e9;
        let scale = Scale::of(&costs, &[f32::NAN]);
        assert_eq!((scale.top, scale.clipped, scale.unknown, scale.unit), (100.0, true, true, "ns"));
        assert_eq!(scale.color(f32::NAN), UNKNOWN);
        assert_eq!(scale.color(1e9), scale.color(100.0));
    }

    #[test]
    fn any_size_and_any_value_gives_a_picture() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("cost.png");
        for (width, height) in [(1, 1), (3, 2), (1, 2000), (2000, 1), (900, 30)] {
            for value in [0.0, 5.0, 1e9, f32::NAN, f32::INFINITY, -1.0] {
                let costs = vec![value; (width * height) as usize];
                let tasks = vec![0; costs.len()];
                let (estimated, measured) = (&costs[..], &costs[..]);
                let picture = CostPicture { width, height, estimated, measured, task_of: Some(&tasks) };
                write_png(&path, &picture).unwrap();
            }
        }
        let picture = CostPicture { width: 2, height: 2, estimated: &[], measured: &[], task_of: None };
        assert!(write_png(&path, &picture).is_err());
    }
}
