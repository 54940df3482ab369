//! Embree 4 (I. Wald et al., *Embree: A Kernel Framework for Efficient CPU Ray Tracing*, 2014) as a device.
//!
//! Of Embree's interfaces the one is used that was measured to be the fastest: with AVX-512 rays are given sixteen at a
//! time, with the flag for coherent rays where they are (`docs/results/cpu.md`); elsewhere one by one, since there a
//! packet is traced ray by ray, which took 1 to 15% more time. A renderer may have to leave out the triangle that a ray
//! starts on. Nearest hits are looked for without that, and once more for the few rays that hit it; any hits need a
//! filter anyway, since Embree does not tell what it was that hides.

use crate::soup::Soup;
use crate::tracer::{Asked, Peer, PeerTracer, info};
use embree4_sys::{
    LoadError, Mesh, Occluder, RTC_INVALID_GEOMETRY_ID, RTCBuildQuality, RTCHit16, RTCRay, RTCRayHit, RTCRayHit16,
    RTCRayQueryFlags, RTCSceneFlags,
};
use rt_core::{Clock, Device, DeviceError, DeviceInfo, Hit, Query, Ray, Scene, Tracer};
use rt_simd::{Isa, Kernel};
use std::sync::Arc;

/// Embree's best trees, as a renderer would have them that traces more than it builds.
const QUALITY: RTCBuildQuality = RTCBuildQuality::HIGH;

/// Rays of Embree's widest packets.
const PACKET: usize = 16;

/// How Embree traces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct EmbreeOptions {
    /// `RTC_SCENE_FLAG_ROBUST`: conservative boxes and a watertight triangle test.
    pub robust: bool,
    /// Threads that trace; 0 is 1.
    pub threads: usize,
    /// Whether rays are given sixteen at a time, not one by one.
    pub packets: bool,
}

impl Default for EmbreeOptions {
    /// Robust, on one thread, packets where they are faster.
    fn default() -> Self {
        Self { robust: true, threads: 1, packets: Kernel::best().isa() == Isa::Avx512 }
    }
}

/// Embree on some threads.
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
        let info = info(format!("Embree {major}.{minor}.{patch}{robust}"), "embree", options.threads);
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
        let packets = self.options.packets;
        let make = move || Embree::new(Soup::of(&scene), flags, packets);
        Ok(Box::new(PeerTracer::start(clock, self.info.units, make)?))
    }
}

struct Embree {
    soup: Soup,
    mesh: Mesh,
    packets: bool,
}

impl Embree {
    fn new(soup: Soup, flags: RTCSceneFlags, packets: bool) -> Result<Self, String> {
        let vertices: Vec<_> = soup.triangles.iter().flat_map(|t| t.vertices()).map(|p| p.to_array()).collect();
        let indices: Vec<_> = (0..soup.triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mesh = Mesh::new(&vertices, &indices, flags, QUALITY).map_err(|error| format!("embree: {error}"))?;
        Ok(Self { soup, mesh, packets })
    }

    /// A ray as Embree wants it. Bad ones hit nothing, and do not disturb others of their packet.
    fn given(&self, ray: &Ray, origin: u32) -> RTCRay {
        if !ray.is_valid() {
            return RTCRay::NOTHING;
        }
        let given = RTCRay::new(ray.origin.to_array(), ray.direction.to_array(), ray.tmin, ray.tmax);
        given.leaving_out(self.soup.position(origin))
    }

    fn single(&self, ray: RTCRay, query: Query) -> Hit {
        match query {
            Query::Any => self.mesh.occluder(ray).map_or(Hit::MISS, |found| self.occluded(found)),
            _ => self.mesh.closest(ray).map_or(Hit::MISS, |found| self.nearest(ray, found)),
        }
    }

    fn packet(&self, rays: &[RTCRay], Asked { query, is_coherent }: Asked, hits: &mut [Hit]) {
        let flags = if is_coherent { RTCRayQueryFlags::COHERENT } else { RTCRayQueryFlags::INCOHERENT };
        let mut packet = RTCRayHit16::default();
        for slot in 0..PACKET {
            packet.ray.set(slot, rays.get(slot).unwrap_or(&RTCRay::NOTHING));
        }
        if query == Query::Any {
            let found = self.mesh.occluders_16(&mut packet.ray, flags);
            for (hit, found) in hits.iter_mut().zip(found) {
                *hit = found.map_or(Hit::MISS, |found| self.occluded(found));
            }
            return;
        }
        self.mesh.closest_16(&mut packet, flags);
        for (slot, (hit, ray)) in hits.iter_mut().zip(rays).enumerate() {
            let found = found(&packet, slot);
            *hit = found.map_or(Hit::MISS, |found| self.nearest(*ray, found));
        }
    }

    /// What was found without regard to what the ray leaves out.
    fn nearest(&self, ray: RTCRay, found: RTCRayHit) -> Hit {
        let is_own = found.hit.primID == ray.id;
        let found = if is_own { self.mesh.closest_filtered(ray) } else { Some(found) };
        found.map_or(Hit::MISS, |RTCRayHit { ray, hit }| Hit {
            t: ray.tfar,
            u: hit.u,
            v: hit.v,
            primitive: self.soup.id(hit.primID),
        })
    }

    fn occluded(&self, Occluder { primitive, t, u, v }: Occluder) -> Hit {
        Hit { t, u, v, primitive: self.soup.id(primitive) }
    }
}

/// What a ray of a packet hits.
fn found(RTCRayHit16 { ray, hit }: &RTCRayHit16, slot: usize) -> Option<RTCRayHit> {
    let RTCHit16 { u, v, primID, geomID, .. } = hit;
    let found = RTCRayHit {
        ray: RTCRay { tfar: ray.tfar[slot], ..RTCRay::NOTHING },
        hit: embree4_sys::RTCHit { u: u[slot], v: v[slot], primID: primID[slot], ..Default::default() },
    };
    (geomID[slot] != RTC_INVALID_GEOMETRY_ID).then_some(found)
}

impl Peer for Embree {
    fn trace(&self, rays: &[Ray], origins: &[u32], asked: Asked, hits: &mut [Hit]) {
        if !self.packets {
            for ((hit, ray), &origin) in hits.iter_mut().zip(rays).zip(origins) {
                *hit = self.single(self.given(ray, origin), asked.query);
            }
            return;
        }
        let mut packet = [RTCRay::NOTHING; PACKET];
        for ((hits, rays), origins) in hits.chunks_mut(PACKET).zip(rays.chunks(PACKET)).zip(origins.chunks(PACKET)) {
            for ((given, ray), &origin) in packet.iter_mut().zip(rays).zip(origins) {
                *given = self.given(ray, origin);
            }
            self.packet(&packet[..rays.len()], asked, hits);
        }
    }
}
