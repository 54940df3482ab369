//! The rays that are measured: from the camera, to the sun, bounced, and anywhere.

use crate::frame::spawn;
use crate::shade::Light;
use anyhow::{Context, Result};
use glam::Vec3;
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use rt_bvh::Stack;
use rt_core::{CameraRays, Hit, Query, Ray, RaySource, Scene, StreamSpec, morton, random};
use rt_scene::prepare::Prepared;
use rt_scene::streams::{Spawned, Spawner};
use rt_scene::{Model, View, view};
use std::f32::consts::TAU;
use std::path::Path;
use std::sync::Arc;

/// Rays of one kind.
#[derive(Debug)]
pub(crate) struct Rays {
    pub(crate) kind: &'static str,
    pub(crate) query: Query,
    pub(crate) source: RaySource,
}

/// A scene with a view of it.
#[derive(Debug)]
pub(crate) struct BenchScene<'a> {
    model: &'a Model,
    pub(crate) tree: Arc<Scene>,
    view: View,
}

/// Rounds of bounces that are made at most to have as many rays as asked for: a camera that sees little but sky.
const MOST_ROUNDS: u32 = 64;

impl<'a> BenchScene<'a> {
    /// Seen as its model says, or `cameras.tsv` beside its file, or as `render` would show it.
    pub(crate) fn new(prepared: &'a Prepared, path: &Path) -> Result<Self> {
        let model = &prepared.model;
        let view = model.view.or_else(|| view::listed(path)).unwrap_or_else(|| prepared.view());
        Ok(Self { model, tree: Arc::clone(&prepared.built.scene), view })
    }

    /// `rays` rays of each kind: primary ones fill a square picture, rounded up to whole rows. Kinds that the scene has
    /// none of are left out.
    pub(crate) fn streams(&self, rays: u32, seed: u32) -> Result<Vec<Rays>> {
        let side = f64::from(rays).sqrt().ceil() as u32;
        let camera = self.view.camera().with_context(|| format!("the camera of {}", self.model.source))?;
        let pixels: Arc<[u32]> = morton::pixel_order(side, side).into();
        let primary = RaySource::Camera(Arc::new(CameraRays { camera, size: [side, side], pixels, samples: 1, seed }));
        let hits = nearest(&self.tree, &primary);
        let light = Light::new(&self.view, self.model.bounds().extent().length());
        let spawner = |seed| Spawner { model: self.model, rays: &primary, hits: &hits, seed, samples: 1, bounce: 0 };
        let count = primary.len() as usize;
        let shadow = filled(count, |round, from| spawner(seed + round).shadow(&light.sun, from), hits.len());
        let diffuse = filled(count, |round, from| spawner(seed + round).diffuse(from), hits.len());
        let random = RaySource::Explicit { rays: self.random(primary.len(), seed), origins: None };
        let all = [
            Rays { kind: "primary", query: Query::Closest, source: primary },
            Rays { kind: "shadow", query: Query::Any, source: shadow },
            Rays { kind: "diffuse", query: Query::Closest, source: diffuse },
            Rays { kind: "random", query: Query::Closest, source: random },
        ];
        Ok(all.into_iter().filter(|rays| !rays.source.is_empty()).collect())
    }

    /// From anywhere in the scene's box in any direction: nothing that neighbours have in common.
    fn random(&self, count: u32, seed: u32) -> Arc<[Ray]> {
        let bounds = self.model.bounds();
        let ray = |index| {
            let origin = bounds.min + bounds.extent() * Vec3::from(random::pcg3d([seed, index, 0]).map(random::unit));
            let [height, turn] = random::pair(seed, index, 1);
            let z = 1.0 - 2.0 * height;
            let (sin, cos) = (TAU * turn).sin_cos();
            let r = (1.0 - z * z).max(0.0).sqrt();
            Ray::new(origin, Vec3::new(r * cos, r * sin, z))
        };
        (0..count).into_par_iter().map(ray).collect::<Vec<_>>().into()
    }
}

/// `count` rays from round after round of spawning off all hits, each with other random numbers.
fn filled(count: usize, round: impl Fn(u32, std::ops::Range<u32>) -> Spawned + Sync, hits: usize) -> RaySource {
    let (mut rays, mut origins): (Vec<Ray>, Vec<u32>) = (Vec::new(), Vec::new());
    for number in 0..MOST_ROUNDS {
        let (source, _) = spawn(hits, |range| round(number, range));
        let RaySource::Explicit { rays: more, origins: from } = source else { break };
        if more.is_empty() || rays.len() >= count {
            break;
        }
        let left = count - rays.len();
        rays.extend(more.iter().take(left));
        origins.extend(from.iter().flat_map(|from| from.iter()).take(left));
    }
    RaySource::Explicit { rays: rays.into(), origins: Some(origins.into()) }
}

/// The nearest hit of every ray, on all cores.
fn nearest(scene: &Scene, source: &RaySource) -> Vec<Hit> {
    const CHUNK: u32 = 1 << 14;
    let chunk = |chunk: u32| {
        let rays = (chunk * CHUNK..source.len().min((chunk + 1) * CHUNK)).map(|i| source.ray(i));
        let mut hits = Vec::with_capacity(CHUNK as usize);
        rt_bvh::trace(scene, &mut Stack::for_scene(scene), StreamSpec::default(), rays, |hit, _| hits.push(hit));
        hits
    };
    (0..source.len().div_ceil(CHUNK)).into_par_iter().flat_map_iter(chunk).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::SceneArgs;

    #[derive(clap::Parser)]
    struct Arguments {
        #[command(flatten)]
        source: SceneArgs,
    }

    /// Fails when spawning stops after one round: a third of the car's picture is floor and sky.
    #[test]
    fn every_kind_has_as_many_rays_as_asked_for() {
        let arguments = <Arguments as clap::Parser>::parse_from(["bench"]);
        let prepared = arguments.source.prepare("car").unwrap();
        let scene = BenchScene::new(&prepared, Path::new("car")).unwrap();
        let streams = scene.streams(1000, 1).unwrap();
        assert_eq!(
            streams.iter().map(|rays| rays.kind).collect::<Vec<_>>(),
            ["primary", "shadow", "diffuse", "random"]
        );
        // 32 × 32 pixels.
        assert!(streams.iter().all(|rays| rays.source.len() == 1024));
        let hits = nearest(&scene.tree, &streams[3].source);
        assert!(hits.len() == 1024 && hits.iter().any(Hit::is_hit));
    }
}
