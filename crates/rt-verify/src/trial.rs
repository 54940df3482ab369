//! One device under trial: rays in, hits out, and what it says instead.

use crate::suite::{Options, Stopped, Suite, Watch};
use rt_core::clock;
use rt_core::{
    Device, DeviceError, DeviceErrorKind, Hit, Launch, Precision, Query, Ray, RaySource, Scene, StreamSpec, TestCounts,
    Tracer, tasks_of,
};
use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// Most rays loaded at once: what every device has room for, and enough to occupy any.
const BATCH: usize = 1 << 18;

/// The longest that a launch of [`BATCH`] rays may take before the device counts as hung. Software rasterisers need
/// some seconds.
const LIMIT: Duration = Duration::from_secs(300);

/// Why a line about trees is skipped.
pub(crate) const OWN_TREES: &str = "this tracer builds its own trees";

/// Why a device gave no answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// It cannot do such things at all, and says so.
    Unsupported(String),
    /// It has no room for so much, and says so: no answer, but a fair one to a scene of gigabytes.
    OutOfMemory(String),
    /// It failed.
    Broken(String),
}

impl From<DeviceError> for Refusal {
    fn from(error: DeviceError) -> Self {
        match error.kind() {
            DeviceErrorKind::Unsupported => Self::Unsupported(error.to_string()),
            DeviceErrorKind::OutOfMemory => Self::OutOfMemory(error.to_string()),
            kind => Self::Broken(format!("{kind:?}: {error}")),
        }
    }
}

/// A device, how carefully it is to trace, and how much.
pub(crate) struct Trial<'a> {
    pub(crate) suite: &'a Suite,
    pub(crate) device: &'a dyn Device,
    pub(crate) precision: Precision,
    pub(crate) walks_our_trees: bool,
    /// [`crate::Subject::exact`].
    pub(crate) exact: bool,
    pub(crate) watch: Watch<'a>,
    /// Where the case that runs begins and how much of the whole it is, in shares of 1.
    pub(crate) span: Cell<[f64; 2]>,
    pub(crate) case: Cell<&'static str>,
}

impl Trial<'_> {
    pub(crate) fn options(&self) -> &Options {
        &self.suite.options
    }

    /// Tells how much of the running case is done (0 to 1) and asks whether to go on.
    pub(crate) fn advance(&self, share: f64) -> Result<(), Stopped> {
        let [start, length] = self.span.get();
        if let Some(progress) = self.watch.progress {
            progress(start + length * share.clamp(0.0, 1.0), self.case.get());
        }
        if self.watch.stop.is_some_and(|stop| stop.load(Ordering::Relaxed)) { Err(Stopped) } else { Ok(()) }
    }

    /// Makes a scene resident.
    pub(crate) fn open(&self, scene: &Arc<Scene>) -> Result<Session, Refusal> {
        let tracer = self.device.tracer(Arc::clone(scene), clock::now)?;
        Ok(Session { tracer, precision: self.precision })
    }

    /// Traces rays on a scene that is not needed again.
    pub(crate) fn trace(&self, scene: &Arc<Scene>, rays: &[(Ray, u32)], query: Query) -> Result<Vec<Hit>, Refusal> {
        self.open(scene)?.trace(rays, query)
    }
}

/// A scene resident on the device.
pub(crate) struct Session {
    tracer: Box<dyn Tracer>,
    precision: Precision,
}

impl Session {
    /// One hit for each ray; the number beside a ray is the primitive it starts on (`u32::MAX`: none).
    pub(crate) fn trace(&mut self, rays: &[(Ray, u32)], query: Query) -> Result<Vec<Hit>, Refusal> {
        let mut hits = Vec::with_capacity(rays.len());
        for batch in rays.chunks(BATCH) {
            hits.append(&mut self.launch(batch, query, false)?.hits);
        }
        Ok(hits)
    }

    /// What each ray costs in tests.
    pub(crate) fn counts(&mut self, rays: &[(Ray, u32)]) -> Result<Vec<TestCounts>, Refusal> {
        Ok(self.launch(rays, Query::Closest, true)?.counts)
    }

    fn launch(&mut self, rays: &[(Ray, u32)], query: Query, counts: bool) -> Result<Launch, Refusal> {
        let (rays, origins): (Vec<Ray>, Vec<u32>) = rays.iter().copied().unzip();
        let tasks = tasks_of(rays.len() as u32, u32::MAX);
        let expected = rays.len();
        // Where no ray has an origin, devices are spared the list.
        let origins = origins.iter().any(|&o| o != u32::MAX).then(|| origins.into());
        let spec = StreamSpec::new(query, self.precision, counts);
        self.tracer.load_rays(RaySource::Explicit { rays: rays.into(), origins }, spec)?;
        let ticket = self.tracer.submit(&tasks, None)?;
        let mut launch = Launch::default();
        self.tracer.wait(ticket, LIMIT, &mut launch)?;
        let enough = |length: usize, name: &str| match length {
            length if length == expected => Ok(()),
            length => Err(Refusal::Broken(format!("{length} {name} for {expected} rays"))),
        };
        enough(launch.hits.len(), "hits")?;
        if counts && launch.counts.is_empty() && expected > 0 {
            return Err(Refusal::Unsupported("the device does not count tests".to_owned()));
        }
        enough(if counts { launch.counts.len() } else { expected }, "counts")?;
        Ok(launch)
    }
}
