//! From the command line's scene argument to a tree that can be traced.

use crate::args::SceneArgs;
use crate::progress;
use anyhow::{Context, Result, bail};
use indicatif::ProgressBar;
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use rt_bvh::{BuildOptions, Built, InvalidTriangles, Mesh, Stack};
use rt_core::bounce::Surfaces;
use rt_core::{Hit, Precision, Query, Ray, RaySource, Scene, StreamSpec};
use rt_scene::obj::{LoadError, LoadOptions, LoadProgress, load_obj};
use rt_scene::scan::{Plan, Scan};
use rt_scene::streams::{Paths, Sun};
use rt_scene::{Model, View, builtin, scenes, view};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A bar appears when loading takes longer than this.
const PATIENCE: Duration = Duration::from_secs(1);

/// A scene that is ready to be traced, and how long that took.
#[derive(Debug)]
pub(crate) struct Prepared {
    pub(crate) model: Model,
    pub(crate) built: Built,
    pub(crate) plan: Plan,
    /// The precision asked for, or the plan's.
    pub(crate) precision: Precision,
    pub(crate) load_s: f64,
    pub(crate) build_s: f64,
}

impl SceneArgs {
    /// What to do with triangles that are not finite.
    pub(crate) const fn invalid(&self) -> InvalidTriangles {
        if self.drop_invalid { InvalidTriangles::Drop } else { InvalidTriangles::Refuse }
    }
}

impl Prepared {
    /// The model's own view, else one that shows all of it: from outside, or from inside where it is a room.
    pub(crate) fn view(&self) -> View {
        let scene = &self.built.scene;
        let automatic = || {
            let mut stack = Stack::for_scene(scene);
            let mut probe = |ray: &Ray| {
                let mut nearest = Hit::MISS;
                let rays = std::iter::once((*ray, Hit::MISS.primitive));
                rt_bvh::trace(scene, &mut stack, StreamSpec::default(), rays, |hit, _| nearest = hit);
                nearest
            };
            let outside = view::auto_view(&self.model);
            view::interior_view(&self.model, &outside, &mut probe).unwrap_or(outside)
        };
        self.model.view.unwrap_or_else(automatic)
    }

    /// One path for each pixel of a picture of `view`, for measurements: the rays that rendering it sends.
    pub(crate) fn paths(&self, view: &View, size: [u32; 2], seed: u32) -> Result<Paths> {
        let camera = view.camera().with_context(|| format!("the camera of {}", self.model.source))?;
        let surfaces = Arc::new(Surfaces::new(Arc::clone(&self.built.scene)));
        Ok(Paths { camera, size, samples: 1, seed, sun: Sun::beside(view), surfaces })
    }
}

/// The hits of a stream in double precision, on all cores.
pub(crate) fn reference(scene: &Scene, source: &RaySource, query: Query) -> Vec<Hit> {
    /// Rays that one core traces at a time.
    const CHUNK: u32 = 1 << 12;
    let spec = StreamSpec { query, precision: Precision::Double, counts: false };
    let chunk = |chunk: u32| {
        let range = chunk * CHUNK..source.len().min((chunk + 1).saturating_mul(CHUNK));
        let mut hits = Vec::with_capacity(range.len());
        let rays = range.map(|i| source.ray(i));
        rt_bvh::trace(scene, &mut Stack::for_scene(scene), spec, rays, |hit, _| hits.push(hit));
        hits
    };
    (0..source.len().div_ceil(CHUNK)).into_par_iter().flat_map_iter(chunk).collect()
}

/// Loads or generates the scene, scans it and builds its tree.
pub(crate) fn prepare(scene: &str, args: &SceneArgs) -> Result<Prepared> {
    let start = Instant::now();
    let model = load(scene, args.drop_invalid)?;
    let mut plan = Plan::new(&Scan::new(&model));
    let load_s = start.elapsed().as_secs_f64();

    let start = Instant::now();
    let mesh = Mesh { positions: &model.positions, indices: &model.indices };
    let options = BuildOptions { builder: args.builder, invalid: args.invalid(), ..BuildOptions::default() };
    let built = rt_bvh::build(mesh, &options).with_context(|| format!("building the tree of {}", model.source))?;
    plan.complete(&built.scene);
    let build_s = start.elapsed().as_secs_f64();

    let precision = args.precision.map_or(plan.precision, Precision::from);
    Ok(Prepared { model, built, plan, precision, load_s, build_s })
}

/// Generates the built-in scene called `name`, if there is one.
pub(crate) fn generate(name: &str) -> Option<Model> {
    match scenes::find(name)?.name {
        "yard" => Some(builtin::yard()),
        "car" => Some(builtin::car()),
        _ => None,
    }
}

/// Generates or loads a scene.
pub(crate) fn load(scene: &str, drop_invalid: bool) -> Result<Model> {
    if let Some(model) = generate(scene) {
        return Ok(model);
    }
    let path = Path::new(scene);
    if !path.exists() && path.extension().is_none() {
        let names: Vec<&str> = scenes::SCENES.iter().map(|entry| entry.name).collect();
        bail!("`{scene}` is neither a file nor a built-in scene; built-in are: {}", names.join(", "));
    }
    let start = Instant::now();
    let mut bar: Option<ProgressBar> = None;
    let mut show = |at: LoadProgress| {
        if start.elapsed() > PATIENCE {
            let bar = bar.get_or_insert_with(|| progress::bar("loading", at.total_bytes));
            bar.set_length(at.total_bytes);
            bar.set_position(at.done_bytes);
        }
    };
    let options = LoadOptions { drop_invalid, ..LoadOptions::default() };
    let loaded = load_obj(path, &options, &mut show).map_err(|error| {
        // The library does not know the option's name.
        let invalid = matches!(error, LoadError::NotFinite { .. });
        // Its message says all that its cause does.
        let error = anyhow::anyhow!("{error}");
        if invalid { error.context("give --drop-invalid to leave such triangles out") } else { error }
    })?;
    if let Some(bar) = bar {
        bar.finish_and_clear();
    }
    for warning in &loaded.warnings {
        eprintln!("warning: {warning}");
    }
    if loaded.invalid_triangles > 0 {
        eprintln!(
            "warning: {scene}: {} triangles with {} invalid vertices are left out",
            loaded.invalid_triangles, loaded.invalid_vertices
        );
    }
    Ok(loaded.model)
}
