//! A small toolkit for building triangle meshes: frames, colours, boxes, grids, lathes, tubes.
//!
//! Everything is plain single-precision arithmetic, square roots and `libm`, so a scene has the same bits on every
//! platform.

mod dice;
mod frame;
mod palette;

pub(super) use dice::Dice;
pub(super) use frame::{Frame, bump, circle, smooth};
pub(super) use palette::{Colour, Palette};

use crate::{Model, Plant, View};
use glam::Vec3;
use std::f32::consts::TAU;
use std::ops::Range;

/// Triangles with colours.
#[derive(Clone, Debug, Default)]
pub(super) struct Mesh {
    /// Vertex positions.
    pub(in crate::builtin) positions: Vec<Vec3>,
    /// Vertex indices, counter-clockwise seen from outside.
    pub(in crate::builtin) indices: Vec<[u32; 3]>,
    /// Palette index of each triangle.
    pub(in crate::builtin) colour_of: Vec<u16>,
    /// Triangles that bend in the wind together and share no vertex with others, and where they stand.
    plants: Vec<(Range<usize>, Vec3)>,
}

impl Mesh {
    /// Number of triangles.
    pub(in crate::builtin) fn len(&self) -> usize {
        self.indices.len()
    }

    /// Adds a vertex.
    pub(in crate::builtin) fn vertex(&mut self, position: Vec3) -> u32 {
        self.positions.push(position);
        self.positions.len() as u32 - 1
    }

    /// Adds a triangle, unless two of its corners coincide, as at the pole of a lathe.
    pub(in crate::builtin) fn triangle(&mut self, corners: [u32; 3], colour: Colour) {
        let [a, b, c] = corners.map(|i| self.positions[i as usize]);
        if a != b && b != c && c != a {
            self.indices.push(corners);
            self.colour_of.push(colour.index());
        }
    }

    /// The triangles from number `first` on are a plant that stands at `foot`.
    pub(in crate::builtin) fn plant(&mut self, first: usize, foot: Vec3) {
        self.plants.push((first..self.len(), foot));
    }

    /// Adds a convex polygon as a fan around its first corner.
    pub(in crate::builtin) fn face(&mut self, corners: &[Vec3], colour: Colour) {
        let first = self.positions.len() as u32;
        self.positions.extend_from_slice(corners);
        for i in 2..corners.len() as u32 {
            self.triangle([first, first + i - 1, first + i], colour);
        }
    }

    /// Adds a mapped copy of another mesh.
    pub(in crate::builtin) fn append(&mut self, other: &Self, frame: &Frame) {
        let (first, before) = (self.positions.len() as u32, self.len());
        self.positions.extend(other.positions.iter().map(|&p| frame.point(p)));
        let plants = other.plants.iter().map(|(own, foot)| (own.start + before..own.end + before, frame.point(*foot)));
        self.plants.extend(plants);
        let flip = frame.mirrors();
        self.indices.extend(other.indices.iter().map(|&[a, b, c]| {
            let [b, c] = if flip { [c, b] } else { [b, c] };
            [first + a, first + b, first + c]
        }));
        self.colour_of.extend_from_slice(&other.colour_of);
    }

    /// The finished scene, without the vertices that no triangle uses, such as all but one of each pole's.
    pub(in crate::builtin) fn into_model(self, source: &str, palette: Palette, view: View) -> Model {
        let mut moved = vec![u32::MAX; self.positions.len()];
        let mut positions = Vec::new();
        let mut move_vertex = |i: u32| {
            let slot = &mut moved[i as usize];
            if *slot == u32::MAX {
                *slot = positions.len() as u32;
                positions.push(self.positions[i as usize]);
            }
            *slot
        };
        let indices: Vec<[u32; 3]> = self.indices.iter().map(|corners| corners.map(&mut move_vertex)).collect();
        // Vertices are in the order in which triangles use them first, so a plant's lie together.
        let vertices = |triangles: Range<usize>| {
            let used = || indices[triangles.clone()].iter().flatten().map(|&vertex| vertex as usize);
            used().min().unwrap_or(0)..used().max().map_or(0, |last| last + 1)
        };
        let plants = self.plants.iter().map(|(own, foot)| Plant { vertices: vertices(own.clone()), foot: *foot });
        let plants = plants.collect();
        Model {
            source: source.into(),
            positions,
            indices,
            plants,
            palette: palette.into_colours(),
            colour_of: self.colour_of,
            view: Some(view),
            ..Model::default()
        }
    }

