//! The rays that follow from the hits of a stream.

use crate::Model;
use glam::Vec3;
use rt_core::bounce::{Aim, Departure, Scatter, Surface, basis};
use rt_core::{Hit, Ray, RaySource};
use std::ops::Range;
use std::sync::Arc;

/// Rays that start on surfaces, with where they come from. The three lists are equally long.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spawned {
    /// The rays, in the order of their parents; `tmin = 0`, `tmax = ∞`, directions of unit length.
    pub rays: Vec<Ray>,
    /// The primitive each ray starts on, which it must not hit.
    pub origins: Vec<u32>,
    /// For each ray, the number of the ray in the stream before from whose hit it starts.
    pub parents: Vec<u32>,
}

impl Spawned {
    /// Puts the rays of a later range behind these.
    pub fn append(&mut self, mut later: Self) {
        self.rays.append(&mut later.rays);
        self.origins.append(&mut later.origins);
        self.parents.append(&mut later.parents);
    }

    /// The rays as a tracer loads them, and the parents.
    #[must_use]
    pub fn into_source(self) -> (RaySource, Vec<u32>) {
        let origins: Arc<[u32]> = self.origins.into();
        (RaySource::Explicit { rays: self.rays.into(), origins: Some(origins) }, self.parents)
    }
}

/// A directional light with an angular radius, such as the sun.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    middle: Vec3,
    radii: [Vec3; 2],
}

impl Sun {
    /// Angular radius of the sun as seen from the earth, in radians: half of 0.533 degrees.
    pub const REAL_RADIUS: f32 = 0.004_65;

    /// A sun in the direction `towards` (of any length), whose disc has the angular radius `radius` in radians; 0 gives
    /// hard shadows.
    ///
    /// `None` when `towards` is zero or not finite, or `radius` is not in `0 ≤ radius < π/2`.
    #[must_use]
    pub fn new(towards: Vec3, radius: f32) -> Option<Self> {
        let middle = towards.as_dvec3().try_normalize()?.as_vec3();
        if !(0.0..std::f32::consts::FRAC_PI_2).contains(&radius) {
            return None;
        }
        let (tangent, bitangent) = basis(middle);
        let size = libm::tan(f64::from(radius)) as f32;
        Some(Self { middle, radii: [tangent * size, bitangent * size] })
    }

    /// Unit vector towards the middle of the sun.
    #[must_use]
    pub const fn direction(&self) -> Vec3 {
        self.middle
    }

    /// Where rays to the sun go: to points spread evenly over a flat disc that is as large as the sun seems.
    #[must_use]
    pub const fn aim(&self) -> Aim {
        Aim::Disc { middle: self.middle, radii: self.radii }
    }
}

/// Finds the rays that follow from the hits of a traced stream, and makes them.
///
/// What they are is defined in [`rt_core::bounce`]. [`Spawner::departures`] names them in half the memory, for a
/// [`rt_core::BounceRays`] that devices make themselves.
#[derive(Clone, Copy, Debug)]
pub struct Spawner<'a> {
    /// The traced model.
    pub model: &'a Model,
    /// The rays of the traced stream.
    pub rays: &'a RaySource,
    /// Their hits, one for each ray.
    pub hits: &'a [Hit],
    /// Seed of the random numbers.
    pub seed: u32,
    /// Consecutive rays that are summed up in the end, as those of one pixel; 0 counts as 1.
    pub samples: u32,
    /// Number of bounces before: 0 for the hits of primary rays.
    pub bounce: u32,
}

