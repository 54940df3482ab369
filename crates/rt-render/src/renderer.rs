//! One frame: camera, shadow and diffuse streams in waves, shaded.

use crate::film::{Lit, Radiance, for_paths};
use crate::{Light, RenderError, Subject, memory};
use glam::Vec3;
use rt_balance::report::StreamRun;
use rt_balance::sample::Fraction;
use rt_balance::{Balancer, Control, Scheduling, Stream};
use rt_bvh::Stack;
use rt_core::bounce::{Departure, Surfaces};
use rt_core::{Camera, Hit, Precision, Ray, RaySource, StreamKind, StreamSpec, TestCounts, random};
use rt_scene::prepare::Prepared;
use rt_scene::streams::{PathStream, Paths, Samples, Wave};
use rt_scene::wind::Strength;
use rt_scene::{Colours, View};
use rt_simd::Kernel;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Passes of the reference measurement; the median of three survives one disturbance.
const REFERENCE_PASSES: usize = 3;

/// Share of the rays that is sampled to see what an estimate would have said: that of the estimators which sample.
const UNUSED_FRACTION: Fraction = Fraction::SIXTY_FOURTH;

/// How tasks are cut.
#[derive(Clone, Copy, Debug)]
pub enum TaskCut {
    /// Tasks that suit the rays and the devices.
    Suited,
    /// Tasks of this many rays.
    Size(u32),
    /// This many tasks per stream.
    Count(u32),
}

impl TaskCut {
    /// From a number of tasks or of their rays, whichever was asked for.
    #[must_use]
    pub fn of_options(tasks: Option<u32>, size: Option<u32>) -> Self {
        tasks.map(Self::Count).or(size.map(Self::Size)).unwrap_or(Self::Suited)
    }

    /// The stream cut for so many devices.
    #[must_use]
    pub fn of(self, stream: Stream, devices: usize) -> Stream {
        match self {
            Self::Suited => stream.with_tasks_for(devices),
            Self::Size(size) => stream.with_task_size(size),
            Self::Count(tasks) => {
                let size = stream.source.len().div_ceil(tasks).max(1);
                stream.with_task_size(size)
            }
        }
    }
}

/// What stays the same over all frames.
#[derive(Debug)]
pub struct Renderer<'a> {
    /// Colours of the scene's triangles.
    pub colours: Colours,
    /// Of the scene that is traced.
    pub surfaces: Arc<Surfaces>,
    /// Sky and sun.
    pub light: Light,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Paths of each pixel.
    pub samples: u32,
    /// Diffuse bounces of each path.
    pub bounces: u32,
    /// How carefully rays are tested.
    pub precision: Precision,
    /// How streams are cut into tasks.
    pub cut: TaskCut,
    /// Seed of all random numbers.
    pub seed: u32,
    /// Whether every task is measured by itself in separate passes.
    pub reference: bool,
    /// The frame whose streams, where they were traced without an estimate, are estimated afterwards, to see what that
    /// would have said.
    pub unused: Option<u32>,
    /// The wind in which the scene moves, by the number of the frame: see [`Animation`](crate::Animation).
    pub wind: Option<Strength>,
    /// Set to `true` to stop.
    pub cancel: &'a AtomicBool,
}

/// Devices, schedule, and who is told of what was traced.
pub struct Session<'a> {
    /// The devices.
    pub balancer: Balancer,
    /// How streams are scheduled.
    pub scheduling: Scheduling,
    /// Is told how far the stream is that is traced, and at its end that it is done.
    pub show: &'a dyn Fn(Progress),
    /// Is given the record of each stream when it has been traced.
    pub record: &'a mut dyn FnMut(Traced<'_>),
}

/// How far a part is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// What is traced.
    pub kind: StreamKind,
    /// Share of the stream's rays that is traced.
    pub share: f64,
    /// Whether the stream is done; told once.
    pub is_done: bool,
    /// Paths of the part: each of its streams has so many rays at most.
    pub paths: u64,
}

/// A stream that was just traced.
#[derive(Debug)]
pub struct Traced<'a> {
    /// What was recorded.
    pub run: StreamRun,
    /// The rays.
    stream: &'a PathStream,
    part: Part<'a>,
}

