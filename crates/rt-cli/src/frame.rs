//! One frame: camera, shadow and diffuse streams in waves, shaded into a film.

use crate::progress;
use crate::shade::Light;
use anyhow::Result;
use glam::Vec3;
use rayon::iter::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};
use rt_balance::report::StreamRun;
use rt_balance::{Balancer, Control, Scheduling, Stream};
use rt_core::bounce::{Aim, Departure, Surfaces};
use rt_core::{BounceRays, Camera, CameraRays, Hit, Precision, Query, RaySource, StreamKind, StreamSpec, random};
use rt_scene::Model;
use rt_scene::streams::Spawner;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Passes of the reference measurement; the median of three survives one disturbance.
const REFERENCE_PASSES: usize = 3;

/// Bytes that one ray of a wave needs at most: where it leaves, its hit, pixel and throughput of this bounce and the next,
/// where its shadow ray leaves, and on a device the 64 of the ray itself.
pub(crate) const BYTES_PER_RAY: u64 = 256;

/// How tasks are cut.
#[derive(Clone, Copy, Debug)]
pub(crate) enum TaskCut {
    /// Tasks of this many rays.
    Size(u32),
    /// This many tasks per stream.
    Count(u32),
}

impl TaskCut {
    pub(crate) fn size(self, rays: u32) -> u32 {
        match self {
            Self::Size(size) => size,
            Self::Count(tasks) => rays.div_ceil(tasks).max(1),
        }
    }
}

/// What stays the same over all frames.
#[derive(Debug)]
pub(crate) struct Renderer<'a> {
    pub(crate) model: &'a Model,
    /// Of the scene that is traced.
    pub(crate) surfaces: Arc<Surfaces>,
    pub(crate) light: Light,
    pub(crate) size: [u32; 2],
    pub(crate) samples: u32,
    pub(crate) bounces: u32,
    pub(crate) precision: Precision,
    pub(crate) cut: TaskCut,
    pub(crate) seed: u32,
    pub(crate) reference: bool,
    pub(crate) cancel: &'a AtomicBool,
}

/// Devices, schedule, and what was recorded of each stream so far.
#[derive(Debug)]
pub(crate) struct Session {
    pub(crate) balancer: Balancer,
    pub(crate) scheduling: Scheduling,
    pub(crate) runs: Vec<StreamRun>,
}

/// A part of one frame that fits the memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wave<'a> {
    pub(crate) camera: Camera,
    pub(crate) frame: u32,
    pub(crate) number: u32,
    /// In Z-curve order, each `x | y << 16`.
    pub(crate) pixels: &'a Arc<[u32]>,
}

/// Sums of radiance over the samples of each pixel, row by row.
#[derive(Clone, Debug)]
pub(crate) struct Film {
    width: u32,
    samples: u32,
    sums: Vec<Vec3>,
}

impl Film {
    pub(crate) fn new([width, height]: [u32; 2], samples: u32) -> Self {
        Self { width, samples, sums: vec![Vec3::ZERO; width as usize * height as usize] }
    }

    /// Adds what `shade` returns for `0..count`, in that order: a pixel (`x | y << 16`) and its radiance.
    ///
    /// Shading runs on all cores, adding does not, so that sums are the same bits on every machine.
    fn add_all(&mut self, count: usize, shade: impl Fn(usize) -> Option<(u32, Vec3)> + Sync) {
        for first in (0..count).step_by(SHADE_BATCH) {
            let batch = first..count.min(first + SHADE_BATCH);
            let shaded: Vec<Option<(u32, Vec3)>> = batch.into_par_iter().with_min_len(1024).map(&shade).collect();
            for (pixel, radiance) in shaded.into_iter().flatten() {
                self.sums[((pixel >> 16) * self.width + (pixel & 0xffff)) as usize] += radiance;
            }
        }
    }

    /// Mean radiance of each pixel.
    pub(crate) fn radiance(&self) -> Vec<Vec3> {
        let scale = 1.0 / self.samples as f32;
        self.sums.iter().map(|&sum| sum * scale).collect()
    }
}

/// Rays shaded at once: enough to occupy every core, few enough that their 20 bytes each do not count as memory.
const SHADE_BATCH: usize = 1 << 18;

/// Hits that one core turns into rays at a time.
const SPAWN_CHUNK: u32 = 1 << 14;

/// What `from` makes of chunks of `hits` hits, in their order.
fn chunks<T: Send>(hits: usize, from: impl Fn(Range<u32>) -> T + Sync) -> Vec<T> {
    let hits = hits as u32;
    let chunk = |chunk| {
        let first = chunk * SPAWN_CHUNK;
        from(first..hits.min(first + SPAWN_CHUNK))
    };
    (0..hits.div_ceil(SPAWN_CHUNK)).into_par_iter().map(chunk).collect()
}

/// The rays of one bounce, and what the camera sees through them.
struct Front {
    source: RaySource,
    /// For each ray, its pixel.
    pixels: Vec<u32>,
    /// For each ray, the share of its radiance that reaches the pixel.
    throughput: Vec<Vec3>,
}

