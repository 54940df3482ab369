//! One scene on one graphics card, as the driver sees it.

use crate::changes::changes;
use crate::pending::{Answers, Finished, How, Part, Pending, finish};
use crate::profile::capabilities;
use crate::ray_generation::RayGeneration;
use crate::ray_list::Sorter;
use crate::{GpuApi, GpuScene, IN_FLIGHT, RayCounters, rays};
use rt_bvh::kernel_io::KernelIo;
use rt_core::arguments::{check_load, check_move, check_spec, check_submit, check_walk, invalid, is_disbelieved};
use rt_core::{
    Clock, DeviceError, DeviceErrorKind, Hit, Launch, RayMask, RaySource, ReducedWalk, Scene, Span, StreamSpec, Task,
    TestCounts, Ticket, Tracer, Traffic, Walk,
};
use rt_shaders::Purpose;
use std::cell::OnceCell;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The longest a walk may take. The trait gives none; a walk is a sample of a stream, so minutes mean a hang.
const WALK_LIMIT: Duration = Duration::from_secs(600);

/// A scene resident on a [`GpuApi`].
#[derive(Debug)]
pub struct GpuTracer<A> {
    api: A,
    scene: GpuScene,
    clock: Clock,
    counters: Arc<RayCounters>,
    source: RaySource,
    /// Where the device makes the rays.
    generation: Option<RayGeneration>,
    spec: StreamSpec,
    pending: VecDeque<Pending>,
    /// Launches whose results are on the host because a later one was asked for first.
    finished: Vec<(Ticket, Launch)>,
    next_ticket: u64,
    traffic: Traffic,
    note: Option<String>,
    /// Those of [`GpuScene::places`], made for the first stream of rays that leave surfaces.
    places: OnceCell<Vec<u32>>,
}

impl<A: GpuApi> GpuTracer<A> {
    /// A tracer of `scene`, whose image is behind `api`, that adds to `counters`.
    pub fn new(api: A, scene: impl Into<GpuScene>, clock: Clock, counters: Arc<RayCounters>) -> Self {
        Self {
            api,
            scene: scene.into().settled(),
            clock,
            counters,
            source: no_rays(),
            generation: None,
            spec: StreamSpec::default(),
            pending: VecDeque::new(),
            finished: Vec::new(),
            next_ticket: 0,
            traffic: Traffic::default(),
            note: None,
            places: OnceCell::new(),
        }
    }

    /// The tracer with something that reports are to say of it.
    #[must_use]
    pub(crate) fn with_note(mut self, note: Option<String>) -> Self {
        self.note = note;
        self
    }

    fn open(&self) -> usize {
        self.pending.len() + self.finished.len()
    }

    /// Starts a kernel for each window that `rays` has rays of.
    fn start(&mut self, how: How, rays: Sorter) -> Result<Vec<Part>, DeviceError> {
        let mut parts = Vec::new();
        let size = self.api.window().max(1);
        for (window, list) in rays.finish(self.api.persistent_lanes()) {
            let Self { api, scene, source, generation, places, .. } = self;
            let places = || &places.get_or_init(|| scene.places())[..];
            let recipe =
                generation.as_ref().and_then(|generation| generation.recipe(source, &list, window * size, places));
            let flight = api.start(how.purpose(), window, &list, recipe.as_ref())?;
            if let (Some(generation), Some(recipe)) = (generation, &recipe) {
                generation.note(&list);
                self.counters.add_made(recipe.count());
                self.traffic.uploaded += size_of_val(recipe.words()) as u64;
            }
            self.traffic.uploaded += size_of_val(list.words()) as u64;
            parts.push(Part { flight, list });
        }
        Ok(parts)
    }

    /// Waits for kernels, writes the answers to their items, and returns the time in kernels.
    fn finish(
        &mut self,
        parts: &[Part],
        limit: Duration,
        how: How,
        mut answers: Answers<'_>,
    ) -> Result<Duration, DeviceError> {
        let begin = Instant::now();
        let mut in_kernel = Duration::ZERO;
        for Part { flight, list } in parts {
            let mut finished = Finished::default();
            let Self { api, scene, source, traffic, .. } = self;
            let left = limit.saturating_sub(begin.elapsed());
            api.wait(*flight, left, &mut |answer| {
                traffic.downloaded += (size_of_val(answer.found) + size_of_val(answer.counts)) as u64;
                finished = finish(scene, source, how, list, &answer, &mut answers);
            })?;
            if let (Some((ray, slot)), true) =
                (finished.first_refused, is_disbelieved(list.items() as u64, finished.refused as u64))
            {
                let (api, refused, all) = (api.name(), finished.refused, list.items());
                let what = format!(
                    "{refused} of {all} answers of the {api} device are none, such as triangle {slot} for ray {ray}"
                );
                return Err(DeviceError::new(DeviceErrorKind::WrongAnswer, what));
            }
            self.traffic.refused += finished.refused as u64;
            self.counters.add(list.items(), finished.on_host);
            self.traffic.on_host += finished.on_host as u64;
            in_kernel += finished.in_kernel;
        }
        Ok(in_kernel)
    }

    /// Brings the oldest launch's results to the host.
    fn collect(&mut self, limit: Duration, out: &mut Launch) -> Result<(), DeviceError> {
        let Some(Pending { parts, total, start, .. }) = self.pending.pop_front() else {
            return Err(invalid("wait: no launch is in flight"));
        };
        out.clear();
        out.hits.resize(total, Hit::MISS);
        out.counts.resize(if self.spec.counts { total } else { 0 }, TestCounts::default());
        let answers = Answers { hits: &mut out.hits, counts: &mut out.counts };
        let in_kernel = self.finish(&parts, limit, How::Trace(self.spec), answers)?;
        out.span = self.span(start, in_kernel);
        Ok(())
    }

