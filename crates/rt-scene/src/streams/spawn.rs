//! The rays that leave where the rays of a stream hit.

use glam::Vec3;
use rayon::prelude::*;
use rt_core::bounce::{Aim, Departure, Scatter, Surfaces};
use rt_core::{BounceRays, Hit, Ray, RaySource};
use rt_simd::{Kernel, Loops};
use std::ops::Range;
use std::sync::Arc;

/// Hits that one core turns into rays at a time.
const CHUNK: u32 = 1 << 14;

/// Those of them that it looks at together.
const WINDOW: usize = 256;

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
        let kernel = Kernel::best();
        let chunk = |chunk: u32| {
            // Of a thread of the pool, which may have inherited another.
            let _environment = rt_fenv::Environment::enter();
            let range = chunk * CHUNK..rays.min((chunk + 1).saturating_mul(CHUNK));
            kernel.run(Departing { from: self, scatters: &scatters, range })
        };
        let chunks: Vec<[Vec<Departure>; N]> = (0..rays.div_ceil(CHUNK)).into_par_iter().map(chunk).collect();
        std::array::from_fn(|i| {
            let parts = || chunks.iter().map(|lists| &lists[i][..]);
            let surfaces = Arc::clone(self.surfaces);
            BounceRays { surfaces, departures: joined(parts), scatter: scatters[i] }
        })
    }
}

/// Where paths go on from a range of the hits.
struct Departing<'a, const N: usize> {
    from: &'a Spawner<'a>,
    scatters: &'a [Scatter; N],
    range: Range<u32>,
}

impl<const N: usize> Loops for Departing<'_, N> {
    type Output = [Vec<Departure>; N];

    #[inline(always)]
    fn run(self) -> Self::Output {
        let mut lists = [const { Vec::new() }; N];
        let mut window = Window::new();
        let may_overflow = self.from.surfaces.may_overflow();
        for first in self.range.clone().step_by(WINDOW) {
            window.depart(self.from, first..self.range.end.min(first + WINDOW as u32), may_overflow);
            for (list, scatter) in lists.iter_mut().zip(self.scatters) {
                window.leave(scatter, list);
            }
        }
        lists
    }
}

/// Some rays of a stream, and where their paths go on.
struct Window {
    rays: [Ray; WINDOW],
    origins: [u32; WINDOW],
    primitives: [u32; WINDOW],
    normals: [Vec3; WINDOW],
    /// Those that go on.
    departures: Vec<Departure>,
    /// Unit vectors on their sides.
    sides: Vec<Vec3>,
    paths: Vec<u32>,
    directions: [Vec3; WINDOW],
}

impl Window {
    fn new() -> Self {
        Self {
            rays: [Ray::new(Vec3::ZERO, Vec3::ZERO); WINDOW],
            origins: [0; WINDOW],
            primitives: [0; WINDOW],
            normals: [Vec3::ZERO; WINDOW],
            departures: Vec::with_capacity(WINDOW),
            sides: Vec::with_capacity(WINDOW),
            paths: Vec::with_capacity(WINDOW),
            directions: [Vec3::ZERO; WINDOW],
        }
    }

    /// Finds where the paths of some rays go on.
    #[inline(always)]
    fn depart(&mut self, spawner: &Spawner<'_>, range: Range<u32>, may_overflow: bool) {
        let hits = &spawner.hits[range.start as usize..range.end as usize];
        let (rays, normals) = (&mut self.rays[..hits.len()], &mut self.normals[..hits.len()]);
        let primitives = &mut self.primitives[..hits.len()];
        primitives.iter_mut().zip(hits).for_each(|(primitive, hit)| *primitive = hit.primitive);
        spawner.rays.rays(range.start, rays, &mut self.origins[..hits.len()]);
        spawner.surfaces.normals(primitives, normals);
        self.departures.clear();
        self.sides.clear();
        self.paths.clear();
        for (number, ((hit, ray), &normal)) in range.zip(hits.iter().zip(rays).zip(&*normals)) {
            // A miss has no triangle either.
            if normal == Vec3::ZERO {
                continue;
            }
            // Whether the ray saw the side away from the normal.
            let behind = normal.as_dvec3().dot(ray.direction.as_dvec3()) > 0.0;
            let Some(from) = Departure::new(hit, behind, path(spawner.rays, number)) else { continue };
            if may_overflow && !begins(spawner.surfaces, &from) {
                continue;
            }
            self.departures.push(from);
            self.sides.push(if behind { -normal } else { normal });
            self.paths.push(from.path);
        }
    }

    /// Adds those whose ray leaves the surface: at sunset only a part of the sun's disc is above it, and rays to the
    /// rest are left out.
    #[inline(always)]
    fn leave(&mut self, scatter: &Scatter, list: &mut Vec<Departure>) {
        let Aim::Disc { .. } = scatter.aim else { return list.extend_from_slice(&self.departures) };
        let directions = &mut self.directions[..self.departures.len()];
        scatter.directions(&self.sides, &self.paths, directions);
        let leaves = |side: &Vec3, direction: &Vec3| side.as_dvec3().dot(direction.as_dvec3()) > LEAST_COSINE;
        for ((from, side), direction) in self.departures.iter().zip(&self.sides).zip(&*directions) {
            list.extend(leaves(side, direction).then_some(*from));
        }
    }
}

/// Whether the ray begins at a point: at the edge of single precision a coordinate may become infinite.
fn begins(surfaces: &Surfaces, from: &Departure) -> bool {
    surfaces.get(from.primitive).is_some_and(|surface| from.origin(&surface).is_finite())
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

/// Least cosine between a shadow ray and the normal: a lower one could be negative for the exact normal and direction.
/// Each is off by some 2⁻²² in single precision.
const LEAST_COSINE: f64 = 1.0 / (1 << 19) as f64;
