//! The rays that are measured: what a renderer traces, and two kinds that it does not.

use crate::shade::Light;
use anyhow::{Context, Result};
use rt_balance::DEFAULT_TASK_SIZE;
use rt_core::{Hit, Launch, Query, Ray, RaySource, Scene, StreamSpec, Tracer, Triangle, morton, tasks_of};
use rt_scene::prepare::Prepared;
use rt_scene::streams::{Spawner, primary};
use rt_verify::rays::{Aim, RayMaker};
use std::time::Duration;

/// One stream of rays.
#[derive(Debug)]
pub(super) struct Kind {
    /// `primary`, `shadow`, `diffuse`, `random` or [`EDGES`].
    pub(super) name: &'static str,
    pub(super) source: RaySource,
    pub(super) query: Query,
}

/// Rays aimed at edges.
pub(super) const EDGES: &str = "edges";

/// The longest a launch may take; a software rasteriser on a loaded machine is slow.
const LIMIT: Duration = Duration::from_secs(600);

/// How many kinds there are.
pub(super) const STREAMS: usize = 5;

/// Camera rays of one picture; shadow and diffuse rays from where they hit; as many random segments, and rays aimed at
/// edges, where single precision leaks.
pub(super) fn streams(prepared: &Prepared, triangles: &[Triangle], size: [u32; 2], seed: u32) -> Result<Vec<Kind>> {
    let view = prepared.view();
    let camera = view.camera().with_context(|| format!("a camera for {}", prepared.model.source))?;
    let pixels = morton::pixel_order(size[0], size[1]).into();
    let camera = RaySource::Camera(std::sync::Arc::new(primary(camera, size, 1, seed, pixels)));
    let hits = reference(&prepared.built.scene, &camera, Query::Closest);
    let spawner = Spawner { model: &prepared.model, rays: &camera, hits: &hits, seed, samples: 1, bounce: 0 };
    let light = Light::new(&view, prepared.model.bounds().extent().length());
    let all = 0..camera.len();
    let maker = RayMaker::new(triangles, seed);
    let aimed = |aim| {
        let rays: Vec<Ray> = all.clone().map(|i| maker.ray(aim, i).0).collect();
        RaySource::Explicit { rays: rays.into(), origins: None }
    };
    let kinds = [
        ("shadow", spawner.shadow(&light.sun, all.clone()).into_source().0, Query::Any),
        ("diffuse", spawner.diffuse(all.clone()).into_source().0, Query::Closest),
        ("random", aimed(Aim::Random), Query::Closest),
        (EDGES, aimed(Aim::Edge), Query::Closest),
        ("primary", camera, Query::Closest),
    ];
    let mut kinds: Vec<Kind> = kinds.into_iter().map(|(name, source, query)| Kind { name, source, query }).collect();
    kinds.rotate_right(1);
    kinds.retain(|kind| !kind.source.is_empty());
    Ok(kinds)
}

/// The hits of a stream in double precision, on all cores.
pub(super) fn reference(scene: &Scene, source: &RaySource, query: Query) -> Vec<Hit> {
    use rayon::prelude::*;
    /// Rays that one core traces at a time.
    const CHUNK: u32 = 1 << 12;
    let spec = StreamSpec { query, precision: rt_core::Precision::Double, counts: false };
    let chunk = |chunk: u32| {
        let range = chunk * CHUNK..source.len().min((chunk + 1) * CHUNK);
        let mut hits = Vec::with_capacity(range.len());
        let rays = range.map(|i| source.ray(i));
        rt_bvh::trace(scene, &mut rt_bvh::Stack::for_scene(scene), spec, rays, |hit, _| hits.push(hit));
        hits
    };
    (0..source.len().div_ceil(CHUNK)).into_par_iter().flat_map_iter(chunk).collect()
}

/// Traces a whole stream in one launch, in tasks as the balancer cuts them by default.
pub(super) fn launch(tracer: &mut dyn Tracer, source: &RaySource, spec: StreamSpec) -> Result<Launch> {
    tracer.load_rays(source.clone(), spec)?;
    let ticket = tracer.submit(&tasks_of(source.len(), DEFAULT_TASK_SIZE), None)?;
    let mut launch = Launch::default();
    tracer.wait(ticket, LIMIT, &mut launch)?;
    Ok(launch)
}
