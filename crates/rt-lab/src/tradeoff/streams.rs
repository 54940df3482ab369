//! The rays that are measured: what a renderer traces, and two kinds that it does not.

use anyhow::{Context, Result};
use rt_balance::DEFAULT_TASK_SIZE;
use rt_core::{Hit, Launch, Precision, Query, Ray, RaySource, Scene, StreamSpec, Tracer, Triangle, tasks_of};
use rt_scene::prepare::Prepared;
use rt_scene::streams::{self, Wave};
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
    let paths = prepared.paths(&prepared.view(), size, seed);
    let paths = paths.with_context(|| format!("a camera for {}", prepared.model.source))?;
    let primary = paths.primary(&Wave::whole(size)?);
    let [shadow, diffuse] = paths.follow(&primary, &reference(&prepared.built.scene, &primary.source, primary.query));
    let all = 0..primary.source.len();
    let maker = RayMaker::new(triangles, seed);
    let aimed = |aim| {
        let rays: Vec<Ray> = all.clone().map(|i| maker.ray(aim, i).0).collect();
        RaySource::Explicit { rays: rays.into(), origins: None }
    };
    let kinds = [
        ("primary", primary.source, primary.query),
        ("shadow", shadow.source, shadow.query),
        ("diffuse", diffuse.source, diffuse.query),
        ("random", aimed(Aim::Random), Query::Closest),
        (EDGES, aimed(Aim::Edge), Query::Closest),
    ];
    let mut kinds: Vec<Kind> = kinds.into_iter().map(|(name, source, query)| Kind { name, source, query }).collect();
    kinds.retain(|kind| !kind.source.is_empty());
    Ok(kinds)
}

/// The hits of a stream in double precision.
pub(super) fn reference(scene: &Scene, source: &RaySource, query: Query) -> Vec<Hit> {
    streams::trace(scene, source, StreamSpec::new(query, Precision::Double, false))
}

/// Traces a whole stream in one launch, in tasks as the balancer cuts them by default.
pub(super) fn launch(tracer: &mut dyn Tracer, source: &RaySource, spec: StreamSpec) -> Result<Launch> {
    tracer.load_rays(source.clone(), spec)?;
    let ticket = tracer.submit(&tasks_of(source.len(), DEFAULT_TASK_SIZE), None)?;
    let mut launch = Launch::default();
    tracer.wait(ticket, LIMIT, &mut launch)?;
    Ok(launch)
}
