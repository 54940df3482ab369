//! What a run tells: the numbers of `report.json` (schema 1) and the raw record they were computed from.

use crate::unused::UnusedEstimate;
use crate::update::{Update, Updated};
use rt_core::{CostEstimator, StreamKind, TaskId, Work};
use rt_sched::calibrate::Fit;
use rt_sched::estimate::Uniform;
use rt_sched::metrics::EstimateErrors;
use serde::{Deserialize, Serialize};

/// One stream of a run, as written to `report.json`. Seconds throughout; `None` (null) where a value is not known.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StreamReport {
    /// `"primary"`, `"shadow 0"`, `"diffuse 0"`, `"custom"`.
    pub kind: String,
    /// Frame of an animation, from 0.
    pub frame: u32,
    /// Wave of the frame, from 0: a part of the image that fits the memory limit.
    pub wave: u32,
    /// Number of rays.
    pub rays: u32,
    /// Number of tasks.
    pub tasks: u32,
    /// How the tasks' cost was estimated.
    pub estimate: EstimateReport,
    /// Wall seconds before that: what streams like this need once, such as compiled kernels. Not part of the makespan.
    pub setup_s: f64,
    /// Wall seconds from before the estimation until the last hit was on the host.
    pub makespan_s: f64,
    /// `makespan / (Σ speed · busy / Σ speed) − 1`, without a unit: how much longer the run took than if every device
    /// had been busy to the end.
    pub imbalance: Option<f64>,
    /// Least seconds that any schedule needs, from the reference pass.
    pub lower_bound_s: Option<f64>,
    /// `makespan / lower bound − 1`, without a unit.
    pub excess: Option<f64>,
    /// One entry for each device, in the order they were given.
    pub devices: Vec<DeviceReport>,
    /// Task by task, from the reference pass.
    pub task_times: Option<TaskTimes>,
}

/// What the tasks of a stream took and were expected to take, one entry for each: what other machines can be simulated
/// with. `None` (null) where seconds are not known.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TaskTimes {
    /// Rays of each task.
    pub rays: Vec<u32>,
    /// Rays of each task whose hits the estimation had found, so that they were not traced again.
    pub kept: Vec<u32>,
    /// Seconds of each task traced alone, all its rays, on each device (`alone_s[device][task]`); empty for a device
    /// that failed.
    pub alone_s: Vec<Vec<Option<f64>>>,
    /// The device that traced each task in the run.
    pub device: Vec<u32>,
    /// Predicted seconds of each task on that device, without the rays that were kept.
    pub predicted_s: Vec<Option<f64>>,
    /// Seconds of each task in the run, on that device, without the rays that were kept.
    pub measured_s: Vec<Option<f64>>,
}

/// The estimation of one stream.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct EstimateReport {
    /// Name of the estimator.
    pub estimator: String,
    /// Name of the estimator that made this estimate: another where `estimator` chooses among several.
    pub chosen: String,
    /// Why, with the numbers that decided; `None` where `estimator` has no choice.
    pub reason: Option<String>,
    /// Share of the rays that was walked, without a unit.
    pub fraction: f64,
    /// Whether it had been measured before how fast the devices are.
    pub are_speeds_known: bool,
    /// What the makespan was expected to lose without an estimate, as a share of it: the most that an estimate can
    /// gain. 1 for static lists before it is known how fast the devices are.
    pub uninformed_excess: f64,
    /// Wall seconds of estimating and planning.
    pub seconds: f64,
    /// `seconds / (makespan − seconds)`: the share of the trace that estimation adds, without a unit.
    pub overhead: Option<f64>,
    /// Mean relative error per task of the estimated number of tests against exact counts, after one common scale.
    pub mre_counts: Option<f64>,
    /// Mean relative error per task of the predicted seconds against measured ones, after one common scale.
    pub mre_time: Option<f64>,
    /// Median over the tasks of the standard error of their tests, relative to the tests: what the estimate says of its
    /// error against counts; `None` where no task has one.
    pub std_error: Option<f64>,
    /// All errors of the estimated number of tests against exact counts.
    pub errors_counts: Option<ErrorReport>,
    /// All errors of the predicted seconds, by prices fitted on other tasks, against measured ones.
    pub errors_time: Option<ErrorReport>,
    /// What an estimate would have said, where none was made; `None` where that was not looked at.
    pub unused: Option<UnusedReport>,
}

