//! `report.json`, schema 2 (described in docs/report.md).

use crate::headline::Headline;
use crate::output::write_atomically;
use crate::{Provenance, ReportError, charts};
use glam::{DVec3, Vec3};
use rt_balance::report::{StreamReport, StreamRun, UpdateReport};
use rt_cluster::{ClusterReport, Shard};
use rt_scene::View;
use rt_scene::prepare::Prepared;
use rt_scene::scan::Plan;
use serde::Serialize;
use std::fmt;
use std::path::Path;

/// The version of the layout; it changes when a field changes its meaning or goes away.
pub const SCHEMA: u32 = 2;

/// Everything one run of `render` or `trace` tells.
#[derive(Debug, Serialize)]
pub struct Report {
    /// Version of the layout: [`SCHEMA`].
    pub schema: u32,
    /// The scene that was traced.
    pub scene: SceneReport,
    /// What was rendered; null where rays were given.
    pub picture: Option<PictureReport>,
    /// Name of the queue.
    pub queue: &'static str,
    /// Null for the central queue, which has none.
    pub policy: Option<&'static str>,
    /// One for each stream, in the order in which they were traced.
    pub streams: Vec<StreamReport>,
    /// How the scene was brought up to date, one entry for each frame before which it moved.
    pub updates: Vec<UpdateReport>,
    /// What was dealt to which process, one entry for each frame; empty where there was one process alone. `streams`
    /// are those of rank 0 then.
    pub cluster: Vec<ClusterReport>,
    /// How well it was balanced.
    pub headline: Headline,
    /// Where the time went.
    pub seconds: Seconds,
    /// Where it comes from.
    pub provenance: Provenance,
}

/// The scene and how it is traced.
#[derive(Clone, Debug, Serialize)]
pub struct SceneReport {
    /// Its file, or the name of a built-in scene.
    pub source: String,
    /// What was subtracted from the coordinates of the file.
    pub offset: [f64; 3],
    /// Triangles of the source.
    pub triangles: usize,
    /// Triangles without area, which no ray can hit.
    pub degenerate: usize,
    /// Triangles with NaN or infinite vertices, left out on request.
    pub invalid: usize,
    /// Name of the builder of its tree.
    pub builder: String,
    /// Why that is not the one asked for, if it is not.
    pub fallback: Option<String>,
    /// Threads there were to build it.
    pub build_threads: usize,
    /// How triangles are tested.
    pub precision: &'static str,
    /// Bytes of nodes, triangles and ids.
    pub bvh_bytes: u64,
    /// What the scan of the scene found and proposes.
    pub plan: Plan,
}

impl SceneReport {
    /// What is known of a scene that is ready to be traced.
    #[must_use]
    pub fn of(prepared: &Prepared) -> Self {
        let build = &prepared.built.report;
        Self {
            source: prepared.model.source.clone(),
            offset: prepared.model.offset.to_array(),
            triangles: prepared.model.indices.len(),
            degenerate: build.dropped_degenerate as usize,
            invalid: build.dropped_invalid as usize,
            builder: build.builder.to_string(),
            fallback: build.fallback.map(|reason| reason.to_string()),
            build_threads: build.threads,
            precision: prepared.precision.name(),
            bvh_bytes: prepared.built.scene.bytes(),
            plan: prepared.plan.clone(),
        }
    }
}

impl Report {
    /// Writes it to a folder, in which shards have reports of their own.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&self, folder: &Path, shard: Option<Shard>) -> Result<(), ReportError> {
        let path = folder.join(charts::report_name(shard));
        write_atomically(&path, |file| Ok(serde_json::to_writer_pretty(file, self)?))
    }

    /// What is missing of the picture that was asked for, and why, in words; `None` where nothing is.
    #[must_use]
    pub fn missing(&self) -> Option<String> {
        self.picture.as_ref().and_then(PictureReport::missing)
    }
}

/// A picture, or the frames of an animation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PictureReport {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Samples of each pixel that are in it: of an animation, in its last frame.
    pub samples: u32,
    /// Samples that were asked for.
    pub samples_asked: u32,
    /// Samples that a part of the pixels has beyond those, where the pass was not whole.
    pub ahead: Option<Ahead>,
    /// Whether a signal ended the run before all was rendered.
    pub interrupted: bool,
    /// Diffuse bounces.
    pub bounces: u32,
    /// Number of the first frame that was asked for.
    pub first_frame: u32,
    /// Frames that are there: of a shard, its own.
    pub frames: u32,
    /// Frames that were asked for: of a shard, its own.
    pub frames_asked: u32,
    /// How many of those that are there were there before.
    pub frames_before: u32,
    /// Which of several processes this was that share the frames, as `3/8`.
    pub shard: Option<String>,
    /// Degrees by which the camera turns from one to the next; 0 along a path.
    pub degrees_per_frame: f32,
    /// The file of key frames that the camera moves along.
    pub camera_path: Option<String>,
    /// How strong the wind is, beside a fresh breeze, that moves the scene from one to the next.
    pub wind: Option<f32>,
    /// Seed of all random numbers.
    pub seed: u32,
    /// The camera of the first frame that was asked for.
    pub camera: CameraReport,
}

