//! A sports saloon on a studio floor. Metres, y up; the nose points to +x.

mod body;
mod cabin;
mod paint;
mod shape;
mod surface;

use super::mesh::{Frame, Mesh, Palette};
use crate::{Model, View};
use glam::Vec3;
use paint::Paint;

/// Number of triangles: that of the car in the paper this project follows.
pub(super) const TRIANGLES: usize = 234_443;

/// Builds the car.
pub(super) fn build() -> Model {
    let mut palette = Palette::default();
    let paint = Paint::new(&mut palette);
    let mut half = Mesh::default();
    body::half_body(&mut half, &paint);
    eprintln!("body {}", half.len() * 2);
    cabin::half_cabin(&mut half, &paint);
    eprintln!("cabin {}", half.len() * 2);
    let mut mesh = Mesh::default();
    mesh.append(&half, &Frame::IDENTITY);
    mesh.append(&half, &Frame::MIRROR_Z);
    mesh.lathe(&Frame::IDENTITY, &[[30.0, 0.0], [0.0, 0.0]], 96, paint.floor);
    Model {
        source: "builtin:car".into(),
        positions: mesh.positions,
        indices: mesh.indices,
        palette: palette.into_colours(),
        colour_of: mesh.colour_of,
        view: Some(View {
            eye: Vec3::new(4.6, 1.55, 4.3),
            target: Vec3::new(0.05, 0.5, 0.0),
            up: Vec3::Y,
            fov_degrees: 32.0,
        }),
    }
}
