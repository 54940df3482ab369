//! Embree and obvhs on the rays of a benchmark, on one thread: what our speed is compared with.

use embree4_sys::{
    Mesh, RTC_INVALID_GEOMETRY_ID, RTCBuildQuality, RTCHit16, RTCRay, RTCRay16, RTCRayHit16, RTCSceneFlags,
};
use rt_balance::clock;
use rt_core::{Device, DeviceError, Launch, Query, RaySource, Scene, StreamSpec, Tracer, tasks_of};
use rt_scene::Model;
use rt_tests::peers::{ObvhsDevice, ObvhsLayout};
use std::error::Error;
use std::hint::black_box;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The longest a run of a peer may take.
const LIMIT: Duration = Duration::from_secs(600);

/// A way to trace with another tracer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Peer {
    /// Embree, one ray at a time.
    Embree {
        /// With the robust flag.
        robust: bool,
    },
    /// Embree, sixteen rays at a time, which are put side by side within the time that is measured. Nearest hits only.
    Embree16 {
        /// With the robust flag.
        robust: bool,
    },
    /// The crate `obvhs`, one ray at a time.
    Obvhs(ObvhsLayout),
}

impl Peer {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Embree { robust: true },
        Self::Embree { robust: false },
        Self::Embree16 { robust: true },
        Self::Embree16 { robust: false },
        Self::Obvhs(ObvhsLayout::Bvh2),
        Self::Obvhs(ObvhsLayout::CwBvh),
    ];

    /// The name that tables use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Embree { robust: true } => "Embree robust",
            Self::Embree { robust: false } => "Embree",
            Self::Embree16 { robust: true } => "Embree robust ×16",
            Self::Embree16 { robust: false } => "Embree ×16",
            Self::Obvhs(ObvhsLayout::Bvh2) => "obvhs Bvh2",
            Self::Obvhs(ObvhsLayout::CwBvh) => "obvhs CwBvh",
        }
    }
}

/// A run of a peer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Run {
    /// Seconds.
    pub seconds: f64,
    /// Rays that hit something.
    pub hits: usize,
}

/// The peers with one scene each.
///
/// A ray is not kept from hitting the primitive it starts on: peers would pay for that with a callback, and the rays
/// of the benchmarks start beside their surfaces. How many rays hit is part of every run, so that it can be compared.
#[derive(Debug)]
pub struct Peers {
    /// Plain and robust.
    embree: Result<[Mesh; 2], String>,
    /// In the order of [`ObvhsLayout::ALL`].
    obvhs: [Box<dyn Tracer>; 2],
}

impl Peers {
    /// Has every peer build its tree of a scene: Embree's at its highest quality, obvhs's as `medium_build`.
    ///
    /// # Errors
    /// When obvhs cannot. That Embree cannot is told by [`Peers::missing`].
    pub fn new(model: &Model, scene: &Arc<Scene>) -> Result<Self, DeviceError> {
        let vertices: Vec<[f32; 3]> = model.positions.iter().map(|p| p.to_array()).collect();
        let mesh = |flags| Mesh::new(&vertices, &model.indices, flags, RTCBuildQuality::HIGH);
        let both = || Ok([mesh(RTCSceneFlags::NONE)?, mesh(RTCSceneFlags::ROBUST)?]);
        let embree = both().map_err(|e: embree4_sys::MeshError| e.to_string());
        let [two, eight] = ObvhsLayout::ALL.map(|layout| ObvhsDevice::new(layout).tracer(Arc::clone(scene), clock));
        Ok(Self { embree, obvhs: [two?, eight?] })
    }

    /// Why Embree is not there, if it is not.
    #[must_use]
    pub fn missing(&self) -> Option<&str> {
        self.embree.as_ref().err().map(String::as_str)
    }

