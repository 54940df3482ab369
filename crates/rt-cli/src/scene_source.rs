//! From the command line's scene argument to a tree that can be traced.

use crate::args::SceneArgs;
use crate::exit::usage;
use crate::output::Outputs;
use crate::progress;
use anyhow::{Context, Result};
use indicatif::ProgressBar;
use rt_bvh::{BuildOptions, Built, InvalidTriangles, Mesh, Stack};
use rt_core::{Hit, Precision, Ray, StreamSpec};
use rt_report::print::note;
use rt_scene::obj::{LoadError, LoadOptions, LoadProgress, load_obj};
use rt_scene::scan::{Plan, Scan};
use rt_scene::{Model, View, builtin, scenes, view};
use std::path::Path;
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
}

/// Loads or generates the scene, scans it and builds its tree.
pub(crate) fn prepare(scene: &Path, args: &SceneArgs) -> Result<Prepared> {
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

/// Adds the files of scenes to what must not be overwritten.
pub(crate) fn protect<S: AsRef<Path>>(outputs: Outputs, scenes: impl IntoIterator<Item = S>) -> Outputs {
    let is_built_in = |scene: &S| scene.as_ref().to_str().is_some_and(|name| scenes::find(name).is_some());
    let files = scenes.into_iter().filter(|scene| !is_built_in(scene));
    files.fold(outputs, |outputs, file| outputs.input("the scene", file.as_ref()))
}

/// Generates or loads a scene.
pub(crate) fn load(path: &Path, drop_invalid: bool) -> Result<Model> {
    if let Some(model) = path.to_str().and_then(generate) {
        return Ok(model);
    }
    if !path.exists() && path.extension().is_none() {
        let names: Vec<&str> = scenes::SCENES.iter().map(|entry| entry.name).collect();
        return Err(usage(format!(
            "`{}` is neither a file nor a built-in scene; built-in are: {}",
            path.display(),
            names.join(", ")
        )));
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
        note(format_args!("warning: {warning}"));
    }
    if loaded.invalid_triangles > 0 {
        note(format_args!(
            "warning: {}: {} triangles with {} invalid vertices are left out",
            path.display(),
            loaded.invalid_triangles,
            loaded.invalid_vertices
        ));
    }
    Ok(loaded.model)
}
