//! The streams of a path tracer, made in this one place for whoever renders, measures or checks.

use super::spawn::{Spawner, path};
use super::{Sun, Wave};
use rt_core::bounce::{Aim, Departure, Surfaces};
use rt_core::{BounceRays, Camera, CameraRays, Hit, Precision, Query, RaySource, StreamKind, StreamSpec};
use std::sync::Arc;

/// What all paths of an image have in common. A path is a ray from the camera with all that follows from it.
///
/// An image is the same to the bit however it is cut into waves: random numbers depend on the seed, the pixel, the
/// sample and the bounce alone.
#[derive(Clone, Debug)]
pub struct Paths {
    /// Where paths begin.
    pub camera: Camera,
    /// Width and height of the image in pixels.
    pub size: [u32; 2],
    /// Paths of each pixel; 0 counts as 1.
    pub samples: u32,
    /// Seed of all random numbers.
    pub seed: u32,
    /// What shadow rays go to.
    pub sun: Sun,
    /// What paths are scattered by.
    pub surfaces: Arc<Surfaces>,
}

/// Some of the samples of each pixel, which follow each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Samples {
    /// Number of the first.
    pub first: u32,
    /// How many, at least 1.
    pub count: u32,
}

impl Samples {
    /// All of so many; of 0 one.
    #[must_use]
    pub const fn all(count: u32) -> Self {
        Self { first: 0, count: if count == 0 { 1 } else { count } }
    }

    /// Where a path stands among those of these samples, that has the number `path` among those of all `all` of them:
    /// pixel by pixel, and for each sample by sample.
    #[must_use]
    pub const fn place(&self, path: u32, all: u32) -> u32 {
        let all = if all == 0 { 1 } else { all };
        path / all * self.count + path % all - self.first
    }
}

/// Rays of one kind, as paths send them.
#[derive(Clone, Debug)]
pub struct PathStream {
    /// The rays, which devices make themselves.
    pub source: RaySource,
    /// What made them.
    pub kind: StreamKind,
    /// What is asked of them.
    pub query: Query,
    /// Number of the pixel that the wave's first path belongs to.
    first: u32,
}

impl Paths {
    /// The rays with which the paths of a wave begin.
    #[must_use]
    pub fn primary(&self, wave: &Wave) -> PathStream {
        self.part(wave, Samples::all(self.samples))
    }

    /// Those of some of the samples of each pixel. They and all that follows from them are what they are among all.
    #[must_use]
    pub fn part(&self, wave: &Wave, Samples { first, count }: Samples) -> PathStream {
        let Self { camera, size, seed, .. } = *self;
        let (pixels, all_samples) = (Arc::clone(&wave.pixels), self.samples.max(1));
        let rays = CameraRays { camera, size, pixels, samples: count, first_sample: first, all_samples, seed };
        let source = RaySource::Camera(Arc::new(rays));
        PathStream { source, kind: StreamKind::Primary, query: Query::Closest, first: wave.first }
    }

    /// What follows where the rays of `stream` hit, which are primary or diffuse: rays to the sun, and the rays with
    /// which the paths go on. Either may be empty.
    #[must_use]
    pub fn follow(&self, stream: &PathStream, hits: &[Hit]) -> [PathStream; 2] {
        let [shadow, diffuse] = self.spawner(stream, hits).streams([self.sun.aim(), Aim::Cosine]);
        [stream.shadow(shadow), stream.diffuse(diffuse)]
    }

    /// The rays to the sun alone, where paths end.
    #[must_use]
    pub fn end(&self, stream: &PathStream, hits: &[Hit]) -> PathStream {
        let [shadow] = self.spawner(stream, hits).streams([self.sun.aim()]);
        stream.shadow(shadow)
    }

    fn spawner<'a>(&'a self, stream: &'a PathStream, hits: &'a [Hit]) -> Spawner<'a> {
        Spawner {
            surfaces: &self.surfaces,
            rays: &stream.source,
            hits,
            seed: self.seed,
            samples: self.samples,
            first_group: stream.first,
            bounce: stream.bounce(),
        }
    }
}

impl PathStream {
    /// The number of a ray's path in its wave: pixel by pixel, and for each sample by sample, those of other parts of
    /// the samples counted too.
    #[must_use]
    pub fn path(&self, ray: u32) -> u32 {
        path(&self.source, ray)
    }

    /// Where the rays leave; nothing for camera rays.
    #[must_use]
    pub fn departures(&self) -> &[Departure] {
        match &self.source {
            RaySource::Bounce(rays) => &rays.departures,
            RaySource::Camera(_) | RaySource::Explicit { .. } => &[],
        }
    }

    /// What is asked of each ray, with this precision and without counts.
    #[must_use]
    pub const fn spec(&self, precision: Precision) -> StreamSpec {
        StreamSpec::new(self.query, precision, false)
    }

    /// How often the paths have been scattered where these rays hit something.
    const fn bounce(&self) -> u32 {
        match self.kind {
            StreamKind::Diffuse(bounce) => bounce + 1,
            _ => 0,
        }
    }

    fn shadow(&self, rays: BounceRays) -> Self {
        let source = RaySource::Bounce(Arc::new(rays));
        Self { source, kind: StreamKind::Shadow(self.bounce()), query: Query::Any, first: self.first }
    }

    fn diffuse(&self, rays: BounceRays) -> Self {
        let source = RaySource::Bounce(Arc::new(rays));
        Self { source, kind: StreamKind::Diffuse(self.bounce()), query: Query::Closest, first: self.first }
    }
}
