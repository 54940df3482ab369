//! Embree 4 (I. Wald et al., *Embree: A Kernel Framework for Efficient CPU Ray Tracing*, 2014) as a device.
//!
//! Nearest hits go through `embree4-rs`. It has no call for occlusion, so any hits go through [`embree4_sys::Mesh`]:
//! the same triangles, flags and quality in a scene of their own.

use super::soup::Soup;
use super::tracer::{Peer, PeerTracer};
use embree4_rs::geometry::TriangleMeshGeometry;
use embree4_rs::{CommittedScene, SceneOptions};
use embree4_sys::{LoadError, Mesh, RTCBuildQuality, RTCRay, RTCSceneFlags};
use rt_core::{Clock, Device, DeviceError, DeviceInfo, Hit, Query, Ray, Scene, Tracer};
use std::fmt::Display;
use std::sync::Arc;

/// Embree's best trees, as a renderer would have them that traces more than it builds.
const QUALITY: RTCBuildQuality = RTCBuildQuality::HIGH;

/// How Embree traces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct EmbreeOptions {
    /// `RTC_SCENE_FLAG_ROBUST`: conservative boxes and a watertight triangle test.
    pub robust: bool,
}

/// Embree on one thread.
#[derive(Debug)]
pub struct EmbreeDevice {
    info: DeviceInfo,
    options: EmbreeOptions,
}

impl EmbreeDevice {
    /// Loads the library, if it was not.
    ///
    /// # Errors
    /// When there is none; the message says where it was looked for.
    pub fn open(options: EmbreeOptions) -> Result<Self, LoadError> {
        let [major, minor, patch] = embree4_sys::version()?;
        let robust = if options.robust { ", robust" } else { "" };
        let name = format!("Embree {major}.{minor}.{patch}{robust}");
        let info = super::info(name, "embree");
        Ok(Self { info, options })
    }
}

impl Device for EmbreeDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn tracer(&self, scene: Arc<Scene>, clock: Clock) -> Result<Box<dyn Tracer>, DeviceError> {
        let robust = if self.options.robust { RTCSceneFlags::ROBUST } else { RTCSceneFlags::NONE };
        let flags = robust | RTCSceneFlags::FILTER_FUNCTION_IN_ARGUMENTS;
        let make = move || Ok(Embree { soup: Soup::of(&scene), flags, closest: None, any: None });
        Ok(Box::new(PeerTracer::start(clock, make)?))
    }
}

struct Embree {
    soup: Soup,
    flags: RTCSceneFlags,
    /// Built when first needed.
    closest: Option<CommittedScene>,
    /// Built when first needed.
    any: Option<Mesh>,
}

fn message(error: impl Display) -> String {
    format!("embree: {error}")
}

impl Embree {
    fn build_closest(&self) -> Result<CommittedScene, String> {
        let vertices: Vec<_> = self.soup.triangles.iter().flat_map(|t| t.vertices()).map(|p| (p.x, p.y, p.z)).collect();
        let indices: Vec<_> = (0..self.soup.triangles.len() as u32).map(|i| (3 * i, 3 * i + 1, 3 * i + 2)).collect();
        let device = embree4_rs::Device::try_new(None).map_err(message)?;
        let mesh = match indices.len() {
            0 => None,
            _ => Some(TriangleMeshGeometry::try_new(&device, &vertices, &indices).map_err(message)?),
        };
        let options = SceneOptions { build_quality: QUALITY, flags: self.flags };
        let scene = embree4_rs::Scene::try_new(device, options).map_err(message)?;
        if let Some(mesh) = mesh {
            scene.attach_geometry(&mesh).map_err(message)?;
        }
        scene.commit().map_err(message)
    }

    fn build_any(&self) -> Result<Mesh, String> {
        let vertices: Vec<_> = self.soup.triangles.iter().flat_map(|t| t.vertices()).map(|p| p.to_array()).collect();
        let indices: Vec<_> = (0..self.soup.triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        Mesh::new(&vertices, &indices, self.flags, QUALITY).map_err(message)
    }

    fn nearest(&self, scene: &CommittedScene, ray: RTCRay, origin: u32) -> Result<Hit, String> {
        let found = match self.soup.position(origin) {
            u32::MAX => scene.intersect_1(ray, None),
            skip => embree4_sys::without(skip, |arguments| scene.intersect_1(ray, Some(arguments))),
        };
        let hit = |found: embree4_sys::RTCRayHit| {
            let primitive = self.soup.id(found.hit.primID);
            Hit { t: found.ray.tfar, u: found.hit.u, v: found.hit.v, primitive }
        };
        Ok(found.map_err(message)?.map_or(Hit::MISS, hit))
    }
}

impl Peer for Embree {
    fn prepare(&mut self, query: Query) -> Result<(), String> {
        match query {
            Query::Closest if self.closest.is_none() => self.closest = Some(self.build_closest()?),
            Query::Any if self.any.is_none() => self.any = Some(self.build_any()?),
            _ => {}
        }
        Ok(())
    }

    fn trace(&self, ray: &Ray, origin: u32, query: Query) -> Result<Hit, String> {
        let given = RTCRay::new(ray.origin.to_array(), ray.direction.to_array(), ray.tmin, ray.tmax);
        match (query, &self.closest, &self.any) {
            (Query::Closest, Some(scene), _) => self.nearest(scene, given, origin),
            (Query::Any, _, Some(mesh)) => {
                let found = mesh.occluder(given, self.soup.position(origin));
                Ok(found.map_or(Hit::MISS, |o| Hit { t: o.t, u: o.u, v: o.v, primitive: self.soup.id(o.primitive) }))
            }
            _ => Err(message("no scene was built for this query")),
        }
    }
}