    /// Adds a box of `size`, centred in the frame: 12 triangles.
    pub(in crate::builtin) fn cuboid(&mut self, frame: &Frame, size: Vec3, colour: Colour) {
        self.taper(frame, size, 1.0, colour);
    }

    /// Adds a box whose upper face is `top` times as wide and deep as its lower face: 12 triangles.
    pub(in crate::builtin) fn taper(&mut self, frame: &Frame, size: Vec3, top: f32, colour: Colour) {
        let first = self.positions.len() as u32;
        for corner in 0..8_u32 {
            let side = |bit: u32| if corner >> bit & 1 == 0 { -0.5 } else { 0.5 };
            let wide = if corner >> 1 & 1 == 0 { 1.0 } else { top };
            self.vertex(frame.point(size * Vec3::new(side(0) * wide, side(1), side(2) * wide)));
        }
        let flip = frame.mirrors();
        for [a, b, c, d] in [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]] {
            let [b, d] = if flip { [d, b] } else { [b, d] };
            self.triangle([first + a, first + b, first + c], colour);
            self.triangle([first + a, first + c, first + d], colour);
        }
    }

    /// Adds a box between two points, given as lower and upper corner: 12 triangles.
    pub(in crate::builtin) fn block(&mut self, low: Vec3, high: Vec3, colour: Colour) {
        self.cuboid(&Frame::at((low + high) * 0.5), high - low, colour);
    }

    /// Adds a surface through `rows + 1` times `columns + 1` points, `point(row, column)`.
    ///
    /// Seen from outside, columns run to the right where rows run up. A closed surface gives the very same point for
    /// the first and the last column.
    pub(in crate::builtin) fn grid(
        &mut self,
        [rows, columns]: [u32; 2],
        mut point: impl FnMut(u32, u32) -> Vec3,
        colour: impl Fn(u32, u32) -> Colour,
    ) {
        let first = self.positions.len() as u32;
        for row in 0..=rows {
            for column in 0..=columns {
                self.vertex(point(row, column));
            }
        }
        for row in 0..rows {
            for column in 0..columns {
                let a = first + row * (columns + 1) + column;
                let [b, c, d] = [a + 1, a + columns + 2, a + columns + 1];
                self.triangle([a, b, c], colour(row, column));
                self.triangle([a, c, d], colour(row, column));
            }
        }
    }

    /// Adds a surface of revolution about the frame's y axis through `(radius, height)` points, which run upwards on
    /// the outside.
    pub(in crate::builtin) fn lathe(&mut self, frame: &Frame, profile: &[[f32; 2]], segments: u32, colour: Colour) {
        self.grid(
            [profile.len() as u32 - 1, segments],
            |row, column| {
                let [radius, height] = profile[row as usize];
                let (c, s) = circle((column % segments) as f32 / segments as f32 * TAU);
                frame.point(Vec3::new(radius * s, height, radius * c))
            },
            |_, _| colour,
        );
    }

    /// Adds a tube of `sides` sides along a path, its radius a function of the index into the path; open at the ends.
    pub(in crate::builtin) fn tube(
        &mut self,
        path: &[Vec3],
        radius: impl Fn(usize) -> f32,
        sides: u32,
        colour: Colour,
    ) {
        // Parallel transport: the frame turns no more than the path does, so the tube does not wring.
        let mut across = Frame::along(Vec3::ZERO, direction(path, 0)).vector(Vec3::X);
        let mut rings = Vec::with_capacity(path.len());
        for (i, &centre) in path.iter().enumerate() {
            let along = direction(path, i);
            across = (across - along * across.dot(along)).normalize();
            rings.push((centre, across * radius(i), along.cross(across) * radius(i)));
        }
        self.grid(
            [path.len() as u32 - 1, sides],
            |row, column| {
                let (centre, u, v) = rings[row as usize];
                let (c, s) = circle((column % sides) as f32 / sides as f32 * TAU);
                centre + u * c + v * s
            },
            |_, _| colour,
        );
    }

    /// Adds a straight bar of constant radius, open at the ends: `2 · sides` triangles.
    pub(in crate::builtin) fn bar(&mut self, from: Vec3, to: Vec3, radius: f32, sides: u32, colour: Colour) {
        self.tube(&[from, to], |_| radius, sides, colour);
    }
}