impl Traced<'_> {
    /// Hands over the pixels that some rays are for, `x | y << 16`, in the order of the rays and each once.
    pub fn pixels(&self, rays: Range<u32>, mut take: impl FnMut(u32)) {
        let samples = u64::from(self.part.paths.samples.max(1));
        // Rays go by their paths, and paths by their pixels: so most rays need no division.
        let mut next_pixel = 0;
        for ray in rays {
            let path = u64::from(self.stream.path(ray));
            if path >= next_pixel {
                let place = path / samples;
                next_pixel = (place + 1) * samples;
                take(self.part.wave.pixels[place as usize]);
            }
        }
    }
}

impl std::fmt::Debug for Session<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Session").field("balancer", &self.balancer).finish_non_exhaustive()
    }
}

/// A part of one frame that fits the memory: some pixels, and some of their samples.
#[derive(Clone, Copy, Debug)]
pub struct Part<'a> {
    /// The paths of the frame.
    pub paths: &'a Paths,
    /// Number of the frame.
    pub frame: u32,
    /// Its own in the frame.
    pub number: u32,
    /// Its pixels.
    pub wave: &'a Wave,
    /// Which of their samples.
    pub samples: Samples,
}

impl<'a> Renderer<'a> {
    /// Of a scene as a view shows it: one pixel of one path without bounces, unless something else is said.
    #[must_use]
    pub fn of(prepared: Prepared, view: &View, cancel: &'a AtomicBool) -> Self {
        // The scene holds the triangles; the model's own go here.
        Self::showing(Subject::of(prepared), view, cancel)
    }

    /// The same of what is left of a scene that is ready to be traced.
    #[must_use]
    pub fn showing(subject: Subject, view: &View, cancel: &'a AtomicBool) -> Self {
        let Subject { scene, colours, precision, extent, .. } = subject;
        Self {
            light: Light::new(view, extent),
            colours,
            surfaces: Arc::new(Surfaces::new(scene)),
            size: [1, 1],
            samples: 1,
            bounces: 0,
            precision,
            cut: TaskCut::Suited,
            seed: 0,
            reference: false,
            unused: None,
            wind: None,
            cancel,
        }
    }
}

