//! A tracer around a peer: a thread of its own that takes launches in order.
//!
//! The thread makes the peer and keeps it: the objects of other libraries need not be fit for moving between threads,
//! and a peer that panics or hangs is a lost device, not a lost test run.

use rt_core::arguments::{check_load, check_submit, check_walk, invalid};
use rt_core::{
    Clock, DeviceError, DeviceErrorKind, Hit, Launch, Query, Ray, RayMask, RaySource, Span, StreamSpec, Task,
    TestCounts, Ticket, Tracer, Walk,
};
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// Launches that may be in flight: as many as our own devices take.
pub(super) const IN_FLIGHT: u32 = 2;

/// The longest that dropping a tracer waits for a launch that nobody waits for any more.
const LAST_LAUNCH: Duration = Duration::from_secs(10);

/// One scene in another tracer's hands.
pub(super) trait Peer {
    /// Builds what the query needs, if it is not there.
    fn prepare(&mut self, query: Query) -> Result<(), String>;

    /// Traces a ray with a query that was prepared for; the primitive `origin` (`u32::MAX`: none) is left out.
    fn trace(&self, ray: &Ray, origin: u32, query: Query) -> Result<Hit, String>;
}

/// What the thread is asked to do, and where the answer goes.
enum Job {
    Load { source: RaySource, query: Query, reply: Sender<Result<(), String>> },
    Trace { tasks: Vec<Task>, done: Option<Arc<RayMask>>, reply: Sender<Result<Traced, String>> },
    Walk { rays: Vec<u32>, reply: Sender<Result<Traced, String>> },
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
    in_flight: VecDeque<(Ticket, Receiver<Result<Traced, String>>)>,
    next_ticket: u64,
}

impl PeerTracer {
    /// Starts the thread and has it make the peer.
    pub(super) fn start<P: Peer>(
        clock: Clock,
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
                Ok(peer) => {
                    let told = ready.send(Ok(()));
                    drop(ready);
                    if told.is_ok() {
                        Worker { peer, clock, source: nothing(), query: Query::Closest }.run(&inbox);
                    }
                }
                Err(reason) => drop(ready.send(Err(reason))),
            }
        });
        let thread = started.map_err(|e| {
            error(DeviceErrorKind::OutOfMemory, "the system cannot start another thread").with_source(e)
        })?;
        made.recv().map_err(|_| lost())?.map_err(|reason| error(DeviceErrorKind::OutOfMemory, reason))?;
        Ok(Self { jobs, thread: Some(thread), alive, rays: 0, in_flight: VecDeque::new(), next_ticket: 0 })
    }

    /// Has a job done and waits for its answer.
    fn ask<R>(&self, job: impl FnOnce(Sender<Result<R, String>>) -> Job) -> Result<R, DeviceError> {
        let (reply, answer) = channel();
        self.jobs.send(job(reply)).map_err(|_| lost())?;
        answer.recv().map_err(|_| lost())?.map_err(failed)
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

fn nothing() -> RaySource {
    RaySource::Explicit { rays: Arc::new([]), origins: None }
}

fn error(kind: DeviceErrorKind, message: impl Into<String>) -> DeviceError {
    DeviceError::new(kind, message)
}

fn lost() -> DeviceError {
    error(DeviceErrorKind::Lost, "the peer's thread has ended: it panicked, and said why on standard error")
}

fn failed(reason: String) -> DeviceError {
    error(DeviceErrorKind::Lost, reason)
}

impl Tracer for PeerTracer {
    fn load_rays(&mut self, source: RaySource, spec: StreamSpec) -> Result<(), DeviceError> {
        check_load(&source, self.in_flight.len())?;
        if spec.counts {
            return Err(error(DeviceErrorKind::Unsupported, "load_rays: peers count no tests: ask for hits alone"));
        }
        let rays = source.len();
        self.ask(|reply| Job::Load { source, query: spec.query, reply })?;
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
        if walk != Walk::Full {
            return Err(error(
                DeviceErrorKind::Unsupported,
                "walk: peers have no reduced traversal: ask for a full one",
            ));
        }
        let (found, span) = self.ask(|reply| Job::Walk { rays: rays.to_vec(), reply })?;
        counts.fill(TestCounts::default());
        if let Some(hits) = hits {
            hits.copy_from_slice(&found);
        }
        Ok(span)
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
            Ok(traced) => traced.map_err(failed),
        };
        self.in_flight.remove(place);
        let (hits, span) = traced?;
        *out = Launch { hits, span, ..Launch::default() };
        Ok(())
    }
}

/// The thread's own state.
struct Worker<P> {
    peer: P,
    clock: Clock,
    source: RaySource,
    query: Query,
}

impl<P: Peer> Worker<P> {
    /// Answers jobs until the tracer is dropped. Who no longer waits for an answer does not get it.
    fn run(mut self, inbox: &Receiver<Job>) {
        for job in inbox {
            match job {
                Job::Load { source, query, reply } => {
                    (self.source, self.query) = (source, query);
                    drop(reply.send(self.peer.prepare(query)));
                }
                Job::Trace { tasks, done, reply } => {
                    let rays = tasks.iter().flat_map(Task::range);
                    drop(reply.send(self.trace(rays, done.as_deref(), self.query)));
                }
                Job::Walk { rays, reply } => {
                    let answer = self.peer.prepare(Query::Closest);
                    drop(reply.send(answer.and_then(|()| self.trace(rays.into_iter(), None, Query::Closest))));
                }
            }
        }
    }

    fn trace(&self, rays: impl Iterator<Item = u32>, done: Option<&RayMask>, query: Query) -> Result<Traced, String> {
        let start = (self.clock)();
        let trace = |index: u32| {
            if done.is_some_and(|done| done.contains(index)) {
                return Ok(Hit::MISS);
            }
            let (ray, origin) = self.source.ray(index);
            self.peer.trace(&ray, origin, query)
        };
        let hits = rays.map(trace).collect::<Result<Vec<Hit>, String>>()?;
        let end = (self.clock)();
        Ok((hits, Span { start, end, in_kernel: end.saturating_sub(start) }))
    }
}
