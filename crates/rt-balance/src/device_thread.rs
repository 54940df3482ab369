//! The thread of a device: it alone holds the device's tracer, so nothing that a backend does, or never ends doing, can
//! hold up whoever asked.
//!
//! A thread cannot be killed. So it owns all that it uses, answers through a channel, and is left behind, with the
//! tracer, when it does not answer: see [`Limits`](crate::Limits).

use crate::answers::{Asked, Audit, Checked};
use crate::clock;
use crate::contain::contain;
use rt_core::{
    Device, DeviceError, DeviceErrorKind, DeviceInfo, Hit, Launch, RayMask, RaySource, Scene, Span, StreamSpec, Task,
    TestCounts, Ticket, Tracer, Traffic, Walk,
};
use std::collections::VecDeque;
use std::io;
use std::ops::Range;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

/// What a device's thread is asked to do, beside taking the scene.
#[derive(Debug)]
pub(crate) enum Call {
    /// [`Tracer::move_scene`], after all launches have ended; where it cannot do that, the device makes another tracer.
    Move { scene: Arc<Scene>, device: Arc<dyn Device> },
    /// [`Tracer::prepare`], after all launches have ended.
    Prepare { source: RaySource, spec: StreamSpec, walk: Option<Walk> },
    /// [`Tracer::load_rays`], after all launches have ended. From now on launches may take `limit`, and of each `audit`
    /// is checked.
    Load { source: RaySource, spec: StreamSpec, limit: Duration, audit: Audit },
    /// [`Tracer::walk`] of a range of a list of rays.
    Walk { rays: Arc<Vec<u32>>, range: Range<usize>, walk: Walk },
    /// [`Tracer::submit`]. There is no answer: what goes wrong is told by the next one.
    Submit { tasks: Vec<Task>, done: Option<Arc<RayMask>> },
    /// [`Tracer::wait`] for the oldest launch, with buffers to be used again.
    Wait { buffers: Launch },
    /// Waits until all launches have ended.
    Rest,
}

/// The answer to a [`Call`].
#[derive(Debug)]
pub(crate) struct Answer {
    /// Position of the device among all members.
    pub(crate) member: usize,
    pub(crate) result: Result<Done, DeviceError>,
    pub(crate) status: Status,
}

/// What a device did.
#[derive(Debug)]
pub(crate) enum Done {
    /// It told what it is. Taking the scene comes next.
    Named(DeviceInfo),
    /// It took scene or rays, is prepared, or at rest.
    Ready,
    Walked(Walked),
    Launched(Launch, Checked),
}

/// The results of a walk.
#[derive(Debug)]
pub(crate) struct Walked {
    pub(crate) counts: Vec<TestCounts>,
    /// Empty unless the walk was a full one.
    pub(crate) hits: Vec<Hit>,
    pub(crate) span: Span,
    pub(crate) checked: Checked,
}

/// What a tracer tells beside results.
#[derive(Clone, Debug, Default)]
pub(crate) struct Status {
    pub(crate) traffic: Traffic,
    pub(crate) note: Option<String>,
    /// Whether the tracer is gone.
    pub(crate) lost: bool,
}

/// Where an answer goes. Dropped without one, it tells that there is none to come: so whoever waits never waits for
/// nobody.
#[derive(Debug)]
struct Reply {
    member: usize,
    to: Option<Sender<Answer>>,
}

impl Reply {
    fn send(mut self, result: Result<Done, DeviceError>, status: Status) {
        self.answer(result, status);
    }

    /// There is to be no answer.
    fn forget(mut self) {
        self.to = None;
    }

    fn answer(&mut self, result: Result<Done, DeviceError>, status: Status) {
        if let Some(to) = self.to.take() {
            // Whoever asked may have left.
            let _ = to.send(Answer { member: self.member, result, status });
        }
    }
}

impl Drop for Reply {
    fn drop(&mut self) {
        self.answer(Err(gone()), Status { lost: true, ..Status::default() });
    }
}

fn gone() -> DeviceError {
    DeviceError::new(DeviceErrorKind::Lost, "the device failed before")
}

/// A device's thread, from outside. Dropping it ends the thread after its current call; nobody waits for that.
#[derive(Debug)]
pub(crate) struct DeviceThread {
    member: usize,
    calls: Sender<(Call, Option<Reply>)>,
    parting: Parting,
}

/// Tells when a thread has ended.
#[derive(Debug)]
pub(crate) struct Parting(Receiver<()>);