impl StreamReport {
    /// Seconds that it would have taken had every device been busy to the end; `None` where that is not known.
    #[must_use]
    pub fn even_s(&self) -> Option<f64> {
        Some(self.makespan_s / (1.0 + self.imbalance?))
    }
}

impl EstimateReport {
    /// Whether nothing was known of costs: every ray counted the same.
    #[must_use]
    pub fn is_uninformed(&self) -> bool {
        self.chosen == Uniform.name()
    }
}

/// An estimate that was made for comparison when the stream had been traced, outside its makespan.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct UnusedReport {
    /// Name of the estimator.
    pub estimator: String,
    /// Share of the rays that was walked, without a unit.
    pub fraction: f64,
    /// Wall seconds that it took, and would have taken before.
    pub seconds: f64,
    /// Errors of the predicted seconds against what the tasks took while the stream was traced, where that is known.
    pub errors_time: Option<ErrorReport>,
}

/// How far estimates lie from the truth per task, after one common scale; no units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ErrorReport {
    /// Mean of `|ĉ − c| / c`.
    pub mean: f64,
    /// `Σ |ĉ − c| / Σ c`.
    pub weighted: f64,
    /// 95th percentile of `|ĉ − c| / c`.
    pub p95: f64,
    /// Mean of `(ĉ − c) / c`.
    pub bias: f64,
}

impl From<EstimateErrors> for ErrorReport {
    fn from(errors: EstimateErrors) -> Self {
        let EstimateErrors { mean_relative, weighted, p95, bias, .. } = errors;
        Self { mean: mean_relative, weighted, p95, bias }
    }
}

/// What a device's launches cost, as fitted to those so far: from counts to seconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ModelReport {
    /// Seconds per launch.
    pub per_launch_s: f64,
    /// Seconds per ray, beyond its tests.
    pub per_ray_s: f64,
    /// Seconds per box test.
    pub per_box_s: f64,
    /// Seconds per triangle test.
    pub per_triangle_s: f64,
    /// Seconds per box test by which rays that follow each other differ.
    pub per_divergence_s: f64,
    /// Root mean square of the relative errors of what was measured, without a unit: what the prices leave unexplained.
    pub residual: f64,
    /// How many prices were told apart: 5, 4 (divergence is free), 2 (launches; rays and tests), or 1.
    pub prices: u32,
}

impl From<Fit> for ModelReport {
    fn from(fit: Fit) -> Self {
        Self {
            per_launch_s: fit.model.per_launch(),
            per_ray_s: fit.model.per_ray(),
            per_box_s: fit.model.per_box(),
            per_triangle_s: fit.model.per_triangle(),
            per_divergence_s: fit.model.per_divergence(),
            residual: fit.relative_error,
            prices: fit.prices,
        }
    }
}

/// One device's part in a stream.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct DeviceReport {
    /// Name of the device.
    pub name: String,
    /// Its backend.
    pub backend: String,
    /// Seconds spent working: the union of its spans, estimation included.
    pub busy_s: f64,
    /// Share of `busy_s` spent inside kernels, without a unit; what is left is hand-over. `None` if it did nothing.
    pub kernel_share: Option<f64>,
    /// Rays that the device left to the host, estimation included; `None` if it dropped out.
    pub on_host: Option<u64>,
    /// Bytes of rays and lists of rays copied to the device; `None` if it dropped out.
    pub uploaded_bytes: Option<u64>,
    /// Bytes of hits and counts copied back; `None` if it dropped out.
    pub downloaded_bytes: Option<u64>,
    /// Number of launches.
    pub launches: u32,
    /// Number of tasks finished.
    pub tasks: u32,
    /// Number of rays traced in launches.
    pub rays: u64,
    /// Its prices for streams of this kind and this estimator; `None` before any were measured.
    pub model: Option<ModelReport>,
    /// Rays whose hits the host traced again to see whether they are right.
    pub audited: u64,
    /// Rays whose hits the host refused and replaced by its own.
    pub refused: u64,
    /// What people should know of how it holds the scene, such as one tree where both do not fit, or of its part in the
    /// stream, such as that it was late.
    pub note: Option<String>,
    /// Why the device dropped out, if it did.
    pub error: Option<String>,
}