    fn span(&self, start: Duration, in_kernel: Duration) -> Span {
        let end = (self.clock)();
        Span { start, end, in_kernel: in_kernel.min(end.saturating_sub(start)) }
    }
}

fn no_rays() -> RaySource {
    RaySource::Explicit { rays: Arc::new([]), origins: None }
}

/// What is asked of the rays of a walk over a stream of `spec`.
const fn how_to(walk: Walk, spec: StreamSpec) -> How {
    match walk {
        // The stream's own query: an any-hit stream costs what its any-hit kernel costs.
        Walk::Full => How::Trace(StreamSpec { counts: true, ..spec }),
        Walk::Reduced(kind @ ReducedWalk::LeafAsHit) => How::Reduced(kind, Purpose::LeafAsHit),
        Walk::Reduced(kind @ ReducedWalk::Unshortened) => How::Reduced(kind, Purpose::Unshortened),
    }
}

impl<A: GpuApi> Tracer for GpuTracer<A> {
    fn prepare(&mut self, source: &RaySource, spec: StreamSpec, walk: Option<Walk>) {
        if !self.pending.is_empty() {
            return;
        }
        let _ = match source {
            RaySource::Camera(_) => self.api.makes(Purpose::Camera),
            RaySource::Bounce(_) => self.api.makes(Purpose::Bounce),
            RaySource::Explicit { .. } => false,
        };
        let walk = walk.map(|walk| how_to(walk, spec));
        for how in [Some(How::Trace(spec)), walk].into_iter().flatten() {
            // Whoever uses the kernel is told what is wrong.
            let _ = self.api.warm_up(how.purpose());
        }
    }

    fn move_scene(&mut self, scene: Arc<Scene>) -> Result<(), DeviceError> {
        check_move(self.open())?;
        let Some(moved) = self.scene.moved(scene) else {
            let what = "move_scene: a scene with another tree: make a tracer of it";
            return Err(DeviceError::new(DeviceErrorKind::Unsupported, what));
        };
        let image = moved.image();
        let changes = changes(&self.scene, &image);
        self.api.write_scene(&changes)?;
        self.traffic.scene += changes.iter().map(|change| change.bytes.len() as u64).sum::<u64>();
        (self.source, self.generation) = (no_rays(), None);
        self.scene = moved.settled();
        Ok(())
    }

    fn load_rays(&mut self, source: RaySource, spec: StreamSpec) -> Result<(), DeviceError> {
        check_load(&source, self.open())?;
        check_spec(&capabilities(), self.scene.given(), spec)?;
        (self.source, self.generation) = (no_rays(), None);
        self.api.reserve_rays(source.len())?;
        let io = KernelIo::new(self.scene.given());
        self.generation = RayGeneration::new(&mut self.api, &io, &source);
        if self.generation.is_none() {
            self.traffic.uploaded += rays::prepare(&mut self.api, &io, &source)?;
        }
        (self.source, self.spec) = (source, spec);
        Ok(())
    }

    fn walk(
        &mut self,
        rays: &[u32],
        walk: Walk,
        counts: &mut [TestCounts],
        hits: Option<&mut [Hit]>,
    ) -> Result<Span, DeviceError> {
        check_walk(rays, counts, hits.as_deref(), self.source.len())?;
        let how = how_to(walk, self.spec);
        let start = (self.clock)();
        let mut sorter = Sorter::new(self.api.window());
        sorter.rays(rays);
        let parts = self.start(how, sorter)?;
        let hits = hits.unwrap_or_default();
        let in_kernel = self.finish(&parts, WALK_LIMIT, how, Answers { hits, counts })?;
        Ok(self.span(start, in_kernel))
    }

    fn submit(&mut self, tasks: &[Task], done: Option<&Arc<RayMask>>) -> Result<Ticket, DeviceError> {
        check_submit(tasks, self.source.len(), self.open(), IN_FLIGHT)?;
        let start = (self.clock)();
        let total: usize = tasks.iter().map(|task| task.rays as usize).sum();
        let mut sorter = Sorter::new(self.api.window());
        sorter.tasks(tasks, done.map(|mask| &**mask));
        let parts = self.start(How::Trace(self.spec), sorter)?;
        let ticket = Ticket(self.next_ticket);
        self.next_ticket += 1;
        self.pending.push_back(Pending { ticket, parts, total, start });
        Ok(ticket)
    }

    fn wait(&mut self, ticket: Ticket, limit: Duration, out: &mut Launch) -> Result<(), DeviceError> {
        let begin = Instant::now();
        if let Some(position) = self.finished.iter().position(|(t, _)| *t == ticket) {
            *out = self.finished.swap_remove(position).1;
            return Ok(());
        }
        if !self.pending.iter().any(|pending| pending.ticket == ticket) {
            return Err(invalid(format!("wait: launch {} is not in flight", ticket.0)));
        }
        // Launches end in order, so earlier ones are taken to the host first.
        loop {
            let left = limit.saturating_sub(begin.elapsed());
            match self.pending.front().map(|pending| pending.ticket) {
                Some(oldest) if oldest != ticket => {
                    let mut launch = Launch::default();
                    self.collect(left, &mut launch)?;
                    self.finished.push((oldest, launch));
                }
                _ => return self.collect(left, out),
            }
        }
    }

    fn traffic(&self) -> Traffic {
        self.traffic
    }

    fn note(&self) -> Option<&str> {
        self.note.as_deref()
    }
}
