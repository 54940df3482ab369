//! From a name or a file to a scene that can be traced: loaded or generated, scanned, its tree built.

#[cfg(feature = "formats")]
use crate::files::load_file;
#[cfg(not(feature = "formats"))]
use crate::obj::load_obj as load_file;
use crate::obj::{Fault, LoadError, LoadOptions, Loaded, Watch};
use crate::progress::{LoadStage, Meter};
use crate::scan::{Plan, Scan};
use crate::streams::{Paths, Sun};
use crate::{Model, View, builtin, scenes, view};
use rt_bvh::{BuildError, BuildOptions, Builder, Built, InvalidTriangles, Mesh, Stack};
use rt_core::bounce::Surfaces;
use rt_core::{CameraError, Hit, Precision, Ray, Scene, SceneError, StreamSpec};
use std::error::Error;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// How a scene is prepared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// What builds the tree.
    pub builder: Builder,
    /// What to do with triangles that are not finite.
    pub invalid: InvalidTriangles,
    /// How triangles are to be tested; `None`: as the scan of the scene proposes.
    pub precision: Option<Precision>,
    /// Whether a floor is put under the scene.
    pub floor: bool,
}

impl Options {
    /// A tree by `builder`; files with triangles that are not finite are refused, and the scan decides on the
    /// precision.
    #[must_use]
    pub const fn new(builder: Builder) -> Self {
        Self { builder, invalid: InvalidTriangles::Refuse, precision: None, floor: false }
    }

    /// How trees are built.
    #[must_use]
    pub fn build(&self) -> BuildOptions {
        BuildOptions { builder: self.builder, invalid: self.invalid, ..BuildOptions::default() }
    }
}

/// A scene that is ready to be traced, and how long that took.
#[derive(Debug)]
pub struct Prepared {
    /// Short name: the built-in scene's, or the file's without folder and ending.
    pub name: String,
    /// The triangles.
    pub model: Model,
    /// The scene with its tree.
    pub built: Built,
    /// What the scan of the scene found and proposes.
    pub plan: Plan,
    /// The precision asked for, or the plan's.
    pub precision: Precision,
    /// The view that a `cameras.tsv` beside the file gives.
    pub listed: Option<View>,
    /// How it was prepared.
    pub options: Options,
    /// What the user should know of the file, one sentence each.
    pub warnings: Vec<String>,
    /// What was done with its numbers, likewise.
    pub notes: Vec<String>,
    /// The material files that were read for it.
    pub libraries: Vec<PathBuf>,
    /// Seconds of loading or generating, and of the scan.
    pub load_s: f64,
    /// Seconds of building the tree.
    pub build_s: f64,
}

impl Prepared {
    /// The model's own view, else the one of a `cameras.tsv` beside its file, else one that shows all of it: from
    /// outside, or from inside where it is a room.
    #[must_use]
    pub fn view(&self) -> View {
        self.view_in(1.0)
    }

    /// The same, as near as a picture lets that is `aspect` times as wide as high.
    #[must_use]
    pub fn view_in(&self, aspect: f32) -> View {
        let scene: &Scene = &self.built.scene;
        let automatic = || {
            let mut stack = Stack::for_scene(scene);
            let mut probe = |ray: &Ray| {
                let mut nearest = Hit::MISS;
                let rays = std::iter::once((*ray, Hit::MISS.primitive));
                rt_bvh::trace(scene, &mut stack, StreamSpec::default(), rays, |hit, _| nearest = hit);
                nearest
            };
            let outside = view::auto_view(&self.model, aspect);
            view::interior_view(&self.model, &outside, &mut probe).unwrap_or(outside)
        };
        self.model.view.or(self.listed).unwrap_or_else(automatic)
    }

    /// One path for each pixel of a picture of `view`: for measurements, the rays that rendering it sends.
    ///
    /// # Errors
    /// When the view makes no camera.
    pub fn paths(&self, view: &View, size: [u32; 2], seed: u32) -> Result<Paths, CameraError> {
        let surfaces = Arc::new(Surfaces::new(Arc::clone(&self.built.scene)));
        Ok(Paths { camera: view.camera()?, size, samples: 1, seed, sun: Sun::beside(view), surfaces })
    }
}