impl PictureReport {
    /// As [`Report::missing`].
    fn missing(&self) -> Option<String> {
        let Self { samples, samples_asked, frames, frames_asked, .. } = self;
        let why = if self.interrupted { "interrupted" } else { "the time was over" };
        if frames_asked > &1 {
            return (frames < frames_asked).then(|| format!("{why}: {frames} of {frames_asked} frames are whole"));
        }
        let ahead = |Ahead { samples, share }: &Ahead| format!(", {samples} of {:.0}% of them", 100.0 * share);
        let ahead = self.ahead.as_ref().map_or_else(String::new, ahead);
        let told = || format!("{why}: {samples} of {samples_asked} samples of each pixel{ahead}");
        (samples < samples_asked).then(told)
    }
}

/// Samples that a part of a picture's pixels has, where a pass was not whole.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Ahead {
    /// Of each of these pixels.
    pub samples: u32,
    /// Their share of all.
    pub share: f64,
}

/// A view, in the coordinates of the scene's file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CameraReport {
    /// Where it is.
    pub eye: [f64; 3],
    /// What it looks at.
    pub target: [f64; 3],
    /// Which way is up.
    pub up: [f32; 3],
    /// Vertical field of view.
    pub fov_degrees: f32,
}

impl CameraReport {
    /// Of a view of a scene whose coordinates are those of its file less `offset`.
    #[must_use]
    pub fn of(view: &View, offset: DVec3) -> Self {
        let place = |point: Vec3| (point.as_dvec3() + offset).to_array();
        Self { eye: place(view.eye), target: place(view.target), up: view.up.to_array(), fov_degrees: view.fov_degrees }
    }
}

/// Options of the command that give the same camera.
impl fmt::Display for CameraReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let point = |point: [f64; 3]| point.map(short).join(",");
        let up = point(self.up.map(f64::from));
        write!(f, "--eye {} --target {} --up {up} --fov {}", point(self.eye), point(self.target), self.fov_degrees)
    }
}

/// The shortest text that is read as the same number: most are single precision.
fn short(value: f64) -> String {
    let single = value as f32;
    if f64::from(single) == value { single.to_string() } else { value.to_string() }
}

/// Wall seconds of the whole run, by what was done.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Seconds {
    /// The scene read or generated, and scanned.
    pub load: f64,
    /// Its tree built.
    pub build: f64,
    /// The scene brought to the devices, kernels compiled.
    pub setup: f64,
    /// The scene moved between frames, its tree fitted or built anew, and brought to the devices.
    pub update: f64,
    /// Sample rays walked and costs estimated.
    pub estimate: f64,
    /// Streams traced, without the estimation.
    pub trace: f64,
    /// The separate measuring passes of `--reference`.
    pub reference: f64,
    /// Estimates that nothing was scheduled by, made for comparison.
    pub unused_estimate: f64,
    /// The picture made of hits.
    pub shade: f64,
    /// Pictures and charts; this file itself is written last and not counted.
    pub write: f64,
    /// From the start of the program.
    pub total: f64,
}

impl Seconds {
    /// Adds updates of the scene between streams, and says what they took.
    pub fn add_updates(&mut self, updates: &[UpdateReport]) -> f64 {
        let update = updates.iter().map(UpdateReport::seconds).sum();
        self.update += update;
        update
    }

    /// Adds streams, and updates of the scene between them, that took `wall_s` seconds with all that was done about
    /// them: what is not accounted for was shading.
    pub fn add_streams(&mut self, runs: &[StreamRun], updates: &[UpdateReport], wall_s: f64) {
        let update = self.add_updates(updates);
        let sum = |part: fn(&StreamRun) -> f64| runs.iter().map(part).sum::<f64>();
        let setup = sum(|run| run.report.setup_s);
        let estimate = sum(|run| run.report.estimate.seconds);
        let makespan = sum(|run| run.report.makespan_s);
        let reference = sum(|run| run.reference_s.unwrap_or_default());
        let unused = sum(|run| run.report.estimate.unused.as_ref().map_or(0.0, |unused| unused.seconds));
        self.setup += setup;
        self.estimate += estimate;
        self.trace += makespan - estimate;
        self.reference += reference;
        self.unused_estimate += unused;
        self.shade += (wall_s - update - setup - makespan - reference - unused).max(0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mutants: an offset left out; digits of single precision written as those of double precision.
    #[test]
    fn a_camera_can_be_typed() {
        let view = View { eye: Vec3::new(1.1, -2.0, 0.5), target: Vec3::ZERO, up: Vec3::Y, fov_degrees: 40.0 };
        let text = CameraReport::of(&view, DVec3::ZERO).to_string();
        assert_eq!(text, "--eye 1.1,-2,0.5 --target 0,0,0 --up 0,1,0 --fov 40");
        let far = CameraReport::of(&view, DVec3::new(5e6, 0.0, 0.25));
        assert_eq!(far.target, [5e6, 0.0, 0.25]);
        assert!(far.to_string().contains("--target 5000000,0,0.25"), "{far}");
    }
}
