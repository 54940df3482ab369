//! A device slowed down to a given speed.

use rt_core::{
    Clock, Device, DeviceError, DeviceInfo, Hit, Launch, RayMask, RaySource, Scene, Span, StreamSpec, Task, TestCounts,
    Ticket, Tracer, Traffic, Walk,
};
use std::sync::Arc;
use std::time::Duration;

/// A device that takes `1 / speed` times as long: results are held back until the slower device would have had them.
///
/// The inner device works at its own speed and then idles, so a throttled device does not load its cores more.
#[derive(Debug)]
pub struct Throttled {
    inner: Arc<dyn Device>,
    info: DeviceInfo,
    speed: f64,
}

impl Throttled {
    /// Slows `inner` down to `speed`; `None` unless `0 < speed ≤ 1`.
    #[must_use]
    pub fn new(inner: Arc<dyn Device>, speed: f64) -> Option<Self> {
        let mut info = inner.info().clone();
        info.name = format!("{} at speed {speed}", info.name);
        (speed > 0.0 && speed <= 1.0).then_some(Self { inner, info, speed })
    }
}

impl Device for Throttled {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn tracer(&self, scene: Arc<Scene>, clock: Clock) -> Result<Box<dyn Tracer>, DeviceError> {
        let inner = self.inner.tracer(scene, clock)?;
        Ok(Box::new(ThrottledTracer { inner, clock, speed: self.speed, free: Duration::ZERO }))
    }
}

#[derive(Debug)]
struct ThrottledTracer {
    inner: Box<dyn Tracer>,
    clock: Clock,
    speed: f64,
    /// When the slower device would be done with all earlier work.
    free: Duration,
}

impl ThrottledTracer {
    /// Places the inner device's span on the slower device's time line and waits for its end.
    fn hold_back(&mut self, span: Span) -> Span {
        let start = span.start.max(self.free);
        let end = start + span.duration().div_f64(self.speed);
        self.free = end;
        std::thread::sleep(end.saturating_sub((self.clock)()));
        Span { start, end, in_kernel: span.in_kernel.div_f64(self.speed) }
    }
}

impl Tracer for ThrottledTracer {
    fn prepare(&mut self, source: &RaySource, spec: StreamSpec, walk: Option<Walk>) {
        self.inner.prepare(source, spec, walk);
    }

    fn load_rays(&mut self, source: RaySource, spec: StreamSpec) -> Result<(), DeviceError> {
        self.inner.load_rays(source, spec)
    }

    fn walk(
        &mut self,
        rays: &[u32],
        walk: Walk,
        counts: &mut [TestCounts],
        hits: Option<&mut [Hit]>,
    ) -> Result<Span, DeviceError> {
        let span = self.inner.walk(rays, walk, counts, hits)?;
        Ok(self.hold_back(span))
    }

    fn submit(&mut self, tasks: &[Task], done: Option<&Arc<RayMask>>) -> Result<Ticket, DeviceError> {
        self.inner.submit(tasks, done)
    }

    fn wait(&mut self, ticket: Ticket, limit: Duration, out: &mut Launch) -> Result<(), DeviceError> {
        self.inner.wait(ticket, limit, out)?;
        out.span = self.hold_back(out.span);
        for seconds in &mut out.task_seconds {
            *seconds /= self.speed as f32;
        }
        Ok(())
    }

    fn traffic(&self) -> Traffic {
        self.inner.traffic()
    }

    fn note(&self) -> Option<&str> {
        self.inner.note()
    }
}
