//! What measuring commands share: a scene on devices, its streams, the machine.

pub(crate) use rt_report::{Machine, command_line};

use crate::args::SceneArgs;
use crate::interrupt;
use anyhow::{Context, Result, bail};
use rt_balance::report::StreamRun;
use rt_balance::{Balancer, Control, Scheduling, Stream};
use rt_core::{CameraRays, Device, Hit, RaySource, Scene, Span, StreamKind, StreamSpec, morton};
use rt_scene::Model;
use rt_scene::prepare::Prepared;
use rt_scene::streams::Spawner;
use std::sync::Arc;

/// A scene on devices, ready for repeated measurements.
pub(crate) struct Subject {
    pub(crate) balancer: Balancer,
    prepared: Prepared,
    /// Results are thrown away, but written as in any run.
    hits: Vec<Hit>,
}

impl Subject {
    /// Loads the scene and brings it to the devices.
    pub(crate) fn open(scene: &str, source: &SceneArgs, devices: &[Arc<dyn Device>]) -> Result<Self> {
        let prepared = source.prepare(scene)?;
        let balancer = Balancer::new(Arc::clone(&prepared.built.scene), devices)?;
        Ok(Self { balancer, prepared, hits: Vec::new() })
    }

    /// The camera's rays, one for each pixel, and the diffuse rays from their hits: the coherent and the incoherent case.
    pub(crate) fn streams(&mut self, size: [u32; 2], seed: u32) -> Result<[Stream; 2]> {
        let camera = self.prepared.view().camera().context("the scene's camera")?;
        let pixels: Arc<[u32]> = morton::pixel_order(size[0], size[1]).into();
        let rays = RaySource::Camera(Arc::new(CameraRays { camera, size, pixels, samples: 1, seed }));
        let spec = StreamSpec { precision: self.prepared.precision, ..StreamSpec::default() };
        let primary = Stream::new(rays.clone(), StreamKind::Primary, spec);
        self.trace(&primary, &mut Scheduling::default())?;
        let spawner =
            Spawner { model: &self.prepared.model, rays: &rays, hits: &self.hits, seed, samples: 1, bounce: 0 };
        let diffuse = spawner.diffuse(0..rays.len()).into_source().0;
        Ok([primary, Stream::new(diffuse, StreamKind::Diffuse(0), spec)])
    }

    /// Traces a stream once.
    pub(crate) fn trace(&mut self, stream: &Stream, scheduling: &mut Scheduling) -> Result<StreamRun> {
        trace(&mut self.balancer, stream, scheduling, &mut self.hits)
    }

    /// Short name.
    pub(crate) fn name(&self) -> &str {
        &self.prepared.name
    }

    /// The scene with its tree.
    pub(crate) fn scene(&self) -> &Scene {
        &self.prepared.built.scene
    }

    /// The triangles.
    pub(crate) fn model(&self) -> &Model {
        &self.prepared.model
    }

    /// Names of the devices.
    pub(crate) fn devices(&self) -> Vec<String> {
        self.balancer.devices().map(|device| device.name.clone()).collect()
    }
}

/// Traces a stream once; the hits are left in `hits`, whatever it held before.
pub(crate) fn trace(
    balancer: &mut Balancer,
    stream: &Stream,
    scheduling: &mut Scheduling,
    hits: &mut Vec<Hit>,
) -> Result<StreamRun> {
    if interrupt::requested() {
        bail!("interrupted");
    }
    hits.clear();
    hits.resize(stream.source.len() as usize, Hit::MISS);
    let control = Control { cancel: Some(interrupt::flag()), progress: None };
    Ok(balancer.trace(stream, scheduling, hits, None, control)?)
}

/// Seconds in the kernel; of the whole launch where the device cannot tell.
pub(crate) fn in_kernel(span: Span) -> f64 {
    let inside = if span.in_kernel.is_zero() { span.duration() } else { span.in_kernel };
    inside.as_secs_f64()
}
