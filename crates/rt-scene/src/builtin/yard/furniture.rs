//! Garden furniture: table, chairs, parasol, bench, pots, and what stands on the table.

use super::paint::Paint;
use super::plants::loose_leaf;
use crate::builtin::mesh::{Dice, Frame, Mesh, circle};
use glam::Vec3;
use std::f32::consts::{PI, TAU};

/// Adds a table of teak planks with its things on it; the frame's origin is on the floor below its middle.
pub(super) fn table(mesh: &mut Mesh, paint: &Paint, at: &Frame) {
    let mut dice = Dice::new(81);
    // 1.7 m by 0.95 m, 0.74 m high: a common table for six.
    let size = Vec3::new(1.7, 0.74, 0.95);
    for plank in 0..9 {
        let z = (plank as f32 - 4.0) * size.z / 9.0;
        mesh.cuboid(
            &at.moved(Vec3::new(0.0, size.y - 0.015, z)),
            Vec3::new(size.x, 0.03, size.z / 9.0 - 0.008),
            dice.pick(paint.teak),
        );
    }
    for x in [-1.0, 1.0] {
        for z in [-1.0, 1.0] {
            let leg = at.moved(Vec3::new(x * 0.76, 0.355, z * 0.38));
            mesh.cuboid(&leg, Vec3::new(0.075, 0.71, 0.075), paint.teak[2]);
        }
        mesh.cuboid(&at.moved(Vec3::new(x * 0.76, 0.66, 0.0)), Vec3::new(0.03, 0.09, 0.68), paint.teak[0]);
    }
    for z in [-0.38, 0.38] {
        mesh.cuboid(&at.moved(Vec3::new(0.0, 0.66, z)), Vec3::new(1.44, 0.09, 0.03), paint.teak[0]);
    }
    let top = at.moved(Vec3::Y * size.y);
    fruit_bowl(mesh, paint, &top.moved(Vec3::new(-0.25, 0.0, 0.05)));
    let jug = [
        [0.0, 0.003],
        [0.055, 0.0],
        [0.075, 0.06],
        [0.07, 0.14],
        [0.045, 0.2],
        [0.055, 0.24],
        [0.05, 0.24],
        [0.04, 0.2],
        [0.06, 0.12],
        [0.0, 0.02],
    ];
    let stand = top.moved(Vec3::new(0.35, 0.0, -0.1));
    mesh.lathe(&stand, &jug, 24, paint.china);
    let handle: Vec<Vec3> = (0..=10)
        .map(|i| {
            let (c, s) = circle(PI * (i as f32 / 10.0 - 0.5));
            stand.point(Vec3::new(0.055 + 0.06 * c, 0.13 + 0.07 * s, 0.0))
        })
        .collect();
    mesh.tube(&handle, |_| 0.008, 6, paint.china);
    for [x, z] in [[0.55, 0.2], [-0.6, -0.2], [0.62, -0.25], [-0.55, 0.3]] {
        let cup = [[0.0, 0.002], [0.028, 0.0], [0.036, 0.1], [0.033, 0.1], [0.025, 0.012]];
        mesh.lathe(&top.moved(Vec3::new(x, 0.0, z)), &cup, 16, paint.canvas[1]);
        let plate = [[0.0, 0.002], [0.07, 0.0], [0.12, 0.018], [0.118, 0.021], [0.07, 0.008], [0.0, 0.008]];
        mesh.lathe(&top.moved(Vec3::new(x * 0.8, 0.0, z * 1.15)), &plate, 24, paint.china);
    }
}