impl Renderer<'_> {
    /// Renders the pixels of one wave into `film`.
    pub(crate) fn wave(&self, session: &mut Session, wave: Wave<'_>, film: &mut Film) -> Result<()> {
        // Frames and waves number their rays from 0 but must not repeat their noise; runs with one seed must.
        let [seed, ..] = random::pcg3d([self.seed, wave.frame, wave.number]);
        let Wave { camera, pixels, .. } = wave;
        let rays = CameraRays { camera, size: self.size, pixels: Arc::clone(pixels), samples: self.samples, seed };
        let pixels: Vec<u32> =
            pixels.iter().flat_map(|&pixel| std::iter::repeat_n(pixel, self.samples as usize)).collect();
        let throughput = vec![Vec3::ONE; pixels.len()];
        let mut front = Front { source: RaySource::Camera(Arc::new(rays)), pixels, throughput };
        let mut run = |stream: Stream| self.trace(session, Stream { frame: wave.frame, wave: wave.number, ..stream });
        for bounce in 0..=self.bounces {
            // Only primary rays all exist; later ones are numbered without those that were lost on the way.
            let samples = if bounce == 0 { self.samples } else { 1 };
            let kind = if bounce == 0 { StreamKind::Primary } else { StreamKind::Diffuse(bounce - 1) };
            let hits = run(self.stream(front.source.clone(), kind, Query::Closest))?;
            self.add_misses(&front, &hits, film);
            let spawner = Spawner { model: self.model, rays: &front.source, hits: &hits, seed, samples, bounce };
            // The last bounce's light is not followed any further.
            let (shadow, diffuse) = if bounce == self.bounces {
                let [shadow] = self.leave(&spawner, [self.light.sun.aim()]);
                (shadow, None)
            } else {
                let [shadow, diffuse] = self.leave(&spawner, [self.light.sun.aim(), Aim::Cosine]);
                (shadow, Some(diffuse))
            };
            let blocked =
                run(self.stream(RaySource::Bounce(Arc::clone(&shadow)), StreamKind::Shadow(bounce), Query::Any))?;
            self.add_sunlight(&front, &shadow.departures, &blocked, film);
            let Some(diffuse) = diffuse else {
                self.add_fill(&front, &hits, film);
                break;
            };
            let parents = diffuse.departures.iter().map(|from| from.parent as usize);
            front = Front {
                pixels: parents.clone().map(|i| front.pixels[i]).collect(),
                throughput: parents.map(|i| front.throughput[i] * self.model.colour(hits[i].primitive)).collect(),
                source: RaySource::Bounce(diffuse),
            };
        }
        Ok(())
    }

    /// The rays that leave from where a stream's rays hit, for each of `aims`.
    fn leave<const N: usize>(&self, spawner: &Spawner<'_>, aims: [Aim; N]) -> [Arc<BounceRays>; N] {
        let mut lists = [const { Vec::new() }; N];
        for chunk in chunks(spawner.hits.len(), |range| spawner.departures(aims, range)) {
            for (list, more) in lists.iter_mut().zip(chunk) {
                list.extend(more);
            }
        }
        std::array::from_fn(|i| {
            let departures = std::mem::take(&mut lists[i]).into();
            let scatter = spawner.scatter(aims[i]);
            Arc::new(BounceRays { surfaces: Arc::clone(&self.surfaces), departures, scatter })
        })
    }

    fn stream(&self, source: RaySource, kind: StreamKind, query: Query) -> Stream {
        let size = self.cut.size(source.len());
        let spec = StreamSpec { query, precision: self.precision, counts: false };
        Stream { seed: self.seed, ..Stream::new(source, kind, spec).with_task_size(size) }
    }

    /// Traces a stream and records it.
    fn trace(&self, session: &mut Session, stream: Stream) -> Result<Vec<Hit>> {
        let Session { balancer, scheduling, runs } = session;
        if stream.source.is_empty() {
            return Ok(Vec::new());
        }
        let mut hits = vec![Hit::MISS; stream.source.len() as usize];
        let bar = progress::bar("tracing", stream.source.len().into());
        let show = |done, _| bar.set_position(done);
        let control = Control { cancel: Some(self.cancel), progress: Some(&show) };
        let traced = balancer.trace(&stream, scheduling, &mut hits, None, control);
        bar.finish_and_clear();
        let mut run = traced?;
        if self.reference {
            balancer.reference(&stream, REFERENCE_PASSES)?.judge(&mut run);
        }
        runs.push(run);
        Ok(hits)
    }

    fn add_misses(&self, front: &Front, hits: &[Hit], film: &mut Film) {
        film.add_all(hits.len(), |i| {
            let sky = || front.throughput[i] * self.light.sky(front.source.ray(i as u32).0.direction);
            (!hits[i].is_hit()).then(|| (front.pixels[i], sky()))
        });
    }

    fn add_sunlight(&self, front: &Front, shadow: &[Departure], blocked: &[Hit], film: &mut Film) {
        film.add_all(blocked.len(), |ray| {
            let from = &shadow[ray];
            let i = from.parent as usize;
            if blocked[ray].is_hit() {
                return None;
            }
            let normal = self.model.triangle(from.primitive)?.area_normal().try_normalize()?.as_vec3();
            let facing = normal.dot(self.light.sun.direction()) * if from.is_behind() { -1.0 } else { 1.0 };
            let light = self.light.sunlight(facing);
            Some((front.pixels[i], front.throughput[i] * self.model.colour(from.primitive) * light))
        });
    }

    fn add_fill(&self, front: &Front, hits: &[Hit], film: &mut Film) {
        film.add_all(hits.len(), |i| {
            let hit = &hits[i];
            // Only directions of camera rays have any length.
            let length = || match &front.source {
                RaySource::Camera(rays) => rays.ray(i as u32).direction.length(),
                _ => 1.0,
            };
            let distance = || hit.t * length();
            let light = || front.throughput[i] * self.model.colour(hit.primitive) * self.light.fill(distance());
            hit.is_hit().then(|| (front.pixels[i], light()))
        });
    }
}
