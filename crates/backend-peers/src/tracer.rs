//! A tracer around a peer: a thread of its own that takes launches in order, and others that help it where the device
//! has more than one.
//!
//! The thread makes the peer and keeps it: a peer that panics or hangs is a lost device, not a lost run.

use rayon::iter::{IndexedParallelIterator, ParallelIterator};
use rayon::slice::{ParallelSlice, ParallelSliceMut};
use rayon::{ThreadPool, ThreadPoolBuilder};
use rt_core::arguments::{check_load, check_submit, check_walk, invalid};
use rt_core::{
    Capabilities, Clock, Coherence, Counted, DeviceError, DeviceErrorKind, DeviceInfo, Hit, Launch, Query, Ray,
    RayMask, RaySource, Span, StreamSpec, Task, TestCounts, Ticket, Tracer, Walk,
};
use rt_simd::Kernel;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// Launches that may be in flight: as many as our own devices take.
pub(super) const IN_FLIGHT: u32 = 2;

/// What all peers can do.
const CAPABILITIES: Capabilities = Capabilities::UNKNOWN.with_counts(Counted::Nothing);

/// The longest that dropping a tracer waits for a launch that nobody waits for any more.
const LAST_LAUNCH: Duration = Duration::from_secs(10);

/// What all peers say of themselves.
pub(super) fn info(name: String, backend: &'static str, threads: usize) -> DeviceInfo {
    let threads = threads.max(1);
    let name = if threads == 1 { name } else { format!("{name} ({threads} threads)") };
    let units = u32::try_from(threads).unwrap_or(u32::MAX);
    DeviceInfo::new(name, backend).with_units(units).with_in_flight(IN_FLIGHT).with_capabilities(CAPABILITIES)
}

/// What is asked of rays.
#[derive(Clone, Copy, Debug)]
pub(super) struct Asked {
    pub(super) query: Query,
    /// Whether neighbours go alike.
    pub(super) is_coherent: bool,
}

impl Asked {
    /// What the caller does not say is clear from what made the rays: those of a camera go alike, and so do those
    /// towards a light, which are asked for any hit.
    const fn of(source: &RaySource, spec: StreamSpec) -> Self {
        let is_coherent = match spec.coherence {
            Coherence::Coherent => true,
            Coherence::Incoherent => false,
            Coherence::Unknown => matches!((source, spec.query), (RaySource::Camera(_), _) | (_, Query::Any)),
        };
        Self { query: spec.query, is_coherent }
    }
}

/// One scene in another tracer's hands.
pub(super) trait Peer: Sync {
    /// Traces rays into `hits`; the primitive of each ray's `origin` (`u32::MAX`: none) is left out. All three are
    /// equally long.
    fn trace(&self, rays: &[Ray], origins: &[u32], asked: Asked, hits: &mut [Hit]);
}

/// What the thread is asked to do, and where the answer goes.
enum Job {
    Load { source: RaySource, spec: StreamSpec, reply: Sender<()> },
    Trace { tasks: Vec<Task>, done: Option<Arc<RayMask>>, reply: Sender<Traced> },
}

type Traced = (Vec<Hit>, Span);

/// A peer's thread, from outside.
#[derive(Debug)]
pub(super) struct PeerTracer {
    jobs: Sender<Job>,
    thread: Option<JoinHandle<()>>,
    /// Disconnected when the thread has nothing left to do.
    alive: Receiver<()>,
    rays: u32,
    in_flight: VecDeque<(Ticket, Receiver<Traced>)>,
    next_ticket: u64,
}

