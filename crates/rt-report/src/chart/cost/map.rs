//! Which task's rays are where in a picture, and what they cost.

use super::tasks::{Origin, TaskCosts};
use super::{Top, one_in};
use crate::table::seconds;
use rt_balance::report::StreamRun;
use std::ops::Range;

/// Estimated and measured cost of the rays of one kind that a picture sent, gathered wave by wave.
///
/// Held at the resolution in which it is shown, so that a wave of a huge picture takes time for its own rays alone and
/// the map no more memory than a screen.
#[derive(Debug)]
pub struct CostMap {
    /// What the rays are called.
    kind: String,
    /// The frame of an animation, and what is told of it.
    frame: Option<(u32, String)>,
    /// Width and height of the picture in pixels.
    picture: [u32; 2],
    /// Width and height of the map in cells: the picture's pixels, or fewer where those are too many.
    size: [u32; 2],
    /// Row by row from the upper left.
    cells: Vec<Cell>,
    tasks: Vec<TaskCost>,
    waves: Vec<Wave>,
    /// Names of the devices.
    devices: Vec<String>,
    /// Of the rays, the largest share that was sampled for estimates that were not used.
    unused_fraction: f64,
    /// Why nothing was estimated, where that is so and told.
    reason: Option<String>,
}

/// A map for each kind of rays of the first frame that was rendered and, of several, of the most expensive one.
///
/// Maps of all frames would take a screen each, and all look alike: the first is the one whose estimates knew nothing,
/// the most expensive one is where a better split would have gained most.
#[derive(Debug)]
pub struct CostMaps {
    size: [u32; 2],
    /// The first, the most expensive of the others that are over, and the one at hand.
    frames: Vec<Frame>,
    /// Frames so far.
    count: u32,
}

/// The maps of a frame.
#[derive(Debug)]
struct Frame {
    number: u32,
    /// Wall seconds of tracing.
    seconds: f64,
    maps: Vec<CostMap>,
}

/// Most kinds of rays that get a map: each takes memory and a screen to look at. Later bounces look alike.
const MOST_KINDS: usize = 6;

/// Most frames of which maps are held: see [`CostMaps`].
const MOST_FRAMES: usize = 3;

impl CostMaps {
    /// No map yet, of a picture of `size` pixels.
    #[must_use]
    pub const fn new(size: [u32; 2]) -> Self {
        Self { size, frames: Vec::new(), count: 0 }
    }

    /// Adds a stream to the map of its frame and kind, as [`CostMap::add`] does. Frames come one after the other.
    pub fn add(&mut self, run: &StreamRun, pixels: impl Fn(Range<u32>, &mut dyn FnMut(u32))) {
        let (kind, number) = (&run.report.kind, run.report.frame);
        if self.frames.last().is_none_or(|frame| frame.number != number) {
            if self.frames.len() == MOST_FRAMES {
                self.drop_cheaper();
            }
            self.frames.push(Frame { number, seconds: 0.0, maps: Vec::new() });
            self.count += 1;
        }
        let Some(Frame { seconds, maps, .. }) = self.frames.last_mut() else { return };
        *seconds += run.report.makespan_s;
        if let Some(map) = maps.iter_mut().find(|map| map.kind == *kind) {
            map.add(run, pixels);
        } else if maps.len() < MOST_KINDS {
            let mut map = CostMap::new(kind, self.size);
            map.add(run, pixels);
            maps.push(map);
        }
    }

    /// Of the last two frames the cheaper one goes.
    fn drop_cheaper(&mut self) {
        if let [.., before, last] = &self.frames[..] {
            let cheaper = self.frames.len() - if last.seconds > before.seconds { 2 } else { 1 };
            self.frames.remove(cheaper);
        }
    }

