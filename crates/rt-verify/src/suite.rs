//! The suite: every case, on one device after the other.

use crate::cases::{self, Case};
use crate::reference::{Reference, Verdict};
use crate::report::{DeviceReport, Row};
use crate::trial::Trial;
use crate::{rays::RayMaker, shapes, tree};
use rayon::prelude::*;
use rt_bvh::Builder;
use rt_core::{Device, Precision, Ray, Scene, Triangle};
use rt_scene::Model;
use std::cell::Cell;
use std::fmt;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock};

/// How much is tried.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Extent {
    /// Under a minute on two cores.
    #[default]
    Quick,
    /// 10⁸ rays at edges, vertices and along axes, 10⁷ spawned rays, 2²⁴ triangles: a quarter of an hour or more, and
    /// some 6 GB of memory.
    Full,
}

impl Extent {
    /// The name that command lines and reports use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Quick => "quick",
            Self::Full => "full",
        }
    }

    /// Rays of each line about closed surfaces. There are 15 lines of edge-, vertex- and axis-aimed rays at offsets up
    /// to 10⁶, which together make 10⁸ in the full suite.
    #[must_use]
    pub const fn rays(self) -> u32 {
        match self {
            Self::Quick => 210_000,
            Self::Full => 6_720_000,
        }
    }
}

/// What to try.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// How much.
    pub extent: Extent,
    /// Rays of each line about closed surfaces, if not [`Extent::rays`]; other cases scale with it.
    pub rays: Option<u32>,
    /// Seed of rays and meshes.
    pub seed: u32,
    /// Who builds the trees.
    pub builder: Builder,
}

impl Default for Options {
    fn default() -> Self {
        Self { extent: Extent::Quick, rays: None, seed: 1, builder: Builder::default() }
    }
}

impl Options {
    pub(crate) fn rays(&self) -> u32 {
        self.rays.unwrap_or(self.extent.rays()).max(1)
    }

    /// Rays of a line that the exact reference judges, each against every triangle of a small mesh.
    pub(crate) fn sample(&self) -> u32 {
        (self.rays() / 100).clamp(200, 20_000)
    }
}

/// A device and how carefully it is to trace.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The device.
    pub device: Arc<dyn Device>,
    /// The precision that every ray is traced with.
    pub precision: Precision,
    /// Whether it walks the trees that `rt_bvh` builds. A tracer that builds its own is not judged by ours.
    pub walks_our_trees: bool,
    /// Whether it promises hits as `rt_core::intersect` defines them: the one right answer to every ray, to the last
    /// bit of the distance. Others may answer what careful tracers can see (`reference::Verdict::admits`).
    pub exact: bool,
}

impl Subject {
    /// One of our own devices.
    #[must_use]
    pub fn new(device: Arc<dyn Device>, precision: Precision) -> Self {
        Self { device, precision, walks_our_trees: true, exact: precision != Precision::Fast }
    }

    /// A device that promises what it says of itself: one that counts no tests of our trees, nor has the hits that are
    /// defined, is judged as a tracer that builds trees of its own.
    #[must_use]
    pub fn of(device: Arc<dyn Device>, precision: Precision) -> Self {
        let capabilities = device.info().capabilities;
        let exact = capabilities.has_defined_bits() && precision != Precision::Fast;
        Self { device, precision, walks_our_trees: capabilities.counts_scene_tree(), exact }
    }
}

/// How a run is watched and stopped.
#[derive(Clone, Copy, Default)]
pub struct Watch<'a> {
    /// Looked at between batches of rays.
    pub stop: Option<&'a AtomicBool>,
    /// Told how much is done, from 0 to 1, and which case runs.
    pub progress: Option<&'a dyn Fn(f64, &'static str)>,
}

impl fmt::Debug for Watch<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Watch").field("stop", &self.stop).finish_non_exhaustive()
    }
}

/// The run was stopped before its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stopped;

impl fmt::Display for Stopped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the suite was stopped before its end")
    }
}

impl std::error::Error for Stopped {}

/// The cases, the scenes they use, and the right answers once they are known.
#[derive(Debug)]
pub struct Suite {
    pub(crate) options: Options,
    pub(crate) models: Vec<Model>,
    exams: OnceLock<Result<Vec<Exam>, String>>,
}

impl Suite {
    /// The suite; beside its own meshes it uses `models`, whose closed parts must not leak.
    #[must_use]
    pub fn new(options: Options, models: Vec<Model>) -> Self {
        Self { options, models, exams: OnceLock::new() }
    }

    /// Tries every case on one device.
    ///
    /// # Errors
    /// When `watch` says stop.
    pub fn run(&self, subject: &Subject, watch: Watch<'_>) -> Result<DeviceReport, Stopped> {
        self.run_chosen(&cases::ALL, subject, watch)
    }

    /// Tries the case called `name` only; without such a case the report is empty.
    ///
    /// # Errors
    /// When `watch` says stop.
    pub fn run_case(&self, name: &str, subject: &Subject, watch: Watch<'_>) -> Result<DeviceReport, Stopped> {
        self.run_cases(&[name], subject, watch)
    }

