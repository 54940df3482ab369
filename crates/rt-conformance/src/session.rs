//! A tracer under test, its errors as messages, and checks that hold for every launch.

use rt_core::{
    Device, DeviceErrorKind, Hit, Launch, Ray, RayMask, RaySource, Scene, Span, StreamSpec, Task, TestCounts, Ticket,
    Tracer, Walk, tasks_of,
};
use rt_verify::clock;
use std::sync::Arc;
use std::time::Duration;

/// The longest any launch of the suite may take. They take milliseconds; a loaded machine may be a thousand times
/// slower.
pub(crate) const LIMIT: Duration = Duration::from_secs(60);

/// Returns an error with the message unless the condition holds.
macro_rules! ensure {
    ($condition:expr, $($message:tt)+) => {
        let holds: bool = $condition;
        if !holds {
            return Err(format!($($message)+));
        }
    };
}
pub(crate) use ensure;

/// A tracer and what was loaded.
pub(crate) struct Session {
    tracer: Box<dyn Tracer>,
    rays: u32,
    spec: StreamSpec,
}

impl Session {
    pub(crate) fn open(device: &dyn Device, scene: &Arc<Scene>) -> Result<Self, String> {
        let tracer = device.tracer(Arc::clone(scene), clock).map_err(|e| format!("tracer: {e}"))?;
        Ok(Self { tracer, rays: 0, spec: StreamSpec::default() })
    }

    /// Opens a tracer, loads rays and traces them all as one task.
    pub(crate) fn whole(
        device: &dyn Device,
        scene: &Arc<Scene>,
        rays: &[(Ray, u32)],
        spec: StreamSpec,
    ) -> Result<Launch, String> {
        let mut session = Self::open(device, scene)?;
        session.load(rays, spec)?;
        session.trace(&tasks_of(rays.len() as u32, u32::MAX), None)
    }

    pub(crate) fn load(&mut self, rays: &[(Ray, u32)], spec: StreamSpec) -> Result<(), String> {
        let (rays, origins): (Vec<Ray>, Vec<u32>) = rays.iter().copied().unzip();
        // Where no ray has an origin, devices are spared the list.
        let origins = origins.iter().any(|&o| o != u32::MAX).then(|| origins.into());
        self.load_source(RaySource::Explicit { rays: rays.into(), origins }, spec)
    }

    pub(crate) fn load_source(&mut self, source: RaySource, spec: StreamSpec) -> Result<(), String> {
        (self.rays, self.spec) = (source.len(), spec);
        self.tracer.load_rays(source, spec).map_err(|e| format!("load_rays: {e}"))
    }

    pub(crate) fn trace(&mut self, tasks: &[Task], done: Option<&Arc<RayMask>>) -> Result<Launch, String> {
        let before = clock();
        let ticket = self.submit(tasks, done)?;
        let launch = self.wait(ticket, tasks)?;
        check_span(launch.span, before, clock())?;
        Ok(launch)
    }

    pub(crate) fn submit(&mut self, tasks: &[Task], done: Option<&Arc<RayMask>>) -> Result<Ticket, String> {
        self.tracer.submit(tasks, done).map_err(|e| format!("submit: {e}"))
    }

    /// Waits into a buffer full of rubbish, which must not show in what comes back.
    pub(crate) fn wait(&mut self, ticket: Ticket, tasks: &[Task]) -> Result<Launch, String> {
        let rubbish = Hit { t: -1.0, u: 9.0, v: 9.0, primitive: 77 };
        let mut launch = Launch {
            hits: vec![rubbish; 3],
            counts: vec![TestCounts { boxes: 9, triangles: 9 }; 5],
            ..Launch::default()
        };
        self.tracer.wait(ticket, LIMIT, &mut launch).map_err(|e| format!("wait: {e}"))?;
        let rays: usize = tasks.iter().map(|t| t.rays as usize).sum();
        let places = rays * self.spec.query.hits_per_ray();
        ensure!(launch.hits.len() == places, "{} hits for {rays} rays, not {places}", launch.hits.len());
        let counts = if self.spec.counts { rays } else { 0 };
        ensure!(launch.counts.len() == counts, "{} counts, not {counts}", launch.counts.len());
        let times = &launch.task_seconds;
        ensure!(times.is_empty() || times.len() == tasks.len(), "{} times of {} tasks", times.len(), tasks.len());
        ensure!(times.iter().all(|s| s.is_finite() && *s >= 0.0), "task times {times:?}");
        Ok(launch)
    }

    /// Walks `rays` and returns counts and hits.
    pub(crate) fn walk(&mut self, rays: &[u32], walk: Walk) -> Result<(Vec<TestCounts>, Vec<Hit>), String> {
        let mut counts = vec![TestCounts::default(); rays.len()];
        let mut hits = vec![Hit::MISS; rays.len()];
        let before = clock();
        let span = self.tracer.walk(rays, walk, &mut counts, Some(&mut hits)).map_err(|e| format!("walk: {e}"))?;
        check_span(span, before, clock())?;
        Ok((counts, hits))
    }

    /// The tracer itself, for calls that must fail.
    pub(crate) fn tracer(&mut self) -> &mut dyn Tracer {
        &mut *self.tracer
    }

    pub(crate) fn into_tracer(self) -> Box<dyn Tracer> {
        self.tracer
    }

    /// All loaded rays as one task.
    pub(crate) fn all(&self) -> Vec<Task> {
        tasks_of(self.rays, u32::MAX)
    }
}

fn check_span(span: Span, before: Duration, after: Duration) -> Result<(), String> {
    ensure!(span.start <= span.end, "the span ends before it starts: {span:?}");
    ensure!(span.in_kernel <= span.duration(), "more time in kernels than passed: {span:?}");
    ensure!(before <= span.start && span.end <= after, "{span:?} outside {before:?} ..= {after:?}, when it was asked");
    Ok(())
}

/// That a call was refused as wrong, which leaves the device as it was.
pub(crate) fn refused<T>(what: &str, answer: Result<T, rt_core::DeviceError>) -> Result<(), String> {
    match answer {
        Err(e) if e.kind() == DeviceErrorKind::InvalidArgument => Ok(()),
        Err(e) => Err(format!("{what}: {:?} ({e}), not InvalidArgument", e.kind())),
        Ok(_) => Err(format!("{what}: accepted")),
    }
}

/// That two lists of hits are the same bits.
pub(crate) fn same_hits(what: &str, found: &[Hit], expected: &[Hit]) -> Result<(), String> {
    ensure!(found.len() == expected.len(), "{what}: {} hits, not {}", found.len(), expected.len());
    let bits = |hit: &Hit| [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive];
    match found.iter().zip(expected).position(|(a, b)| bits(a) != bits(b)) {
        Some(i) => Err(format!("{what}: ray {i}: {:?}, not {:?}", found[i], expected[i])),
        None => Ok(()),
    }
}
