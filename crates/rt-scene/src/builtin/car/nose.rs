//! What sits in the openings of the nose: the grille's wires, lamps, splitter.

use super::body::{grille_field, intake_field};
use super::interior::cushion;
use super::paint::Paint;
use super::shape::{HALF_LENGTH, body, stations};
use crate::builtin::mesh::{Colour, Frame, Mesh, circle};
use glam::Vec3;
use std::f32::consts::{PI, TAU};

/// The body's front as one sees it from ahead: for a height and a distance from the middle, where it is along the car.
///
/// A table of many points of the shell, in columns of equal distance from the middle.
pub(super) struct Face(Vec<Vec<Vec3>>);

/// Columns of a [`Face`] in a metre.
const COLUMNS: f32 = 50.0;

impl Face {
    /// Tabulates the shell every 5 mm or so.
    pub(super) fn new() -> Self {
        let mut columns = vec![Vec::new(); COLUMNS as usize];
        for x in stations(800).into_iter().filter(|&x| x > 1.5) {
            for j in 0..=240 {
                let p = body(x, j as f32 / 240.0);
                if let Some(column) = columns.get_mut((p.z * COLUMNS) as usize) {
                    column.push(p);
                }
            }
        }
        Self(columns)
    }

    /// Where the shell is along the car, by the nearest point of the table.
    fn at(&self, y: f32, z: f32) -> f32 {
        let column = (z.abs() * COLUMNS) as usize;
        let near = self.0.iter().skip(column.saturating_sub(1)).take(3).flatten();
        let distance = |p: &Vec3| (p.y - y) * (p.y - y) + (p.z - z.abs()) * (p.z - z.abs());
        near.min_by(|a, b| distance(a).total_cmp(&distance(b))).map_or(HALF_LENGTH, |p| p.x)
    }
}

/// Two crossing families of wires in the grille and the intakes; each is a path just behind the opening.
pub(super) fn wires(face: &Face) -> Vec<Vec<Vec3>> {
    let mut paths = Vec::new();
    // Distance between wires, and how far behind the body's face they run.
    let pitch = 0.0165;
    for lean in [-1.0, 1.0] {
        for i in -46..=46 {
            let foot = i as f32 * pitch * std::f32::consts::SQRT_2;
            let mut path = Vec::new();
            for k in 0..=40 {
                let y = 0.27 + 0.2 * k as f32 / 40.0;
                let z = foot + lean * (y - 0.37);
                let p = Vec3::new(2.0, y, z.abs());
                if grille_field(p).min(intake_field(p)) < 0.004 {
                    path.push(Vec3::new(face.at(y, z) - 0.022, y, z));
                } else if path.len() > 2 {
                    paths.push(std::mem::take(&mut path));
                } else {
                    path.clear();
                }
            }
            if path.len() > 2 {
                paths.push(path);
            }
        }
    }
    paths
}

/// Point of a path at a fraction of its index.
pub(super) fn along(path: &[Vec3], t: f32) -> Vec3 {
    let at = t * (path.len() - 1) as f32;
    let i = (at as usize).min(path.len() - 2);
    path[i].lerp(path[i + 1], at - i as f32)
}

/// Adds the left half of what is fixed: lamps, backs of the openings, splitter.
pub(super) fn half_nose(mesh: &mut Mesh, paint: &Paint, face: &Face) {
    // Two projector lamps with rings, and a row of small lights above them.
    for (y, z, r) in [(0.573, 0.565, 0.043), (0.588, 0.675, 0.043)] {
        let x = face.at(y, z) - 0.065;
        let lamp = Frame::along(Vec3::new(x, y, z), Vec3::new(1.0, 0.08, 0.12));
        ring(mesh, &lamp, r, paint.chrome);
        let lens: Vec<[f32; 2]> = (0..=8)
            .map(|i| {
                let (c, s) = circle(0.5 * PI * i as f32 / 8.0);
                [if i == 8 { 0.0 } else { 0.82 * r * c }, 0.012 + 0.6 * r * s]
            })
            .collect();
        mesh.lathe(&lamp, &lens, 32, paint.lens);
    }
    for i in 0..9 {
        let z = 0.525 + 0.027 * i as f32;
        let y = 0.624 + 0.28 * (z - 0.6) - 0.008;
        let x = face.at(y, z) - 0.022;
        cushion(
            mesh,
            &Frame::at(Vec3::new(x, y, z)),
            Vec3::new(0.012, 0.006, 0.010),
            0.5,
            [6, 12],
            if i > 6 { paint.amber } else { paint.lens },
        );
    }
    // The dark backs of grille and intake, 9 cm in.
    back(mesh, face, [0.0, 0.50], [0.28, 0.47], paint.black);
    back(mesh, face, [0.55, 0.76], [0.27, 0.44], paint.black);
    splitter(mesh, paint);
}

/// Adds a ring around a lamp.
fn ring(mesh: &mut Mesh, lamp: &Frame, radius: f32, colour: Colour) {
    let section: Vec<[f32; 2]> = (0..=10)
        .map(|i| {
            let (c, s) = circle(TAU * (i % 10) as f32 / 10.0);
            [radius + 0.006 * c, 0.01 + 0.012 * s]
        })
        .collect();
    mesh.lathe(lamp, &section, 40, colour);
}

/// Adds a panel that follows the nose, behind an opening.
fn back(mesh: &mut Mesh, face: &Face, [z0, z1]: [f32; 2], [y0, y1]: [f32; 2], colour: Colour) {
    mesh.grid(
        [8, 16],
        |row, column| {
            let z = z1 - (z1 - z0) * column as f32 / 16.0;
            let y = y0 + (y1 - y0) * row as f32 / 8.0;
            Vec3::new(face.at(y, z) - 0.09, y, z)
        },
        |_, _| colour,
    );
}

/// Adds a thin lip under the nose, 3 cm ahead of it.
fn splitter(mesh: &mut Mesh, paint: &Paint) {
    let columns = 40;
    mesh.grid(
        [4, columns],
        |row, column| {
            let s = 1.0 - column as f32 / columns as f32;
            let z = 0.86 * s;
            let x = 2.20 - 0.10 * s * s - 0.42 * libm::powf(s, 6.0);
            let [out, y] = [[-0.25, 0.165], [0.03, 0.165], [0.04, 0.172], [0.03, 0.18], [-0.25, 0.185]][row as usize];
            Vec3::new(x + out, y, z)
        },
        |_, _| paint.black,
    );
}
