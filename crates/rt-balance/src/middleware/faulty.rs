//! A device that fails on purpose.

use rt_core::{
    Clock, Device, DeviceError, DeviceErrorKind, DeviceInfo, Hit, Launch, RayMask, RaySource, Scene, Span, StreamSpec,
    Task, TestCounts, Ticket, Tracer, Traffic, Walk,
};
use std::sync::Arc;
use std::time::Duration;

/// Where a [`Faulty`] device fails. Counting starts at 0 and over again with every tracer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Fault {
    /// The n-th `submit` reports a lost device.
    Submit(u32),
    /// The n-th `wait` reports a lost device: the launch ran, its hits are gone.
    Wait(u32),
    /// The n-th `wait` reports that its launch hangs.
    Hang(u32),
    /// The n-th `walk` reports a lost device.
    Walk(u32),
}

/// A device that works until its fault, and fails at everything from then on.
#[derive(Debug)]
pub struct Faulty {
    inner: Arc<dyn Device>,
    fault: Fault,
}

impl Faulty {
    /// `inner` with a fault.
    #[must_use]
    pub fn new(inner: Arc<dyn Device>, fault: Fault) -> Self {
        Self { inner, fault }
    }
}

impl Device for Faulty {
    fn info(&self) -> &DeviceInfo {
        self.inner.info()
    }

    fn tracer(&self, scene: Arc<Scene>, clock: Clock) -> Result<Box<dyn Tracer>, DeviceError> {
        let inner = self.inner.tracer(scene, clock)?;
        Ok(Box::new(FaultyTracer { inner, fault: self.fault, left: self.fault.position(), failed: false }))
    }
}

impl Fault {
    const fn position(self) -> u32 {
        match self {
            Self::Submit(n) | Self::Wait(n) | Self::Hang(n) | Self::Walk(n) => n,
        }
    }
}

#[derive(Debug)]
struct FaultyTracer {
    inner: Box<dyn Tracer>,
    fault: Fault,
    /// Calls that still succeed.
    left: u32,
    failed: bool,
}

impl FaultyTracer {
    /// Counts a call if it is of the kind that fails.
    fn strike(&mut self, counts: bool) -> Result<(), DeviceError> {
        if counts && !self.failed {
            self.failed = self.left == 0;
            self.left = self.left.saturating_sub(1);
        }
        match (self.failed, self.fault) {
            (false, _) => Ok(()),
            (true, Fault::Hang(_)) => Err(DeviceError::new(DeviceErrorKind::Hung, "injected fault: the launch hangs")),
            (true, _) => Err(DeviceError::new(DeviceErrorKind::Lost, "injected fault: the device is lost")),
        }
    }
}

impl Tracer for FaultyTracer {
    fn prepare(&mut self, source: &RaySource, spec: StreamSpec, walk: Option<Walk>) {
        self.inner.prepare(source, spec, walk);
    }

    fn load_rays(&mut self, source: RaySource, spec: StreamSpec) -> Result<(), DeviceError> {
        self.strike(false)?;
        self.inner.load_rays(source, spec)
    }

    fn walk(
        &mut self,
        rays: &[u32],
        walk: Walk,
        counts: &mut [TestCounts],
        hits: Option<&mut [Hit]>,
    ) -> Result<Span, DeviceError> {
        self.strike(matches!(self.fault, Fault::Walk(_)))?;
        self.inner.walk(rays, walk, counts, hits)
    }

    fn submit(&mut self, tasks: &[Task], done: Option<&Arc<RayMask>>) -> Result<Ticket, DeviceError> {
        self.strike(matches!(self.fault, Fault::Submit(_)))?;
        self.inner.submit(tasks, done)
    }

    fn wait(&mut self, ticket: Ticket, limit: Duration, out: &mut Launch) -> Result<(), DeviceError> {
        self.strike(matches!(self.fault, Fault::Wait(_) | Fault::Hang(_)))?;
        self.inner.wait(ticket, limit, out)
    }

    fn traffic(&self) -> Traffic {
        self.inner.traffic()
    }

    fn note(&self) -> Option<&str> {
        self.inner.note()
    }
}