impl PeerTracer {
    /// Starts the thread and has it make the peer.
    pub(super) fn start<P: Peer>(
        clock: Clock,
        threads: u32,
        make: impl FnOnce() -> Result<P, String> + Send + 'static,
    ) -> Result<Self, DeviceError> {
        let (jobs, inbox) = channel();
        let (ready, made) = channel();
        let (living, alive) = channel();
        let thread = std::thread::Builder::new().name("rt-peer".to_owned());
        let started = thread.spawn(move || {
            // Dropped when all else is.
            let _living: Sender<()> = living;
            match make() {
                Ok(peer) => run(peer, clock, threads as usize, &inbox, ready),
                Err(reason) => drop(ready.send(Err(reason))),
            }
        });
        let thread = started.map_err(|e| {
            error(DeviceErrorKind::OutOfMemory, "the system cannot start another thread").with_source(e)
        })?;
        made.recv().map_err(|_| lost())?.map_err(|reason| error(DeviceErrorKind::OutOfMemory, reason))?;
        Ok(Self { jobs, thread: Some(thread), alive, rays: 0, in_flight: VecDeque::new(), next_ticket: 0 })
    }
}

impl Drop for PeerTracer {
    /// Waits for the thread to release what it holds of the other library: a process that ends meanwhile takes that
    /// library apart under it, which was seen to crash and to hang with Embree. A peer that hangs itself is left
    /// behind.
    fn drop(&mut self) {
        // Closes the channel of jobs, so that the thread ends after its launch.
        drop(std::mem::replace(&mut self.jobs, channel().0));
        if self.alive.recv_timeout(LAST_LAUNCH) == Err(RecvTimeoutError::Disconnected) {
            // Its panic was told as a lost device.
            drop(self.thread.take().map(JoinHandle::join));
        }
    }
}

fn error(kind: DeviceErrorKind, message: impl Into<String>) -> DeviceError {
    DeviceError::new(kind, message)
}

fn lost() -> DeviceError {
    error(DeviceErrorKind::Lost, "the peer's thread has ended: it panicked, and said why on standard error")
}

impl Tracer for PeerTracer {
    fn load_rays(&mut self, source: RaySource, spec: StreamSpec) -> Result<(), DeviceError> {
        check_load(&source, self.in_flight.len())?;
        if !CAPABILITIES.can_trace(spec) {
            let message = "load_rays: peers count no tests and find one hit of a ray: ask for no more";
            return Err(error(DeviceErrorKind::Unsupported, message));
        }
        let rays = source.len();
        let (reply, answer) = channel();
        self.jobs.send(Job::Load { source, spec, reply }).map_err(|_| lost())?;
        answer.recv().map_err(|_| lost())?;
        self.rays = rays;
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
        Err(error(DeviceErrorKind::Unsupported, format!("walk: peers count no tests: {walk:?} is not to be had")))
    }

    fn submit(&mut self, tasks: &[Task], done: Option<&Arc<RayMask>>) -> Result<Ticket, DeviceError> {
        check_submit(tasks, self.rays, self.in_flight.len(), IN_FLIGHT)?;
        let (reply, answer) = channel();
        self.jobs.send(Job::Trace { tasks: tasks.to_vec(), done: done.cloned(), reply }).map_err(|_| lost())?;
        let ticket = Ticket(self.next_ticket);
        self.next_ticket += 1;
        self.in_flight.push_back((ticket, answer));
        Ok(ticket)
    }

    fn wait(&mut self, ticket: Ticket, limit: Duration, out: &mut Launch) -> Result<(), DeviceError> {
        let place = self.in_flight.iter().position(|(open, _)| *open == ticket);
        let place = place.ok_or_else(|| invalid(format!("wait: {ticket:?} is not in flight")))?;
        let answer = self.in_flight[place].1.recv_timeout(limit);
        let traced = match answer {
            Err(RecvTimeoutError::Timeout) => {
                return Err(error(DeviceErrorKind::Hung, format!("wait: the launch took more than {limit:?}")));
            }
            Err(RecvTimeoutError::Disconnected) => Err(lost()),
            Ok(traced) => Ok(traced),
        };
        self.in_flight.remove(place);
        let (hits, span) = traced?;
        *out = Launch { hits, span, ..Launch::default() };
        Ok(())
    }
}

