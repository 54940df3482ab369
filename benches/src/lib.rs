//! What the benchmarks share: scenes with cameras, and the tracers that ours are compared with.
#![forbid(unsafe_code)]

pub mod large;
pub mod options;
pub mod peers;

use rt_core::bounce::Surfaces;
use rt_core::{Precision, Query, RaySource, Scene};
use rt_scene::streams::{self, Paths, Sun, Wave};
use rt_scene::{Model, View, builtin, obj, view};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;

/// A stream's name, its rays, and what is asked of them.
pub type NamedStream = (&'static str, RaySource, Query);

/// A scene and the view it is benchmarked from.
#[derive(Debug)]
pub struct BenchScene {
    /// Short name.
    pub name: String,
    /// The triangles.
    pub model: Model,
    /// The camera's parameters.
    pub view: View,
}

impl BenchScene {
    /// `yard`, `car`, or an OBJ file, whose camera is taken from a `cameras.tsv` beside it if that names it.
    ///
    /// # Errors
    /// When the file cannot be loaded.
    pub fn open(scene: &str) -> Result<Self, Box<dyn Error>> {
        let model = match scene {
            "yard" => builtin::yard(),
            "car" => builtin::car(),
            path => obj::load_obj(Path::new(path), &obj::LoadOptions::default(), &mut obj::unwatched)?.model,
        };
        let path = Path::new(scene);
        let name = path.file_stem().map_or_else(|| scene.to_owned(), |stem| stem.to_string_lossy().into_owned());
        let listed = view::listed(path, &model);
        let view = model.view.or(listed).unwrap_or_else(|| view::auto_view(&model));
        Ok(Self { name, model, view })
    }

    /// The paths of an image of `scene`, which is this model's tree: the rays that rendering it sends.
    ///
    /// # Errors
    /// When the view makes no camera.
    pub fn paths(&self, scene: &Arc<Scene>, size: [u32; 2], samples: u32, seed: u32) -> Result<Paths, Box<dyn Error>> {
        let surfaces = Arc::new(Surfaces::new(Arc::clone(scene)));
        Ok(Paths { camera: self.view.camera()?, size, samples, seed, sun: Sun::beside(&self.view), surfaces })
    }

    /// The streams of a path tracer's first steps that are not empty, one path for each pixel: primary rays of an image, shadow
    /// rays towards the sun and diffuse rays from what those hit; each with its name and what is asked of it.
    ///
    /// # Errors
    /// When the view makes no camera.
    pub fn streams(&self, scene: &Arc<Scene>, size: [u32; 2]) -> Result<Vec<NamedStream>, Box<dyn Error>> {
        let paths = self.paths(scene, size, 1, 1)?;
        let primary = paths.primary(&Wave::whole(size)?);
        let hits = streams::trace(scene, &primary.source, primary.spec(Precision::Robust));
        let [shadow, diffuse] = paths.follow(&primary, &hits);
        let streams = [("primary", primary), ("shadow", shadow), ("diffuse", diffuse)];
        let streams = streams.into_iter().map(|(name, stream)| (name, stream.source, stream.query));
        Ok(streams.filter(|(_, source, _)| !source.is_empty()).collect())
    }
}
