//! The seams of a backend: [`Device`] and [`Tracer`].

use crate::{BounceRays, CameraRays, DeviceInfo, Hit, Precision, Query, Ray, RayMask, Scene, Task, TestCounts, Walk};
use alloc::boxed::Box;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::error::Error;
use core::fmt::{self, Debug};
use core::time::Duration;

/// Time since an origin that all devices of a process share. A function, so that `no_std` code can hold one.
pub type Clock = fn() -> Duration;

/// A processing unit that can hold a scene: a set of CPU cores, a GPU. Opened once.
pub trait Device: Send + Sync + Debug {
    /// What the device is.
    fn info(&self) -> &DeviceInfo;

    /// Makes the scene resident. Devices that share the host's memory copy nothing.
    ///
    /// # Errors
    /// When the scene does not fit or the device is lost.
    fn tracer(&self, scene: Arc<Scene>, clock: Clock) -> Result<Box<dyn Tracer>, DeviceError>;
}

/// One scene resident on one device.
///
/// Launches run in the order in which they were submitted. [`DeviceErrorKind::InvalidArgument`] leaves the tracer as it
/// was; so does [`DeviceErrorKind::Unsupported`] where rays are loaded or walked, or the scene moves. After any other
/// error the tracer is lost: the driver drops it and gives its tasks to others. So it does when a call panics, does not
/// return in time, or answers what is not true. A driver may drop a tracer at any time, with launches in flight, and on
/// another thread than it was made on.
pub trait Tracer: Send + Debug {
    /// Does beforehand what a stream of this kind will need once, and samples of it by `walk`: compiling kernels, say.
    /// So it is not timed with the rays; results do not depend on it. What fails is told when it is needed. Launches in
    /// flight must have been waited for.
    fn prepare(&mut self, source: &RaySource, spec: StreamSpec, walk: Option<Walk>) {
        let _ = (source, spec, walk);
    }

    /// Goes on with a scene that has the tree of its own ([`Scene::has_tree_of`]) over triangles that have moved, and
    /// brings to the device no more than what is new of it. Rays are to be loaded anew. Launches in flight must have
    /// been waited for.
    ///
    /// # Errors
    /// [`DeviceErrorKind::Unsupported`], with the tracer as it was, when it cannot do that: then a tracer of the scene
    /// is to be made. When a launch is in flight, or the device is lost.
    fn move_scene(&mut self, scene: Arc<Scene>) -> Result<(), DeviceError> {
        let _ = scene;
        let what = "it takes a scene that has moved as any other: make a tracer of it";
        Err(DeviceError::new(DeviceErrorKind::Unsupported, what))
    }

    /// Replaces the rays. Launches in flight must have been waited for.
    ///
    /// # Errors
    /// When the rays do not fit, or a launch is in flight; [`DeviceErrorKind::Unsupported`], with the device as it was,
    /// when it cannot do what `spec` asks.
    fn load_rays(&mut self, source: RaySource, spec: StreamSpec) -> Result<(), DeviceError>;

    /// Walks single rays and counts their tests; blocks until done. [`Walk::Full`] does what launches of the stream do:
    /// it passes by what the stream's mask hides, and looks for as many hits as that asks for.
    ///
    /// `counts` has one entry for each of `rays`. So has `hits`, which [`Walk::Full`] fills if given; of
    /// [`Query::All`] with the nearest.
    ///
    /// # Errors
    /// When the lengths differ, an index is not a loaded ray's, or the device is lost;
    /// [`DeviceErrorKind::Unsupported`], with the device as it was, when it has no such walk.
    fn walk(
        &mut self,
        rays: &[u32],
        walk: Walk,
        counts: &mut [TestCounts],
        hits: Option<&mut [Hit]>,
    ) -> Result<Span, DeviceError>;

    /// Starts one launch that traces `tasks`, leaving out rays in `done`.
    ///
    /// # Errors
    /// When a task names rays that are not loaded, too many launches are in flight, or the device is lost.
    fn submit(&mut self, tasks: &[Task], done: Option<&Arc<RayMask>>) -> Result<Ticket, DeviceError>;

    /// Waits for a launch at most `limit` and takes its results into `out`, whose buffers are reused.
    ///
    /// # Errors
    /// [`DeviceErrorKind::Hung`] when the limit passed; otherwise when the ticket is unknown or the device is lost.
    fn wait(&mut self, ticket: Ticket, limit: Duration, out: &mut Launch) -> Result<(), DeviceError>;

    /// What went between host and device since the tracer was made. Nothing, for a device that is the host.
    fn traffic(&self) -> Traffic {
        Traffic::default()
    }