impl Spawner<'_> {
    /// For every hit of the rays `range`, a diffuse ray: cosine-weighted about the normal on the side that was seen.
    ///
    /// A `range` beyond the rays or hits is cut; the whole stream is `0..hits.len()`.
    #[must_use]
    pub fn diffuse(&self, range: Range<u32>) -> Spawned {
        self.spawn(Aim::Cosine, range)
    }

    /// For every hit of the rays `range`, a ray towards a random point of the sun, where the seen side faces that point:
    /// a question for [`rt_core::Query::Any`].
    ///
    /// A `range` beyond the rays or hits is cut; the whole stream is `0..hits.len()`.
    #[must_use]
    pub fn shadow(&self, sun: &Sun, range: Range<u32>) -> Spawned {
        self.spawn(sun.aim(), range)
    }

    /// How directions are drawn that go to `aim`.
    #[must_use]
    pub const fn scatter(&self, aim: Aim) -> Scatter {
        Scatter { aim, seed: self.seed, samples: self.samples, bounce: self.bounce }
    }

    /// Where the rays leave that [`Spawner::diffuse`] or [`Spawner::shadow`] would make, for each of `aims`: all in one
    /// pass over the hits, since most of the work is to find the surface.
    #[must_use]
    pub fn departures<const N: usize>(&self, aims: [Aim; N], range: Range<u32>) -> [Vec<Departure>; N] {
        let scatters = aims.map(|aim| self.scatter(aim));
        let mut lists = [const { Vec::new() }; N];
        for parent in self.cut(range) {
            let Some((from, surface)) = self.departure(parent) else { continue };
            for (list, scatter) in lists.iter_mut().zip(&scatters) {
                list.extend(leaves(scatter, &surface, &from).then_some(from));
            }
        }
        lists
    }

    fn spawn(&self, aim: Aim, range: Range<u32>) -> Spawned {
        let (scatter, range) = (self.scatter(aim), self.cut(range));
        let mut out = Spawned {
            rays: Vec::with_capacity(range.len()),
            origins: Vec::with_capacity(range.len()),
            parents: Vec::with_capacity(range.len()),
        };
        for parent in range {
            let Some((from, surface)) = self.departure(parent) else { continue };
            if !leaves(&scatter, &surface, &from) {
                continue;
            }
            out.rays.push(scatter.ray(&surface, &from));
            out.origins.push(from.primitive);
            out.parents.push(parent);
        }
        out
    }

    fn cut(&self, range: Range<u32>) -> Range<u32> {
        let end = range.end.min(self.rays.len()).min(u32::try_from(self.hits.len()).unwrap_or(u32::MAX));
        range.start.min(end)..end
    }

    /// Where rays leave that follow from the hit of ray `parent`; `None` where none can.
    fn departure(&self, parent: u32) -> Option<(Departure, Surface)> {
        let hit = &self.hits[parent as usize];
        // A miss has no triangle either.
        let surface = Surface::new(&self.model.triangle(hit.primitive)?, 0)?;
        let from = Departure::new(hit, surface.is_seen_from_behind(&self.rays.ray(parent).0), parent)?;
        // At the edge of single precision a coordinate may become infinite.
        (!surface.may_overflow() || from.origin(&surface).is_finite()).then_some((from, surface))
    }
}

/// Whether the ray leaves the surface: at sunset only a part of the sun's disc is above it, and rays to the rest are
/// left out.
fn leaves(scatter: &Scatter, surface: &Surface, from: &Departure) -> bool {
    let Aim::Disc { .. } = scatter.aim else { return true };
    let normal = from.normal(surface);
    normal.as_dvec3().dot(scatter.direction(normal, from.parent).as_dvec3()) > LEAST_COSINE
}

/// Least cosine between a shadow ray and the normal: a lower one could be negative for the exact normal and direction.
/// Each is off by some 2⁻²² in single precision.
const LEAST_COSINE: f64 = 1.0 / (1 << 19) as f64;

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::random;

    #[test]
    fn suns_have_a_direction_and_a_size() {
        assert!(Sun::new(Vec3::ZERO, 0.1).is_none());
        assert!(Sun::new(Vec3::NAN, 0.1).is_none());
        assert!(Sun::new(Vec3::Y, -0.1).is_none());
        assert!(Sun::new(Vec3::Y, f32::NAN).is_none());
        assert!(Sun::new(Vec3::Y, 2.0).is_none());
        let sun = Sun::new(Vec3::new(0.0, 1e-20, 1e-20), Sun::REAL_RADIUS).unwrap();
        for i in 0..1000 {
            let d = sun.aim().direction(Vec3::Z, random::pair(1, i, 0)).as_dvec3();
            assert!((d.length() - 1.0).abs() < 3e-7);
            // Of so small an angle the cosine says too little in single precision.
            assert!(d.cross(sun.direction().as_dvec3()).length() <= f64::from(Sun::REAL_RADIUS) + 2e-7);
        }
        assert_eq!(Sun::new(Vec3::Y, 0.0).unwrap().aim().direction(Vec3::Z, [0.3, 0.9]).normalize(), Vec3::Y);
    }
}
