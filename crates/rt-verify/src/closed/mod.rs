//! Closed surfaces: meshes whose every edge belongs to an even number of triangles, points inside them, and rays from
//! there, which must hit something.

mod parts;

pub use parts::is_closed;

use crate::rays;
use crate::shapes::{self, TORUS_TUBE};
use core::f32::consts::TAU;
use glam::Vec3;
use rt_core::{Ray, Triangle, random};

/// The closed surfaces that can be made at any size and place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Solid {
    /// An icosphere.
    Sphere,
    /// A cube of grids, whose vertices line up along the axes.
    Box,
    /// A torus.
    Torus,
}

impl Solid {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Sphere, Self::Box, Self::Torus];

    /// The name that reports use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sphere => "sphere",
            Self::Box => "box",
            Self::Torus => "torus",
        }
    }

    /// The surface with radius 1; each step of `detail` halves its edges, which are about `1.5 / 2^detail` long.
    fn triangles(self, detail: u32) -> Vec<Triangle> {
        match self {
            Self::Sphere => shapes::icosphere(detail),
            Self::Box => shapes::box_grid(1 << detail),
            Self::Torus => shapes::torus(6 << detail, 3 << detail),
        }
    }
}

/// What rays from inside a closed surface are aimed at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Target {
    /// Nothing: a random direction.
    Random,
    /// A point of an edge.
    Edge,
    /// A vertex.
    Vertex,
    /// Along an axis, where possible through a vertex's own coordinates, with zeros of either sign.
    Axis,
}

impl Target {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Random, Self::Edge, Self::Vertex, Self::Axis];

    /// The name that reports use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::Edge => "edges",
            Self::Vertex => "vertices",
            Self::Axis => "axes",
        }
    }
}

/// Where rays may start.
#[derive(Clone, Debug)]
enum Inside {
    /// Anywhere in a ball; the surface is convex.
    Ball { centre: Vec3, radius: f32 },
    /// Near the ring in the middle of a torus's tube.
    Ring { centre: Vec3, radius: f32, room: f32 },
    /// At these points.
    Points(Vec<Vec3>),
}

/// A closed surface.
#[derive(Clone, Debug)]
pub struct Closed {
    /// Its triangles.
    pub triangles: Vec<Triangle>,
    inside: Inside,
}

/// A ray from the inside of a closed surface, and the distance at which it has left for sure (∞: unknown).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Escape {
    /// The ray.
    pub ray: Ray,
    /// Greatest distance of a right hit.
    pub latest: f32,
}

/// How far behind its target a hit may lie, relative to the distance, beside the target's own rounding.
const BEHIND: f32 = 1e-3;

/// Steps of the number format that an edge must have at its place: fewer, and rounding folds the surface up.
const LEAST_STEPS: f32 = 8.0;

impl Closed {
    /// `solid` moved by `offset`, with edges that are at least eight steps of the number format there: as finely cut as
    /// that allows, and larger than radius 1 where even the coarsest would not do.
    #[must_use]
    pub fn solid(solid: Solid, offset: Vec3) -> Self {
        let step = offset.abs().max_element().next_up() - offset.abs().max_element();
        // Half of what edges are, since some are shorter.
        let edge = |detail: u32, radius: f32| 0.75 * radius / (1_u32 << detail) as f32;
        let (mut detail, mut radius) = (5, 1.0);
        while detail > 1 && edge(detail, radius) < LEAST_STEPS * step {
            detail -= 1;
        }
        while edge(detail, radius) < LEAST_STEPS * step {
            radius *= 2.0;
        }
        let unit = solid.triangles(detail);
        let triangles = unit.iter().map(|t| t.scaled(radius)).collect::<Vec<_>>();
        let inside = match solid {
            Solid::Sphere | Solid::Box => Inside::Ball { centre: offset, radius: 0.6 * radius },
            Solid::Torus => Inside::Ring { centre: offset, radius, room: 0.25 * TORUS_TUBE * radius },
        };
        Self { triangles: shapes::moved(&triangles, offset), inside }
    }