/// Loads or generates the scene, scans it and builds its tree; `watch` is told how far that is.
///
/// # Errors
/// When there is no such scene, its file cannot be loaded or its tree not be built, or `watch` breaks.
pub fn prepare(scene: &Path, options: &Options, watch: &mut Watch<'_>) -> Result<Prepared, PrepareError> {
    let start = Instant::now();
    let mut named = load(scene, options.invalid, watch)?;
    let listed = view::listed(scene, &named.model).unwrap_or_else(|wrong| {
        named.warnings.push(format!("{wrong}; the view is chosen without it"));
        None
    });
    finish(named, listed, start, options, watch)
}

/// The same of triangles that are in memory already.
///
/// # Errors
/// When the tree cannot be built, or `watch` breaks.
pub fn prepare_model(model: Model, options: &Options, watch: &mut Watch<'_>) -> Result<Prepared, PrepareError> {
    let name = model.source.clone();
    let named = Named { name, model, warnings: Vec::new(), notes: Vec::new(), libraries: Vec::new() };
    finish(named, None, Instant::now(), options, watch)
}

/// Scans what was loaded since `start`, and builds its tree.
fn finish(
    named: Named,
    listed: Option<View>,
    start: Instant,
    options: &Options,
    watch: &mut Watch<'_>,
) -> Result<Prepared, PrepareError> {
    let Named { name, mut model, warnings, notes, libraries } = named;
    if options.floor {
        model.add_floor().map_err(|source| PrepareError::Build { scene: model.source.clone(), source })?;
    }
    let scan = Scan::watched(&model, watch).ok_or_else(|| PrepareError::Load(Fault::Stopped.of(&model.source)))?;
    let mut plan = Plan::new(&scan);
    let load_s = start.elapsed().as_secs_f64();

    let start = Instant::now();
    let mesh = Mesh { positions: &model.positions, indices: &model.indices };
    let stopped = || PrepareError::Load(Fault::Stopped.of(&model.source));
    let mut meter = Meter::begin(LoadStage::Building, mesh.indices.len() as u64, watch).map_err(|_| stopped())?;
    let built = rt_bvh::build_with(mesh, &options.build(), &mut |placed, _| meter.at(placed.into()).is_ok()).map_err(
        |source| match source {
            BuildError::Cancelled => stopped(),
            source => PrepareError::Build { scene: model.source.clone(), source },
        },
    )?;
    let Built { scene, report } = built;
    // Nobody else has it yet, so nothing is copied.
    let scene = model.described(Arc::unwrap_or_clone(scene));
    let scene = scene.map_err(|source| PrepareError::Parts { scene: model.source.clone(), source })?;
    let built = Built { scene: Arc::new(scene), report };
    plan.complete(&built.scene);
    if listed.is_some() {
        plan.reasons.push("the view is given by cameras.tsv beside the file".to_owned());
    }
    let build_s = start.elapsed().as_secs_f64();

    let precision = options.precision.unwrap_or(plan.precision);
    Ok(Prepared {
        name,
        model,
        built,
        plan,
        precision,
        listed,
        options: *options,
        warnings,
        notes,
        libraries,
        load_s,
        build_s,
    })
}

/// A scene's triangles, and what it is called.
#[derive(Debug)]
pub struct Named {
    /// Short name: the built-in scene's, or the file's without folder and ending.
    pub name: String,
    /// The triangles.
    pub model: Model,
    /// What the user should know of the file, one sentence each.
    pub warnings: Vec<String>,
    /// What was done with its numbers, likewise.
    pub notes: Vec<String>,
    /// The material files that were read for it.
    pub libraries: Vec<PathBuf>,
}

/// Generates the built-in scene called `name`, if there is one.
#[must_use]
pub fn generate(name: &str) -> Option<Model> {
    match scenes::find(name)?.name {
        "yard" => Some(builtin::yard()),
        "car" => Some(builtin::car()),
        _ => None,
    }
}

/// What tables call a scene: the built-in scene's name, or the file's without folder and ending.
#[must_use]
pub fn short_name(scene: &Path) -> String {
    let stem = |path: &Path| path.file_stem().unwrap_or(path.as_os_str()).to_owned();
    let is_packed = scene.extension().is_some_and(|ending| ending == "gz" || ending == "xz");
    let name = if is_packed { stem(Path::new(&stem(scene))) } else { stem(scene) };
    name.to_string_lossy().into_owned()
}

/// Whether a scene is built in or its file is there; so much can be said before any of several scenes is worked on.
///
/// # Errors
/// When there is no such scene.
pub fn check(scene: &Path) -> Result<(), PrepareError> {
    if scene.to_str().is_some_and(|name| scenes::find(name).is_some()) {
        return Ok(());
    }
    let name = || scene.display().to_string();
    match fs::metadata(scene) {
        Ok(_) => Ok(()),
        Err(_) if scene.extension().is_none() => Err(PrepareError::Unknown { scene: name() }),
        Err(error) => Err(PrepareError::Load(LoadError { file: name(), fault: Fault::Read(error) })),
    }
}