    /// Traces a stream; `None` for a peer that is missing or cannot.
    ///
    /// # Errors
    /// The peer's.
    pub fn run(&mut self, peer: Peer, source: &RaySource, query: Query) -> Result<Option<Run>, Box<dyn Error>> {
        match (peer, &self.embree) {
            (Peer::Obvhs(layout), _) => Ok(Some(launch(&mut *self.obvhs[layout as usize], source, query)?)),
            (_, Err(_)) | (Peer::Embree16 { .. }, _) if query == Query::Any => Ok(None),
            (Peer::Embree { robust }, Ok(meshes)) => Ok(Some(single(&meshes[usize::from(robust)], source, query))),
            (Peer::Embree16 { robust }, Ok(meshes)) => Ok(Some(packets(&meshes[usize::from(robust)], source))),
            (_, Err(_)) => Ok(None),
        }
    }
}

/// The same rays without the primitives they start on.
fn without_origins(source: &RaySource) -> RaySource {
    match source {
        RaySource::Explicit { rays, .. } => RaySource::Explicit { rays: Arc::clone(rays), origins: None },
        camera @ RaySource::Camera(_) => camera.clone(),
        bounce @ RaySource::Bounce(_) => {
            let rays = (0..bounce.len()).map(|i| bounce.ray(i).0).collect();
            RaySource::Explicit { rays, origins: None }
        }
    }
}

fn launch(tracer: &mut dyn Tracer, source: &RaySource, query: Query) -> Result<Run, DeviceError> {
    tracer.load_rays(without_origins(source), StreamSpec { query, ..StreamSpec::default() })?;
    let ticket = tracer.submit(&tasks_of(source.len(), u32::MAX), None)?;
    let mut launch = Launch::default();
    tracer.wait(ticket, LIMIT, &mut launch)?;
    let hits = launch.hits.iter().filter(|hit| hit.is_hit()).count();
    Ok(Run { seconds: launch.span.in_kernel.as_secs_f64(), hits })
}

fn given(source: &RaySource, index: u32) -> RTCRay {
    let (ray, _) = source.ray(index);
    RTCRay::new(ray.origin.to_array(), ray.direction.to_array(), ray.tmin, ray.tmax)
}

fn single(mesh: &Mesh, source: &RaySource, query: Query) -> Run {
    let begin = Instant::now();
    let rays = (0..source.len()).map(|i| given(source, i));
    let hits = match query {
        Query::Closest => rays.filter(|ray| black_box(mesh.closest(*ray)).is_some()).count(),
        Query::Any => rays.filter(|ray| mesh.is_occluded(*ray)).count(),
    };
    Run { seconds: begin.elapsed().as_secs_f64(), hits }
}

fn packets(mesh: &Mesh, source: &RaySource) -> Run {
    let begin = Instant::now();
    let mut hits = 0;
    let mut packet = Box::new(RTCRayHit16::default());
    for first in (0..source.len()).step_by(16) {
        packet.hit = RTCHit16::default();
        for slot in 0..16 {
            // Beyond the last ray, one that ends before it begins: such rays take no part.
            let nothing = RTCRay::new([0.0; 3], [0.0, 0.0, 1.0], 1.0, -1.0);
            let index = first.saturating_add(slot);
            let ray = if index < source.len() { given(source, index) } else { nothing };
            put(&mut packet.ray, slot as usize, &ray);
        }
        mesh.closest_16(&mut packet);
        hits += packet.hit.geomID.iter().filter(|id| **id != RTC_INVALID_GEOMETRY_ID).count();
    }
    Run { seconds: begin.elapsed().as_secs_f64(), hits }
}

fn put(packet: &mut RTCRay16, slot: usize, ray: &RTCRay) {
    (packet.org_x[slot], packet.org_y[slot], packet.org_z[slot]) = (ray.org_x, ray.org_y, ray.org_z);
    (packet.dir_x[slot], packet.dir_y[slot], packet.dir_z[slot]) = (ray.dir_x, ray.dir_y, ray.dir_z);
    (packet.tnear[slot], packet.tfar[slot], packet.mask[slot]) = (ray.tnear, ray.tfar, ray.mask);
}
