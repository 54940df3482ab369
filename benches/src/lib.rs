//! What the benchmarks share: scenes with cameras.
#![forbid(unsafe_code)]

use rt_core::{CameraRays, RaySource, morton};
use rt_scene::{Model, View, builtin, obj, view};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;

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
            path => obj::load_obj(Path::new(path), &obj::LoadOptions::default(), &mut |_| {})?.model,
        };
        let path = Path::new(scene);
        let name = path.file_stem().map_or_else(|| scene.to_owned(), |stem| stem.to_string_lossy().into_owned());
        let listed = view::listed(path);
        let view = model.view.or(listed).unwrap_or_else(|| view::auto_view(&model));
        Ok(Self { name, model, view })
    }

    /// All camera rays of an image, in Z-curve order.
    ///
    /// # Errors
    /// When the view makes no camera.
    pub fn primary(&self, size: [u32; 2], samples: u32, seed: u32) -> Result<RaySource, Box<dyn Error>> {
        let pixels: Arc<[u32]> = morton::pixel_order(size[0], size[1]).into();
        let camera = self.view.camera()?;
        Ok(RaySource::Camera(Arc::new(CameraRays { camera, size, pixels, samples, seed })))
    }
}