impl Parting {
    /// Waits for the thread's end, until `deadline` at most.
    pub(crate) fn wait(&self, deadline: Instant) {
        let left = deadline.saturating_duration_since(Instant::now());
        // Nothing is ever sent: the sender goes with the thread.
        let _: Result<(), RecvTimeoutError> = self.0.recv_timeout(left);
    }
}

impl DeviceThread {
    /// Starts a thread that brings the scene to the device. Two answers come: what the device is, and whether it took
    /// it.
    ///
    /// # Errors
    /// When the system cannot start a thread.
    pub(crate) fn start(
        member: usize,
        device: Arc<dyn Device>,
        scene: Arc<Scene>,
        to: Sender<Answer>,
    ) -> io::Result<Self> {
        let (calls, inbox) = channel();
        let (here, parting) = channel();
        let named = Reply { member, to: Some(to.clone()) };
        let opened = Reply { member, to: Some(to) };
        thread::Builder::new().name(format!("rt-device-{member}")).spawn(move || {
            // Moved in, so that it is dropped last.
            let _here: Sender<()> = here;
            rt_fenv::settle_thread();
            let mut crew = Crew::new(scene);
            if crew.open(device, named, opened) {
                crew.serve(&inbox);
            }
        })?;
        Ok(Self { member, calls, parting: Parting(parting) })
    }

    /// Asks for something; the answer goes to `to`.
    pub(crate) fn ask(&self, call: Call, to: &Sender<Answer>) {
        self.send(call, Some(Reply { member: self.member, to: Some(to.clone()) }));
    }

    /// Asks for something without an answer of its own.
    pub(crate) fn tell(&self, call: Call) {
        self.send(call, None);
    }

    fn send(&self, call: Call, reply: Option<Reply>) {
        // Where the thread has ended, the reply says so when it is dropped.
        drop(self.calls.send((call, reply)));
    }

    /// Ends the thread after its current call.
    pub(crate) fn dismiss(self) -> Parting {
        self.parting
    }
}

/// A launch that was submitted.
#[derive(Debug)]
struct Flight {
    ticket: Ticket,
    tasks: Vec<Task>,
    done: Option<Arc<RayMask>>,
}

/// What a device's thread has.
struct Crew {
    scene: Arc<Scene>,
    tracer: Option<Box<dyn Tracer>>,
    /// What went wrong where there was nobody to tell.
    untold: Option<DeviceError>,
    in_flight: VecDeque<Flight>,
    /// Results that nobody asked for.
    unwanted: Launch,
    asked: Asked,
    limit: Duration,
}

impl Crew {
    fn new(scene: Arc<Scene>) -> Self {
        Self {
            asked: Asked::new(Arc::clone(&scene)),
            scene,
            tracer: None,
            untold: None,
            in_flight: VecDeque::new(),
            unwanted: Launch::default(),
            limit: Duration::MAX,
        }
    }

    /// Brings the scene to the device; `false` where that failed.
    fn open(&mut self, device: Arc<dyn Device>, named: Reply, opened: Reply) -> bool {
        let info = contain("info", || Ok(Done::Named(device.info().clone())));
        if info.is_err() {
            // Neither comes any more: one answer says so.
            named.forget();
            opened.send(info, Status { lost: true, ..Status::default() });
            return false;
        }
        named.send(info, Status::default());
        let scene = Arc::clone(&self.scene);
        let tracer = contain("tracer", || device.tracer(scene, clock::now));
        // The device may be the caller's last reference to it, and its destructor is the backend's.
        let _ = contain("drop", move || {
            drop(device);
            Ok(())
        });
        match tracer {
            Ok(tracer) => {
                self.tracer = Some(tracer);
                self.tell(opened, Ok(Done::Ready));
                true
            }
            Err(error) => {
                opened.send(Err(error), Status { lost: true, ..Status::default() });
                false
            }
        }
    }

    /// Does what is asked until the driver has left.
    fn serve(mut self, inbox: &Receiver<(Call, Option<Reply>)>) {
        for (call, reply) in inbox {
            let refusable = matches!(call, Call::Load { .. } | Call::Walk { .. });
            let result = match self.untold.take() {
                Some(error) => Err(error),
                // Backends' panics are told apart inside; what is left is what a caller's rays may cause.
                None => contain("check", || self.perform(call)),
            };
            let harmless = |error: &DeviceError| refusable && is_refusal(error.kind());
            let lost = result.as_ref().err().is_some_and(|error| !harmless(error));
            match reply {
                // Told before it is dropped, which may take for ever.
                Some(reply) if lost => reply.send(result, Status { lost, ..Status::default() }),
                Some(reply) => self.tell(reply, result),
                None => self.untold = result.err(),
            }
            if lost {
                self.leave();
            }
        }
        self.leave();
    }

