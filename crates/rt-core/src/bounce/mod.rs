//! Rays that leave surfaces where other rays met them, made on demand from their number.
//!
//! This module defines them. All it does are sums and products in single precision, whole numbers and the choice
//! between them, so that a device without double precision, and one that does not divide or take roots as IEEE 754
//! says, can make the same bits: no result depends on who computes it.

mod block;
mod direction;
mod exact;
mod surface;

pub use direction::{Aim, basis};
pub use surface::{GREATEST_EXPONENT, LEAST_EXPONENT, Surface};

use crate::{Hit, Ray, Scene, Triangle, random, scale};
use alloc::sync::Arc;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// The triangles of a scene by their primitive ids.
#[derive(Debug)]
pub struct Surfaces {
    scene: Arc<Scene>,
    /// [`Scene::slots`].
    slots: Arc<[u32]>,
}

impl Surfaces {
    /// Those of `scene`: 4 bytes for each triangle.
    #[must_use]
    pub fn new(scene: Arc<Scene>) -> Self {
        let slots = scene.slots().into();
        Self { scene, slots }
    }

    /// Those of a scene that may have moved from this one: quicker than anew, if it has.
    #[must_use]
    pub fn moved(&self, scene: Arc<Scene>) -> Self {
        if !scene.has_tree_of(&self.scene) {
            return Self::new(scene);
        }
        Self { scene, slots: Arc::clone(&self.slots) }
    }

    /// The scene.
    #[must_use]
    pub const fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// Where a primitive's triangle is in leaf order; `None` where there is none that can be hit.
    #[must_use]
    pub fn slot(&self, primitive: u32) -> Option<u32> {
        self.slots.get(primitive as usize).copied().filter(|&slot| slot != u32::MAX)
    }

    /// The triangle of a primitive, in the scene's local coordinates; `None` where there is none that can be hit.
    #[must_use]
    pub fn triangle(&self, primitive: u32) -> Option<&Triangle> {
        self.scene.triangles().get(self.slot(primitive)? as usize)
    }

    /// The surface of a primitive; `None` where rays cannot leave it, since it is none of the scene's or has no area as
    /// far as single precision can tell.
    #[must_use]
    pub fn get(&self, primitive: u32) -> Option<Surface> {
        Surface::new(self.triangle(primitive)?, self.scene.scale_exponent())
    }

    /// [`Surface::normal`] of a primitive's surface; zero where there is none.
    #[must_use]
    pub fn normal(&self, primitive: u32) -> Vec3 {
        self.get(primitive).map_or(Vec3::ZERO, |surface| surface.normal())
    }

    /// [`Surfaces::normal`] of each of these primitives.
    ///
    /// # Panics
    /// When there are not as many places as primitives.
    #[inline(always)]
    pub fn normals(&self, primitives: &[u32], normals: &mut [Vec3]) {
        assert_eq!(primitives.len(), normals.len(), "a place for each normal");
        let ((primitives, last), (normals, places)) = (primitives.as_chunks(), normals.as_chunks_mut());
        primitives.iter().zip(normals).for_each(|(primitives, normals)| block::normals(self, primitives, normals));
        last.iter().zip(places).for_each(|(&primitive, normal)| *normal = self.normal(primitive));
    }

    /// Whether a point of a surface may have a coordinate beyond single precision.
    #[must_use]
    pub fn may_overflow(&self) -> bool {
        let bounds = self.scene.bounds();
        let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
        scale::exponent(largest) + self.scene.scale_exponent() > GREATEST_EXPONENT
    }
}

/// Where a ray leaves a surface: a point of a triangle, one of its sides, and the path that the ray belongs to. 16
/// bytes.
///
/// A path is a ray from the camera with all that follows from it, one ray after the other.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct Departure {
    /// Weights of the second and the third vertex in units of 2⁻²⁴, together at most 1; in the first one's upper bit
    /// [`Departure::BEHIND`].
    pub weights: [u32; 2],
    /// The triangle.
    pub primitive: u32,
    /// Number of the path in its wave: that of the camera ray it began with. So a ray knows its pixel and its random
    /// numbers however many paths have ended before.
    pub path: u32,
}

