//! Rays by number: random, aimed where kernels leak, along the axes, and as a path tracer would send them.

use core::f32::consts::TAU;
use glam::Vec3;
use rt_core::{Aabb, Ray, Triangle, random};

/// What a ray is aimed at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Aim {
    /// From one random point in and around the scene to another.
    Random,
    /// At the inside of a random triangle.
    Interior,
    /// At a point on an edge of a random triangle, as exactly as single precision allows.
    Edge,
    /// Exactly at a vertex of a random triangle.
    Vertex,
    /// Along an axis in either sense, with zero components of either sign.
    Axis,
    /// From the inside of a random triangle into a random direction; that triangle is left out.
    Diffuse,
    /// From the inside of a random triangle to just before that of another one, as to a light; the first is left out.
    Shadow,
}

impl Aim {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Random, Self::Interior, Self::Edge, Self::Vertex, Self::Axis, Self::Diffuse, Self::Shadow];
}

/// How far a shadow ray goes, of the way to its light: 1/64 short, so that the light itself is beyond any rounding.
const SHADOW_END: f32 = 63.0 / 64.0;

/// Of the largest extent, the share that any other counts as at least: see `RayMaker::around`.
const FLAT: f32 = 0.125;

/// Makes rays for one set of triangles; the same seed makes the same rays.
#[derive(Clone, Copy, Debug)]
pub struct RayMaker<'a> {
    triangles: &'a [Triangle],
    bounds: Aabb,
    seed: u32,
}

impl<'a> RayMaker<'a> {
    /// A maker for `triangles`; without any, rays are aimed into the unit cube.
    #[must_use]
    pub fn new(triangles: &'a [Triangle], seed: u32) -> Self {
        let finite = triangles.iter().filter(|t| t.is_finite());
        let bounds = finite.map(Triangle::bounds).reduce(Aabb::union);
        Self { triangles, bounds: bounds.unwrap_or(Aabb { min: Vec3::ZERO, max: Vec3::ONE }), seed }
    }

    /// Ray `index` aimed at `aim`, and the primitive it starts on (`u32::MAX`: none).
    #[must_use]
    pub fn ray(&self, aim: Aim, index: u32) -> (Ray, u32) {
        let from = self.around(index, 0);
        let chosen = random::below(self.triangles.len() as u32, self.seed, index, 1);
        let triangle = self.triangles.get(chosen as usize).filter(|t| t.is_finite());
        let Some(triangle) = triangle else { return (toward(from, self.around(index, 2)), u32::MAX) };
        let [a, b, c] = triangle.vertices();
        let [x, y] = random::pair(self.seed, index, 3);
        let (u, v) = if x + y > 1.0 { (1.0 - x, 1.0 - y) } else { (x, y) };
        let inside = a + (b - a) * u + (c - a) * v;
        match aim {
            Aim::Random => (toward(from, self.around(index, 2)), u32::MAX),
            Aim::Interior => (toward(from, inside), u32::MAX),
            Aim::Edge => (toward(from, b + (c - b) * x), u32::MAX),
            Aim::Vertex => (toward(from, [a, b, c][index as usize % 3]), u32::MAX),
            Aim::Axis => {
                let mut direction = if index & 8 == 0 { Vec3::ZERO } else { Vec3::splat(-0.0) };
                direction[index as usize % 3] = if index & 16 == 0 { 1.0 } else { -1.0 };
                let through = if index & 32 == 0 { from } else { a };
                let back = (self.bounds.extent() + Vec3::ONE).max_element();
                let origin = if index & 64 == 0 { through } else { through - direction * back };
                (Ray::new(origin, direction), u32::MAX)
            }
            Aim::Diffuse => (Ray::new(inside, sphere(random::pair(self.seed, index, 4))), chosen),
            Aim::Shadow => {
                let other = random::below(self.triangles.len() as u32, self.seed, index, 5);
                let light = self.triangles.get(other as usize).filter(|t| t.is_finite()).unwrap_or(triangle);
                let centre = light.a + ((light.b - light.a) + (light.c - light.a)) / 3.0;
                (toward(inside, centre).with_range(0.0, SHADOW_END), chosen)
            }
        }
    }

    /// Rays `0 .. count`, all kinds of [`Aim`] in turn.
    #[must_use]
    pub fn mixed(&self, count: u32) -> Vec<(Ray, u32)> {
        (0..count).map(|i| self.ray(Aim::ALL[i as usize % Aim::ALL.len()], i)).collect()
    }

    /// A random point in the bounds grown by half their extent on all sides; along axes where that is next to nothing, by as much
    /// as an eighth of the largest, lest all rays on a flat scene run in its plane.
    fn around(&self, index: u32, dimension: u32) -> Vec3 {
        let unit = Vec3::from(random::pcg3d([self.seed, index, dimension]).map(random::unit));
        let Aabb { min, max } = self.bounds;
        let extent = self.bounds.extent();
        let extent = extent.max(Vec3::splat(extent.max_element() * FLAT));
        min * 0.5 + max * 0.5 + extent * (unit * 2.0 - 1.0)
    }
}

/// The half line from `from` through `to`; along an axis where both are one point.
fn toward(from: Vec3, to: Vec3) -> Ray {
    let direction = to - from;
    Ray::new(from, if direction == Vec3::ZERO { Vec3::Z } else { direction })
}

/// A uniform direction from two uniform numbers.
pub(crate) fn sphere([x, y]: [f32; 2]) -> Vec3 {
    let z = 1.0 - 2.0 * x;
    let (sin, cos) = (TAU * y).sin_cos();
    let r = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(r * cos, r * sin, z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{brute, shapes};

    #[test]
    fn rays_are_reproducible_valid_and_mostly_hit_what_they_aim_at() {
        let triangles = shapes::icosphere(2);
        let maker = RayMaker::new(&triangles, 3);
        for aim in Aim::ALL {
            let rays: Vec<_> = (0..200).map(|i| maker.ray(aim, i)).collect();
            assert!(rays.iter().all(|(ray, _)| ray.is_valid()));
            assert_eq!(rays[17], maker.ray(aim, 17));
            let hits = rays.iter().filter(|(ray, origin)| brute::any(&triangles, ray, *origin)).count();
            // Of those aimed at an edge, some pass just beside the silhouette; inside a sphere, nothing is in the
            // shadow.
            let least = match aim {
                Aim::Interior | Aim::Edge | Aim::Vertex => 180,
                Aim::Shadow => 0,
                Aim::Random | Aim::Axis | Aim::Diffuse => 50,
            };
            assert!(hits >= least, "{aim:?}: {hits}");
        }
        // In a dense soup most lights are hidden.
        let soup = shapes::soup(3000, 0.3, 1);
        let maker = RayMaker::new(&soup, 4);
        let shadows: Vec<_> = (0..200).map(|i| maker.ray(Aim::Shadow, i)).collect();
        let dark = shadows.iter().filter(|(ray, origin)| brute::any(&soup, ray, *origin)).count();
        assert!(dark >= 100, "{dark}");
        // A flat scene is seen from both sides, not from its own plane.
        let flat = shapes::grid(4, 0.0, 0);
        let maker = RayMaker::new(&flat, 5);
        let hits = (0..200).filter(|i| brute::any(&flat, &maker.ray(Aim::Interior, *i).0, u32::MAX)).count();
        assert_eq!(hits, 200);
        assert!(RayMaker::new(&[], 0).mixed(30).iter().all(|(ray, _)| ray.is_valid()));
    }
}