/// Adds a bowl of fruit.
fn fruit_bowl(mesh: &mut Mesh, paint: &Paint, at: &Frame) {
    let bowl =
        [[0.0, 0.004], [0.06, 0.0], [0.13, 0.05], [0.16, 0.1], [0.15, 0.1], [0.12, 0.055], [0.05, 0.02], [0.0, 0.02]];
    mesh.lathe(at, &bowl, 28, paint.shutter);
    for i in 0..7 {
        let (c, s) = circle(i as f32 / 6.0 * TAU);
        let out = if i == 6 { 0.0 } else { 0.085 };
        let r = 0.042;
        let profile: Vec<[f32; 2]> = (0..=8)
            .map(|k| {
                let (c, s) = circle(PI * (k as f32 / 8.0 - 0.5));
                [if k % 8 == 0 { 0.0 } else { r * c }, r * s]
            })
            .collect();
        let height = if i == 6 { 0.14 } else { 0.095 };
        mesh.lathe(&at.moved(Vec3::new(out * c, height, out * s)), &profile, 12, paint.fruit[i % 3]);
    }
}

/// Adds a slatted chair that faces the frame's −z.
pub(super) fn chair(mesh: &mut Mesh, paint: &Paint, at: &Frame, seed: u32) {
    let mut dice = Dice::new(seed);
    for x in [-0.23, 0.23] {
        mesh.cuboid(&at.moved(Vec3::new(x, 0.31, -0.2)), Vec3::new(0.045, 0.62, 0.045), paint.teak[0]);
        let back = at.moved(Vec3::new(x, 0.21, 0.22));
        mesh.cuboid(&back, Vec3::new(0.045, 0.42, 0.045), paint.teak[2]);
        mesh.cuboid(&at.moved(Vec3::new(x, 0.68, 0.265)).pitched(0.16), Vec3::new(0.042, 0.54, 0.042), paint.teak[2]);
        mesh.cuboid(&at.moved(Vec3::new(x, 0.635, 0.01)), Vec3::new(0.06, 0.03, 0.5), paint.teak[1]);
        mesh.cuboid(&at.moved(Vec3::new(x, 0.38, 0.01)), Vec3::new(0.03, 0.06, 0.38), paint.teak[0]);
    }
    for slat in 0..6 {
        let z = -0.19 + slat as f32 * 0.076;
        mesh.cuboid(&at.moved(Vec3::new(0.0, 0.425, z)), Vec3::new(0.41, 0.022, 0.062), dice.pick(paint.teak));
    }
    for slat in 0..7 {
        let x = (slat as f32 - 3.0) * 0.058;
        mesh.cuboid(
            &at.moved(Vec3::new(x, 0.69, 0.268)).pitched(0.16),
            Vec3::new(0.036, 0.42, 0.016),
            dice.pick(paint.teak),
        );
    }
    mesh.cuboid(&at.moved(Vec3::new(0.0, 0.92, 0.305)).pitched(0.16), Vec3::new(0.43, 0.07, 0.03), paint.teak[3]);
}

/// Adds a parasol: pole, eight ribs, and a canopy that sags between them.
pub(super) fn parasol(mesh: &mut Mesh, paint: &Paint, at: &Frame) {
    const RIBS: u32 = 8;
    /// Strips across the cloth between two ribs.
    const STRIPS: u32 = 6;
    let (top, rim, radius) = (2.55, 2.02, 1.45);
    mesh.bar(at.point(Vec3::ZERO), at.point(Vec3::Y * (top + 0.05)), 0.022, 12, paint.teak[2]);
    let foot = [[0.26, 0.0], [0.26, 0.05], [0.06, 0.09], [0.04, 0.3], [0.022, 0.3]];
    mesh.lathe(at, &foot, 24, paint.metal);
    let knob = [[0.02, 0.0], [0.035, 0.03], [0.02, 0.07], [0.0, 0.08]];
    mesh.lathe(&at.moved(Vec3::Y * top), &knob, 12, paint.teak[1]);
    let canopy = |turn: f32, t: f32, sag: f32| {
        let (c, s) = circle(turn);
        let y = top + (rim - top) * libm::powf(t, 1.25) - sag * t;
        // Cloth between two ribs runs straight, so it lies nearer to the pole there.
        let r = radius * t * (1.0 - 0.6 * sag);
        at.point(Vec3::new(r * s, y, r * c))
    };
    let columns = RIBS * STRIPS;
    mesh.grid(
        [8, columns],
        |row, column| {
            let s = (column % STRIPS) as f32 / STRIPS as f32;
            // The last row is the valance, hanging down from the rim.
            let t = (8 - row).min(7) as f32 / 7.0;
            let t = if row == 0 { 1.0 } else { t };
            let p = canopy((column % columns) as f32 / columns as f32 * TAU, t, 0.26 * s * (1.0 - s));
            if row == 0 { p - Vec3::Y * 0.13 } else { p }
        },
        |_, column| paint.canvas[(column / STRIPS % 2) as usize],
    );
    for rib in 0..RIBS {
        let turn = rib as f32 / RIBS as f32 * TAU;
        let path: Vec<Vec3> = (0..=6).map(|i| canopy(turn, i as f32 / 6.0, 0.0) - Vec3::Y * 0.015).collect();
        mesh.tube(&path[1..], |_| 0.008, 4, paint.teak[2]);
        let (c, s) = circle(turn);
        mesh.bar(at.point(Vec3::new(0.02 * s, 1.75, 0.02 * c)), canopy(turn, 0.55, 0.02), 0.007, 4, paint.teak[2]);
    }
}

