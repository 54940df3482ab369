//! What tracing costs: device-independent work, a device's own seconds, and the estimator's seam.

use crate::{Coherence, RaySource, Task, TaskId, TestCounts, Walk};
use alloc::string::String;
use alloc::vec::Vec;
use core::any::TypeId;
use core::fmt::{self, Debug};

/// Expected work of one task on one tree layout: how many rays, box tests and triangle tests, and how unlike
/// neighbouring rays are. Always finite and ≥ 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Work {
    rays: f32,
    boxes: f32,
    triangles: f32,
    divergence: f32,
    std_error: f32,
}

/// A standard error that is not known. A number, so that equal works are equal.
const UNKNOWN: f32 = -1.0;

impl Work {
    /// Work of `rays` rays that make `boxes` box tests and `triangles` triangle tests in total.
    ///
    /// Values that are negative or not finite are clamped to `0 ..= f32::MAX` (NaN to 0), so scheduling never fails.
    #[must_use]
    pub fn new(rays: f32, boxes: f32, triangles: f32) -> Self {
        let [rays, boxes, triangles] = [rays, boxes, triangles].map(clamped);
        Self { rays, boxes, triangles, divergence: 0.0, std_error: UNKNOWN }
    }

    /// The same work with the divergence of its rays, in box tests; clamped as in [`Work::new`].
    #[must_use]
    pub fn with_divergence(mut self, divergence: f32) -> Self {
        self.divergence = clamped(divergence);
        self
    }

    /// The same work with the standard error of its number of tests (boxes + triangles), in tests. Anything but a
    /// number ≥ 0 says that it is not known.
    #[must_use]
    pub const fn with_std_error(mut self, std_error: f32) -> Self {
        self.std_error = if std_error >= 0.0 { std_error } else { UNKNOWN };
        self
    }

    /// Number of rays.
    #[must_use]
    pub const fn rays(&self) -> f32 {
        self.rays
    }

    /// Expected box tests.
    #[must_use]
    pub const fn boxes(&self) -> f32 {
        self.boxes
    }

    /// Expected triangle tests.
    #[must_use]
    pub const fn triangles(&self) -> f32 {
        self.triangles
    }

    /// By how much the box tests of rays that follow each other differ, summed over the rays, in box tests.
    ///
    /// Two tasks of equal counts take different times: rays that go other ways than the one before them find little of
    /// what they need in caches, and branch predictors err. This is a measure of it that exact counts give for nothing.
    #[must_use]
    pub const fn divergence(&self) -> f32 {
        self.divergence
    }

    /// What has a price of its own in a [`CostModel`]: rays, box tests, triangle tests, divergence.
    #[must_use]
    pub fn parts(&self) -> [f64; 4] {
        [self.rays, self.boxes, self.triangles, self.divergence].map(f64::from)
    }

    /// Box and triangle tests together: the count that estimation errors are measured in.
    #[must_use]
    pub fn tests(&self) -> f32 {
        self.boxes + self.triangles
    }

    /// Standard error of [`Work::tests`] against exact counts, in tests; `None` where too little is known to say it.
    #[must_use]
    pub fn std_error(&self) -> Option<f32> {
        (self.std_error >= 0.0).then_some(self.std_error)
    }

    /// Both works done one after the other; the standard error is unknown.
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        Self::new(self.rays + other.rays, self.boxes + other.boxes, self.triangles + other.triangles)
            .with_divergence(self.divergence + other.divergence)
    }

    /// Tests and divergence (not rays) multiplied by `factor`; the standard error scales along.
    #[must_use]
    pub fn scaled(&self, factor: f32) -> Self {
        Self::new(self.rays, self.boxes * factor, self.triangles * factor)
            .with_divergence(self.divergence * factor)
            .with_std_error(self.std_error * factor)
    }

    /// A `share` of the work, from 0 to 1, its rays too; the standard error is unknown.
    #[must_use]
    pub fn part(&self, share: f32) -> Self {
        Self::new(self.rays * share, self.boxes * share, self.triangles * share)
            .with_divergence(self.divergence * share)
    }
}

/// Work is never negative, infinite or undefined.
fn clamped(x: f32) -> f32 {
    if x > 0.0 { x.min(f32::MAX) } else { 0.0 }
}

/// One device's seconds for work on one tree layout:
/// `per_launch + per_ray · rays + per_box · boxes + per_triangle · triangles + per_divergence · divergence`. Every part
/// is finite and ≥ 0, and one ray with one box test costs more than nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CostModel {
    per_launch: f64,
    per_ray: f64,
    per_box: f64,
    per_triangle: f64,
    per_divergence: f64,
}

