//! The rays that follow from the hits of a stream.

use super::sampling::{basis, cosine_weighted, disc};
use super::surface::SurfacePoint;
use crate::Model;
use glam::{DVec3, Vec3};
use rt_core::{Hit, Ray, RaySource, random};
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

    fn push(&mut self, origin: Vec3, direction: Vec3, primitive: u32, parent: u32) {
        // At the edge of single precision a coordinate may have become infinite.
        if origin.is_finite() {
            self.rays.push(Ray::new(origin, direction));
            self.origins.push(primitive);
            self.parents.push(parent);
        }
    }
}

/// A directional light with an angular radius, such as the sun.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    direction: DVec3,
    tangent: DVec3,
    bitangent: DVec3,
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
        let direction = towards.as_dvec3().try_normalize()?;
        if !(0.0..std::f32::consts::FRAC_PI_2).contains(&radius) {
            return None;
        }
        let (tangent, bitangent) = basis(direction);
        let size = libm::tan(f64::from(radius));
        Some(Self { direction, tangent: tangent * size, bitangent: bitangent * size })
    }

    /// Unit vector towards the middle of the sun.
    #[must_use]
    pub fn direction(&self) -> Vec3 {
        self.direction.as_vec3()
    }

    /// A unit vector towards a point of the sun, spread evenly over a flat disc that is as large as the sun seems.
    fn sample(&self, uniform: [f32; 2]) -> DVec3 {
        let (x, y, _) = disc(uniform);
        (self.direction + self.tangent * x + self.bitangent * y).normalize()
    }
}

/// Makes the next streams from the hits of a traced one.
///
/// Random numbers come from [`random::spread_pair`] of (seed, group of the parent ray, bounce, number in the group), so
/// that the rays of one group fill the hemisphere and the sun evenly. Two streams that number their
/// rays from 0 (the waves of an image, the frames of an animation) need different seeds.
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
        self.spawn(range, 1, |point, uniform| Some(cosine_weighted(point.normal, uniform).as_vec3()))
    }

    /// For every hit of the rays `range`, a ray towards a random point of the sun, where the seen side faces that point:
    /// a question for [`rt_core::Query::Any`].
    ///
    /// A `range` beyond the rays or hits is cut; the whole stream is `0..hits.len()`.
    #[must_use]
    pub fn shadow(&self, sun: &Sun, range: Range<u32>) -> Spawned {
        self.spawn(range, 2, |point, uniform| {
            // At sunset only a part of the disc is above the surface: rays to the rest are left out.
            let direction = sun.sample(uniform).as_vec3();
            let above = point.normal.dot(direction.as_dvec3()) > LEAST_COSINE;
            above.then_some(direction)
        })
    }

    fn spawn(
        &self,
        range: Range<u32>,
        purpose: u32,
        direction: impl Fn(&SurfacePoint, [f32; 2]) -> Option<Vec3>,
    ) -> Spawned {
        // Dimension 0 belongs to positions inside a pixel.
        let dimension = self.bounce.wrapping_mul(2).wrapping_add(purpose);
        let end = range.end.min(self.rays.len()).min(u32::try_from(self.hits.len()).unwrap_or(u32::MAX));
        let start = range.start.min(end);
        let samples = self.samples.max(1);
        let uniform = |ray: u32| random::spread_pair(self.seed, ray / samples, dimension, ray % samples);
        let most = (end - start) as usize;
        let mut out = Spawned {
            rays: Vec::with_capacity(most),
            origins: Vec::with_capacity(most),
            parents: Vec::with_capacity(most),
        };
        for parent in start..end {
            let hit = &self.hits[parent as usize];
            // A miss has no triangle either.
            let Some(triangle) = self.model.triangle(hit.primitive) else { continue };
            let Some(point) = SurfacePoint::new(&triangle, hit, self.rays.ray(parent).0.direction) else { continue };
            if let Some(direction) = direction(&point, uniform(parent)) {
                out.push(point.origin(), direction, hit.primitive, parent);
            }
        }
        out
    }
}

/// Least cosine between a shadow ray and the normal: a lower one could be negative for the exact normal and direction,
/// given directions rounded to single precision (2⁻²⁴ per component).
const LEAST_COSINE: f64 = 1e-6;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn suns_have_a_direction_and_a_size() {
        assert!(Sun::new(Vec3::ZERO, 0.1).is_none());
        assert!(Sun::new(Vec3::NAN, 0.1).is_none());
        assert!(Sun::new(Vec3::Y, -0.1).is_none());
        assert!(Sun::new(Vec3::Y, f32::NAN).is_none());
        assert!(Sun::new(Vec3::Y, 2.0).is_none());
        let sun = Sun::new(Vec3::new(0.0, 1e-20, 1e-20), Sun::REAL_RADIUS).unwrap();
        for i in 0..1000 {
            let d = sun.sample(random::pair(1, i, 0));
            assert!((d.length() - 1.0).abs() < 1e-12);
            assert!(d.dot(sun.direction) >= f64::from(Sun::REAL_RADIUS).cos() - 1e-12);
        }
        assert_eq!(Sun::new(Vec3::Y, 0.0).unwrap().sample([0.3, 0.9]).as_vec3(), Vec3::Y);
    }
}
