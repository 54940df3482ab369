//! A device that fails on purpose.

use rt_core::{
    Clock, Device, DeviceError, DeviceErrorKind, DeviceInfo, Hit, Launch, RayMask, RaySource, Scene, Span, StreamSpec,
    Task, TestCounts, Ticket, Tracer, Traffic, Walk,
};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// One fault of a [`Faulty`] device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Fault {
    /// The call that fails.
    pub call: FaultyCall,
    /// How many calls of that kind go well before. Counting starts at 0 and over again with every tracer.
    pub after: u32,
    /// How it fails.
    pub failure: Failure,
}

impl Fault {
    /// The call that comes `after` as many good ones fails so.
    #[must_use]
    pub const fn new(call: FaultyCall, after: u32, failure: Failure) -> Self {
        Self { call, after, failure }
    }
}

/// A call of a backend.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FaultyCall {
    /// [`Device::tracer`].
    Open,
    /// [`Tracer::prepare`], which cannot report an error: it does nothing then.
    Prepare,
    /// [`Tracer::move_scene`].
    Move,
    /// [`Tracer::load_rays`].
    Load,
    /// [`Tracer::walk`].
    Walk,
    /// [`Tracer::submit`].
    Submit,
    /// [`Tracer::wait`]: the launch ran, its hits are gone.
    Wait,
    /// The tracer's destructor.
    Drop,
}

impl FaultyCall {
    /// All but [`FaultyCall::Move`], which no stream asks for.
    pub const ALL: [Self; 7] =
        [Self::Open, Self::Prepare, Self::Load, Self::Walk, Self::Submit, Self::Wait, Self::Drop];
}

/// How a call fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Failure {
    /// It reports an error of this kind, and so does every later call, unless it is one that leaves the device as it
    /// was.
    Error(DeviceErrorKind),
    /// It panics.
    Panic,
    /// It does not return before [`Faulty::release`].
    Hang,
    /// It takes so much longer.
    Delay(Duration),
    /// From then on, what it answers is not true. Only walks and launches answer anything.
    Lie(Lie),
}

/// What a device answers that is not true.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Lie {
    /// Hits of a primitive that the scene does not have.
    Primitive,
    /// Distances that are no numbers.
    NotANumber,
    /// Distances beyond the ray's end, or before its begin.
    Distance,
    /// Fewer hits than rays.
    TooFew,
    /// Nothing is hit.
    Misses,
    /// Each ray has the answer of the one before it, as when launches are mixed up.
    Shifted,
    /// One ray of each launch or walk misses.
    OneMiss,
}

impl Lie {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Primitive, Self::NotANumber, Self::Distance, Self::TooFew, Self::Misses, Self::Shifted, Self::OneMiss];

    fn tell(self, hits: &mut Vec<Hit>) {
        match self {
            Self::TooFew => drop(hits.pop()),
            _ => self.alter(hits),
        }
    }

    fn alter(self, hits: &mut [Hit]) {
        let first = hits.iter().position(Hit::is_hit).unwrap_or(0);
        let Some(hit) = hits.get_mut(first) else { return };
        match self {
            Self::Primitive => *hit = Hit { t: 1.0, u: 0.1, v: 0.1, primitive: u32::MAX - 1 },
            Self::NotANumber => hit.t = f32::NAN,
            Self::Distance => *hit = Hit { t: -f32::MAX, u: 0.1, v: 0.1, primitive: 0 },
            Self::Misses => hits.fill(Hit::MISS),
            Self::Shifted => hits.rotate_right(1),
            Self::OneMiss => *hit = Hit::MISS,
            Self::TooFew => {}
        }
    }
}

/// A device that works until its fault.
#[derive(Debug)]
pub struct Faulty {
    inner: Arc<dyn Device>,
    fault: Fault,
    gate: Arc<Gate>,
}

/// Where calls hang.
#[derive(Debug, Default)]
struct Gate {
    state: Mutex<GateState>,
    opened: Condvar,
}

#[derive(Debug, Default)]
struct GateState {
    is_open: bool,
    /// Calls in front of it.
    hanging: u32,
}

impl Gate {
    fn state(&self) -> MutexGuard<'_, GateState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn hang(&self) {
        let mut state = self.state();
        state.hanging += 1;
        let state = self.opened.wait_while(state, |state| !state.is_open);
        state.unwrap_or_else(PoisonError::into_inner).hanging -= 1;
    }
}

impl Faulty {
    /// `inner` with a fault.
    #[must_use]
    pub fn new(inner: Arc<dyn Device>, fault: Fault) -> Self {
        Self { inner, fault, gate: Arc::default() }
    }

    /// Lets calls that hang return, now and from now on; so does dropping the device. Threads would hang for ever else.
    pub fn release(&self) {
        self.gate.state().is_open = true;
        self.gate.opened.notify_all();
    }

