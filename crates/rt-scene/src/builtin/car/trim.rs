//! Mirrors, handles, wipers, sills, exhausts, diffuser, spoiler, plates.

use super::interior::cushion;
use super::paint::Paint;
use super::shape::deck;
use crate::builtin::mesh::{Frame, Mesh};
use glam::Vec3;

/// Adds the left half of the trim.
pub(super) fn half_trim(mesh: &mut Mesh, paint: &Paint) {
    mirror(mesh, paint);
    handle(mesh, paint);
    sill(mesh, paint);
    exhaust(mesh, paint);
    spoiler(mesh, paint);
}

/// Adds the mirror on the door, its glass to the rear.
fn mirror(mesh: &mut Mesh, paint: &Paint) {
    let head = Frame::at(Vec3::new(0.60, 0.945, 0.955)).turned(0.12);
    cushion(mesh, &head, Vec3::new(0.065, 0.058, 0.105), 0.65, [20, 40], paint.body);
    let glass = head.moved(Vec3::new(-0.05, 0.0, 0.0));
    cushion(mesh, &glass, Vec3::new(0.018, 0.046, 0.09), 0.5, [10, 28], paint.mirror);
    let foot = Vec3::new(0.64, 0.855, 0.80);
    mesh.tube(&[foot, Vec3::new(0.625, 0.895, 0.86), Vec3::new(0.605, 0.92, 0.92)], |_| 0.017, 12, paint.black);
}

/// Adds the handle of the door and the recess behind it.
fn handle(mesh: &mut Mesh, paint: &Paint) {
    let at = Frame::at(Vec3::new(-0.26, 0.70, 0.905));
    cushion(mesh, &at, Vec3::new(0.085, 0.013, 0.017), 0.5, [12, 32], paint.chrome);
    cushion(mesh, &at.moved(Vec3::new(0.0, -0.004, -0.012)), Vec3::new(0.07, 0.024, 0.006), 0.7, [8, 28], paint.black);
}

/// Adds the sill between the wheels.
fn sill(mesh: &mut Mesh, paint: &Paint) {
    let at = Frame::at(Vec3::new(0.03, 0.19, 0.845));
    cushion(mesh, &at, Vec3::new(0.90, 0.035, 0.055), 0.3, [12, 64], paint.black);
}

/// Adds two tail pipes and the fins between them.
fn exhaust(mesh: &mut Mesh, paint: &Paint) {
    for z in [0.47, 0.57] {
        let pipe = Frame::along(Vec3::new(-2.03, 0.285, z), Vec3::NEG_X);
        let profile =
            [[0.042, -0.1], [0.042, 0.10], [0.044, 0.112], [0.039, 0.114], [0.036, 0.10], [0.034, -0.05], [0.0, -0.05]];
        mesh.lathe(&pipe, &profile, 36, paint.chrome);
    }
    for i in 0..3 {
        let z = 0.08 + 0.13 * i as f32;
        let fin = Frame::at(Vec3::new(-2.02, 0.225, z)).rolled(-0.15);
        mesh.cuboid(&fin, Vec3::new(0.34, 0.10, 0.008), paint.black);
    }
}

/// Adds the lip on the edge of the boot.
fn spoiler(mesh: &mut Mesh, paint: &Paint) {
    let columns = 48;
    mesh.grid(
        [5, columns],
        |row, column| {
            let s = column as f32 / columns as f32;
            let z = 0.66 * s;
            let x = -2.06 + 0.12 * z * z;
            // Its ends run out into the boot lid.
            let fade = 1.0 - s * s * s * s;
            let [out, up] =
                [[-0.045, -0.012], [-0.06, 0.020], [-0.055, 0.027], [-0.03, 0.016], [0.02, 0.005], [0.08, -0.010]]
                    [row as usize];
            Vec3::new(x + out, deck(x + out, z) + if row == 0 { up } else { up * fade - 0.006 * (1.0 - fade) }, z)
        },
        |_, _| paint.body,
    );
}

/// Adds what has no mirror image: wipers, plates, badge.
pub(super) fn single_trim(mesh: &mut Mesh, paint: &Paint) {
    for (pivot, tip) in [([0.98, 0.25], [0.80, -0.36]), ([1.0, -0.28], [0.78, -0.62])] {
        let at = |t: f32, up: f32| {
            let [x, z] = [pivot[0] + (tip[0] - pivot[0]) * t, pivot[1] + (tip[1] - pivot[1]) * t];
            Vec3::new(x, deck(x, z) + 0.03 + up, z)
        };
        mesh.tube(&[at(0.0, 0.0), at(0.25, 0.03), at(0.6, 0.03)], |_| 0.007, 6, paint.black);
        mesh.tube(&[at(0.22, 0.02), at(0.6, 0.022), at(1.0, 0.02)], |_| 0.005, 6, paint.black);
    }
    let rear = Frame::at(Vec3::new(-2.185, 0.5, 0.0));
    mesh.cuboid(&rear, Vec3::new(0.008, 0.11, 0.50), paint.plate);
}

/// Triangles of the badge's rim: two strips of 32 segments.
pub(super) const BADGE_RIM: usize = 2 * 2 * 32;

/// Adds the badge on the bonnet, a dish whose face has `segments` triangles.
pub(super) fn badge(mesh: &mut Mesh, paint: &Paint, segments: u32) {
    let at = Frame::along(Vec3::new(2.02, deck(2.02, 0.0) + 0.002, 0.0), Vec3::new(0.35, 1.0, 0.0));
    mesh.lathe(&at, &[[0.034, -0.004], [0.034, 0.004], [0.028, 0.007]], 32, paint.chrome);
    mesh.lathe(&at, &[[0.027, 0.006], [0.0, 0.008]], segments, paint.gap);
}