impl Renderer<'_> {
    /// The paths of a frame.
    #[must_use]
    pub fn paths(&self, camera: Camera, frame: u32) -> Paths {
        // Frames number their pixels alike but must not repeat their noise; runs with one seed must.
        let [seed, ..] = random::pcg3d([self.seed, frame, 0]);
        let Self { size, samples, .. } = *self;
        Paths { camera, size, samples, seed, sun: self.light.sun, surfaces: Arc::clone(&self.surfaces) }
    }

    /// Renders a part: adds the radiance of its samples to `sums`, one for each pixel of the wave in its order. If
    /// those are of the samples before, they are the same bits whatever else is rendered, in which parts, where, and by
    /// which devices. Returns how much of the time was set-up, which the first streams of a kind need and no others.
    ///
    /// # Errors
    /// When there is no memory, the rays cannot be traced, or [`Renderer::cancel`] is set. The sums are as they were.
    pub fn part(&self, session: &mut Session<'_>, part: Part<'_>, sums: &mut [Vec3]) -> Result<Duration, RenderError> {
        let mut setup_s = 0.0;
        self.shade(part, sums, &mut |stream| self.trace(session, part, stream, &mut setup_s))?;
        Ok(Duration::try_from_secs_f64(setup_s).unwrap_or_default())
    }

    /// Renders a part with hits that `trace` finds.
    pub(crate) fn shade(
        &self,
        part: Part<'_>,
        sums: &mut [Vec3],
        trace: &mut dyn FnMut(&PathStream) -> Result<Vec<Hit>, RenderError>,
    ) -> Result<(), RenderError> {
        let Part { paths, wave, samples, .. } = part;
        let count = wave.pixels.len() * samples.count as usize;
        let mut radiance = Radiance::new(count)?;
        // For each path the share of its radiance that reaches the pixel.
        let mut throughput = memory::filled(Vec3::ONE, count, "the rays of a wave")?;
        let mut front = paths.part(wave, samples);
        for bounce in 0..=self.bounces {
            let hits = trace(&front)?;
            let seen = Seen { stream: &front, throughput: &throughput, part };
            self.add_misses(&seen, &hits, &mut radiance);
            // The last bounce's light is not followed any further.
            if bounce == self.bounces {
                self.add_fill(&seen, &hits, &mut radiance);
                let shadow = paths.end(&front, &hits);
                drop(hits);
                let blocked = trace(&shadow)?;
                self.add_sunlight(&Seen { stream: &shadow, ..seen }, &blocked, &mut radiance);
                break;
            }
            let [shadow, diffuse] = paths.follow(&front, &hits);
            drop(hits);
            let blocked = trace(&shadow)?;
            self.add_sunlight(&Seen { stream: &shadow, ..seen }, &blocked, &mut radiance);
            self.dim(&mut throughput, &Seen { stream: &diffuse, throughput: &[], part });
            front = diffuse;
        }
        radiance.add_to(sums, samples.count as usize);
        Ok(())
    }

    /// Traces a stream and records it; adds the seconds of its set-up.
    fn trace(
        &self,
        session: &mut Session<'_>,
        part: Part<'_>,
        stream: &PathStream,
        setup_s: &mut f64,
    ) -> Result<Vec<Hit>, RenderError> {
        let Session { balancer, scheduling, show, record } = session;
        let rays = stream.source.len();
        let (kind, paths) = (stream.kind, part.wave.pixels.len() as u64 * u64::from(part.samples.count));
        let at = |share, is_done| show(Progress { kind, share, is_done, paths });
        if rays == 0 {
            at(1.0, true);
            return Ok(Vec::new());
        }
        let path_stream = stream;
        let stream = Stream::new(stream.source.clone(), stream.kind, stream.spec(self.precision));
        let stream = self.cut.of(stream, balancer.devices().count());
        let stream = Stream { seed: self.seed, frame: part.frame, wave: part.number, ..stream };
        let mut hits = memory::filled(Hit::MISS, rays as usize, "the hits of a wave")?;
        let progress = |done: u64, all: u64| at(done as f64 / all.max(1) as f64, false);
        let quiet = Control { cancel: Some(self.cancel), ..Control::default() };
        let traced =
            balancer.trace(&stream, scheduling, &mut hits, None, Control { progress: Some(&progress), ..quiet });
        at(1.0, true);
        let mut run = traced?;
        *setup_s += run.report.setup_s;
        if self.reference {
            let stream = stream.cut_as(&run);
            balancer.reference(&stream, REFERENCE_PASSES, &scheduling.limits, quiet)?.judge(&mut run);
        }
        if self.unused == Some(part.frame) && run.report.estimate.is_uninformed() {
            balancer.estimate_unused(&stream, &mut run, UNUSED_FRACTION, scheduling.limits, quiet)?;
        }
        record(Traced { run, stream: path_stream, part });
        Ok(hits)
    }

    /// What paths lose where they leave a surface.
    fn dim(&self, throughput: &mut [Vec3], left: &Seen<'_>) {
        let departures = left.stream.departures();
        for_paths(
            throughput,
            departures.len(),
            |i| left.path(i),
            |rays, first, throughput| {
                for i in rays {
                    throughput[left.path(i) - first] *= self.colours.of(departures[i].primitive);
                }
            },
        );
    }

    /// The hits of a stream, found on this thread and without a device; `counted` is told what each ray cost.
    pub(crate) fn walk(&self, stream: &PathStream, mut counted: impl FnMut(TestCounts)) -> Vec<Hit> {
        let scene = self.surfaces.scene();
        let spec = StreamSpec { counts: true, ..stream.spec(self.precision) };
        let rays = (0..stream.source.len()).map(|ray| stream.source.ray(ray));
        let mut hits = Vec::with_capacity(stream.source.len() as usize);
        rt_bvh::trace(scene, &mut Stack::for_scene(scene), spec, rays, |hit, counts| {
            counted(counts);
            hits.push(hit);
        });
        hits
    }

    fn add_misses(&self, seen: &Seen<'_>, hits: &[Hit], radiance: &mut Radiance) {
        seen.add(radiance, hits.len(), |rays, lit| {
            let mut window = Window::new();
            for rays in windows_that_miss(rays, hits) {
                let made = window.make(&seen.stream.source, &rays);
                for (i, ray) in rays.zip(made).filter(|(i, _)| !hits[*i].is_hit()) {
                    seen.light(lit, i, self.light.sky(ray.direction));
                }
            }
        });
    }

    fn add_sunlight(&self, seen: &Seen<'_>, blocked: &[Hit], radiance: &mut Radiance) {
        let departures = seen.stream.departures();
        seen.add(radiance, blocked.len(), |rays, lit| {
            let mut window = Window::new();
            for rays in windows_that_miss(rays, blocked) {
                let normals = window.normals(&self.surfaces, &departures[rays.clone()]);
                for (i, normal) in rays.zip(normals).filter(|(i, _)| !blocked[*i].is_hit()) {
                    let from = &departures[i];
                    let facing = normal.dot(self.light.sun.direction()) * if from.is_behind() { -1.0 } else { 1.0 };
                    seen.light(lit, i, self.colours.of(from.primitive) * self.light.sunlight(facing));
                }
            }
        });
    }

    fn add_fill(&self, seen: &Seen<'_>, hits: &[Hit], radiance: &mut Radiance) {
        seen.add(radiance, hits.len(), |rays, lit| {
            for i in rays.filter(|&i| hits[i].is_hit()) {
                let hit = &hits[i];
                // Only directions of camera rays have any length.
                let length = match &seen.stream.source {
                    RaySource::Camera(rays) => rays.ray(i as u32).direction.length(),
                    _ => 1.0,
                };
                seen.light(lit, i, self.colours.of(hit.primitive) * self.light.fill(hit.t * length));
            }
        });
    }
}