    /// The surface with every coordinate multiplied by `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f32) -> Self {
        let inside = match &self.inside {
            Inside::Ball { centre, radius } => Inside::Ball { centre: *centre * factor, radius: radius * factor },
            Inside::Ring { centre, radius, room } => {
                Inside::Ring { centre: *centre * factor, radius: radius * factor, room: room * factor }
            }
            Inside::Points(points) => Inside::Points(points.iter().map(|&p| p * factor).collect()),
        };
        Self { triangles: self.triangles.iter().map(|t| t.scaled(factor)).collect(), inside }
    }

    /// Ray `index` from inside, aimed at `target`; the same seed makes the same rays.
    #[must_use]
    pub fn ray(&self, target: Target, seed: u32, index: u32) -> Escape {
        let chosen = random::below(self.triangles.len() as u32, seed, index, 0);
        let [a, b, c] = self.triangles[chosen as usize].vertices();
        let [x, y] = random::pair(seed, index, 1);
        let aim = match target {
            Target::Edge if index & 1 == 0 => a + (b - a) * 0.5,
            Target::Edge => b + (c - b) * x,
            _ => [a, b, c][index as usize % 3],
        };
        let from = self.start(aim, seed, index);
        let everywhere = |ray| Escape { ray, latest: f32::INFINITY };
        match target {
            Target::Random => everywhere(Ray::new(from, rays::sphere([x, y]))),
            Target::Axis => {
                let axis = (index / 2) as usize % 3;
                let mut direction = if index & 8 == 0 { Vec3::ZERO } else { Vec3::splat(-0.0) };
                direction[axis] = if index & 16 == 0 { 1.0 } else { -1.0 };
                let mut level = aim;
                level[axis] = from[axis];
                let from = if self.is_surely_inside(level) { level } else { from };
                everywhere(Ray::new(from, direction))
            }
            Target::Edge | Target::Vertex if aim == from => everywhere(Ray::new(from, Vec3::X)),
            Target::Edge | Target::Vertex => self.aimed(from, aim, index),
        }
    }

    /// From inside to a point of the surface; every fourth ray of a convex surface comes from outside through that
    /// point.
    fn aimed(&self, from: Vec3, aim: Vec3, index: u32) -> Escape {
        match self.inside {
            Inside::Points(_) => Escape { ray: Ray::new(from, aim - from), latest: f32::INFINITY },
            Inside::Ball { .. } if index & 12 == 12 => {
                let outside = aim + (aim - from);
                Escape { ray: Ray::new(outside, from - outside), latest: 1.0 }
            }
            _ => {
                let largest = aim.abs().max_element();
                let rounding = 4.0 * (largest.next_up() - largest) / aim.distance(from);
                Escape { ray: Ray::new(from, aim - from), latest: 1.0 + BEHIND + rounding }
            }
        }
    }

    /// A point inside from which the way to `aim` does not touch the surface before.
    fn start(&self, aim: Vec3, seed: u32, index: u32) -> Vec3 {
        let unit = Vec3::from(random::pcg3d([seed, index, 2]).map(random::unit)) * 2.0 - 1.0;
        match &self.inside {
            // Every other ray starts in the very middle, where coordinates are round.
            Inside::Ball { centre, .. } if index & 2 == 0 => *centre,
            // The cube inside the ball.
            Inside::Ball { centre, radius } => *centre + unit * (radius * 0.57),
            Inside::Ring { centre, radius, room } => {
                let out = (aim - *centre) * Vec3::new(1.0, 0.0, 1.0);
                let [turn, _] = random::pair(seed, index, 3);
                let (sin, cos) = (TAU * turn).sin_cos();
                *centre + out.try_normalize().unwrap_or(Vec3::new(cos, 0.0, sin)) * *radius + unit * (room * 0.57)
            }
            Inside::Points(points) => points[random::below(points.len() as u32, seed, index, 3) as usize],
        }
    }

    /// In double precision, where squares of very small and very large coordinates are still numbers.
    fn is_surely_inside(&self, point: Vec3) -> bool {
        let from = |centre: &Vec3| point.as_dvec3() - centre.as_dvec3();
        match &self.inside {
            Inside::Ball { centre, radius } => from(centre).length() <= f64::from(*radius),
            Inside::Ring { centre, radius, room } => {
                let p = from(centre);
                (p.x.hypot(p.z) - f64::from(*radius)).hypot(p.y) <= f64::from(*room)
            }
            Inside::Points(_) => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brute;

    #[test]
    fn solids_are_closed_wherever_they_are() {
        for solid in Solid::ALL {
            for offset in [0.0, 1.0, 1e3, 1e5, 1e6, 1e7] {
                let closed = Closed::solid(solid, Vec3::new(offset, -offset, offset));
                assert!(is_closed(&closed.triangles), "{solid:?} at {offset}");
                assert!(closed.triangles.iter().all(brute::has_area), "{solid:?} at {offset}");
            }
            let mut open = Closed::solid(solid, Vec3::ZERO).triangles;
            open.pop();
            assert!(!is_closed(&open), "{solid:?} without a triangle");
        }
        assert_eq!(shapes::icosphere(2).len(), 320);
    }

    // Brute force in double precision must let none escape; fails when a start is outside or a latest distance too
    // near.
    #[test]
    fn no_ray_escapes_brute_force() {
        for solid in Solid::ALL {
            for offset in [0.0, 1e6] {
                let closed = Closed::solid(solid, Vec3::splat(offset));
                for (target, index) in Target::ALL.into_iter().flat_map(|t| (0..50).map(move |i| (t, i))) {
                    let Escape { ray, latest } = closed.ray(target, 5, index);
                    let hit = brute::closest(&closed.triangles, &ray, u32::MAX);
                    assert!(hit.t <= latest && hit.is_hit(), "{solid:?} {target:?} {index}: {ray:?} {hit:?}");
                }
            }
        }
    }

    #[test]
    fn closed_parts_are_found_among_open_ones() {
        let far = |triangles: &[Triangle], x: f32| shapes::moved(triangles, Vec3::new(x, 0.0, 0.0));
        let mut all = shapes::grid(6, 0.1, 1);
        all.extend(far(&shapes::icosphere(2), 5.0));
        all.extend(far(&shapes::torus(12, 8), 10.0));
        // A sheet that was modelled twice is closed, but has no inside.
        all.extend(far(&[shapes::grid(30, 0.1, 2), shapes::grid(30, 0.1, 2)].concat(), 20.0));
        let parts = Closed::parts(&all, 8, 1);
        assert_eq!(parts.iter().map(|part| part.triangles.len()).collect::<Vec<_>>(), [320, 192]);
        for part in &parts {
            for (target, index) in Target::ALL.into_iter().flat_map(|t| (0..50).map(move |i| (t, i))) {
                let Escape { ray, .. } = part.ray(target, 5, index);
                assert!(brute::any(&part.triangles, &ray, u32::MAX), "{target:?} {index}: {ray:?}");
            }
        }
    }
}
