//! A small toolkit for building triangle meshes: frames, colours, boxes, grids, lathes, tubes.
//!
//! Everything is plain single-precision arithmetic, square roots and `libm`, so a scene has the same bits on every
//! platform.

use crate::{Model, View};
use glam::Vec3;
use std::f32::consts::TAU;

/// Index of a colour in a [`Palette`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Colour(u16);

impl Colour {
    /// The index.
    pub(super) const fn index(self) -> u16 {
        self.0
    }
}

/// The colours of a scene, in linear light.
#[derive(Debug, Default)]
pub(super) struct Palette(Vec<Vec3>);

impl Palette {
    /// Adds a colour given as one reads it from a picture: `0xRRGGBB`, sRGB.
    pub(super) fn add(&mut self, rgb: u32) -> Colour {
        let index = self.0.len() as u16;
        let [_, r, g, b] = rgb.to_be_bytes();
        self.0.push(Vec3::from([r, g, b].map(|byte| linear(f32::from(byte) / 255.0))));
        Colour(index)
    }

    /// Adds several colours.
    pub(super) fn add_all<const N: usize>(&mut self, rgb: [u32; N]) -> [Colour; N] {
        rgb.map(|colour| self.add(colour))
    }
}

/// Linear light from an sRGB component (IEC 61966-2-1).
fn linear(component: f32) -> f32 {
    if component <= 0.040_45 { component / 12.92 } else { libm::powf((component + 0.055) / 1.055, 2.4) }
}

/// A unit vector in the plane of the first two axes, `turn` radians from the first.
pub(super) fn circle(turn: f32) -> (f32, f32) {
    (libm::cosf(turn), libm::sinf(turn))
}

/// The smooth step from 0 at `from` to 1 at `to`, flat at both ends; `from` may be the larger.
pub(super) fn smooth(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// A bump of height 1 at `centre` that has fallen to 0.37 at a distance of `width`.
pub(super) fn bump(centre: f32, width: f32, x: f32) -> f32 {
    let d = (x - centre) / width;
    libm::expf(-d * d)
}

/// An affine map from a part's own coordinates to those of the whole.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    origin: Vec3,
    axes: [Vec3; 3],
}

impl Frame {
    /// The map that moves nothing.
    pub(super) const IDENTITY: Self = Self { origin: Vec3::ZERO, axes: Vec3::AXES };

    /// A move to `origin`.
    pub(super) const fn at(origin: Vec3) -> Self {
        Self { origin, axes: Vec3::AXES }
    }

    /// Mirrors across the plane z = 0.
    pub(super) const MIRROR_Z: Self = Self { origin: Vec3::ZERO, axes: [Vec3::X, Vec3::Y, Vec3::NEG_Z] };

    /// The same place with the x axis turned towards −z (counter-clockwise seen from above) by `radians`.
    pub(super) fn turned(self, radians: f32) -> Self {
        let (c, s) = circle(radians);
        let [x, y, z] = self.axes;
        Self { axes: [x * c - z * s, y, x * s + z * c], ..self }
    }

    /// The same place with the x axis turned towards y by `radians`.
    pub(super) fn rolled(self, radians: f32) -> Self {
        let (c, s) = circle(radians);
        let [x, y, z] = self.axes;
        Self { axes: [x * c + y * s, y * c - x * s, z], ..self }
    }

    /// The same place with the y axis turned towards z by `radians`.
    pub(super) fn pitched(self, radians: f32) -> Self {
        let (c, s) = circle(radians);
        let [x, y, z] = self.axes;
        Self { axes: [x, y * c + z * s, z * c - y * s], ..self }
    }

    /// Axes stretched by three factors.
    pub(super) fn scaled(self, factors: Vec3) -> Self {
        let [x, y, z] = self.axes;
        Self { axes: [x * factors.x, y * factors.y, z * factors.z], ..self }
    }

    /// The origin moved by an offset in the frame's own axes.
    pub(super) fn moved(self, offset: Vec3) -> Self {
        Self { origin: self.point(offset), ..self }
    }

    /// A frame at `origin` whose y axis points along `axis`, the others square to it in an arbitrary but fixed way.
    pub(super) fn along(origin: Vec3, axis: Vec3) -> Self {
        let y = axis.normalize();
        let side = if y.x.abs() < 0.8 { Vec3::X } else { Vec3::Z };
        let z = side.cross(y).normalize();
        Self { origin, axes: [y.cross(z), y, z] }
    }

    /// Where the map takes a point.
    pub(super) fn point(&self, p: Vec3) -> Vec3 {
        self.origin + self.vector(p)
    }

    /// Where the map takes a direction.
    pub(super) fn vector(&self, v: Vec3) -> Vec3 {
        self.axes[0] * v.x + self.axes[1] * v.y + self.axes[2] * v.z
    }

    /// Whether the map turns clockwise into counter-clockwise.
    fn mirrors(&self) -> bool {
        self.axes[0].cross(self.axes[1]).dot(self.axes[2]) < 0.0
    }
}