    /// What people should know of how the scene is held, such as that it is not as was asked for.
    fn note(&self) -> Option<&str> {
        None
    }
}

/// What a tracer's device and the host had to do with each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Bytes copied to the device: rays and lists of rays, not the scene.
    pub uploaded: u64,
    /// Bytes of the scene that were copied to it when that moved.
    pub scene: u64,
    /// Bytes copied back: hits and counts.
    pub downloaded: u64,
    /// Rays of launches and walks that the device left to the host.
    pub on_host: u64,
    /// Those of them whose answer by the device the host refused.
    pub refused: u64,
}

impl Traffic {
    /// What came after `earlier`.
    #[must_use]
    pub const fn since(&self, earlier: &Self) -> Self {
        Self {
            uploaded: self.uploaded.saturating_sub(earlier.uploaded),
            scene: self.scene.saturating_sub(earlier.scene),
            downloaded: self.downloaded.saturating_sub(earlier.downloaded),
            on_host: self.on_host.saturating_sub(earlier.on_host),
            refused: self.refused.saturating_sub(earlier.refused),
        }
    }
}

/// Where a stream's rays come from.
#[derive(Clone, Debug)]
pub enum RaySource {
    /// Rays in memory. `origins` holds, for each ray, the primitive it starts on and must not hit (`u32::MAX`: none).
    Explicit {
        /// The rays.
        rays: Arc<[Ray]>,
        /// The primitive each ray starts on, as long as `rays`.
        origins: Option<Arc<[u32]>>,
    },
    /// Camera rays, made on the device.
    Camera(Arc<CameraRays>),
    /// Rays that leave surfaces, made on the device.
    Bounce(Arc<BounceRays>),
}

impl RaySource {
    /// Number of rays; saturates at `u32::MAX`.
    #[must_use]
    pub fn len(&self) -> u32 {
        match self {
            Self::Explicit { rays, .. } => u32::try_from(rays.len()).unwrap_or(u32::MAX),
            Self::Camera(camera) => camera.len(),
            Self::Bounce(bounce) => bounce.len(),
        }
    }

    /// Whether there is no ray.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Ray `index`, which must be below [`RaySource::len`], and the primitive it starts on (`u32::MAX`: none).
    #[inline]
    #[must_use]
    pub fn ray(&self, index: u32) -> (Ray, u32) {
        match self {
            Self::Explicit { rays, origins } => {
                (rays[index as usize], origins.as_ref().map_or(u32::MAX, |o| o[index as usize]))
            }
            Self::Camera(camera) => (camera.ray(index), u32::MAX),
            Self::Bounce(bounce) => bounce.ray(index),
        }
    }

    /// As many rays as there is room for, from number `first` on, which must all be below [`RaySource::len`]; and, in
    /// as many places, the primitives that they start on.
    ///
    /// # Panics
    /// When there are not as many places for the one as for the other.
    // To be compiled for the instructions of the caller.
    #[inline(always)]
    pub fn rays(&self, first: u32, rays: &mut [Ray], origins: &mut [u32]) {
        assert_eq!(rays.len(), origins.len(), "a primitive for each ray");
        match self {
            Self::Camera(camera) => {
                camera.rays(first, rays);
                origins.fill(u32::MAX);
            }
            Self::Bounce(bounce) => bounce.rays(first, rays, origins),
            Self::Explicit { .. } => {
                for ((ray, origin), index) in rays.iter_mut().zip(origins).zip(first..) {
                    (*ray, *origin) = self.ray(index);
                }
            }
        }
    }

    /// The rays of these numbers, which must all be below [`RaySource::len`], and the primitives that they start on.
    ///
    /// # Panics
    /// When there are not as many places of either kind as numbers.
    #[inline(always)]
    pub fn rays_of(&self, numbers: &[u32], rays: &mut [Ray], origins: &mut [u32]) {
        assert!(rays.len() == numbers.len() && origins.len() == numbers.len(), "two places for each ray");
        match (self, numbers) {
            // All that are between the first and the last.
            (_, &[first, .., last])
                if (last.wrapping_sub(first) as usize).wrapping_add(1) == numbers.len()
                    && numbers.is_sorted_by(|a, b| a < b) =>
            {
                self.rays(first, rays, origins);
            }
            (Self::Camera(camera), _) => {
                camera.rays_of(numbers, rays);
                origins.fill(u32::MAX);
            }
            (Self::Bounce(bounce), _) => bounce.rays_of(numbers, rays, origins),
            _ => {
                for ((ray, origin), &number) in rays.iter_mut().zip(origins).zip(numbers) {
                    (*ray, *origin) = self.ray(number);
                }
            }
        }
    }
}

