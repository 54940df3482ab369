//! A device slowed down to a given speed.

use rt_core::{
    Clock, Device, DeviceError, DeviceErrorKind, DeviceInfo, Hit, Launch, RayMask, RaySource, Scene, Span, StreamSpec,
    Task, TestCounts, Ticket, Tracer, Traffic, Walk,
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
    /// The slowest speed there is. A launch takes a millisecond or more, so below it results would be held back for
    /// minutes, and a run would only wait for the device to be given up.
    pub const SLOWEST: f64 = 1e-3;

    /// Slows `inner` down to `speed`; `None` unless that is from [`Throttled::SLOWEST`] to 1.
    #[must_use]
    pub fn new(inner: Arc<dyn Device>, speed: f64) -> Option<Self> {
        let mut info = inner.info().clone();
        info.name = format!("{} at speed {speed}", info.name);
        (Self::SLOWEST..=1.0).contains(&speed).then_some(Self { inner, info, speed })
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
    /// The inner device's span on the slower device's time line.
    fn slowed(&mut self, span: Span) -> Span {
        let start = span.start.max(self.free);
        let end = start + span.duration().div_f64(self.speed);
        self.free = end;
        Span { start, end, in_kernel: span.in_kernel.div_f64(self.speed) }
    }

    fn sleep_until(&self, time: Duration) {
        std::thread::sleep(time.saturating_sub((self.clock)()));
    }
}

impl Tracer for ThrottledTracer {
    fn prepare(&mut self, source: &RaySource, spec: StreamSpec, walk: Option<Walk>) {
        self.inner.prepare(source, spec, walk);
    }

    fn move_scene(&mut self, scene: Arc<Scene>) -> Result<(), DeviceError> {
        self.inner.move_scene(scene)
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
        let span = self.slowed(span);
        self.sleep_until(span.end);
        Ok(span)
    }

    fn submit(&mut self, tasks: &[Task], done: Option<&Arc<RayMask>>) -> Result<Ticket, DeviceError> {
        self.inner.submit(tasks, done)
    }

    fn wait(&mut self, ticket: Ticket, limit: Duration, out: &mut Launch) -> Result<(), DeviceError> {
        let latest = (self.clock)().saturating_add(limit);
        self.inner.wait(ticket, limit, out)?;
        let span = self.slowed(out.span);
        self.sleep_until(span.end.min(latest));
        if span.end > latest {
            let message = format!("a launch was not done after {:.1} s at speed {}", limit.as_secs_f64(), self.speed);
            return Err(DeviceError::new(DeviceErrorKind::Hung, message));
        }
        out.span = span;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock;

    /// A device whose every launch took a second, and is done already.
    #[derive(Debug)]
    struct OneSecond(DeviceInfo);

    #[derive(Debug)]
    struct OneSecondTracer;

    impl Device for OneSecond {
        fn info(&self) -> &DeviceInfo {
            &self.0
        }

        fn tracer(&self, _: Arc<Scene>, _: Clock) -> Result<Box<dyn Tracer>, DeviceError> {
            Ok(Box::new(OneSecondTracer))
        }
    }

    impl Tracer for OneSecondTracer {
        fn load_rays(&mut self, _: RaySource, _: StreamSpec) -> Result<(), DeviceError> {
            Ok(())
        }

        fn walk(
            &mut self,
            _: &[u32],
            _: Walk,
            _: &mut [TestCounts],
            _: Option<&mut [Hit]>,
        ) -> Result<Span, DeviceError> {
            Ok(Span::default())
        }

        fn submit(&mut self, _: &[Task], _: Option<&Arc<RayMask>>) -> Result<Ticket, DeviceError> {
            Ok(Ticket(0))
        }

        fn wait(&mut self, _: Ticket, _: Duration, out: &mut Launch) -> Result<(), DeviceError> {
            let end = clock();
            let second = Duration::from_secs(1);
            out.span = Span { start: end.saturating_sub(second), end: end.max(second), in_kernel: second };
            Ok(())
        }
    }

    fn throttled(speed: f64) -> Option<Throttled> {
        let info = DeviceInfo::new("one", "cpu");
        Throttled::new(Arc::new(OneSecond(info)), speed)
    }

    // Mutant: the limit handed to the inner device alone, which is done at once; then the launch comes back some ten
    // seconds later, and as if all were well.
    #[test]
    fn a_launch_that_is_held_back_beyond_its_limit_has_hung() {
        let device = throttled(0.1).unwrap();
        let scene = rt_bvh::build(rt_bvh::Mesh { positions: &[], indices: &[] }, &rt_bvh::BuildOptions::default());
        let mut tracer = device.tracer(scene.unwrap().scene, clock).unwrap();
        let ticket = tracer.submit(&[], None).unwrap();
        let error = tracer.wait(ticket, Duration::from_millis(10), &mut Launch::default()).unwrap_err();
        assert_eq!(error.kind(), DeviceErrorKind::Hung);
    }

    #[test]
    fn speeds_that_cannot_be_served_are_refused() {
        for speed in [f64::NAN, f64::NEG_INFINITY, -1.0, 0.0, 1e-300, 9.9e-4, 1.000_001, f64::INFINITY] {
            assert!(throttled(speed).is_none(), "{speed}");
        }
        for speed in [Throttled::SLOWEST, 0.5, 1.0] {
            assert!(throttled(speed).is_some(), "{speed}");
        }
    }
}
