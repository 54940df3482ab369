//! A smooth surface one can cut: panels, openings and gaps are what a scalar field leaves of it.

use crate::builtin::mesh::{Colour, Mesh};
use glam::{Vec2, Vec3};
use std::collections::HashMap;

/// Where a cut may meet an edge, as a fraction of it: nearer to its ends it would leave slivers. A cut is off by at
/// most this fraction of an edge, half a millimetre on the body.
const NEAREST: f32 = 0.05;

/// A triangulated surface whose vertices remember where in its parameter plane they lie.
#[derive(Clone, Debug, Default)]
pub(super) struct Surface {
    points: Vec<Vec3>,
    params: Vec<Vec2>,
    triangles: Vec<[u32; 3]>,
}

/// The two sides of a cut.
#[derive(Debug)]
pub(super) struct Split {
    /// Where the field is positive.
    pub(super) outside: Surface,
    /// Where it is negative.
    pub(super) inside: Surface,
    /// The edges along the cut, with the outside on their left.
    pub(super) seam: Vec<[Vec3; 2]>,
}

impl Surface {
    /// The surface `point(u, v)` over the given `u` and `v`. Seen from outside, `u` runs to the right where `v` runs
    /// up.
    pub(super) fn loft(us: &[f32], vs: &[f32], point: impl Fn(f32, f32) -> Vec3) -> Self {
        let mut surface = Self::default();
        for &u in us {
            for &v in vs {
                surface.points.push(point(u, v));
                surface.params.push(Vec2::new(u, v));
            }
        }
        let columns = vs.len() as u32;
        for i in 0..us.len() as u32 - 1 {
            for j in 0..columns - 1 {
                let a = i * columns + j;
                let [b, c, d] = [a + columns, a + columns + 1, a + 1];
                surface.push([a, b, c]);
                surface.push([a, c, d]);
            }
        }
        surface
    }

    /// Adds a triangle unless it collapses, as at the tip of the nose.
    fn push(&mut self, corners: [u32; 3]) {
        let [a, b, c] = corners.map(|i| self.points[i as usize]);
        if a != b && b != c && c != a {
            self.triangles.push(corners);
        }
    }

    /// Cuts along the zeros of a field of position and parameters.
    pub(super) fn split(&self, field: impl Fn(Vec3, Vec2) -> f32) -> Split {
        let value: Vec<f32> = self.points.iter().zip(&self.params).map(|(&p, &uv)| field(p, uv)).collect();
        let mut all = Self { points: self.points.clone(), params: self.params.clone(), triangles: Vec::new() };
        let (mut outside, mut inside, mut seam) = (Vec::new(), Vec::new(), Vec::new());
        let mut cuts: HashMap<[u32; 2], u32> = HashMap::new();
        for &corners in &self.triangles {
            let positive = corners.map(|i| value[i as usize] >= 0.0);
            let count = positive.iter().filter(|&&is| is).count();
            if count == 0 || count == 3 {
                if count == 3 { &mut outside } else { &mut inside }.push(corners);
                continue;
            }
            // The corner alone on its side comes first; the order around the triangle stays.
            let lone = (0..3).find(|&i| positive[i] == (count == 1)).expect("one corner differs from the others");
            let [a, b, c] = [corners[lone], corners[(lone + 1) % 3], corners[(lone + 2) % 3]];
            let [p, q] = [all.cut(a, b, &value, &mut cuts), all.cut(a, c, &value, &mut cuts)];
            let (tip, rest) = if count == 1 { (&mut outside, &mut inside) } else { (&mut inside, &mut outside) };
            tip.push([a, p, q]);
            rest.push([p, b, c]);
            rest.push([p, c, q]);
            let edge = if count == 1 { [p, q] } else { [q, p] };
            seam.push(edge.map(|i| all.points[i as usize]));
        }
        let inside = Self { triangles: inside, ..all.clone() };
        Split { outside: Self { triangles: outside, ..all }, inside, seam }
    }

    /// The vertex where a cut meets the edge between two vertices; the same one from both sides of the edge.
    fn cut(&mut self, a: u32, b: u32, value: &[f32], cuts: &mut HashMap<[u32; 2], u32>) -> u32 {
        let [a, b] = [a.min(b), a.max(b)];
        *cuts.entry([a, b]).or_insert_with(|| {
            let [i, j] = [a as usize, b as usize];
            let t = (value[i] / (value[i] - value[j])).clamp(NEAREST, 1.0 - NEAREST);
            self.points.push(self.points[i].lerp(self.points[j], t));
            self.params.push(self.params[i].lerp(self.params[j], t));
            self.points.len() as u32 - 1
        })
    }

