//! The rays that leave where the rays of a stream hit.

use rayon::prelude::*;
use rt_core::bounce::{Aim, Departure, Scatter, Surface, Surfaces};
use rt_core::{BounceRays, Hit, RaySource};
use std::ops::Range;
use std::sync::Arc;

/// Hits that one core turns into rays at a time.
const CHUNK: u32 = 1 << 14;

/// Finds the rays that follow from the hits of a traced stream.
///
/// What they are is defined in [`rt_core::bounce`]. A ray depends on its path, the seed and the bounce, never on
/// threads, on chunks or on which other rays hit.
#[derive(Clone, Copy, Debug)]
pub struct Spawner<'a> {
    /// The triangles of the traced scene.
    pub surfaces: &'a Arc<Surfaces>,
    /// The rays of the traced stream.
    pub rays: &'a RaySource,
    /// Their hits, one for each ray.
    pub hits: &'a [Hit],
    /// Seed of the random numbers.
    pub seed: u32,
    /// Consecutive paths that are summed up in the end, as those of one pixel; 0 counts as 1.
    pub samples: u32,
    /// Number of the first path's group among all of the image.
    pub first_group: u32,
    /// Number of bounces before: 0 for the hits of primary rays.
    pub bounce: u32,
}

impl Spawner<'_> {
    /// A ray for each hit that can send one to `aim`, in the order of the paths; all `N` lists in one pass over the
    /// hits, since most of the work is to find the surface.
    ///
    /// Rays that go about the normal leave on the side that was seen. Rays to a disc leave where the seen side faces
    /// the point that is drawn of it; they are a question for [`rt_core::Query::Any`].
    #[must_use]
    pub fn streams<const N: usize>(&self, aims: [Aim; N]) -> [BounceRays; N] {
        let scatters = aims.map(|aim| Scatter {
            aim,
            seed: self.seed,
            samples: self.samples,
            first_group: self.first_group,
            bounce: self.bounce,
        });
        let rays = self.rays.len().min(u32::try_from(self.hits.len()).unwrap_or(u32::MAX));
        let chunk = |chunk: u32| self.departures(&scatters, chunk * CHUNK..rays.min((chunk + 1).saturating_mul(CHUNK)));
        let chunks: Vec<[Vec<Departure>; N]> = (0..rays.div_ceil(CHUNK)).into_par_iter().map(chunk).collect();
        std::array::from_fn(|i| {
            let parts = || chunks.iter().map(|lists| &lists[i][..]);
            let surfaces = Arc::clone(self.surfaces);
            BounceRays { surfaces, departures: joined(parts), scatter: scatters[i] }
        })
    }

    fn departures<const N: usize>(&self, scatters: &[Scatter; N], range: Range<u32>) -> [Vec<Departure>; N] {
        // Of a thread of the pool, which may have inherited another.
        let _environment = rt_fenv::Environment::enter();
        let mut lists = [const { Vec::new() }; N];
        for ray in range {
            let Some((from, surface)) = self.departure(ray) else { continue };
            for (list, scatter) in lists.iter_mut().zip(scatters) {
                list.extend(leaves(scatter, &surface, &from).then_some(from));
            }
        }
        lists
    }

    /// Where the path of ray number `ray` goes on; `None` where it ends.
    fn departure(&self, ray: u32) -> Option<(Departure, Surface)> {
        let hit = &self.hits[ray as usize];
        // A miss has no triangle either.
        let surface = self.surfaces.get(hit.primitive)?;
        let path = path(self.rays, ray);
        let from = Departure::new(hit, surface.is_seen_from_behind(&self.rays.ray(ray).0), path)?;
        // At the edge of single precision a coordinate may become infinite.
        (!surface.may_overflow() || from.origin(&surface).is_finite()).then_some((from, surface))
    }
}

/// The number of the path that a ray belongs to. Camera rays, and rays of unknown origin, begin one each.
pub(super) fn path(rays: &RaySource, ray: u32) -> u32 {
    match rays {
        RaySource::Bounce(bounce) => bounce.departures[ray as usize].path,
        RaySource::Camera(camera) => camera.path(ray),
        RaySource::Explicit { .. } => ray,
    }
}

/// The parts behind each other, in memory that is asked for once.
fn joined<'a, I: Iterator<Item = &'a [Departure]>>(parts: impl Fn() -> I) -> Arc<[Departure]> {
    const NOWHERE: Departure = Departure { weights: [0; 2], primitive: u32::MAX, path: 0 };
    let count = parts().map(<[Departure]>::len).sum();
    let mut all: Arc<[Departure]> = std::iter::repeat_n(NOWHERE, count).collect();
    let mut rest = Arc::get_mut(&mut all).expect("nobody else has it yet");
    for part in parts() {
        let (place, behind) = rest.split_at_mut(part.len());
        place.copy_from_slice(part);
        rest = behind;
    }
    all
}

/// Whether the ray leaves the surface: at sunset only a part of the sun's disc is above it, and rays to the rest are
/// left out.
fn leaves(scatter: &Scatter, surface: &Surface, from: &Departure) -> bool {
    let Aim::Disc { .. } = scatter.aim else { return true };
    let normal = from.normal(surface);
    normal.as_dvec3().dot(scatter.direction(normal, from.path).as_dvec3()) > LEAST_COSINE
}

/// Least cosine between a shadow ray and the normal: a lower one could be negative for the exact normal and direction.
/// Each is off by some 2⁻²² in single precision.
const LEAST_COSINE: f64 = 1.0 / (1 << 19) as f64;