    /// Answers, and says how the tracer is.
    fn tell(&mut self, reply: Reply, result: Result<Done, DeviceError>) {
        let tracer = &self.tracer;
        let status = contain("traffic", || {
            let traffic = tracer.as_ref().map(|tracer| tracer.traffic()).unwrap_or_default();
            let note = tracer.as_ref().and_then(|tracer| tracer.note()).map(str::to_owned);
            Ok(Status { traffic, note, lost: false })
        });
        match status {
            Ok(status) => reply.send(result, status),
            Err(error) => {
                reply.send(Err(error), Status { lost: true, ..Status::default() });
                self.leave();
            }
        }
    }

    /// Drops the tracer.
    fn leave(&mut self) {
        self.in_flight.clear();
        let tracer = self.tracer.take();
        // Nothing to be told: the device is gone, or the driver.
        let _ = contain("drop", move || {
            drop(tracer);
            Ok(())
        });
    }

    fn perform(&mut self, call: Call) -> Result<Done, DeviceError> {
        if !matches!(call, Call::Walk { .. } | Call::Submit { .. } | Call::Wait { .. }) {
            self.rest()?;
        }
        if let Call::Move { scene, device } = call {
            return self.follow(&scene, &*device);
        }
        let Self { tracer, in_flight, asked, limit, .. } = self;
        let tracer = tracer.as_mut().ok_or_else(gone)?;
        match call {
            Call::Prepare { source, spec, walk } => contain("prepare", || {
                tracer.prepare(&source, spec, walk);
                Ok(Done::Ready)
            }),
            Call::Load { source, spec, limit: longest, audit } => {
                contain("load_rays", || tracer.load_rays(source.clone(), spec))?;
                *limit = longest;
                asked.load(source, spec, audit);
                Ok(Done::Ready)
            }
            Call::Walk { rays, range, walk } => {
                let rays = rays.get(range).unwrap_or_default();
                let mut counts = vec![TestCounts::default(); rays.len()];
                let mut hits = vec![Hit::MISS; if walk == Walk::Full { rays.len() } else { 0 }];
                let wanted = (walk == Walk::Full).then_some(&mut hits[..]);
                let span = contain("walk", || tracer.walk(rays, walk, &mut counts, wanted))?;
                let checked = match walk {
                    Walk::Full => asked.check_walk(rays, &mut hits, &mut counts)?,
                    Walk::Reduced(_) => Checked::default(),
                };
                Ok(Done::Walked(Walked { counts, hits, span: asked.check_span(span)?, checked }))
            }
            Call::Submit { tasks, done } => {
                let ticket = contain("submit", || tracer.submit(&tasks, done.as_ref()))?;
                in_flight.push_back(Flight { ticket, tasks, done });
                Ok(Done::Ready)
            }
            Call::Wait { mut buffers } => {
                let Some(flight) = in_flight.pop_front() else { return Err(gone()) };
                contain("wait", || tracer.wait(flight.ticket, *limit, &mut buffers))?;
                let checked = asked.check_launch(&flight.tasks, flight.done.as_deref(), &mut buffers)?;
                Ok(Done::Launched(buffers, checked))
            }
            // The former was done above.
            Call::Move { .. } | Call::Rest => Ok(Done::Ready),
        }
    }

    /// Goes on with a scene that has moved.
    fn follow(&mut self, scene: &Arc<Scene>, device: &dyn Device) -> Result<Done, DeviceError> {
        let tracer = self.tracer.as_mut().ok_or_else(gone)?;
        match contain("move_scene", || tracer.move_scene(Arc::clone(scene))) {
            Err(error) if is_refusal(error.kind()) => {
                // Its memory is free before another takes the scene.
                self.leave();
                self.tracer = Some(contain("tracer", || device.tracer(Arc::clone(scene), clock::now))?);
            }
            moved => moved?,
        }
        (self.asked, self.scene) = (Asked::new(Arc::clone(scene)), Arc::clone(scene));
        Ok(Done::Ready)
    }

    /// Waits for launches that nobody asks for any more.
    fn rest(&mut self) -> Result<(), DeviceError> {
        let Self { tracer: Some(tracer), in_flight, unwanted, limit, .. } = self else { return Ok(()) };
        while let Some(flight) = in_flight.pop_front() {
            contain("wait", || tracer.wait(flight.ticket, *limit, unwanted))?;
        }
        Ok(())
    }
}

/// Whether an error leaves the tracer as it was, where rays are loaded or walked.
const fn is_refusal(kind: DeviceErrorKind) -> bool {
    matches!(kind, DeviceErrorKind::InvalidArgument | DeviceErrorKind::Unsupported)
}
