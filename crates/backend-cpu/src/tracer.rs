//! One scene on one CPU device: a thread that takes launches in order and runs them on the device's threads.

use crate::executor::Executor;
use crate::launches::{Launches, Layout, Results, WINDOW};
use crate::masked::Masked;
use crate::stopwatch::Stopwatch;
use rt_bvh::Stack;
use rt_core::arguments::{check_load, check_move, check_submit, check_walk, invalid};
use rt_core::{
    Clock, Coherence, DeviceError, DeviceErrorKind, Hit, Launch, Query, RayMask, RaySource, Scene, Span, StreamSpec,
    Task, TestCounts, Ticket, Tracer, Walk,
};
use std::collections::VecDeque;
use std::ops::Range;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

/// Fewest rays that one of several threads traces before it looks for more work: enough to hide the hand-over and the
/// reading of the clock (about 1 µs), so few that a task of 32 × 32 pixels feeds four threads.
const CHUNK: usize = 256;

/// Where no more than one ray in so many is done, their lanes stay empty; where more are, packets are filled up with
/// later rays. Filling up after every gap would take all packets out of step with the Z-curve's squares of pixels: with
/// one ray in 64 done that cost 5% of tracing coherent rays.
const FEW_DONE: u32 = 4;

/// A scene resident on a CPU device.
#[derive(Debug)]
pub(crate) struct CpuTracer {
    jobs: Sender<Job>,
    layout: Layout,
    scene: Arc<Scene>,
    rays: u32,
    source: RaySource,
    spec: StreamSpec,
    in_flight: VecDeque<(Ticket, Receiver<Launch>)>,
    capacity: u32,
    next_ticket: u64,
    /// Buffers of finished launches, handed to later ones.
    spare: Vec<Launch>,
    /// Those of the last walk, likewise.
    walked: Walked,
}

/// What the tracer's thread is asked to do.
#[derive(Debug)]
enum Job {
    Move {
        scene: Arc<Scene>,
        launches: Option<Launches>,
    },
    /// To get ready for so many rays of a stream whose mask hides something.
    Show {
        spec: StreamSpec,
        rays: u32,
        ready: Sender<()>,
    },
    Trace {
        source: RaySource,
        spec: StreamSpec,
        tasks: Vec<Task>,
        done: Option<Arc<RayMask>>,
        out: Launch,
        reply: Sender<Launch>,
    },
    Walk {
        source: RaySource,
        spec: StreamSpec,
        rays: Vec<u32>,
        walk: Walk,
        /// Whether hits are asked for.
        hits: bool,
        out: Walked,
        reply: Sender<Walked>,
    },
}

/// What came of a walk.
#[derive(Debug, Default)]
struct Walked {
    counts: Vec<TestCounts>,
    /// Empty unless they were asked for.
    hits: Vec<Hit>,
    span: Span,
}

impl CpuTracer {
    pub(crate) fn new(
        executor: Arc<Executor>,
        scene: Arc<Scene>,
        layout: Layout,
        clock: Clock,
        capacity: u32,
    ) -> Result<Self, DeviceError> {
        let (jobs, inbox) = channel();
        let launches = layout.of(&scene);
        let (masked, own) = (Masked::default(), Arc::clone(&scene));
        let worker = Worker { executor, layout: layout.clone(), launches, masked, scene: own, clock };
        // Detached on purpose: dropping the tracer closes the channel and the thread ends after its launch; joining
        // would make a lost tracer's owner wait for it.
        std::thread::Builder::new().name("rt-cpu-launch".to_owned()).spawn(move || worker.run(&inbox)).map_err(
            |e| DeviceError::new(DeviceErrorKind::OutOfMemory, "the system cannot start another thread").with_source(e),
        )?;
        Ok(Self {
            jobs,
            layout,
            scene,
            rays: 0,
            source: no_rays(),
            spec: StreamSpec::default(),
            in_flight: VecDeque::new(),
            capacity,
            next_ticket: 0,
            spare: Vec::new(),
            walked: Walked::default(),
        })
    }

    fn send(&self, job: Job) -> Result<(), DeviceError> {
        self.jobs.send(job).map_err(|_| lost())
    }
}

fn no_rays() -> RaySource {
    RaySource::Explicit { rays: Arc::new([]), origins: None }
}

fn lost() -> DeviceError {
    DeviceError::new(DeviceErrorKind::Lost, "the CPU device's thread has ended: it panicked in an earlier launch")
}

