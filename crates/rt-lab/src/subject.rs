//! What experiments share: a scene on devices, and its streams.

use crate::Lab;
use anyhow::{Context, Result};
use rt_balance::report::StreamRun;
use rt_balance::{Balancer, Limits, Reference, Scheduling, Stream};
use rt_core::{Device, Hit, Scene};
use rt_scene::Model;
use rt_scene::prepare::{Options, Prepared};
use rt_scene::streams::{PathStream, Wave};
use std::path::Path;
use std::sync::Arc;

/// A scene on devices, ready for repeated measurements.
pub(crate) struct Subject<'a> {
    lab: Lab<'a>,
    pub(crate) balancer: Balancer,
    prepared: Prepared,
    /// Results are thrown away, but written as in any run.
    hits: Vec<Hit>,
}

impl<'a> Subject<'a> {
    /// Loads the scene and brings it to the devices.
    pub(crate) fn open(lab: Lab<'a>, scene: &Path, devices: &[Arc<dyn Device>]) -> Result<Self> {
        let prepared = lab.prepare(scene)?;
        let scene = Arc::clone(&prepared.built.scene);
        let balancer = Balancer::open(scene, devices, &Limits::default(), lab.control())?;
        Ok(Self { lab, balancer, prepared, hits: Vec::new() })
    }

    /// The camera's rays, one for each pixel, and the diffuse rays from their hits: the coherent and the incoherent
    /// case.
    pub(crate) fn streams(&mut self, size: [u32; 2], seed: u32) -> Result<[Stream; 2]> {
        let paths = self.prepared.paths(&self.prepared.view(), size, seed).context("the scene's camera")?;
        let precision = self.prepared.precision;
        let stream = |stream: &PathStream| Stream::new(stream.source.clone(), stream.kind, stream.spec(precision));
        let rays = paths.primary(&Wave::whole(size)?);
        let primary = stream(&rays);
        self.trace(&primary, &mut Scheduling::default())?;
        let [_, diffuse] = paths.follow(&rays, &self.hits);
        Ok([primary, stream(&diffuse)])
    }

    /// Traces a stream once.
    pub(crate) fn trace(&mut self, stream: &Stream, scheduling: &mut Scheduling) -> Result<StreamRun> {
        trace(self.lab, &mut self.balancer, stream, scheduling, &mut self.hits)
    }

    /// Every task's own time and tests, in a pass of its own.
    pub(crate) fn reference(&mut self, stream: &Stream) -> Result<Reference> {
        Ok(self.balancer.reference(stream, 1, &Limits::default(), self.lab.control())?)
    }

    /// Short name.
    pub(crate) fn name(&self) -> &str {
        &self.prepared.name
    }

    /// The scene with its tree.
    pub(crate) fn scene(&self) -> &Scene {
        &self.prepared.built.scene
    }

    /// How it was prepared.
    pub(crate) fn options(&self) -> &Options {
        &self.prepared.options
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
    lab: Lab<'_>,
    balancer: &mut Balancer,
    stream: &Stream,
    scheduling: &mut Scheduling,
    hits: &mut Vec<Hit>,
) -> Result<StreamRun> {
    lab.go_on()?;
    hits.clear();
    hits.resize(stream.source.len() as usize, Hit::MISS);
    Ok(balancer.trace(stream, scheduling, hits, None, lab.control())?)
}
