//! One frame: camera, shadow and diffuse streams in waves, shaded into a film.

use crate::film::Film;
use crate::shade::Light;
use crate::{memory, progress};
use anyhow::Result;
use glam::Vec3;
use rt_balance::report::StreamRun;
use rt_balance::{Balancer, Control, Scheduling, Stream};
use rt_core::bounce::Surfaces;
use rt_core::{Camera, Hit, Precision, RaySource, random};
use rt_scene::Colours;
use rt_scene::streams::{PathStream, Paths, Wave};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Passes of the reference measurement; the median of three survives one disturbance.
const REFERENCE_PASSES: usize = 3;

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
    pub(crate) colours: Colours,
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
pub(crate) struct Part<'a> {
    pub(crate) paths: &'a Paths,
    pub(crate) frame: u32,
    /// Of the wave in its frame.
    pub(crate) number: u32,
    pub(crate) wave: &'a Wave,
}

impl Renderer<'_> {
    /// The paths of a frame.
    pub(crate) fn paths(&self, camera: Camera, frame: u32) -> Paths {
        // Frames number their pixels alike but must not repeat their noise; runs with one seed must.
        let [seed, ..] = random::pcg3d([self.seed, frame, 0]);
        let Self { size, samples, .. } = *self;
        Paths { camera, size, samples, seed, sun: self.light.sun, surfaces: Arc::clone(&self.surfaces) }
    }

    /// Renders the pixels of one wave into `film`.
    pub(crate) fn wave(&self, session: &mut Session, part: Part<'_>, film: &mut Film) -> Result<()> {
        let Part { paths, wave, .. } = part;
        // For each path the share of its radiance that reaches the pixel.
        let count = wave.pixels.len() * self.samples as usize;
        let mut throughput = memory::filled(Vec3::ONE, count, "the rays of a wave")?;
        let pixel = |path: u32| wave.pixels[(path / self.samples) as usize];
        let mut front = paths.primary(wave);
        for bounce in 0..=self.bounces {
            let hits = self.trace(session, part, &front)?;
            let seen = Seen { stream: &front, throughput: &throughput, pixel: &pixel };
            self.add_misses(&seen, &hits, film);
            // The last bounce's light is not followed any further.
            if bounce == self.bounces {
                self.add_fill(&seen, &hits, film);
                let shadow = paths.end(&front, &hits);
                drop(hits);
                let blocked = self.trace(session, part, &shadow)?;
                self.add_sunlight(&Seen { stream: &shadow, ..seen }, &blocked, film);
                break;
            }
            let [shadow, diffuse] = paths.follow(&front, &hits);
            drop(hits);
            let blocked = self.trace(session, part, &shadow)?;
            self.add_sunlight(&Seen { stream: &shadow, ..seen }, &blocked, film);
            for from in diffuse.departures() {
                throughput[from.path as usize] *= self.colours.of(from.primitive);
            }
            front = diffuse;
        }
        Ok(())
    }

    /// Traces a stream and records it.
    fn trace(&self, session: &mut Session, part: Part<'_>, stream: &PathStream) -> Result<Vec<Hit>> {
        let Session { balancer, scheduling, runs } = session;
        let rays = stream.source.len();
        if rays == 0 {
            return Ok(Vec::new());
        }
        let stream = Stream::new(stream.source.clone(), stream.kind, stream.spec(self.precision));
        let stream = Stream { seed: self.seed, frame: part.frame, wave: part.number, ..stream }
            .with_task_size(self.cut.size(rays));
        let mut hits = memory::filled(Hit::MISS, rays as usize, "the hits of a wave")?;
        let bar = progress::bar("tracing", rays.into());
        let show = |done, _| bar.set_position(done);
        let control = Control { cancel: Some(self.cancel), progress: Some(&show), ..Control::default() };
        let traced = balancer.trace(&stream, scheduling, &mut hits, None, control);
        bar.finish_and_clear();
        let mut run = traced?;
        if self.reference {
            balancer.reference(&stream, REFERENCE_PASSES, &scheduling.limits, control)?.judge(&mut run);
        }
        runs.push(run);
        Ok(hits)
    }

    fn add_misses(&self, seen: &Seen<'_>, hits: &[Hit], film: &mut Film) {
        film.add_all(hits.len(), |i| {
            let sky = || self.light.sky(seen.stream.source.ray(i as u32).0.direction);
            (!hits[i].is_hit()).then(|| seen.through(i, sky()))
        });
    }

    fn add_sunlight(&self, seen: &Seen<'_>, blocked: &[Hit], film: &mut Film) {
        let departures = seen.stream.departures();
        film.add_all(blocked.len(), |i| {
            if blocked[i].is_hit() {
                return None;
            }
            let from = &departures[i];
            let normal = self.surfaces.triangle(from.primitive)?.area_normal().try_normalize()?.as_vec3();
            let facing = normal.dot(self.light.sun.direction()) * if from.is_behind() { -1.0 } else { 1.0 };
            Some(seen.through(i, self.colours.of(from.primitive) * self.light.sunlight(facing)))
        });
    }

    fn add_fill(&self, seen: &Seen<'_>, hits: &[Hit], film: &mut Film) {
        film.add_all(hits.len(), |i| {
            let hit = &hits[i];
            // Only directions of camera rays have any length.
            let length = || match &seen.stream.source {
                RaySource::Camera(rays) => rays.ray(i as u32).direction.length(),
                _ => 1.0,
            };
            let light = || self.colours.of(hit.primitive) * self.light.fill(hit.t * length());
            hit.is_hit().then(|| seen.through(i, light()))
        });
    }
}

/// What the camera sees through the rays of a stream.
#[derive(Clone, Copy)]
struct Seen<'a> {
    stream: &'a PathStream,
    /// For each path of the wave, the share of its radiance that reaches the pixel.
    throughput: &'a [Vec3],
    /// The pixel of a path.
    pixel: &'a (dyn Fn(u32) -> u32 + Sync),
}

impl Seen<'_> {
    /// What light that comes along ray `i` adds to which pixel.
    fn through(&self, i: usize, light: Vec3) -> (u32, Vec3) {
        let path = self.stream.path(i as u32);
        ((self.pixel)(path), self.throughput[path as usize] * light)
    }
}