/// Adds a bench that faces the frame's +z, 1.5 m wide, with arms of iron.
pub(super) fn bench(mesh: &mut Mesh, paint: &Paint, at: &Frame) {
    let mut dice = Dice::new(85);
    for slat in 0..5 {
        let z = 0.22 - slat as f32 * 0.095;
        mesh.cuboid(&at.moved(Vec3::new(0.0, 0.44, z)), Vec3::new(1.5, 0.03, 0.08), dice.pick(paint.teak));
    }
    for slat in 0..4 {
        let y = 0.55 + slat as f32 * 0.1;
        let z = -0.22 - slat as f32 * 0.022;
        mesh.cuboid(&at.moved(Vec3::new(0.0, y, z)).pitched(-0.2), Vec3::new(1.5, 0.08, 0.025), dice.pick(paint.teak));
    }
    for x in [-0.68, 0.68] {
        let leg =
            |points: &[[f32; 2]]| -> Vec<Vec3> { points.iter().map(|&[y, z]| at.point(Vec3::new(x, y, z))).collect() };
        mesh.tube(
            &leg(&[[0.0, 0.28], [0.2, 0.23], [0.42, 0.25], [0.6, 0.26], [0.66, 0.2], [0.66, -0.1], [0.64, -0.26]]),
            |_| 0.017,
            8,
            paint.metal,
        );
        mesh.tube(
            &leg(&[[0.0, -0.34], [0.2, -0.24], [0.42, -0.2], [0.6, -0.25], [0.9, -0.32]]),
            |_| 0.017,
            8,
            paint.metal,
        );
        mesh.tube(&leg(&[[0.42, 0.25], [0.38, 0.0], [0.42, -0.2]]), |_| 0.015, 8, paint.metal);
    }
}

/// Adds a terracotta pot with a round plant.
pub(super) fn pot(mesh: &mut Mesh, paint: &Paint, foot: Vec3, size: f32, leaves: u32, seed: u32) {
    let s = size;
    let profile = [
        [0.0, 0.005],
        [0.2 * s, 0.0],
        [0.3 * s, 0.5 * s],
        [0.34 * s, 0.5 * s],
        [0.34 * s, 0.6 * s],
        [0.29 * s, 0.6 * s],
        [0.27 * s, 0.54 * s],
    ];
    mesh.lathe(&Frame::at(foot), &profile, 28, paint.terracotta);
    mesh.lathe(&Frame::at(foot), &[[0.27 * s, 0.54 * s], [0.0, 0.55 * s]], 28, paint.soil);
    let mut dice = Dice::new(seed);
    let centre = foot + Vec3::Y * (0.95 * s);
    mesh.bar(foot + Vec3::Y * (0.54 * s), centre, 0.015, 6, paint.bark);
    for _ in 0..leaves {
        let d = dice.in_ball().normalize_or(Vec3::Y);
        let p = centre + d * (dice.between(0.3, 0.42) * s);
        let colour = dice.pick(paint.ivy);
        loose_leaf(mesh, &mut dice, p, d, 0.07, colour);
    }
}