/// How the scene was brought up to date before a frame of an animation. Seconds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UpdateReport {
    /// The frame, from 0.
    pub frame: u32,
    /// `"fitted"`, or `"rebuilt"`.
    pub tree: &'static str,
    /// Why it was built anew; `None` where it was not.
    pub why: Option<String>,
    /// How many times as expensive as the tree that was built the fitted one is, by the surface area heuristic; `None`
    /// where it could not be fitted.
    pub growth: Option<f32>,
    /// Finding out where the triangles are.
    pub move_s: f64,
    /// Fitting the tree, or finding out that it cannot be.
    pub fit_s: f64,
    /// Building another; 0 where it was not.
    pub build_s: f64,
    /// Until all devices had the scene.
    pub bring_s: f64,
    /// Bytes of what had changed that graphics cards were sent.
    pub sent_bytes: u64,
}

impl UpdateReport {
    /// What an update before a frame did, when moving the triangles had taken so long.
    #[must_use]
    pub fn new(frame: u32, move_s: f64, update: &Update) -> Self {
        let &Update { tree, growth, fit_s, build_s, bring_s, sent_bytes } = update;
        let (tree, why) = match tree {
            Updated::Fitted => ("fitted", None),
            Updated::Rebuilt(cause) => ("rebuilt", Some(cause.to_string())),
        };
        Self { frame, tree, why, growth, move_s, fit_s, build_s, bring_s, sent_bytes }
    }

    /// All of it.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.move_s + self.fit_s + self.build_s + self.bring_s
    }
}

/// What a device did from `start_s` to `end_s`: one bar of the timeline.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Activity {
    /// Position of the device in the run.
    pub device: usize,
    /// Estimation or launch.
    pub kind: ActivityKind,
    /// Begin, in seconds since the balancer was made.
    pub start_s: f64,
    /// End, in seconds since the balancer was made.
    pub end_s: f64,
    /// The tasks of a launch; empty for an estimation.
    pub tasks: Vec<TaskId>,
    /// Rays walked or traced.
    pub rays: u32,
    /// What the cost model predicted, in seconds; `None` for an estimation.
    pub predicted_s: Option<f64>,
}

/// What a bar of the timeline stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ActivityKind {
    /// Walking samples for the estimate.
    Estimate,
    /// Tracing tasks.
    Launch,
}

/// Everything recorded while one stream was traced: charts and metrics are made from it.
#[derive(Clone, Debug)]
pub struct StreamRun {
    /// The numbers.
    pub report: StreamReport,
    /// What made the rays.
    pub kind: StreamKind,
    /// The stream's tasks.
    pub tasks: Vec<rt_core::Task>,
    /// The estimate the run was scheduled by, one entry for each task.
    pub work: Vec<Work>,
    /// Rays of each task whose hits the estimation had found, so that they were not traced again.
    pub kept: Vec<u32>,
    /// Predicted seconds of each task on the device that traced it.
    pub predicted_s: Vec<f64>,
    /// Measured seconds of each task on the device that traced it; NaN where unknown.
    pub measured_s: Vec<f64>,
    /// Which device traced each task.
    pub device_of: Vec<u32>,
    /// The timeline, in no particular order.
    pub activities: Vec<Activity>,
    /// Wall seconds of the reference pass, if there was one.
    pub reference_s: Option<f64>,
    /// What an estimate would have said, where none was made and somebody looked.
    pub unused: Option<UnusedEstimate>,
}