    /// The maps, frame by frame in the order in which their kinds came.
    #[must_use]
    pub fn into_maps(mut self) -> Vec<CostMap> {
        // The most expensive frame may be the first one.
        while self.frames.len() > 2 {
            self.drop_cheaper();
        }
        let first = self.frames.first().map_or(0.0, |frame| frame.seconds);
        let is_first_most = self.frames.iter().all(|frame| frame.seconds <= first);
        if is_first_most {
            self.frames.truncate(1);
        }
        let about = |(index, frame): (usize, &Frame)| {
            let told = match (self.count, index) {
                (0 | 1, _) => return None,
                (all, 0) if is_first_most => format!("the first and most expensive of {all}"),
                (all, 0) => format!("the first of {all}"),
                (all, _) => format!("the most expensive of {all}"),
            };
            Some((frame.number, format!("{told}, {} of tracing", seconds(frame.seconds))))
        };
        let abouts: Vec<Option<(u32, String)>> = self.frames.iter().enumerate().map(about).collect();
        let mut maps = Vec::new();
        for (frame, about) in self.frames.into_iter().zip(abouts) {
            maps.extend(frame.maps.into_iter().map(|map| CostMap { frame: about.clone(), ..map }));
        }
        maps
    }
}

/// The pixels of some rays as [`CostMap::add`] asks for them, of which each ray's is known.
pub fn each_ray(pixel: impl Fn(u32) -> u32) -> impl Fn(Range<u32>, &mut dyn FnMut(u32)) {
    move |rays, take| rays.for_each(|ray| take(pixel(ray)))
}

/// A part of the picture that was traced together.
#[derive(Debug)]
struct Wave {
    /// Number of its first task in the map.
    first: usize,
    /// As in [`TaskCosts`].
    factors: Vec<f64>,
}

/// One task.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TaskCost {
    pub(crate) rays: u32,
    /// Those whose hits the estimate had found, so that they were not traced again.
    pub(crate) kept: u32,
    /// As in [`TaskCosts`].
    pub(crate) tests: Option<(f32, Option<f32>)>,
    /// Seconds on its own device; NaN where unknown.
    pub(crate) estimated_s: f64,
    pub(crate) measured_s: f64,
    /// From its own device's seconds to those of a mean device.
    factor: f64,
    pub(crate) device: u32,
    origin: Origin,
}

impl TaskCost {
    /// Rays that were traced.
    pub(crate) const fn traced(&self) -> u32 {
        self.rays.saturating_sub(self.kept)
    }

    /// Estimated and measured nanoseconds per ray that was traced, on a device of mean speed; NaN where unknown.
    fn per_ray(&self) -> [f64; 2] {
        [self.estimated_s, self.measured_s].map(|s| s * self.factor * 1e9 / f64::from(self.traced()))
    }
}

/// A part of the map: sums over the tasks that have rays there, in nanoseconds per ray, and one of those tasks.
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
    fn add(&mut self, cost: f64) {
        if cost.is_finite() {
            self.sum += cost as f32;
            self.known += 1;
        }
    }

    /// NaN where nothing is known.
    fn value(self) -> f32 {
        self.sum / self.known as f32
    }
}

/// Nanoseconds per ray over all tasks of which both are known; `None` where there is no such task.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Means {
    pub(crate) estimated: Option<f64>,
    pub(crate) measured: Option<f64>,
}

/// A map's longer side is at most this many cells, so that two of them fit on a screen.
const LONGEST_SIDE: u32 = 880;

/// The number of cells' tasks where there is none.
const NO_TASK: u32 = u32::MAX;

impl CostMap {
    /// An empty map of a picture of `size` pixels.
    #[must_use]
    pub fn new(kind: &str, size: [u32; 2]) -> Self {
        let longer = size[0].max(size[1]);
        let fit = |side: u32| {
            if longer > LONGEST_SIDE {
                (u64::from(side) * u64::from(LONGEST_SIDE)).div_ceil(u64::from(longer)) as u32
            } else {
                side
            }
        };
        let cells = size.map(fit);
        let empty = Cell { estimated: Mean::default(), measured: Mean::default(), task: NO_TASK };
        Self {
            kind: kind.to_owned(),
            frame: None,
            picture: size,
            size: cells,
            cells: vec![empty; cells[0] as usize * cells[1] as usize],
            tasks: Vec::new(),
            waves: Vec::new(),
            devices: Vec::new(),
            unused_fraction: 0.0,
            reason: None,
        }
    }

