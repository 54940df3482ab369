//! Who traces: Embree by each of its interfaces, obvhs, and this project with each set of instructions.

use crate::page::Who;
use backend_cpu::{CpuDevice, Isa};
use backend_peers::{ObvhsDevice, ObvhsLayout};
use embree4_sys::{
    Mesh, MeshError, RTC_INVALID_GEOMETRY_ID, RTCBuildQuality, RTCHit16, RTCRay, RTCRayHit16, RTCRayQueryFlags,
    RTCSceneFlags,
};
use rt_core::{Coherence, Device, Hit, Launch, Query, Ray, RaySource, Scene, StreamSpec, Tracer, tasks_of};
use rt_scene::Model;
use rt_verify::clock;
use std::error::Error;
use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};

/// The longest that a run may take.
const LIMIT: Duration = Duration::from_secs(600);

/// Rays of a task: those of 32 × 32 pixels.
const TASK: u32 = 1024;

/// Rays that Embree is given between two looks at the clock: so few that they stay in a second-level cache.
const BATCH: usize = 4096;

/// Rays of Embree's widest packets.
const PACKET: usize = 16;

pub(crate) struct Contender {
    pub(crate) name: String,
    pub(crate) who: Who,
    way: Way,
}

enum Way {
    Embree { mesh: Arc<Mesh>, packets: Option<RTCRayQueryFlags> },
    Device { tracer: Box<dyn Tracer>, threads: usize, launch: Launch },
}

/// What a contender says of a ray: the distance where it tells one, or that there is a hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Traced {
    Miss,
    Hit,
    At(f32),
}

pub(crate) struct Run {
    pub(crate) seconds: f64,
    /// An answer for each ray, if they are asked for.
    pub(crate) traced: Vec<Traced>,
}

/// Everybody, and why others are not there. Embree's tree is its best one, obvhs's as `medium_build` makes it.
pub(crate) fn all(
    model: &Model,
    scene: &Arc<Scene>,
    threads: &[usize],
) -> Result<(Vec<Contender>, Vec<String>), Box<dyn Error>> {
    let (mut all, mut missing) = (Vec::new(), Vec::new());
    match embree(model) {
        Ok(mesh) => {
            let mesh = Arc::new(mesh);
            let mut add = |name: &str, short, packets| {
                let way = Way::Embree { mesh: Arc::clone(&mesh), packets };
                all.push(Contender { name: name.to_owned(), who: Who::Embree(short), way });
            };
            add("Embree, single rays", "1", None);
            add("Embree, 16 rays", "16", Some(RTCRayQueryFlags::INCOHERENT));
            add("Embree, 16 coherent rays", "16c", Some(RTCRayQueryFlags::COHERENT));
        }
        Err(error) => missing.push(error.to_string()),
    }
    let mut add = |name: String, who: Who, device: &dyn Device| -> Result<(), Box<dyn Error>> {
        let threads = if let Who::Ours(_, threads) = &who { *threads } else { 1 };
        let tracer = device.tracer(Arc::clone(scene), clock)?;
        all.push(Contender { name, who, way: Way::Device { tracer, threads, launch: Launch::default() } });
        Ok(())
    };
    let obvhs = ObvhsDevice::new(ObvhsLayout::Bvh2, 1);
    add(obvhs.info().name.clone(), Who::Obvhs, &obvhs)?;
    for &threads in threads {
        for isa in Isa::available() {
            let device = CpuDevice::open_all_with(&[threads], Some(isa))?.pop().ok_or("one device was asked for")?;
            let name = format!(
                "raybalance, {isa}{}",
                if threads == 1 { String::new() } else { format!(", {threads} threads (wall time)") }
            );
            add(name, Who::Ours(isa.to_string(), threads), &device)?;
        }
    }
    Ok((all, missing))
}

fn embree(model: &Model) -> Result<Mesh, MeshError> {
    let vertices: Vec<[f32; 3]> = model.positions.iter().map(|p| p.to_array()).collect();
    Mesh::new(&vertices, &model.indices, RTCSceneFlags::ROBUST, RTCBuildQuality::HIGH)
}