/// 1 in units of 2⁻²⁴, the finest in which single precision holds all of `0..=1`.
const ONE: u32 = 1 << 24;

impl Departure {
    /// The bit of a ray that leaves from the side away from the normal.
    pub const BEHIND: u32 = 1 << 31;

    /// From the point of a hit; `None` for a miss, and for weights that are no weights.
    #[must_use]
    pub fn new(hit: &Hit, behind: bool, path: u32) -> Option<Self> {
        // Twice as wide as rounding could ever make them.
        let is_weight = |w: f32| (-0.01..=1.01).contains(&w);
        if !(hit.is_hit() && is_weight(hit.u) && is_weight(hit.v)) {
            return None;
        }
        // Not negative: the conversion to whole numbers makes that 0.
        let [u, v] = [hit.u, hit.v].map(|w| ((f64::from(w) * f64::from(ONE) + 0.5) as u32).min(ONE));
        let side = if behind { Self::BEHIND } else { 0 };
        Some(Self { weights: [u | side, v.min(ONE - u)], primitive: hit.primitive, path })
    }

    /// Whether the ray leaves from the side away from the normal.
    #[must_use]
    pub const fn is_behind(&self) -> bool {
        self.weights[0] & Self::BEHIND != 0
    }

    /// Unit vector on the ray's side.
    #[must_use]
    pub fn normal(&self, surface: &Surface) -> Vec3 {
        if self.is_behind() { -surface.normal() } else { surface.normal() }
    }

    /// The point where the ray starts.
    #[must_use]
    pub fn origin(&self, surface: &Surface) -> Vec3 {
        surface.origin(block::weights(self.weights), self.normal(surface))
    }
}

/// How the directions of a stream are drawn.
///
/// Random numbers come from [`random::spread_pair`] of (seed, group of the path, bounce, number in the group), so that
/// the rays of one group spread evenly. They do not depend on the waves in which an image is traced, since each wave
/// says which group its first one is. The frames of an animation number their groups alike and need different seeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter {
    /// Where the rays go.
    pub aim: Aim,
    /// Seed of the random numbers.
    pub seed: u32,
    /// Consecutive paths that make a group and are summed up in the end, as those of one pixel; 0 counts as 1.
    pub samples: u32,
    /// Number of the group that the wave's first path belongs to.
    pub first_group: u32,
    /// Number of bounces before: 0 for rays that leave where camera rays hit.
    pub bounce: u32,
}

impl Scatter {
    /// The random numbers' dimension. 0 belongs to positions inside a pixel.
    #[must_use]
    pub const fn dimension(&self) -> u32 {
        let purpose = match self.aim {
            Aim::Cosine => 1,
            Aim::Disc { .. } => 2,
        };
        self.bounce.wrapping_mul(2).wrapping_add(purpose)
    }

    /// The direction in which `path` goes on from the side of `normal`.
    #[must_use]
    pub fn direction(&self, normal: Vec3, path: u32) -> Vec3 {
        let samples = self.samples.max(1);
        let group = self.first_group.wrapping_add(path / samples);
        let uniform = random::spread_pair(self.seed, group, self.dimension(), path % samples);
        self.aim.direction(normal, uniform)
    }

    /// [`Scatter::direction`] of each of these paths.
    ///
    /// # Panics
    /// When there are not as many of each.
    #[inline(always)]
    pub fn directions(&self, normals: &[Vec3], paths: &[u32], directions: &mut [Vec3]) {
        assert!(normals.len() == paths.len() && normals.len() == directions.len(), "as many of each");
        let ((normals, last_normals), (paths, last_paths)) = (normals.as_chunks(), paths.as_chunks());
        let (blocks, rest) = directions.as_chunks_mut();
        for ((normals, paths), directions) in normals.iter().zip(paths).zip(blocks) {
            block::directions(self, normals, paths, directions);
        }
        for ((&normal, &path), direction) in last_normals.iter().zip(last_paths).zip(rest) {
            *direction = self.direction(normal, path);
        }
    }

