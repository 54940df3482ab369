//! What the benchmarks share: scenes with cameras.
#![forbid(unsafe_code)]

use rt_core::{CameraRays, RaySource, morton};
use rt_scene::{Model, View, builtin, obj, view};
use std::error::Error;
use std::fs;
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
        let listed = camera_beside(path);
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

/// The line of `cameras.tsv` for this file: name, eye, target, up, vertical field of view.
fn camera_beside(path: &Path) -> Option<View> {
    let table = fs::read_to_string(path.parent()?.join("cameras.tsv")).ok()?;
    let name = path.file_name()?.to_str()?;
    let line = table.lines().find(|line| line.split('\t').next() == Some(name))?;
    let fields: Vec<&str> = line.split('\t').collect();
    let vector = |text: &str| {
        let parts: Vec<f32> = text.split_whitespace().filter_map(|x| x.parse().ok()).collect();
        (parts.len() == 3).then(|| glam::Vec3::from_slice(&parts))
    };
    let [_, eye, target, up, fov] = fields[..] else { return None };
    Some(View { eye: vector(eye)?, target: vector(target)?, up: vector(up)?, fov_degrees: fov.trim().parse().ok()? })
}