    /// Tries the cases with these names, in the suite's order; names that no case has are passed over.
    ///
    /// # Errors
    /// When `watch` says stop.
    pub fn run_cases(
        &self,
        names: &[impl AsRef<str>],
        subject: &Subject,
        watch: Watch<'_>,
    ) -> Result<DeviceReport, Stopped> {
        let wanted = |case: &Case| names.iter().any(|name| name.as_ref() == case.name);
        let chosen: Vec<Case> = cases::ALL.into_iter().filter(wanted).collect();
        self.run_chosen(&chosen, subject, watch)
    }

    /// The names of all cases, in the order in which they run.
    pub fn case_names() -> impl Iterator<Item = &'static str> {
        cases::ALL.into_iter().map(|case| case.name)
    }

    fn run_chosen(&self, cases: &[Case], subject: &Subject, watch: Watch<'_>) -> Result<DeviceReport, Stopped> {
        let info = subject.device.info();
        let trial = Trial {
            suite: self,
            device: &*subject.device,
            precision: subject.precision,
            walks_our_trees: subject.walks_our_trees,
            exact: subject.exact,
            watch,
            span: Cell::new([0.0; 2]),
            case: Cell::new(""),
        };
        let total: f64 = cases.iter().map(|case| case.weight).sum();
        let mut rows: Vec<Row> = Vec::new();
        let mut start = 0.0;
        for case in cases {
            trial.span.set([start, case.weight / total]);
            trial.case.set(case.name);
            trial.advance(0.0)?;
            (case.run)(&trial, &mut rows)?;
            start += case.weight / total;
        }
        Ok(DeviceReport { device: info.name.clone(), backend: info.backend, precision: subject.precision.name(), rows })
    }

    /// Scenes and rays with the reference's verdicts; made once for all devices.
    pub(crate) fn exams(&self) -> Result<&[Exam], String> {
        self.exams.get_or_init(|| self.make_exams()).as_deref().map_err(Clone::clone)
    }

    fn make_exams(&self) -> Result<Vec<Exam>, String> {
        let seed = self.options.seed;
        let shapes = [
            ("soup", shapes::soup(600, 0.3, seed)),
            ("terrain", shapes::grid(20, 0.2, seed)),
            ("sphere", shapes::icosphere(3)),
            ("needles", shapes::needles(300, 1e-5, seed)),
            ("coplanar layers", shapes::layers(5, 4)),
            ("fan", shapes::fan(64)),
            ("mixed scales", shapes::mixed_scales(300, seed)),
        ];
        let mut exams = Vec::new();
        for (name, triangles) in shapes {
            exams.push(Exam::new(name.to_owned(), triangles, self.options.sample(), &self.options)?);
        }
        for model in &self.models {
            let triangles: Vec<Triangle> = (0..model.indices.len() as u32).filter_map(|i| model.triangle(i)).collect();
            // As many tests as on the small meshes together allow: some seconds for a million triangles.
            let rays = (self.options.sample() / 4).max(100);
            exams.push(Exam::new(model.source.clone(), triangles, rays, &self.options)?);
        }
        Ok(exams)
    }
}

/// A scene, rays, and what the exact reference says of them.
#[derive(Debug)]
pub(crate) struct Exam {
    pub(crate) name: String,
    pub(crate) triangles: Vec<Triangle>,
    pub(crate) scene: Arc<Scene>,
    pub(crate) rays: Vec<(Ray, u32)>,
    pub(crate) verdicts: Vec<Verdict>,
}

/// Rays that share a pass over the triangles: enough that reading these from memory does not count.
const BATCH: usize = 32;

impl Exam {
    /// Rays of every aim at `triangles`, resolved on all cores.
    pub(crate) fn new(name: String, triangles: Vec<Triangle>, rays: u32, options: &Options) -> Result<Self, String> {
        let rays = RayMaker::new(&triangles, options.seed).mixed(rays);
        Self::with_rays(name, triangles, rays, options)
    }

    pub(crate) fn with_rays(
        name: String,
        triangles: Vec<Triangle>,
        rays: Vec<(Ray, u32)>,
        options: &Options,
    ) -> Result<Self, String> {
        let scene = tree::build(&triangles, options.builder).map_err(|e| format!("{name}: {e}"))?;
        let reference = Reference::new(&triangles);
        let verdicts = rays.par_chunks(BATCH).flat_map_iter(|batch| reference.resolve_all(batch)).collect();
        Ok(Self { name, triangles, scene, rays, verdicts })
    }

    /// How many rays are ambiguous, in words. An exact tracer is judged by the one right answer to those too.
    pub(crate) fn ambiguity(&self) -> String {
        let all = self.verdicts.iter().filter(|verdict| verdict.is_ambiguous()).count();
        let ties = self.verdicts.iter().filter(|verdict| verdict.is_tie()).count();
        format!("{all} of {} rays are ambiguous to inexact tracers, {ties} of them by ties", self.rays.len())
    }
}
