//! Several rays made side by side: the definition is [`super::Scatter::ray`]'s, in loops that compilers turn into words
//! of however many lanes the target has.

use super::{Aim, BounceRays, Departure, ONE, Scatter, Surface, Surfaces};
use crate::{Ray, Triangle, random};
use glam::Vec3;

/// Rays that are made side by side.
pub(super) const LANES: usize = 16;

/// A number for each ray.
type Lanes<T> = [T; LANES];

/// Coordinates of points or directions, side by side.
#[derive(Clone, Copy)]
struct Points([Lanes<f32>; 3]);

impl Points {
    const ZERO: Self = Self([[0.0; LANES]; 3]);

    #[inline(always)]
    fn get(&self, lane: usize) -> Vec3 {
        let [x, y, z] = &self.0;
        Vec3::new(x[lane], y[lane], z[lane])
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, point: Vec3) {
        let [x, y, z] = &mut self.0;
        (x[lane], y[lane], z[lane]) = (point.x, point.y, point.z);
    }
}

/// Vertices of triangles, side by side.
struct Corners([Points; 3]);

impl Corners {
    const ZERO: Self = Self([Points::ZERO; 3]);

    #[inline(always)]
    fn set(&mut self, lane: usize, triangle: &Triangle) {
        self.0.iter_mut().zip(triangle.vertices()).for_each(|(points, vertex)| points.set(lane, vertex));
    }

    #[inline(always)]
    fn get(&self, lane: usize) -> [Vec3; 3] {
        let [a, b, c] = &self.0;
        [a.get(lane), b.get(lane), c.get(lane)]
    }
}

/// The random numbers of paths, side by side.
struct Paths {
    /// Number of the path's group.
    group: Lanes<u32>,
    /// Its own in the group.
    sample: Lanes<u32>,
}

impl Paths {
    #[inline(always)]
    fn new(scatter: &Scatter, path: impl Fn(usize) -> u32) -> Self {
        let samples = scatter.samples.max(1);
        let (mut group, mut sample) = ([0; LANES], [0; LANES]);
        for lane in 0..LANES {
            let path = path(lane);
            (group[lane], sample[lane]) = (scatter.first_group.wrapping_add(path / samples), path % samples);
        }
        Self { group, sample }
    }

    /// Where they go from the sides of these normals.
    #[inline(always)]
    fn aim(&self, scatter: &Scatter, normals: &Points) -> Points {
        match scatter.aim {
            // Known here, so that it is no choice in the loop.
            Aim::Cosine => self.aim_at(Aim::Cosine, scatter, normals),
            Aim::Disc { middle, radii } => self.aim_at(Aim::Disc { middle, radii }, scatter, normals),
        }
    }

    #[inline(always)]
    fn aim_at(&self, aim: Aim, scatter: &Scatter, normals: &Points) -> Points {
        let dimension = scatter.dimension();
        let mut directions = Points::ZERO;
        for lane in 0..LANES {
            let uniform = random::spread_pair(scatter.seed, self.group[lane], dimension, self.sample[lane]);
            directions.set(lane, aim.direction(normals.get(lane), uniform));
        }
        directions
    }
}

/// Makes the rays of these departures, and says whether it could: it cannot where one of them has no triangle, or one
/// without area or at the ends of single precision.
#[inline(always)]
pub(super) fn make(of: &BounceRays, departures: &Lanes<Departure>, rays: &mut Lanes<Ray>) -> bool {
    let mut corners = Corners::ZERO;
    let (mut second, mut third, mut side) = ([0; LANES], [0; LANES], [0.0; LANES]);
    for (lane, from) in departures.iter().enumerate() {
        let Some(triangle) = of.surfaces.triangle(from.primitive) else { return false };
        corners.set(lane, triangle);
        [second[lane], third[lane]] = from.weights;
        side[lane] = if from.is_behind() { -1.0 } else { 1.0 };
    }
    let scale_exponent = of.surfaces.scene().scale_exponent();
    let (mut origins, mut normals) = (Points::ZERO, Points::ZERO);
    let mut are_usual = [false; LANES];
    for lane in 0..LANES {
        let (surface, is_usual) = Surface::usual(corners.get(lane), scale_exponent);
        are_usual[lane] = is_usual;
        let normal = surface.normal() * side[lane];
        normals.set(lane, normal);
        origins.set(lane, surface.usual_origin(weights([second[lane], third[lane]]), normal));
    }
    if are_usual.contains(&false) {
        return false;
    }
    let paths = Paths::new(&of.scatter, |lane| departures[lane].path);
    let directions = paths.aim(&of.scatter, &normals);
    for (lane, ray) in rays.iter_mut().enumerate() {
        *ray = Ray::new(origins.get(lane), directions.get(lane));
    }
    true
}

/// The unit normals of these primitives; zero for those without a surface.
#[inline(always)]
pub(super) fn normals(surfaces: &Surfaces, primitives: &Lanes<u32>, normals: &mut Lanes<Vec3>) {
    let mut corners = Corners::ZERO;
    // Of a triangle without area, which is not usual, where there is none.
    for (lane, &primitive) in primitives.iter().enumerate() {
        if let Some(triangle) = surfaces.triangle(primitive) {
            corners.set(lane, triangle);
        }
    }
    let mut found = Points::ZERO;
    let mut are_usual = [false; LANES];
    for (lane, usual) in are_usual.iter_mut().enumerate() {
        let (surface, is_usual) = Surface::usual(corners.get(lane), surfaces.scene().scale_exponent());
        *usual = is_usual;
        found.set(lane, surface.normal());
    }
    for (lane, normal) in normals.iter_mut().enumerate() {
        *normal = if are_usual[lane] { found.get(lane) } else { surfaces.normal(primitives[lane]) };
    }
}

/// Where paths go on from the sides of these normals.
#[inline(always)]
pub(super) fn directions(scatter: &Scatter, normals: &Lanes<Vec3>, paths: &Lanes<u32>, to: &mut Lanes<Vec3>) {
    let mut sides = Points::ZERO;
    normals.iter().enumerate().for_each(|(lane, &normal)| sides.set(lane, normal));
    let directions = Paths::new(scatter, |lane| paths[lane]).aim(scatter, &sides);
    to.iter_mut().enumerate().for_each(|(lane, direction)| *direction = directions.get(lane));
}

/// Weights of the three vertices from those of the second and the third as [`Departure`] has them.
#[inline(always)]
pub(super) fn weights(weights: [u32; 2]) -> [f32; 3] {
    let [u, v] = weights.map(|weight| (weight & !Departure::BEHIND).min(ONE));
    // Below 2²⁶, which fits words with a sign: fewer processors convert others.
    [ONE.saturating_sub(u + v), u, v].map(|weight| weight as i32 as f32 * (1.0 / ONE as f32))
}