impl CostModel {
    /// A device that needs one nanosecond for every ray, box test and triangle test, and none for a launch: what is
    /// assumed of every device before any launch was measured.
    pub const UNIT: Self =
        Self { per_launch: 0.0, per_ray: 1e-9, per_box: 1e-9, per_triangle: 1e-9, per_divergence: 0.0 };

    /// Seconds per launch, ray, box test and triangle test, divergence being free; `None` unless all are finite and ≥ 0
    /// and `per_ray + per_box > 0`.
    #[must_use]
    pub fn new(per_launch: f64, per_ray: f64, per_box: f64, per_triangle: f64) -> Option<Self> {
        let valid = [per_launch, per_ray, per_box, per_triangle].iter().all(|x| x.is_finite() && *x >= 0.0);
        let model = Self { per_launch, per_ray, per_box, per_triangle, per_divergence: 0.0 };
        (valid && per_ray + per_box > 0.0).then_some(model)
    }

    /// The same model with a price of divergence, in seconds per box test of it; `None` unless it is finite and ≥ 0.
    #[must_use]
    pub fn with_divergence(mut self, per_divergence: f64) -> Option<Self> {
        self.per_divergence = per_divergence;
        (per_divergence.is_finite() && per_divergence >= 0.0).then_some(self)
    }

    /// Seconds that every launch costs on the device beside its rays, while it ramps up and drains. Launches in flight
    /// do not hide them, as they hide the host's hand-over.
    #[must_use]
    pub const fn per_launch(&self) -> f64 {
        self.per_launch
    }

    /// Seconds per ray, beyond its tests.
    #[must_use]
    pub const fn per_ray(&self) -> f64 {
        self.per_ray
    }

    /// Seconds per box test.
    #[must_use]
    pub const fn per_box(&self) -> f64 {
        self.per_box
    }

    /// Seconds per triangle test.
    #[must_use]
    pub const fn per_triangle(&self) -> f64 {
        self.per_triangle
    }

    /// Seconds per box test of [`Work::divergence`].
    #[must_use]
    pub const fn per_divergence(&self) -> f64 {
        self.per_divergence
    }

    /// The price of each of [`Work::parts`], in seconds.
    #[must_use]
    pub const fn per_part(&self) -> [f64; 4] {
        [self.per_ray, self.per_box, self.per_triangle, self.per_divergence]
    }

    /// Expected seconds of `work`, without the launch.
    #[must_use]
    pub fn seconds(&self, work: &Work) -> f64 {
        self.per_part().iter().zip(work.parts()).map(|(price, part)| price * part).sum()
    }
}

impl Default for CostModel {
    fn default() -> Self {
        Self::UNIT
    }
}

/// What made the rays of a stream. Bounces count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum StreamKind {
    /// Camera rays in Z-curve order: neighbours in the stream take similar paths.
    Primary,
    /// Shadow rays towards a light, from the hits of the given bounce; any hit ends them.
    Shadow(u32),
    /// Cosine-weighted diffuse rays from the hits of the given bounce: incoherent.
    Diffuse(u32),
    /// Rays of a caller, of which nothing is known.
    Custom,
}

impl StreamKind {
    /// Whether neighbouring rays take similar paths where nobody says otherwise.
    #[must_use]
    pub const fn is_coherent(&self) -> bool {
        matches!(self, Self::Primary)
    }
}

impl fmt::Display for StreamKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Primary => write!(f, "primary"),
            Self::Shadow(bounce) => write!(f, "shadow {bounce}"),
            Self::Diffuse(bounce) => write!(f, "diffuse {bounce}"),
            Self::Custom => write!(f, "custom"),
        }
    }
}

/// A stream of rays as an estimator sees it: its kind and how it is cut into tasks.
#[derive(Clone, Copy, Debug)]
pub struct RayStream<'a> {
    /// What made the rays.
    pub kind: StreamKind,
    /// What the caller knows of rays that follow each other.
    pub coherence: Coherence,
    /// The tasks; they cover the stream's rays in order.
    pub tasks: &'a [Task],
    /// Seed of this stream's samples.
    pub seed: u32,
    /// Which wave of a larger stream this is: waves are alike from frame to frame, not among each other.
    pub wave: u32,
    /// The rays themselves, for estimators that learn where in the scene rays are expensive; `None` where the caller
    /// has only their number.
    pub source: Option<&'a RaySource>,
    /// Number of devices that will trace the stream: what an exact estimate is worth depends on it.
    pub devices: u32,
    /// What the makespan is expected to lose when nothing is estimated, as a share of it; 1 where devices may differ.
    /// An estimate that costs more does not pay.
    pub uninformed_excess: f64,
    /// Whether the queue moves tasks when it turns out what they cost: not static lists, nor where launches cost the
    /// devices more than moving mends.
    pub moves: bool,
    /// Whether there is a device that walks samples: some count no tests.
    pub has_walks: bool,
}

