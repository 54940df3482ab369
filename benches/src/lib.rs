//! What the benchmarks share: scenes with cameras, and the tracers that ours are compared with.
#![forbid(unsafe_code)]

pub mod options;
pub mod peers;

use rt_bvh::Stack;
use rt_core::{CameraRays, Hit, Query, RaySource, Scene, StreamSpec, morton};
use rt_scene::streams::{Spawner, Sun};
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

    /// All camera rays of an image, in Z-curve order.
    ///
    /// # Errors
    /// When the view makes no camera.
    pub fn primary(&self, size: [u32; 2], samples: u32, seed: u32) -> Result<RaySource, Box<dyn Error>> {
        let pixels: Arc<[u32]> = morton::pixel_order(size[0], size[1]).into();
        let camera = self.view.camera()?;
        Ok(RaySource::Camera(Arc::new(CameraRays { camera, size, pixels, samples, seed })))
    }

    /// The streams of a path tracer's first steps that are not empty: primary rays of an image, shadow rays towards the sun and
    /// diffuse rays from what those hit; each with its name and what is asked of it.
    ///
    /// # Errors
    /// When the view makes no camera.
    pub fn streams(&self, scene: &Scene, size: [u32; 2]) -> Result<Vec<NamedStream>, Box<dyn Error>> {
        let primary = self.primary(size, 1, 1)?;
        let mut hits: Vec<Hit> = Vec::with_capacity(primary.len() as usize);
        let rays = (0..primary.len()).map(|i| primary.ray(i));
        rt_bvh::trace(scene, &mut Stack::for_scene(scene), StreamSpec::default(), rays, |hit, _| hits.push(hit));
        let spawner = Spawner { model: &self.model, rays: &primary, hits: &hits, seed: 1, samples: 1, bounce: 0 };
        let sun = Sun::new(glam::Vec3::new(0.4, 0.8, 0.5), Sun::REAL_RADIUS).ok_or("the sun shines from somewhere")?;
        let all = 0..hits.len() as u32;
        let shadow = spawner.shadow(&sun, all.clone()).into_source().0;
        let diffuse = spawner.diffuse(all).into_source().0;
        let streams = [
            ("primary", primary, Query::Closest),
            ("shadow", shadow, Query::Any),
            ("diffuse", diffuse, Query::Closest),
        ];
        Ok(streams.into_iter().filter(|(_, source, _)| !source.is_empty()).collect())
    }
}