/// Unit vector along a path at its point `i`: between the neighbours, or to the only one.
fn direction(path: &[Vec3], i: usize) -> Vec3 {
    (path[(i + 1).min(path.len() - 1)] - path[i.saturating_sub(1)]).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume inside a closed surface whose triangles are counter-clockwise seen from outside (divergence theorem).
    fn volume(mesh: &Mesh) -> f32 {
        let corner = |i: u32| mesh.positions[i as usize];
        mesh.indices.iter().map(|&[a, b, c]| corner(a).dot(corner(b).cross(corner(c))) / 6.0).sum()
    }

    fn near(a: f32, b: f32) -> bool {
        (a - b).abs() < 0.01 * b.abs()
    }

    // Fails when a face of the box, a strip of the lathe or a mirrored copy is wound the other way.
    #[test]
    fn closed_parts_have_their_outside_outside() {
        let colour = Palette::default().add(0);
        let frame = Frame::at(Vec3::new(3.0, -2.0, 1.0)).turned(0.4).rolled(1.1).pitched(-0.7);
        let mut cuboid = Mesh::default();
        cuboid.cuboid(&frame, Vec3::new(1.0, 2.0, 3.0), colour);
        assert!(near(volume(&cuboid), 6.0), "{}", volume(&cuboid));
        let mut cylinder = Mesh::default();
        cylinder.lathe(&frame, &[[0.0, 0.0], [1.0, 0.0], [1.0, 2.0], [0.0, 2.0]], 64, colour);
        assert_eq!(cylinder.len(), 64 * 4);
        assert!(near(volume(&cylinder), TAU), "{}", volume(&cylinder));
        let mut mirrored = Mesh::default();
        mirrored.append(&cuboid, &Frame::MIRROR_Z);
        assert!(near(volume(&mirrored), 6.0), "{}", volume(&mirrored));
        let mut direct = Mesh::default();
        direct.cuboid(&Frame::IDENTITY.scaled(Vec3::new(1.0, -2.0, 3.0)), Vec3::ONE, colour);
        assert!(near(volume(&direct), 6.0), "{}", volume(&direct));
    }

    // Fails when a tube's frame is wound or turns along a bend: its ends are then not where those of a straight one
    // are.
    #[test]
    fn a_tube_has_its_outside_outside_and_its_radius_everywhere() {
        let colour = Palette::default().add(0);
        let path = [Vec3::ZERO, Vec3::Y, Vec3::new(0.5, 2.0, 0.0), Vec3::new(2.0, 2.5, 0.5)];
        let mut tube = Mesh::default();
        tube.tube(&path, |_| 0.1, 8, colour);
        assert_eq!(tube.len(), 3 * 8 * 2);
        for (i, p) in tube.positions.iter().enumerate() {
            assert!(near(p.distance(path[i / 9]), 0.1));
        }
        let [a, b, c] = tube.indices[0].map(|i| tube.positions[i as usize]);
        assert!((b - a).cross(c - a).dot(a - path[0]) > 0.0);
    }

    #[test]
    fn colours_are_linear_light() {
        let mut palette = Palette::default();
        assert_eq!(palette.add_all([0x000000, 0xffffff, 0x808080]).map(Colour::index), [0, 1, 2]);
        let colours = palette.into_colours();
        assert_eq!((colours[0], colours[1]), (Vec3::ZERO, Vec3::ONE));
        // Half of the code range is 21.6 % of the light.
        assert!(colours[2].abs_diff_eq(Vec3::splat(0.2159), 1e-4));
    }
}