/// Answers jobs with the help of other threads, if there are to be more than one.
fn run<P: Peer>(peer: P, clock: Clock, threads: usize, inbox: &Receiver<Job>, ready: Sender<Result<(), String>>) {
    let source = RaySource::Explicit { rays: Arc::new([]), origins: None };
    let mut worker = Worker { asked: Asked::of(&source, StreamSpec::default()), peer, clock, source };
    let mut work = |pool: Option<&ThreadPool>| {
        if ready.send(Ok(())).is_ok() {
            worker.run(inbox, pool);
        }
    };
    if threads == 1 {
        return work(None);
    }
    let pool = ThreadPoolBuilder::new().num_threads(threads).thread_name(|index| format!("rt-peer {index}"));
    // All have ended when this returns.
    if let Err(failure) = pool.build_scoped(|thread| thread.run(), |pool| work(Some(pool))) {
        drop(ready.send(Err(format!("{threads} threads cannot be started: {failure}"))));
    }
}

/// The thread's own state.
struct Worker<P> {
    peer: P,
    clock: Clock,
    source: RaySource,
    asked: Asked,
}

/// Rays that are made and traced together: so few that they stay in a cache, and enough for threads to share.
const CHUNK: usize = 1024;

/// Room for the rays of a chunk.
struct Room {
    rays: Vec<Ray>,
    origins: Vec<u32>,
    /// The numbers of those to be traced, and what they hit.
    open: Vec<u32>,
    hits: Vec<Hit>,
}

impl Room {
    fn new() -> Self {
        let nothing = Ray::new(glam::Vec3::ZERO, glam::Vec3::Z);
        let (rays, origins, hits) = (vec![nothing; CHUNK], vec![u32::MAX; CHUNK], vec![Hit::MISS; CHUNK]);
        Self { rays, origins, open: Vec::with_capacity(CHUNK), hits }
    }
}

impl<P: Peer> Worker<P> {
    /// Answers jobs until the tracer is dropped. Who no longer waits for an answer does not get it.
    fn run(&mut self, inbox: &Receiver<Job>, pool: Option<&ThreadPool>) {
        for job in inbox {
            match job {
                Job::Load { source, spec, reply } => {
                    (self.asked, self.source) = (Asked::of(&source, spec), source);
                    let _ = reply.send(());
                }
                Job::Trace { tasks, done, reply } => drop(reply.send(self.trace(&tasks, done.as_deref(), pool))),
            }
        }
    }

    fn trace(&self, tasks: &[Task], done: Option<&RayMask>, pool: Option<&ThreadPool>) -> Traced {
        let start = (self.clock)();
        let rays: Vec<u32> = tasks.iter().flat_map(Task::range).collect();
        let mut hits = vec![Hit::MISS; rays.len()];
        let chunk = |room: &mut Room, (rays, hits): (&[u32], &mut [Hit])| self.chunk(rays, done, room, hits);
        match pool {
            None => {
                let mut room = Room::new();
                rays.chunks(CHUNK).zip(hits.chunks_mut(CHUNK)).for_each(|own| chunk(&mut room, own));
            }
            Some(pool) => pool.install(|| {
                rays.par_chunks(CHUNK).zip(hits.par_chunks_mut(CHUNK)).for_each_init(Room::new, chunk);
            }),
        }
        let end = (self.clock)();
        (hits, Span { start, end, in_kernel: end.saturating_sub(start) })
    }

    /// Traces the rays of these numbers but for those that are done, which miss.
    fn chunk(&self, numbers: &[u32], done: Option<&RayMask>, room: &mut Room, hits: &mut [Hit]) {
        let is_open = |ray: u32| done.is_none_or(|done| !done.contains(ray));
        let Room { rays, origins, open, hits: found } = room;
        open.clear();
        open.extend(numbers.iter().copied().filter(|&ray| is_open(ray)));
        let count = open.len();
        let (rays, origins, found) = (&mut rays[..count], &mut origins[..count], &mut found[..count]);
        Kernel::best().make_of(&self.source, open, rays, origins);
        self.peer.trace(rays, origins, self.asked, found);
        let places = numbers.iter().zip(hits).filter(|(ray, _)| is_open(**ray));
        places.zip(found).for_each(|((_, hit), found)| *hit = *found);
    }
}