    /// Adds the tasks of a wave. `pixels` hands over the pixels of some of its rays, `x | y << 16`, those that follow
    /// each other and are the same once or more often. Pixels outside the picture are left out. Tasks are numbered on
    /// from those of the waves before.
    pub fn add(&mut self, run: &StreamRun, pixels: impl Fn(Range<u32>, &mut dyn FnMut(u32))) {
        let costs = TaskCosts::of(run);
        self.waves.push(Wave { first: self.tasks.len(), factors: costs.factors.clone() });
        if self.devices.is_empty() {
            self.devices = run.report.devices.iter().map(|device| device.name.clone()).collect();
        }
        if costs.origin != Origin::Used {
            self.reason = self.reason.take().or_else(|| run.report.estimate.reason.clone());
        }
        let unused = run.report.estimate.unused.as_ref().map_or(0.0, |unused| unused.fraction);
        self.unused_fraction = self.unused_fraction.max(unused);
        for (index, task) in run.tasks.iter().enumerate() {
            let device = run.device_of[index];
            let cost = TaskCost {
                rays: task.rays,
                kept: run.kept[index],
                tests: costs.tests.get(index).copied(),
                estimated_s: costs.estimated_s[index],
                measured_s: costs.measured_s[index],
                factor: costs.factors.get(device as usize).copied().unwrap_or(1.0),
                device,
                origin: costs.origin,
            };
            let number = self.tasks.len() as u32;
            let [estimated, measured] = cost.per_ray();
            let mut before = None;
            pixels(task.range(), &mut |here| {
                // The samples of a pixel follow each other.
                if before.replace(here) != Some(here)
                    && let Some(cell) = self.cell_of(here)
                {
                    cell.estimated.add(estimated);
                    cell.measured.add(measured);
                    cell.task = number;
                }
            });
            self.tasks.push(cost);
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

    /// Whether it is of one of several frames.
    pub(crate) const fn is_of_animation(&self) -> bool {
        self.frame.is_some()
    }

    /// What the rays are called, such as `shadow 0`; of an animation with the frame.
    #[must_use]
    pub fn name(&self) -> String {
        let frame = self.frame.as_ref().map_or_else(String::new, |(number, told)| format!(", frame {number} ({told})"));
        format!("{} rays{frame}", self.kind)
    }

    /// The same without blanks, as channels of a file are called: `shadow_0`, or `frame_7.shadow_0`.
    #[must_use]
    pub fn channel(&self) -> String {
        let frame = self.frame.as_ref().map_or_else(String::new, |(number, _)| format!("frame_{number}."));
        format!("{frame}{}", self.kind.replace(' ', "_"))
    }

    /// Width and height in cells.
    pub(crate) const fn size(&self) -> [u32; 2] {
        self.size
    }

    pub(crate) fn tasks(&self) -> &[TaskCost] {
        &self.tasks
    }

    /// Names of the devices.
    pub(crate) fn devices(&self) -> &[String] {
        &self.devices
    }

    /// For each wave the number of its first task, and for each device what turns its seconds into those of a mean one.
    pub(crate) fn waves(&self) -> impl Iterator<Item = (usize, &[f64])> {
        self.waves.iter().map(|wave| (wave.first, &wave.factors[..]))
    }

    /// The number of a cell's task; `None` where no such ray was sent.
    pub(crate) fn task_at(&self, x: u32, y: u32) -> Option<u32> {
        let task = self.cells[y as usize * self.size[0] as usize + x as usize].task;
        (task != NO_TASK).then_some(task)
    }

    /// Estimated and measured nanoseconds per ray of a cell; NaN where unknown.
    pub(crate) fn costs_at(&self, x: u32, y: u32) -> [f32; 2] {
        let cell = &self.cells[y as usize * self.size[0] as usize + x as usize];
        [cell.estimated.value(), cell.measured.value()]
    }

    /// The end of the scale that both maps share, in nanoseconds per ray: by what was measured, so that an estimate
    /// which is far off does not darken the truth.
    pub(crate) fn top(&self) -> Top {
        let side = |index: usize| self.tasks.iter().map(move |task| (task.per_ray()[index], task.traced()));
        let is_measured = side(1).any(|(cost, rays)| cost.is_finite() && rays > 0);
        Top::of(side(usize::from(is_measured)))
    }

    /// The means of both maps, over the same tasks.
    pub(crate) fn means(&self) -> Means {
        let is_estimated = self.origin() != Origin::Nowhere;
        let known = |task: &&TaskCost| {
            let [estimated, measured] = task.per_ray();
            measured.is_finite() && (estimated.is_finite() || !is_estimated)
        };
        let (mut rays, mut sums) = (0.0, [0.0; 2]);
        for task in self.tasks.iter().filter(known) {
            let traced = f64::from(task.traced());
            rays += traced;
            sums.iter_mut().zip(task.per_ray()).for_each(|(sum, cost)| *sum += cost * traced);
        }
        let [estimated, measured] = sums.map(|sum| Some(sum / rays).filter(|mean| mean.is_finite()));
        Means { estimated, measured }
    }

    /// Where most of the estimates come from.
    pub(crate) fn origin(&self) -> Origin {
        let count = |origin: Origin| self.tasks.iter().filter(|task| task.origin == origin).count();
        let all = [Origin::Used, Origin::NotUsed, Origin::Nowhere];
        all.into_iter().max_by_key(|&origin| (count(origin), std::cmp::Reverse(origin))).unwrap_or(Origin::Nowhere)
    }

    /// What the map of estimates is called.
    pub(crate) const fn name_of_estimate(origin: Origin) -> &'static str {
        match origin {
            Origin::Used => "estimated",
            Origin::NotUsed => "estimated (not used)",
            Origin::Nowhere => "not estimated",
        }
    }

    /// Whether seconds of different devices were made comparable.
    pub(crate) fn is_normalised(&self) -> bool {
        self.waves.iter().flat_map(|wave| &wave.factors).any(|&factor| factor != 1.0)
    }

    /// What a map of estimates that were not used shows; `None` where they were, or there are none.
    pub(crate) fn not_used(&self) -> Option<String> {
        let sampled = one_in(self.unused_fraction);
        (self.origin() == Origin::NotUsed).then(|| format!("what {sampled}, sampled afterwards, would have predicted"))
    }

    /// Why nothing was estimated; `None` where something was.
    pub(crate) fn why_not(&self) -> Option<String> {
        let reason = self.reason.as_ref().map_or_else(String::new, |reason| format!(": {reason}"));
        (self.origin() != Origin::Used).then(|| format!("No estimate was made{reason}."))
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::samples::run;
    use super::*;
    use rt_core::{Task, Work};

    /// A stream of tasks of so many rays, estimated and measured in seconds, all on one device.
    fn stream(sizes: &[u32], estimated_s: &[f64], measured_s: &[f64]) -> StreamRun {
        let mut first = 0;
        let mut task = |&rays: &u32| {
            first += rays;
            Task { first: first - rays, rays }
        };
        let mut run = run(1, Vec::new());
        run.report.estimate.chosen = "exact".to_owned();
        run.tasks = sizes.iter().map(&mut task).collect();
        run.work = vec![Work::new(1.0, 1.0, 0.0); sizes.len()];
        run.kept = vec![0; sizes.len()];
        run.device_of = vec![0; sizes.len()];
        (run.predicted_s, run.measured_s) = (estimated_s.to_vec(), measured_s.to_vec());
        run
    }

    #[test]
    fn tasks_spread_over_their_pixels() {
        // Two samples a pixel; the third pixel lies outside the picture, the fourth has no ray.
        let mut map = CostMap::new("primary", [2, 2]);
        let pixels = [0, 1, 7, 1 << 16];
        map.add(&stream(&[2, 4], &[2e-9, 8e-9], &[2e-9, 8e-9]), each_ray(|ray| pixels[(ray / 2) as usize]));
        let cells: Vec<Option<u32>> = (0..4).map(|i| map.task_at(i % 2, i / 2)).collect();
        assert_eq!(cells, [Some(0), Some(1), None, None]);
        assert_eq!((map.costs_at(0, 0), map.costs_at(1, 0)), ([1.0; 2], [2.0; 2]));
        assert!(map.costs_at(0, 1)[0].is_nan());
    }

    /// Fails when means are over different tasks, or count tasks and not rays.
    #[test]
    fn both_means_are_over_the_same_rays() {
        let mut map = CostMap::new("primary", [3, 1]);
        map.add(&stream(&[1, 3, 5], &[3e-9, 3e-9, f64::NAN], &[1e-9, 9e-9, 50e-9]), each_ray(|_| 0));
        // One scale takes the estimates of a device to what it took: unknown here.
        let Means { estimated, measured } = map.means();
        assert!((measured.unwrap() - 2.5).abs() < 1e-9 && (estimated.unwrap() - 1.5).abs() < 1e-9);
    }

    /// Fails when a wave's tasks are numbered from 0, or a map is made for each wave.
    #[test]
    fn waves_together_make_the_map_of_the_whole() {
        let seconds: Vec<f64> = (0..45).map(|i| f64::from(i) * 1e-6).collect();
        let pixel = |i: u32| (i % 90) | ((i / 90) << 16);
        let mut whole = CostMap::new("primary", [90, 50]);
        whole.add(&stream(&[100; 45], &seconds, &seconds), each_ray(pixel));
        let mut parts = CostMap::new("primary", [90, 50]);
        for wave in 0..5 {
            let own = &seconds[9 * wave..9 * (wave + 1)];
            parts.add(&stream(&[100; 9], own, own), each_ray(|ray| pixel(900 * wave as u32 + ray)));
        }
        let all = || (0..50).flat_map(|y| (0..90).map(move |x| (x, y)));
        assert!(all().all(|(x, y)| whole.task_at(x, y) == parts.task_at(x, y)));
        assert!(all().all(|(x, y)| whole.costs_at(x, y)[1] == parts.costs_at(x, y)[1]));
        assert_eq!(parts.waves().map(|(first, _)| first).collect::<Vec<_>>(), [0, 9, 18, 27, 36]);
    }

    /// Fails when the map is as large as the picture.
    #[test]
    fn a_map_of_a_huge_picture_is_small() {
        let mut map = CostMap::new("primary", [65_536, 40_000]);
        assert_eq!(map.size(), [880, 538]);
        map.add(&stream(&[2], &[4e-9], &[6e-9]), each_ray(|ray| [0, 65_535 | 39_999 << 16][ray as usize]));
        assert_eq!((map.task_at(0, 0), map.task_at(879, 537)), (Some(0), Some(0)));
        assert_eq!(map.cells.iter().filter(|cell| cell.task != NO_TASK).count(), 2);
    }

    /// Fails when an estimate sets the scale of what was measured.
    #[test]
    fn the_scale_is_that_of_what_was_measured() {
        let mut map = CostMap::new("primary", [2, 1]);
        map.add(&stream(&[10, 10], &[1e-9, 1e-3], &[20e-9, f64::NAN]), each_ray(|_| 0));
        assert!((map.top().cost - 2.0).abs() < 1e-9, "{:?}", map.top());
    }

    /// Mutants: the last frame in place of the most expensive one; the first twice; a picture alone called a frame.
    #[test]
    fn the_first_and_the_most_expensive_frame_have_maps() {
        let told = |makespans: &[f64]| {
            let mut maps = CostMaps::new([2, 1]);
            for (frame, &makespan_s) in (4..).zip(makespans) {
                // Two streams of two kinds.
                for kind in ["primary", "shadow 0"] {
                    let mut run = stream(&[2], &[1e-9], &[1e-9]);
                    (run.report.frame, run.report.kind) = (frame, kind.to_owned());
                    run.report.makespan_s = makespan_s / 2.0;
                    maps.add(&run, each_ray(|ray| ray));
                }
            }
            maps.into_maps().iter().map(CostMap::name).collect::<Vec<_>>()
        };
        assert_eq!(told(&[]), [""; 0]);
        assert_eq!(told(&[1.0]), ["primary rays", "shadow 0 rays"]);
        let both = |frame: &str| ["primary", "shadow 0"].map(|kind| format!("{kind} rays, frame {frame} of tracing)"));
        let first = both("4 (the first and most expensive of 3, 5.00 s");
        assert_eq!(told(&[5.0, 1.0, 2.0]), first);
        for makespans in [&[1.0, 2.0, 9.0, 3.0, 4.0][..], &[1.0, 2.0, 9.0, 8.0, 8.5]] {
            let maps = told(makespans);
            assert_eq!(maps[..2], both("4 (the first of 5, 1.00 s"));
            assert_eq!(maps[2..], both("6 (the most expensive of 5, 9.00 s"));
        }
    }
}