impl Tracer for CpuTracer {
    fn move_scene(&mut self, scene: Arc<Scene>) -> Result<(), DeviceError> {
        check_move(self.in_flight.len())?;
        let launches = self.layout.of(&scene);
        (self.source, self.rays) = (no_rays(), 0);
        self.scene = Arc::clone(&scene);
        self.send(Job::Move { scene, launches })
    }

    fn load_rays(&mut self, source: RaySource, spec: StreamSpec) -> Result<(), DeviceError> {
        check_load(&source, self.in_flight.len())?;
        if self.scene.hides(spec.mask) {
            let (ready, is_ready) = channel();
            self.send(Job::Show { spec, rays: source.len(), ready })?;
            is_ready.recv().map_err(|_| lost())?;
        }
        self.rays = source.len();
        self.source = source;
        self.spec = spec;
        Ok(())
    }

    fn walk(
        &mut self,
        rays: &[u32],
        walk: Walk,
        counts: &mut [TestCounts],
        hits: Option<&mut [Hit]>,
    ) -> Result<Span, DeviceError> {
        check_walk(rays, counts, hits.as_deref(), self.rays)?;
        let (reply, answer) = channel();
        let (source, spec) = (self.source.clone(), self.spec);
        // Reduced walks find none.
        let hits = hits.filter(|_| walk == Walk::Full);
        let (wanted, out) = (hits.is_some(), std::mem::take(&mut self.walked));
        self.send(Job::Walk { source, spec, rays: rays.to_vec(), walk, hits: wanted, out, reply })?;
        self.walked = answer.recv().map_err(|_| lost())?;
        counts.copy_from_slice(&self.walked.counts);
        if let Some(hits) = hits {
            hits.copy_from_slice(&self.walked.hits);
        }
        Ok(self.walked.span)
    }

    fn submit(&mut self, tasks: &[Task], done: Option<&Arc<RayMask>>) -> Result<Ticket, DeviceError> {
        check_submit(tasks, self.rays, self.in_flight.len(), self.capacity)?;
        let ticket = Ticket(self.next_ticket);
        self.next_ticket += 1;
        let (reply, answer) = channel();
        let out = self.spare.pop().unwrap_or_default();
        let (source, spec) = (self.source.clone(), self.spec);
        self.send(Job::Trace { source, spec, tasks: tasks.to_vec(), done: done.cloned(), out, reply })?;
        self.in_flight.push_back((ticket, answer));
        Ok(ticket)
    }

    fn wait(&mut self, ticket: Ticket, limit: Duration, out: &mut Launch) -> Result<(), DeviceError> {
        let Some(position) = self.in_flight.iter().position(|(t, _)| *t == ticket) else {
            return Err(invalid(format!("wait: launch {} is not in flight", ticket.0)));
        };
        match self.in_flight[position].1.recv_timeout(limit) {
            Ok(mut launch) => {
                self.in_flight.remove(position);
                std::mem::swap(out, &mut launch);
                self.spare.push(launch);
                Ok(())
            }
            Err(RecvTimeoutError::Timeout) => Err(DeviceError::new(
                DeviceErrorKind::Hung,
                format!("the launch did not end within {:.1} s", limit.as_secs_f64()),
            )),
            Err(RecvTimeoutError::Disconnected) => Err(lost()),
        }
    }
}

/// The tracer's thread.
struct Worker {
    executor: Arc<Executor>,
    layout: Layout,
    /// What traces and walks nearly everything; absent for a scene of too many triangles.
    launches: Option<Launches>,
    /// The same for streams whose masks hide something.
    masked: Masked,
    scene: Arc<Scene>,
    clock: Clock,
}

/// A part of a task: its rays, where their results go, and the thread seconds it took.
struct Piece<'a> {
    task: usize,
    rays: Range<u32>,
    /// So many for each ray as the stream asks for.
    hits: &'a mut [Hit],
    counts: &'a mut [TestCounts],
    seconds: &'a mut f32,
}

impl Worker {
    fn run(mut self, inbox: &Receiver<Job>) {
        rt_fenv::settle_thread();
        self.executor.adopt_current_thread();
        // Ends when the tracer is dropped. A reply nobody waits for any more is not an error.
        for job in inbox {
            match job {
                Job::Move { scene, launches } => {
                    (self.scene, self.launches, self.masked) = (scene, launches, Masked::default());
                }
                Job::Show { spec, rays, ready } => {
                    if let Some(all) = &self.launches {
                        self.masked.prepare(&self.layout, &self.scene, all, spec, rays);
                    }
                    let _ = ready.send(());
                }
                Job::Trace { source, spec, tasks, done, mut out, reply } => {
                    self.trace(&source, spec, &tasks, done.as_deref(), &mut out);
                    let _ = reply.send(out);
                }
                Job::Walk { source, spec, rays, walk, hits, mut out, reply } => {
                    self.walk(&source, spec, &rays, walk, hits, &mut out);
                    let _ = reply.send(out);
                }
            }
        }
    }

