//! A sports saloon on a studio floor. Metres, y up; the nose points to +x.

mod body;
mod cabin;
mod interior;
mod nose;
mod paint;
mod shape;
mod surface;
mod trim;
mod wheel;

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
    cabin::half_cabin(&mut half, &paint);
    nose::half_nose(&mut half, &paint);
    trim::half_trim(&mut half, &paint);
    let wheel = wheel::wheel(&paint);
    for axle in shape::AXLES {
        // The wheel's outer face, +y of its own, looks to the left; a turn about the axle puts the caliper behind.
        let place = Frame::at(Vec3::new(axle, shape::WHEEL, TRACK)).pitched(std::f32::consts::FRAC_PI_2);
        half.append(&wheel, &place);
    }
    let mut mesh = Mesh::default();
    mesh.append(&half, &Frame::IDENTITY);
    mesh.append(&half, &Frame::MIRROR_Z);
    interior::interior(&mut mesh, &paint);
    trim::single_trim(&mut mesh, &paint);
    floor(&mut mesh, &paint);
    // Pieces of wire come in sixes; the badge takes what does not divide.
    let left = TRIANGLES.saturating_sub(mesh.len() + trim::BADGE_RIM);
    trim::badge(&mut mesh, &paint, 24 + (left % TRIANGLES_PER_PIECE) as u32);
    wires(&mut mesh, &paint);
    let view =
        View { eye: Vec3::new(4.6, 1.55, 4.3), target: Vec3::new(0.05, 0.5, 0.0), up: Vec3::Y, fov_degrees: 32.0 };
    mesh.into_model("builtin:car", palette, view)
}

/// Half the distance between the middles of the tyres.
const TRACK: f32 = 0.782;
/// Half the side of the floor, in metres.
const FLOOR: f32 = 150.0;
/// Triangles of a piece of a grille's wire, which has three sides.
const TRIANGLES_PER_PIECE: usize = 6;

/// Adds the floor: one square, so that rays beside the car cost next to nothing.
fn floor(mesh: &mut Mesh, paint: &Paint) {
    let corner = |x: f32, z: f32| Vec3::new(x, 0.0, z) * FLOOR;
    mesh.face(&[corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0), corner(-1.0, -1.0)], paint.floor);
}

/// Spends what is left of the triangles on the wires of the grille: the more pieces a wire has, the smoother its bow.
fn wires(mesh: &mut Mesh, paint: &Paint) {
    let paths = nose::wires();
    let pieces = TRIANGLES.saturating_sub(mesh.len()) / TRIANGLES_PER_PIECE;
    for (i, path) in paths.iter().enumerate() {
        let count = pieces / paths.len() + usize::from(i < pieces % paths.len());
        let fine: Vec<Vec3> = (0..=count).map(|k| nose::along(path, k as f32 / count as f32)).collect();
        mesh.tube(&fine, |_| 0.0016, 3, paint.steel);
    }
}