/// Triangles with colours.
#[derive(Clone, Debug, Default)]
pub(super) struct Mesh {
    /// Vertex positions.
    pub(super) positions: Vec<Vec3>,
    /// Vertex indices, counter-clockwise seen from outside.
    pub(super) indices: Vec<[u32; 3]>,
    /// Palette index of each triangle.
    pub(super) colour_of: Vec<u16>,
}

impl Mesh {
    /// Number of triangles.
    pub(super) fn len(&self) -> usize {
        self.indices.len()
    }

    /// Adds a vertex.
    pub(super) fn vertex(&mut self, position: Vec3) -> u32 {
        self.positions.push(position);
        self.positions.len() as u32 - 1
    }

    /// Adds a triangle, unless two of its corners coincide, as at the pole of a lathe.
    pub(super) fn triangle(&mut self, corners: [u32; 3], colour: Colour) {
        let [a, b, c] = corners.map(|i| self.positions[i as usize]);
        if a != b && b != c && c != a {
            self.indices.push(corners);
            self.colour_of.push(colour.index());
        }
    }

    /// Adds a convex polygon as a fan around its first corner.
    pub(super) fn face(&mut self, corners: &[Vec3], colour: Colour) {
        let first = self.positions.len() as u32;
        self.positions.extend_from_slice(corners);
        for i in 2..corners.len() as u32 {
            self.triangle([first, first + i - 1, first + i], colour);
        }
    }

    /// Adds a mapped copy of another mesh.
    pub(super) fn append(&mut self, other: &Self, frame: &Frame) {
        let first = self.positions.len() as u32;
        self.positions.extend(other.positions.iter().map(|&p| frame.point(p)));
        let flip = frame.mirrors();
        self.indices.extend(other.indices.iter().map(|&[a, b, c]| {
            let [b, c] = if flip { [c, b] } else { [b, c] };
            [first + a, first + b, first + c]
        }));
        self.colour_of.extend_from_slice(&other.colour_of);
    }

    /// The finished scene, without the vertices that no triangle uses, such as all but one of each pole's.
    pub(super) fn into_model(self, source: &str, palette: Palette, view: View) -> Model {
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
        let indices = self.indices.iter().map(|corners| corners.map(&mut move_vertex)).collect();
        Model {
            source: source.into(),
            positions,
            indices,
            palette: palette.0,
            colour_of: self.colour_of,
            view: Some(view),
        }
    }

    /// Adds a box of `size`, centred in the frame: 12 triangles.
    pub(super) fn cuboid(&mut self, frame: &Frame, size: Vec3, colour: Colour) {
        self.taper(frame, size, 1.0, colour);
    }

    /// Adds a box whose upper face is `top` times as wide and deep as its lower face: 12 triangles.
    pub(super) fn taper(&mut self, frame: &Frame, size: Vec3, top: f32, colour: Colour) {
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
    pub(super) fn block(&mut self, low: Vec3, high: Vec3, colour: Colour) {
        self.cuboid(&Frame::at((low + high) * 0.5), high - low, colour);
    }

    /// Adds a surface through `rows + 1` times `columns + 1` points, `point(row, column)`.
    ///
    /// Seen from outside, columns run to the right where rows run up. A closed surface gives the very same point for
    /// the first and the last column.
    pub(super) fn grid(
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
    pub(super) fn lathe(&mut self, frame: &Frame, profile: &[[f32; 2]], segments: u32, colour: Colour) {
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
    pub(super) fn tube(&mut self, path: &[Vec3], radius: impl Fn(usize) -> f32, sides: u32, colour: Colour) {
        // Parallel transport: the frame turns no more than the path does, so the tube does not wring.
        let mut across = Frame::along(Vec3::ZERO, direction(path, 0)).axes[0];
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
    pub(super) fn bar(&mut self, from: Vec3, to: Vec3, radius: f32, sides: u32, colour: Colour) {
        self.tube(&[from, to], |_| radius, sides, colour);
    }
}

/// Unit vector along a path at its point `i`: between the neighbours, or to the only one.
fn direction(path: &[Vec3], i: usize) -> Vec3 {
    (path[(i + 1).min(path.len() - 1)] - path[i.saturating_sub(1)]).normalize()
}

/// A stream of random numbers, a function of its seed alone.
#[derive(Clone, Debug)]
pub(super) struct Dice {
    seed: u32,
    thrown: u32,
}

impl Dice {
    /// The stream of `seed`.
    pub(super) const fn new(seed: u32) -> Self {
        Self { seed, thrown: 0 }
    }

    /// A number between `low` and `high`.
    pub(super) fn between(&mut self, low: f32, high: f32) -> f32 {
        self.thrown += 1;
        low + (high - low) * rt_core::random::pair(self.seed, self.thrown, 0)[0]
    }

    /// One of several, all as likely.
    pub(super) fn pick<T: Copy, const N: usize>(&mut self, of: [T; N]) -> T {
        self.thrown += 1;
        of[rt_core::random::below(N as u32, self.seed, self.thrown, 0) as usize]
    }

    /// A point inside the unit sphere, by rejection.
    pub(super) fn in_ball(&mut self) -> Vec3 {
        loop {
            let p = Vec3::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), self.between(-1.0, 1.0));
            if p.length_squared() <= 1.0 {
                return p;
            }
        }
    }
}