impl<'a> RayStream<'a> {
    /// A stream of which only its kind and its tasks are known, for one device: the first wave, seed 0, no rays at
    /// hand, nothing said of coherence, everything to win from an estimate, tasks that move and a device that walks
    /// samples. What is different is set by struct update.
    #[must_use]
    pub const fn new(kind: StreamKind, tasks: &'a [Task]) -> Self {
        Self {
            kind,
            coherence: Coherence::Unknown,
            tasks,
            seed: 0,
            wave: 0,
            source: None,
            devices: 1,
            uninformed_excess: 1.0,
            moves: true,
            has_walks: true,
        }
    }

    /// Whether neighbouring rays take similar paths, so that a strided sample represents a task well: as the caller
    /// says, or as the kind does.
    #[must_use]
    pub const fn is_coherent(&self) -> bool {
        match self.coherence {
            Coherence::Unknown => self.kind.is_coherent(),
            Coherence::Coherent => true,
            Coherence::Incoherent => false,
        }
    }

    /// Number of rays in all tasks.
    #[must_use]
    pub fn rays(&self) -> u32 {
        self.tasks.iter().map(|task| task.rays).sum()
    }
}

/// The driver's answer to a [`Step::Sample`]; empty in the first call of a stream.
#[derive(Clone, Copy, Debug, Default)]
pub struct Observation<'a> {
    /// The rays that were asked for, in that order.
    pub rays: &'a [u32],
    /// For each of them, its counts under the walk that was asked for.
    pub counts: &'a [TestCounts],
}

/// What an estimator wants next.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Walk these rays and call again with their counts. The hits of a [`Walk::Full`] are kept by the driver, and
    /// their rays are not traced again.
    Sample {
        /// Distinct ray indices of the stream.
        rays: Vec<u32>,
        /// How to walk them.
        walk: Walk,
    },
    /// The expected work of each task, in task order.
    Done(Vec<Work>),
}

/// Predicted and measured seconds of one task on the device that traced it, launch cost left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TaskOutcome {
    /// The task.
    pub task: TaskId,
    /// What the device's cost model said of the estimated work.
    pub predicted_s: f64,
    /// What it took; where a device only knows the time of a whole launch, the task's predicted share of it.
    pub measured_s: f64,
}

/// A finished launch, for estimators that learn.
#[derive(Clone, Copy, Debug)]
pub struct LaunchRecord<'a> {
    /// The stream.
    pub stream: RayStream<'a>,
    /// The estimate the launch was scheduled by, one entry for each task of the stream.
    pub work: &'a [Work],
    /// Position of the device in the run.
    pub device: usize,
    /// The tasks of the launch.
    pub outcomes: &'a [TaskOutcome],
    /// Whether each task's seconds were measured; otherwise only their sum was.
    pub per_task: bool,
}

/// What a finished stream tells about the price of its estimate.
#[derive(Clone, Copy, Debug)]
pub struct StreamRecord<'a> {
    /// The stream.
    pub stream: RayStream<'a>,
    /// Rays that were walked for the estimate.
    pub walked_rays: u64,
    /// Device seconds of those walks, over all devices.
    pub walk_s: f64,
    /// Device seconds that passed beside the walks while the estimate was made, over all devices: the host chose
    /// samples, handed them over and read them.
    pub host_s: f64,
    /// Rays traced in launches, those with kept hits left out.
    pub traced_rays: u64,
    /// Device seconds of those launches, over all devices.
    pub trace_s: f64,
}