    /// The kernels for a stream, and its walks where those are `counted`; `None` where its rays go alone.
    fn launches_for(&self, source: &RaySource, spec: StreamSpec, counted: bool) -> Option<&Launches> {
        let all = self.launches.as_ref().filter(|_| Launches::suit(spec, counted))?;
        if self.scene.hides(spec.mask) { self.masked.of(&self.scene, spec.mask, source.len()) } else { Some(all) }
    }

    fn timed(&self, work: impl FnOnce()) -> Span {
        let start = (self.clock)();
        work();
        let end = (self.clock)();
        Span { start, end, in_kernel: end.saturating_sub(start) }
    }

    fn trace(&self, source: &RaySource, spec: StreamSpec, tasks: &[Task], done: Option<&RayMask>, out: &mut Launch) {
        out.task_seconds.clear();
        let span = self.timed(|| {
            let rays: usize = tasks.iter().map(|task| task.rays as usize).sum();
            // What an earlier launch left in the buffers is overwritten ray by ray.
            out.hits.resize(rays * spec.query.hits_per_ray(), Hit::MISS);
            out.counts.resize(if spec.counts { rays } else { 0 }, TestCounts::default());
            let chunk = chunk_of(rays, self.executor.threads());
            let mut seconds = vec![0.0_f32; tasks.iter().map(|t| (t.rays as usize).div_ceil(chunk)).sum()];
            let pieces = cut(tasks, chunk, spec.query.hits_per_ray(), &mut out.hits, &mut out.counts, &mut seconds);
            let task_of: Vec<usize> = pieces.iter().map(|piece| piece.task).collect();
            self.executor.for_each(
                pieces,
                || (Stack::for_scene(&self.scene), Stopwatch::start()),
                |(stack, watch), mut piece| {
                    self.trace_piece(stack, source, spec, done, &mut piece);
                    *piece.seconds = watch.lap();
                },
            );
            out.task_seconds.resize(tasks.len(), 0.0);
            let share = 1.0 / self.executor.threads() as f32;
            for (task, seconds) in task_of.into_iter().zip(seconds) {
                out.task_seconds[task] += seconds * share;
            }
        });
        out.span = span;
    }

    fn trace_piece(
        &self,
        stack: &mut Stack,
        source: &RaySource,
        spec: StreamSpec,
        done: Option<&RayMask>,
        piece: &mut Piece<'_>,
    ) {
        let range = piece.rays.clone();
        let is_done = |ray: u32| done.is_some_and(|mask| mask.contains(ray));
        let number = done.map_or(0, |mask| mask.count_in(range.clone()));
        if let Some(launches) = self.launches_for(source, spec, spec.counts) {
            let done = done.filter(|_| number > 0).map(|mask| (mask, number > range.len() as u32 / FEW_DONE));
            launches.trace(source, spec, range, done, Results { hits: piece.hits, counts: piece.counts });
        } else {
            piece.hits.fill(Hit::MISS);
            piece.counts.fill(TestCounts::default());
            let rays = || range.clone().filter(|&ray| !is_done(ray));
            let mut numbers = rays();
            let per_ray = spec.query.hits_per_ray();
            let mut put = |found: &[Hit], tests: TestCounts| {
                let place = numbers.next().map_or(0, |ray| (ray - range.start) as usize);
                piece.hits[place * per_ray..][..per_ray].copy_from_slice(found);
                piece.counts.get_mut(place).into_iter().for_each(|slot| *slot = tests);
            };
            let made = rays().map(|ray| source.ray(ray));
            match spec.query {
                Query::All { .. } => rt_bvh::trace_several(&self.scene, stack, spec, made, put),
                _ => rt_bvh::trace(&self.scene, stack, spec, made, |hit, tests| put(&[hit], tests)),
            }
        }
    }

