//! `report.json`, schema 1 (described in docs/report.md).

use rt_balance::report::StreamReport;
use rt_scene::scan::Plan;
use serde::Serialize;

/// The version of the layout; it changes when a field changes its meaning or goes away.
pub(crate) const SCHEMA: u32 = 1;

/// Everything one run of `render` or `trace` tells.
#[derive(Debug, Serialize)]
pub(crate) struct Report {
    pub(crate) schema: u32,
    pub(crate) version: &'static str,
    /// The command line, program name left out.
    pub(crate) command: Vec<String>,
    pub(crate) scene: SceneReport,
    pub(crate) queue: &'static str,
    /// Null for the central queue, which has none.
    pub(crate) policy: Option<&'static str>,
    pub(crate) streams: Vec<StreamReport>,
    pub(crate) seconds: Seconds,
}

/// The scene and how it is traced.
#[derive(Debug, Serialize)]
pub(crate) struct SceneReport {
    pub(crate) source: String,
    pub(crate) triangles: usize,
    /// Triangles without area, which no ray can hit.
    pub(crate) degenerate: usize,
    /// Triangles with NaN or infinite vertices, left out on request.
    pub(crate) invalid: usize,
    pub(crate) builder: String,
    pub(crate) precision: &'static str,
    pub(crate) bvh_bytes: u64,
    pub(crate) plan: Plan,
}

/// Wall seconds of the whole run, by what was done.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(crate) struct Seconds {
    pub(crate) load: f64,
    pub(crate) build: f64,
    /// The scene brought to the devices, kernels compiled.
    pub(crate) setup: f64,
    pub(crate) estimate: f64,
    pub(crate) trace: f64,
    /// The separate measuring passes of `--reference`.
    pub(crate) reference: f64,
    pub(crate) shade: f64,
    /// Pictures and charts; this file itself is written last and not counted.
    pub(crate) write: f64,
    pub(crate) total: f64,
}