impl StreamRecord<'_> {
    /// Device seconds of a traced ray; `None` unless they were measured.
    #[must_use]
    pub fn ray_s(&self) -> Option<f64> {
        let seconds = self.trace_s / self.traced_rays as f64;
        (seconds.is_finite() && seconds > 0.0).then_some(seconds)
    }

    /// Seconds of a walked ray in seconds of a traced one, without a unit; `None` unless both were measured.
    #[must_use]
    pub fn walk_price(&self) -> Option<f64> {
        let price = (self.walk_s / self.walked_rays as f64) / self.ray_s()?;
        (price.is_finite() && price > 0.0).then_some(price)
    }

    /// What the host did for a walked ray, over all devices, in seconds of a traced ray; `None` unless both were
    /// measured.
    #[must_use]
    pub fn host_price(&self) -> Option<f64> {
        let price = (self.host_s / self.walked_rays as f64) / self.ray_s()?;
        (price.is_finite() && price >= 0.0).then_some(price)
    }
}

/// What tells the counts of one estimator from another's: prices fitted to some mean nothing for others.
///
/// Estimators of one type that count otherwise, such as by another walk, tell themselves apart by `variant`. Names are
/// for people: two estimators may have the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct CountsToken {
    kind: TypeId,
    variant: u32,
}

impl CountsToken {
    /// The counts of this variant of estimators of type `E`.
    #[must_use]
    pub fn of<E: ?Sized + 'static>(variant: u32) -> Self {
        Self { kind: TypeId::of::<E>(), variant }
    }
}

/// Estimates the work of each task of a stream.
///
/// An estimator does no I/O: it names rays, the driver walks them on all devices in parallel, and the estimator reads
/// the counts. So it is pure, testable without a device, and the same on one machine or many.
pub trait CostEstimator: Debug + Send + 'static {
    /// Short name for reports, such as `"exact"`.
    fn name(&self) -> &'static str;

    /// Name of the estimator that made the last estimate: another than [`CostEstimator::name`] where one chooses among
    /// several.
    fn chosen(&self) -> &'static str {
        self.name()
    }

    /// Why it made the last estimate as it did, with the numbers that decided; `None` where it has no choice.
    fn reason(&self) -> Option<String> {
        None
    }

    /// What its counts have in common: streams of one token and kind teach and use the same prices. One for each type,
    /// unless it says otherwise; who wraps an estimator passes on the wrapped one's.
    fn counts(&self) -> CountsToken {
        CountsToken::of::<Self>(0)
    }

    /// Whether there are streams that it knows nothing of without samples: where no device walks any, it is of no use.
    fn needs_samples(&self) -> bool {
        self.walk().is_some()
    }

    /// How it will have samples walked, so that devices can get ready; `None` if it asks for none.
    fn walk(&self) -> Option<Walk> {
        Some(Walk::Full)
    }

    /// Takes the answer to the previous step and says what is wanted next. The first call of a stream carries an
    /// empty observation; after [`Step::Done`] the next call begins another stream.
    fn next(&mut self, stream: RayStream<'_>, seen: Observation<'_>) -> Step;

    /// Whether the work it returned tells tasks of one size apart. An estimator that knows nothing of a task but its
    /// size says `false`.
    fn counts_tests(&self) -> bool {
        true
    }

    /// Learns from a finished launch. Called after the stream was traced; most estimators ignore it.
    fn learn(&mut self, launch: &LaunchRecord<'_>) {
        let _ = launch;
    }

    /// Learns what the estimate cost. Called once after the last [`CostEstimator::learn`] of a stream.
    fn finish(&mut self, record: &StreamRecord<'_>) {
        let _ = record;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_is_always_finite_and_not_negative() {
        let work = Work::new(f32::NAN, -1.0, f32::INFINITY);
        assert_eq!((work.rays(), work.boxes(), work.triangles()), (0.0, 0.0, f32::MAX));
        assert_eq!(work.std_error(), None);
        assert_eq!(Work::new(1.0, 2.0, 3.0).with_std_error(0.5).scaled(2.0).std_error(), Some(1.0));
    }

    #[test]
    fn cost_models_are_positive() {
        assert!(CostModel::new(0.0, 0.0, 0.0, 1.0).is_none());
        assert!(CostModel::new(-1.0, 1.0, 1.0, 1.0).is_none());
        let model = CostModel::new(1.0, 2.0, 3.0, 4.0).expect("valid");
        assert_eq!(model.seconds(&Work::new(1.0, 10.0, 100.0)), 432.0);
        assert_eq!(model.with_divergence(f64::NAN), None);
        let model = model.with_divergence(5.0).expect("valid");
        let work = Work::new(1.0, 10.0, 100.0).with_divergence(1000.0);
        assert_eq!(model.seconds(&work), 5432.0);
        assert_eq!(model.seconds(&work.part(0.5)), 2716.0);
        assert_eq!(model.seconds(&work.plus(&work)), 10_864.0);
    }
}