    fn walk(
        &self,
        source: &RaySource,
        spec: StreamSpec,
        rays: &[u32],
        walk: Walk,
        with_hits: bool,
        Walked { counts, hits, span }: &mut Walked,
    ) {
        *span = self.timed(|| {
            // What an earlier walk left in the buffers is overwritten ray by ray.
            counts.resize(rays.len(), TestCounts::default());
            hits.resize(if with_hits { rays.len() } else { 0 }, Hit::MISS);
            // Rays in the stream's order, so that neighbours share packets; most lists are in it.
            let mut order: Vec<(u32, usize)> = Vec::new();
            if !rays.is_sorted() {
                order.extend(rays.iter().copied().zip(0..));
                order.sort_unstable();
            }
            let sorted: Vec<u32> = order.iter().map(|&(ray, _)| ray).collect();
            let rays = if order.is_empty() { rays } else { &sorted };
            let mut results = Results { hits, counts };
            let pieces = rays.chunks(chunk_of(rays.len(), self.executor.threads()));
            let pieces = pieces.map(|rays| (rays, results.split_off(rays.len()))).collect();
            let launches = self.launches_for(source, spec, true);
            self.executor.for_each(
                pieces,
                || Stack::for_scene(&self.scene),
                |stack, (rays, results): (&[u32], Results<'_>)| match launches {
                    Some(launches) => launches.walk(source, spec, walk, rays, results),
                    None => self.walk_scene(stack, source, spec, walk, rays, results),
                },
            );
            if !order.is_empty() {
                (*counts, *hits) = (scattered(counts, &order), scattered(hits, &order));
            }
        });
    }

    /// Walks rays through the scene's own tree, one by one.
    fn walk_scene(
        &self,
        stack: &mut Stack,
        source: &RaySource,
        spec: StreamSpec,
        walk: Walk,
        rays: &[u32],
        Results { hits, counts }: Results<'_>,
    ) {
        let (mut hits, mut counts) = (hits.iter_mut(), counts.iter_mut());
        let mut put = |hit: Hit, tests: TestCounts| {
            counts.next().into_iter().for_each(|count| *count = tests);
            hits.next().into_iter().for_each(|slot| *slot = hit);
        };
        let rays = rays.iter().map(|&ray| source.ray(ray));
        match walk {
            // The stream's own query: an any-hit stream costs what its any-hit kernel costs, and one of all hits what
            // finding all of them does.
            Walk::Full => {
                let spec = StreamSpec { counts: true, ..spec };
                match spec.query {
                    Query::All { .. } => {
                        rt_bvh::trace_several(&self.scene, stack, spec, rays, |hits, tests| put(hits[0], tests));
                    }
                    _ => rt_bvh::trace(&self.scene, stack, spec, rays, &mut put),
                }
            }
            Walk::Reduced(_) => rt_bvh::count(&self.scene, stack, walk, spec.precision, rays, &mut put),
        }
    }
}

/// Whether rays that follow each other take similar paths: as the caller says, or as what made them does.
pub(crate) const fn coherence(source: &RaySource, spec: StreamSpec) -> Coherence {
    match (spec.coherence, source) {
        (Coherence::Unknown, RaySource::Camera(_)) => Coherence::Coherent,
        (coherence, _) => coherence,
    }
}

/// Values that belong to sorted rays, if there are any, at the places from which those came.
fn scattered<T: Copy>(values: &[T], order: &[(u32, usize)]) -> Vec<T> {
    let mut placed = values.to_vec();
    for (&value, &(_, place)) in values.iter().zip(order) {
        placed[place] = value;
    }
    placed
}

/// Rays that a thread traces before it looks for more work. One thread takes tasks whole; several take as many as
/// kernels sort together, where that leaves enough for each of them.
const fn chunk_of(rays: usize, threads: usize) -> usize {
    if threads == 1 {
        usize::MAX
    } else if rays >= 4 * threads * WINDOW {
        WINDOW
    } else {
        CHUNK
    }
}

/// Cuts every task into pieces of at most `chunk` rays, with `per_ray` hits each.
fn cut<'a>(
    tasks: &[Task],
    chunk: usize,
    per_ray: usize,
    mut hits: &'a mut [Hit],
    mut counts: &'a mut [TestCounts],
    seconds: &'a mut [f32],
) -> Vec<Piece<'a>> {
    let mut pieces = Vec::with_capacity(seconds.len());
    let mut seconds = seconds.iter_mut();
    for (index, task) in tasks.iter().enumerate() {
        let mut range = task.range();
        while !range.is_empty() {
            let len = range.len().min(chunk);
            let (own_hits, other_hits) = std::mem::take(&mut hits).split_at_mut(len * per_ray);
            let counted = if counts.is_empty() { 0 } else { len };
            let (own_counts, other_counts) = std::mem::take(&mut counts).split_at_mut(counted);
            (hits, counts) = (other_hits, other_counts);
            // One slot of seconds was made for each piece.
            if let Some(seconds) = seconds.next() {
                let rays = range.start..range.start + len as u32;
                pieces.push(Piece { task: index, rays, hits: own_hits, counts: own_counts, seconds });
            }
            range.start += len as u32;
        }
    }
    pieces
}