    /// Keeps what is outside and gives back the seam.
    pub(super) fn remove(&mut self, field: impl Fn(Vec3, Vec2) -> f32) -> Vec<[Vec3; 2]> {
        let split = self.split(field);
        *self = split.outside;
        split.seam
    }

    /// Draws the zeros of a field as edges, so that a band around them, however thin, can be cut out afterwards.
    pub(super) fn score(&mut self, field: impl Fn(Vec3, Vec2) -> f32) {
        let Split { mut outside, inside, .. } = self.split(field);
        outside.triangles.extend(inside.triangles);
        *self = outside;
    }

    /// Cuts out a region and adds it to `mesh` in its own colour.
    pub(super) fn colour(&mut self, mesh: &mut Mesh, colour: Colour, field: impl Fn(Vec3, Vec2) -> f32) {
        let split = self.split(field);
        *self = split.outside;
        split.inside.add_to(mesh, colour);
    }

    /// Adds the surface to `mesh`, only the vertices in use.
    pub(super) fn add_to(&self, mesh: &mut Mesh, colour: Colour) {
        let mut moved = vec![u32::MAX; self.points.len()];
        for corners in &self.triangles {
            let corners = corners.map(|i| {
                let slot = &mut moved[i as usize];
                if *slot == u32::MAX {
                    *slot = mesh.vertex(self.points[i as usize]);
                }
                *slot
            });
            mesh.triangle(corners, colour);
        }
    }
}

/// Adds a strip from every edge of a seam to its image under `to`: the thickness of a panel, the wall of a recess.
/// Edges that only move along themselves sweep no area and are left out.
pub(super) fn flange(mesh: &mut Mesh, seam: &[[Vec3; 2]], colour: Colour, to: impl Fn(Vec3) -> Vec3) {
    for &[a, b] in seam {
        // In square metres, squared: a strip a micrometre wide is none.
        let swept = |p: Vec3| (b - a).cross(to(p) - p).length_squared();
        if swept(a).min(swept(b)) > 1e-16 {
            mesh.face(&[b, a, to(a), to(b)], colour);
        }
    }
}

/// Distance to a rectangle with corners rounded by `radius`, negative inside (I. Quilez, *2D distance functions*).
pub(super) fn rounded(p: Vec2, centre: Vec2, half: Vec2, radius: f32) -> f32 {
    let q = (p - centre).abs() - half + radius;
    q.max(Vec2::ZERO).length() + q.max_element().min(0.0) - radius
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(surface: &Surface) -> f32 {
        let corner = |i: u32| surface.points[i as usize];
        let twice = |&[a, b, c]: &[u32; 3]| (corner(b) - corner(a)).cross(corner(c) - corner(a)).z;
        surface.triangles.iter().map(twice).sum::<f32>() * 0.5
    }

    fn square() -> Surface {
        let steps: Vec<f32> = (0..=20).map(|i| i as f32 * 0.1 - 1.0).collect();
        Surface::loft(&steps, &steps, |u, v| Vec3::new(u, v, 0.0))
    }

    // Fails when a piece of a cut triangle is lost, doubled or turned over.
    #[test]
    fn a_cut_keeps_the_area_and_the_orientation() {
        let split = square().split(|p, _| p.length() - 0.7);
        let (outside, inside) = (area(&split.outside), area(&split.inside));
        assert!((outside + inside - 4.0).abs() < 1e-4, "{outside} {inside}");
        assert!((inside - std::f32::consts::PI * 0.49).abs() < 0.02, "{inside}");
    }

    // Fails when the seam's edges of inner and outer corners are not turned alike.
    #[test]
    fn the_seam_goes_round_the_hole_once() {
        let split = square().split(|p, _| p.length() - 0.7);
        let length: f32 = split.seam.iter().map(|[a, b]| a.distance(*b)).sum();
        assert!((length - std::f32::consts::TAU * 0.7).abs() < 0.05, "{length}");
        // The outside is on the left, so the hole is circled clockwise.
        assert!(split.seam.iter().all(|[a, b]| a.cross(*b).z < 0.0));
    }

    // Fails when bands thinner than a triangle are cut without scoring their middle first.
    #[test]
    fn a_scored_line_can_be_cut_out_as_a_thin_band() {
        let mut surface = square();
        let line = |p: Vec3| p.x + 0.3 * p.y - 0.123;
        surface.score(|p, _| line(p));
        let band = surface.split(|p, _| line(p).abs() - 0.01).inside;
        assert!((area(&band) - 2.0 * 0.02).abs() < 0.01, "{}", area(&band));
    }
}