/// Generates or loads a scene; `watch` is told how far a file is loaded.
///
/// # Errors
/// When there is no such scene, or its file cannot be loaded, or `watch` breaks.
pub fn load(scene: &Path, invalid: InvalidTriangles, watch: &mut Watch<'_>) -> Result<Named, PrepareError> {
    let name = short_name(scene);
    if let Some(model) = scene.to_str().and_then(generate) {
        return Ok(Named { name, model, warnings: Vec::new(), notes: Vec::new(), libraries: Vec::new() });
    }
    check(scene)?;
    let options = LoadOptions { drop_invalid: invalid == InvalidTriangles::Drop, ..LoadOptions::default() };
    let Loaded { model, warnings, notes, libraries, .. } =
        load_file(scene, &options, watch).map_err(PrepareError::Load)?;
    Ok(Named { name, model, warnings, notes, libraries })
}

/// Why a scene cannot be traced.
#[derive(Debug)]
#[non_exhaustive]
pub enum PrepareError {
    /// It is neither a file nor a built-in scene.
    Unknown {
        /// What was asked for.
        scene: String,
    },
    /// The file cannot be loaded.
    Load(LoadError),
    /// The tree cannot be built.
    Build {
        /// Where the triangles come from.
        scene: String,
        /// Why.
        source: BuildError,
    },
    /// Masks or geometries of a model do not fit its triangles.
    Parts {
        /// Where the triangles come from.
        scene: String,
        /// Why.
        source: SceneError,
    },
}

impl fmt::Display for PrepareError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown { scene } => {
                let names: Vec<&str> = scenes::SCENES.iter().map(|entry| entry.name).collect();
                write!(f, "`{scene}` is neither a file nor a built-in scene; built-in are: {}", names.join(", "))
            }
            Self::Load(error) => error.fmt(f),
            Self::Build { scene, .. } => write!(f, "building the tree of {scene}"),
            Self::Parts { scene, .. } => write!(f, "masks and geometries of {scene}"),
        }
    }
}

impl Error for PrepareError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::Build { source, .. } => Some(source),
            Self::Parts { source, .. } => Some(source),
            // The message of a load error says all that its cause does.
            Self::Unknown { .. } | Self::Load(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::{LoadProgress, unwatched};
    use std::ops::ControlFlow;

    fn prepared(scene: &str) -> Result<Prepared, PrepareError> {
        prepare(Path::new(scene), &Options::new(Builder::Sah), &mut unwatched)
    }

    /// Mutants: `Load` without its message; the precision of the plan instead of the one asked for.
    #[test]
    fn scenes_are_prepared_or_refused_with_what_there_is() {
        let car = prepared("car").unwrap();
        assert_eq!(car.name, "car");
        assert!(!car.built.scene.triangles().is_empty() && car.view().camera().is_ok());
        let fast = Options { precision: Some(Precision::Fast), ..Options::new(Builder::Sah) };
        assert_eq!(prepare(Path::new("car"), &fast, &mut unwatched).unwrap().precision, Precision::Fast);
        assert!(prepared("cat").unwrap_err().to_string().contains("built-in are: yard, car"));
        assert!(prepared("missing.obj").unwrap_err().to_string().contains("missing.obj"));
    }

    /// Mutants: building that does not tell, that does not stop, or whose stop reads like a fault of the mesh.
    #[test]
    fn building_tells_how_far_it_is_and_stops() {
        for &builder in Builder::ALL {
            let mut told = Vec::new();
            let mut watch = |at: LoadProgress| {
                if at.stage == LoadStage::Building {
                    told.push((at.done, at.total));
                }
                if told.len() < 2 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
            };
            let stopped = prepare(Path::new("yard"), &Options::new(builder), &mut watch);
            assert!(matches!(stopped, Err(PrepareError::Load(LoadError { fault: Fault::Stopped, .. }))), "{builder}");
            assert_eq!((told.len(), told[0].0), (2, 0), "{builder}");
            assert!(0 < told[1].0 && told[1].0 <= told[1].1, "{builder}: {told:?}");
        }
    }

    #[test]
    fn every_listed_scene_can_be_generated() {
        assert!(scenes::SCENES.iter().all(|entry| generate(entry.name).is_some()));
    }
}