/// Rays that are shaded together.
const WINDOW: usize = 256;

/// Those of some rays, where one of them misses.
fn windows_that_miss(rays: Range<usize>, hits: &[Hit]) -> impl Iterator<Item = Range<usize>> {
    let end = rays.end;
    let windows = rays.step_by(WINDOW).map(move |first| first..end.min(first + WINDOW));
    windows.filter(|rays| hits[rays.clone()].iter().any(|hit| !hit.is_hit()))
}

/// What is made of the rays of a window, many at a time.
struct Window {
    kernel: Kernel,
    rays: [Ray; WINDOW],
    primitives: [u32; WINDOW],
    normals: [Vec3; WINDOW],
}

impl Window {
    fn new() -> Self {
        let rays = [Ray::new(Vec3::ZERO, Vec3::ZERO); WINDOW];
        Self { kernel: Kernel::best(), rays, primitives: [0; WINDOW], normals: [Vec3::ZERO; WINDOW] }
    }

    fn make(&mut self, source: &RaySource, numbers: &Range<usize>) -> &[Ray] {
        let made = &mut self.rays[..numbers.len()];
        self.kernel.make(source, numbers.start as u32, made, &mut self.primitives[..numbers.len()]);
        made
    }

    fn normals(&mut self, surfaces: &Surfaces, departures: &[Departure]) -> &[Vec3] {
        let (primitives, normals) = (&mut self.primitives[..departures.len()], &mut self.normals[..departures.len()]);
        primitives.iter_mut().zip(departures).for_each(|(primitive, from)| *primitive = from.primitive);
        self.kernel.normals(surfaces, primitives, normals);
        normals
    }
}

/// What the camera sees through the rays of a stream.
#[derive(Clone, Copy)]
struct Seen<'a> {
    stream: &'a PathStream,
    /// For each path of the part, the share of its radiance that reaches the pixel.
    throughput: &'a [Vec3],
    part: Part<'a>,
}

impl Seen<'_> {
    /// The place of ray `i`'s path among those of the part.
    fn path(&self, i: usize) -> usize {
        let Part { samples, paths, .. } = self.part;
        samples.place(self.stream.path(i as u32), paths.samples) as usize
    }

    /// Adds what `shade` finds for each of so many rays, on all cores.
    fn add(&self, radiance: &mut Radiance, count: usize, shade: impl Fn(Range<usize>, &mut Lit<'_>) + Sync) {
        radiance.add_all(count, |i| self.path(i), shade);
    }

    /// Adds light that comes along ray `i`.
    fn light(&self, lit: &mut Lit<'_>, i: usize, light: Vec3) {
        let path = self.path(i);
        lit.add(path, self.throughput[path] * light);
    }
}