    /// Whether a call hangs.
    #[must_use]
    pub fn hangs(&self) -> bool {
        self.gate.state().hanging > 0
    }
}

impl Drop for Faulty {
    fn drop(&mut self) {
        self.release();
    }
}

impl Device for Faulty {
    fn info(&self) -> &DeviceInfo {
        self.inner.info()
    }

    fn tracer(&self, scene: Arc<Scene>, clock: Clock) -> Result<Box<dyn Tracer>, DeviceError> {
        let gate = Arc::clone(&self.gate);
        let mut pending = Pending { fault: self.fault, gate, left: self.fault.after, struck: false };
        pending.strike(FaultyCall::Open)?;
        let inner = self.inner.tracer(scene, clock)?;
        Ok(Box::new(FaultyTracer { inner, pending }))
    }
}

/// A fault that is to come.
#[derive(Debug)]
struct Pending {
    fault: Fault,
    gate: Arc<Gate>,
    /// Calls that still go well.
    left: u32,
    struck: bool,
}

impl Pending {
    /// Fails if it is time to; says whether the answer is to be a lie.
    fn strike(&mut self, call: FaultyCall) -> Result<Option<Lie>, DeviceError> {
        let (is_it, Fault { failure, .. }) = (self.fault.call == call, self.fault);
        let now = is_it && !self.struck && self.left == 0;
        if is_it {
            self.left = self.left.saturating_sub(1);
            self.struck |= now;
        }
        match failure {
            Failure::Error(kind) if now || (self.struck && !is_harmless(kind, self.fault.call)) => {
                Err(DeviceError::new(kind, format!("injected fault: {kind:?} at {call:?}")))
            }
            Failure::Panic if now => panic!("injected fault: a panic at {call:?}"),
            Failure::Hang if now => {
                self.gate.hang();
                Ok(None)
            }
            Failure::Delay(time) if now => {
                std::thread::sleep(time);
                Ok(None)
            }
            Failure::Lie(lie) if is_it && self.struck => Ok(Some(lie)),
            _ => Ok(None),
        }
    }
}

/// Whether a device goes on after such an error.
const fn is_harmless(kind: DeviceErrorKind, call: FaultyCall) -> bool {
    let refusable = matches!(call, FaultyCall::Load | FaultyCall::Walk | FaultyCall::Move);
    matches!(kind, DeviceErrorKind::InvalidArgument) || refusable && matches!(kind, DeviceErrorKind::Unsupported)
}

#[derive(Debug)]
struct FaultyTracer {
    inner: Box<dyn Tracer>,
    pending: Pending,
}

impl Drop for FaultyTracer {
    fn drop(&mut self) {
        // An error cannot be told here.
        let _ = self.pending.strike(FaultyCall::Drop);
    }
}

impl Tracer for FaultyTracer {
    fn prepare(&mut self, source: &RaySource, spec: StreamSpec, walk: Option<Walk>) {
        if self.pending.strike(FaultyCall::Prepare).is_ok() {
            self.inner.prepare(source, spec, walk);
        }
    }

    fn move_scene(&mut self, scene: Arc<Scene>) -> Result<(), DeviceError> {
        self.pending.strike(FaultyCall::Move)?;
        self.inner.move_scene(scene)
    }

    fn load_rays(&mut self, source: RaySource, spec: StreamSpec) -> Result<(), DeviceError> {
        self.pending.strike(FaultyCall::Load)?;
        self.inner.load_rays(source, spec)
    }

    fn walk(
        &mut self,
        rays: &[u32],
        walk: Walk,
        counts: &mut [TestCounts],
        mut hits: Option<&mut [Hit]>,
    ) -> Result<Span, DeviceError> {
        let lie = self.pending.strike(FaultyCall::Walk)?;
        let span = self.inner.walk(rays, walk, counts, hits.as_deref_mut())?;
        if let (Some(lie), Some(hits)) = (lie, hits) {
            lie.alter(hits);
        }
        Ok(span)
    }

    fn submit(&mut self, tasks: &[Task], done: Option<&Arc<RayMask>>) -> Result<Ticket, DeviceError> {
        self.pending.strike(FaultyCall::Submit)?;
        self.inner.submit(tasks, done)
    }

    fn wait(&mut self, ticket: Ticket, limit: Duration, out: &mut Launch) -> Result<(), DeviceError> {
        let lie = self.pending.strike(FaultyCall::Wait)?;
        self.inner.wait(ticket, limit, out)?;
        lie.into_iter().for_each(|lie| lie.tell(&mut out.hits));
        Ok(())
    }

    fn traffic(&self) -> Traffic {
        self.inner.traffic()
    }

    fn note(&self) -> Option<&str> {
        self.inner.note()
    }
}