/// What is asked of every ray of a stream; a kernel does only that.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct StreamSpec {
    /// Nearest hit, any, or several.
    pub query: Query,
    /// How carefully.
    pub precision: Precision,
    /// Whether launches return exact counts beside the hits.
    pub counts: bool,
    /// Whose tests those counts are, and those of walks. It changes no hit of [`Query::Closest`].
    pub counted: CountedTree,
    /// What the caller knows of rays that follow each other. It changes no hit.
    pub coherence: Coherence,
    /// Rays hit the primitives whose mask has one of these bits ([`Scene::with_masks`]); usually all.
    pub mask: u32,
}

/// Whose tests a stream counts, in launches and walks alike.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum CountedTree {
    /// Those of the device's own traversal: the cheapest way that it has.
    #[default]
    Own,
    /// Those of the scene's tree ([`Scene::nodes`]), where the device can count them: the same on every such device.
    Scene,
}

/// Whether rays that follow each other in a stream take similar paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Coherence {
    /// Not known: taken from what made the rays, where that says it.
    #[default]
    Unknown,
    /// They do: neighbours of a picture, rays sorted by where they start and where they go.
    Coherent,
    /// They do not.
    Incoherent,
}

impl StreamSpec {
    /// What is asked of each ray, of which nothing else is known.
    #[must_use]
    pub const fn new(query: Query, precision: Precision, counts: bool) -> Self {
        Self { query, precision, counts, counted: CountedTree::Own, coherence: Coherence::Unknown, mask: u32::MAX }
    }
}

impl Default for StreamSpec {
    /// The nearest hit of each ray, carefully, and no counts.
    fn default() -> Self {
        Self::new(Query::default(), Precision::default(), false)
    }
}

/// A launch in flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Ticket(pub u64);

/// When a device worked, on the clock its tracer was given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Span {
    /// First instruction, or the submission where that is unknown.
    pub start: Duration,
    /// Results on the host.
    pub end: Duration,
    /// Time spent in kernels, at most `end − start`.
    pub in_kernel: Duration,
}

impl Span {
    /// `end − start`.
    #[must_use]
    pub const fn duration(&self) -> Duration {
        self.end.saturating_sub(self.start)
    }

    /// Time that the device was busy: in kernels, or all where those are not timed.
    #[must_use]
    pub const fn busy(&self) -> Duration {
        if self.in_kernel.is_zero() { self.duration() } else { self.in_kernel }
    }
}

/// The results of a launch.
#[derive(Clone, Debug, Default)]
pub struct Launch {
    /// [`Query::hits_per_ray`] for each ray of the launch's tasks, in their order. [`Hit::MISS`] for rays that were
    /// left out.
    pub hits: Vec<Hit>,
    /// Exact counts beside the hits; empty unless the stream asked for them.
    pub counts: Vec<TestCounts>,
    /// Device seconds of each task, in order; empty where only the launch's time is known. On processors the threads'
    /// own time divided by their number, so that what the system ran in between does not count.
    pub task_seconds: Vec<f32>,
    /// When the launch ran.
    pub span: Span,
}

impl Launch {
    /// Empties the buffers, keeping their memory.
    pub fn clear(&mut self) {
        self.hits.clear();
        self.counts.clear();
        self.task_seconds.clear();
        self.span = Span::default();
    }
}

/// What kind of failure a [`DeviceError`] is: enough to react to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum DeviceErrorKind {
    /// The call was wrong; the device is as it was.
    InvalidArgument,
    /// Scene or rays do not fit.
    OutOfMemory,
    /// The device cannot do what was asked at all.
    Unsupported,
    /// The device stopped working.
    Lost,
    /// A launch did not end within its limit.
    Hung,
    /// The backend panicked.
    Panicked,
    /// What the device answered cannot be true.
    WrongAnswer,
}

/// Why a device failed.
#[derive(Debug)]
pub struct DeviceError {
    kind: DeviceErrorKind,
    message: String,
    source: Option<Box<dyn Error + Send + Sync>>,
}

impl DeviceError {
    /// An error with a message that names what was asked and what to do.
    #[must_use]
    pub fn new(kind: DeviceErrorKind, message: impl Into<String>) -> Self {
        Self { kind, message: message.into(), source: None }
    }

    /// Adds the driver's own error.
    #[must_use]
    pub fn with_source(mut self, source: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        self.source = Some(source.into());
        self
    }

    /// The kind of failure.
    #[must_use]
    pub const fn kind(&self) -> DeviceErrorKind {
        self.kind
    }
}

impl fmt::Display for DeviceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl Error for DeviceError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.source.as_ref().map(|e| &**e as &(dyn Error + 'static))
    }
}