    /// The ray that leaves a surface: `tmin = 0`, `tmax = ∞`, a direction of unit length up to rounding.
    #[must_use]
    pub fn ray(&self, surface: &Surface, from: &Departure) -> Ray {
        Ray::new(from.origin(surface), self.direction(from.normal(surface), from.path))
    }
}

/// A stream of rays that leave surfaces.
#[derive(Clone, Debug)]
pub struct BounceRays {
    /// The scene whose triangles they leave.
    pub surfaces: Arc<Surfaces>,
    /// Where each ray leaves.
    pub departures: Arc<[Departure]>,
    /// Where they go.
    pub scatter: Scatter,
}

impl BounceRays {
    /// Number of rays; saturates at `u32::MAX`.
    #[must_use]
    pub fn len(&self) -> u32 {
        u32::try_from(self.departures.len()).unwrap_or(u32::MAX)
    }

    /// Whether there is no ray.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.departures.is_empty()
    }

    /// Ray number `index`, which must be below [`BounceRays::len`], and the primitive it starts on. Invalid, so that it
    /// misses, where that is none of the scene's or has no area.
    #[must_use]
    pub fn ray(&self, index: u32) -> (Ray, u32) {
        let from = &self.departures[index as usize];
        (self.ray_of(from), from.primitive)
    }

    /// As many rays as there is room for, from number `first` on, which must all be below [`BounceRays::len`], and in
    /// as many places the primitives that they start on: the same bits as one by one, faster.
    ///
    /// # Panics
    /// When there are not as many places for the one as for the other.
    #[inline(always)]
    pub fn rays(&self, first: u32, rays: &mut [Ray], origins: &mut [u32]) {
        let departures = &self.departures[first as usize..][..rays.len()];
        let (blocks, rest) = departures.as_chunks();
        self.make(blocks.iter().copied(), rest.iter().copied(), rays, origins);
    }

    /// The same for the rays of these numbers.
    ///
    /// # Panics
    /// When there are not as many places of either kind as numbers.
    #[inline(always)]
    pub fn rays_of(&self, numbers: &[u32], rays: &mut [Ray], origins: &mut [u32]) {
        assert_eq!(rays.len(), numbers.len(), "a place for each ray");
        let departure = |&number: &u32| self.departures[number as usize];
        let (blocks, rest) = numbers.as_chunks::<{ block::LANES }>();
        let blocks = blocks.iter().map(|numbers| core::array::from_fn(|lane| departure(&numbers[lane])));
        self.make(blocks, rest.iter().map(departure), rays, origins);
    }

    #[inline(always)]
    fn make(
        &self,
        blocks: impl Iterator<Item = [Departure; block::LANES]>,
        rest: impl Iterator<Item = Departure>,
        rays: &mut [Ray],
        origins: &mut [u32],
    ) {
        assert_eq!(rays.len(), origins.len(), "a primitive for each ray");
        let ((rays, last_rays), (origins, last_origins)) = (rays.as_chunks_mut(), origins.as_chunks_mut());
        for ((rays, origins), departures) in rays.iter_mut().zip(origins).zip(blocks) {
            if !block::make(self, &departures, rays) {
                self.one_by_one(&departures, rays);
            }
            *origins = departures.map(|from| from.primitive);
        }
        for ((ray, origin), from) in last_rays.iter_mut().zip(last_origins).zip(rest) {
            (*ray, *origin) = (self.ray_of(&from), from.primitive);
        }
    }

    #[inline(never)]
    fn one_by_one(&self, departures: &[Departure], rays: &mut [Ray]) {
        rays.iter_mut().zip(departures).for_each(|(ray, from)| *ray = self.ray_of(from));
    }

    fn ray_of(&self, from: &Departure) -> Ray {
        self.surfaces
            .get(from.primitive)
            .map_or(Ray::new(Vec3::ZERO, Vec3::ZERO), |surface| self.scatter.ray(&surface, from))
    }
}

#[cfg(test)]
mod tests;