impl Contender {
    /// Traces all rays.
    pub(crate) fn run(&mut self, rays: &Arc<[Ray]>, query: Query, keep: bool) -> Result<Run, Box<dyn Error>> {
        match &mut self.way {
            Way::Embree { mesh, packets: None } => Ok(single(mesh, rays, query, keep)),
            Way::Embree { mesh, packets: Some(flags) } => Ok(packets(mesh, *flags, rays, query, keep)),
            Way::Device { tracer, threads, launch, .. } => {
                let source = RaySource::Explicit { rays: Arc::clone(rays), origins: None };
                let spec = StreamSpec { query, coherence: Coherence::Unknown, ..StreamSpec::default() };
                tracer.load_rays(source, spec)?;
                let tasks = tasks_of(rays.len() as u32, TASK);
                let (wall, processor) = (Instant::now(), processor_time());
                let ticket = tracer.submit(&tasks, None)?;
                tracer.wait(ticket, LIMIT, launch)?;
                let seconds = if *threads == 1 { worked(processor) } else { wall.elapsed().as_secs_f64() };
                let traced = |hit: &Hit| if hit.is_hit() { Traced::At(hit.t) } else { Traced::Miss };
                let traced = launch.hits.iter().filter(|_| keep).map(traced).collect();
                Ok(Run { seconds, traced })
            }
        }
    }
}

/// Seconds of processor time since then, without what asking for it takes: half a microsecond, which Embree's batches
/// would pay for.
fn worked(begin: Duration) -> f64 {
    static ASKING: LazyLock<Duration> = LazyLock::new(|| {
        let asked = (0..100).map(|_| processor_time()).collect::<Vec<_>>();
        asked.windows(2).map(|pair| pair[1] - pair[0]).min().unwrap_or_default()
    });
    (processor_time() - begin).saturating_sub(*ASKING).as_secs_f64()
}

/// Time for which this process has had a processor.
#[cfg(unix)]
fn processor_time() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    // Neither is negative: the clock counts up from 0.
    Duration::new(time.tv_sec.unsigned_abs(), time.tv_nsec.unsigned_abs() as u32)
}

/// Wall time, where the system is not asked.
#[cfg(not(unix))]
fn processor_time() -> Duration {
    clock()
}

fn given(ray: &Ray) -> RTCRay {
    RTCRay::new(ray.origin.to_array(), ray.direction.to_array(), ray.tmin, ray.tmax)
}

fn single(mesh: &Mesh, rays: &[Ray], query: Query, keep: bool) -> Run {
    let mut run = Run { seconds: 0.0, traced: Vec::new() };
    let mut traced = Vec::with_capacity(BATCH);
    for rays in rays.chunks(BATCH) {
        let given: Vec<RTCRay> = rays.iter().map(given).collect();
        traced.clear();
        let begin = processor_time();
        for ray in &given {
            traced.push(match query {
                Query::Closest | Query::All { .. } => {
                    mesh.closest(*ray).map_or(Traced::Miss, |found| Traced::At(found.ray.tfar))
                }
                Query::Any if mesh.is_occluded(*ray) => Traced::Hit,
                Query::Any => Traced::Miss,
            });
        }
        run.seconds += worked(begin);
        if keep {
            run.traced.extend(&traced);
        }
    }
    run
}

fn packets(mesh: &Mesh, flags: RTCRayQueryFlags, rays: &[Ray], query: Query, keep: bool) -> Run {
    let mut run = Run { seconds: 0.0, traced: Vec::new() };
    let mut packets = vec![RTCRayHit16::default(); BATCH / PACKET];
    for rays in rays.chunks(BATCH) {
        for (packet, rays) in packets.iter_mut().zip(rays.chunks(PACKET)) {
            (0..PACKET).for_each(|slot| packet.ray.set(slot, &rays.get(slot).map_or(RTCRay::NOTHING, given)));
            packet.hit = RTCHit16::default();
        }
        let used = &mut packets[..rays.len().div_ceil(PACKET)];
        let begin = processor_time();
        for packet in &mut *used {
            match query {
                Query::Closest | Query::All { .. } => mesh.closest_16(packet, flags),
                Query::Any => mesh.occluded_16(&mut packet.ray, flags),
            }
        }
        run.seconds += worked(begin);
        if keep {
            let all = used.iter().flat_map(|packet| (0..PACKET).map(move |slot| answer(packet, slot, query)));
            run.traced.extend(all.take(rays.len()));
        }
    }
    run
}

fn answer(packet: &RTCRayHit16, slot: usize, query: Query) -> Traced {
    match query {
        Query::Closest if packet.hit.geomID[slot] == RTC_INVALID_GEOMETRY_ID => Traced::Miss,
        Query::Closest | Query::All { .. } => Traced::At(packet.ray.tfar[slot]),
        Query::Any if packet.ray.tfar[slot] == f32::NEG_INFINITY => Traced::Hit,
        Query::Any => Traced::Miss,
    }
}
