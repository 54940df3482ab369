//! What one sees through the open windows: tub, seats, dashboard, steering wheel.

use super::paint::Paint;
use crate::builtin::mesh::{Colour, Frame, Mesh, bump, circle};
use glam::Vec3;
use std::f32::consts::{PI, TAU};

/// Adds a cushion: a superellipsoid with half-axes `half`, squarish by `power` (1 is an ellipsoid, towards 0 a box).
pub(super) fn cushion(
    mesh: &mut Mesh,
    frame: &Frame,
    half: Vec3,
    power: f32,
    [rows, columns]: [u32; 2],
    colour: Colour,
) {
    let raise = |x: f32| if x.abs() < 1e-6 { 0.0 } else { x.signum() * libm::powf(x.abs(), power) };
    mesh.grid(
        [rows, columns],
        |row, column| {
            let (level, up) = circle(PI * (row as f32 / rows as f32 - 0.5));
            let (c, s) = circle(TAU * (column % columns) as f32 / columns as f32);
            let level = if row % rows == 0 { 0.0 } else { raise(level) };
            let around = Vec3::new(level * raise(s), raise(up), level * raise(c));
            frame.point(around * half)
        },
        |_, _| colour,
    );
}

/// Adds the whole interior.
pub(super) fn interior(mesh: &mut Mesh, paint: &Paint) {
    tub(mesh, paint);
    for z in [-0.37, 0.37] {
        seat(mesh, paint, &Frame::at(Vec3::new(-0.22, 0.30, z)), 1.0);
        seat(mesh, paint, &Frame::at(Vec3::new(-0.98, 0.34, z * 0.86)), 0.8);
    }
    dashboard(mesh, paint);
    steering_wheel(mesh, paint);
    console(mesh, paint);
    // The mirror inside, below the windscreen's upper edge.
    let mirror = Frame::at(Vec3::new(0.33, 1.12, 0.0)).turned(0.15);
    cushion(mesh, &mirror, Vec3::new(0.012, 0.032, 0.115), 0.4, [10, 24], paint.black);
    mesh.bar(mirror.point(Vec3::ZERO), Vec3::new(0.36, 1.19, 0.0), 0.006, 8, paint.black);
}

/// Adds floor, bulkheads and door cards: a dark box that the body hides from outside.
fn tub(mesh: &mut Mesh, paint: &Paint) {
    let low = Vec3::new(-1.45, 0.235, -0.70);
    let high = Vec3::new(0.93, 0.80, 0.70);
    let corner = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    mesh.face(
        &[
            corner(low.x, low.y, high.z),
            corner(high.x, low.y, high.z),
            corner(high.x, low.y, low.z),
            corner(low.x, low.y, low.z),
        ],
        paint.carpet,
    );
    // The bulkheads lean; the rear one carries the shelf below the rear window.
    mesh.face(
        &[
            corner(high.x, low.y, low.z),
            corner(high.x, low.y, high.z),
            corner(high.x + 0.1, high.y - 0.03, high.z),
            corner(high.x + 0.1, high.y - 0.03, low.z),
        ],
        paint.carpet,
    );
    mesh.face(
        &[
            corner(low.x + 0.15, low.y, high.z),
            corner(low.x + 0.15, low.y, low.z),
            corner(low.x, 0.84, low.z),
            corner(low.x, 0.84, high.z),
        ],
        paint.carpet,
    );
    mesh.face(
        &[corner(low.x, 0.84, -0.66), corner(-1.72, 0.86, -0.5), corner(-1.72, 0.86, 0.5), corner(low.x, 0.84, 0.66)],
        paint.leather_dark,
    );
    for side in [-1.0, 1.0] {
        door_card(mesh, paint, side);
    }
}

/// Adds the lining of one side, with an armrest and a grab handle.
fn door_card(mesh: &mut Mesh, paint: &Paint, side: f32) {
    mesh.grid(
        [16, 40],
        |row, column| {
            let [t, s] = [row as f32 / 16.0, column as f32 / 40.0];
            let x = -1.45 + 2.40 * s;
            // Bows outwards in the middle, and has a ledge at armrest height.
            let ledge = 0.035 * bump(0.6, 0.09, t);
            let z = 0.70 + 0.035 * libm::sinf(PI * t) - ledge;
            Vec3::new(x, 0.235 + 0.56 * t, side * z)
        },
        |row, _| if row < 8 { paint.leather_dark } else { paint.leather },
    );
    let rest = Frame::at(Vec3::new(0.15, 0.60, side * 0.68));
    cushion(mesh, &rest, Vec3::new(0.26, 0.03, 0.045), 0.5, [10, 24], paint.leather_dark);
    let grip: Vec<Vec3> = (0..=12)
        .map(|i| {
            let (c, s) = circle(PI * i as f32 / 12.0);
            Vec3::new(0.52 + 0.07 * c, 0.69, side * (0.70 - 0.045 * s))
        })
        .collect();
    mesh.tube(&grip, |_| 0.008, 8, paint.chrome);
}

/// Adds a bucket seat that faces +x: cushion and back with bolsters and pleats, and a headrest.
fn seat(mesh: &mut Mesh, paint: &Paint, at: &Frame, size: f32) {
    let at = at.scaled(Vec3::splat(size));
    let fine = [14, 32];
    let base = at.moved(Vec3::new(0.0, 0.08, 0.0)).rolled(0.14);
    cushion(mesh, &base, Vec3::new(0.27, 0.075, 0.19), 0.45, fine, paint.leather);
    let back = at.moved(Vec3::new(-0.32, 0.40, 0.0)).rolled(0.30);
    cushion(mesh, &back, Vec3::new(0.06, 0.33, 0.17), 0.5, fine, paint.leather);
    for side in [-1.0, 1.0] {
        let bolster = base.moved(Vec3::new(0.0, 0.035, side * 0.215));
        cushion(mesh, &bolster, Vec3::new(0.26, 0.075, 0.055), 0.6, fine, paint.leather_dark);
        let wing = back.moved(Vec3::new(0.035, -0.03, side * 0.20));
        cushion(mesh, &wing, Vec3::new(0.085, 0.29, 0.055), 0.6, fine, paint.leather_dark);
    }
    // Pleats: rolls across cushion and back.
    for i in 0..6 {
        let roll = base.moved(Vec3::new(-0.15 + 0.065 * i as f32, 0.07, 0.0));
        cushion(mesh, &roll, Vec3::new(0.031, 0.016, 0.145), 0.6, [8, 16], paint.leather);
        let roll = back.moved(Vec3::new(0.055, -0.20 + 0.075 * i as f32, 0.0));
        cushion(mesh, &roll, Vec3::new(0.016, 0.036, 0.135), 0.6, [8, 16], paint.leather);
    }
    let head = back.moved(Vec3::new(0.0, 0.43, 0.0));
    cushion(mesh, &head, Vec3::new(0.045, 0.08, 0.12), 0.5, fine, paint.leather_dark);
    for z in [-0.05, 0.05] {
        mesh.bar(
            back.point(Vec3::new(0.0, 0.28, z)),
            head.point(Vec3::new(0.0, -0.04, z)),
            0.007 * size,
            8,
            paint.chrome,
        );
    }
}

/// Adds the dashboard: a swept section, a binnacle with two dials before the driver, vents.
fn dashboard(mesh: &mut Mesh, paint: &Paint) {
    /// Section in (x, y), from below the windscreen over the top and down towards the knees.
    const SECTION: [[f32; 2]; 9] = [
        [1.00, 0.80],
        [0.86, 0.835],
        [0.72, 0.84],
        [0.62, 0.825],
        [0.585, 0.795],
        [0.59, 0.75],
        [0.62, 0.68],
        [0.66, 0.58],
        [0.74, 0.48],
    ];
    mesh.grid(
        [8, 48],
        |row, column| {
            let s = column as f32 / 24.0 - 1.0;
            let [x, y] = SECTION[row as usize];
            // The ends curve towards the doors.
            Vec3::new(x - 0.12 * s * s * s * s, y - 0.03 * s * s, 0.68 * s)
        },
        |row, _| if row < 4 { paint.leather_dark } else { paint.leather },
    );
    let driver = 0.37;
    let hood = Frame::at(Vec3::new(0.63, 0.845, driver));
    cushion(mesh, &hood, Vec3::new(0.11, 0.055, 0.19), 0.6, [14, 36], paint.leather_dark);
    for side in [-1.0, 1.0] {
        let dial = Frame::along(Vec3::new(0.53, 0.845, driver + side * 0.08), Vec3::new(-1.0, 0.15, 0.0));
        mesh.lathe(
            &dial,
            &[[0.058, -0.02], [0.058, 0.012], [0.05, 0.012], [0.048, 0.002], [0.0, 0.002]],
            32,
            paint.chrome,
        );
    }
    // The outer vents sit where the ends have curved away.
    for [x, z] in [[0.553, -0.58], [0.583, -0.1], [0.583, 0.1], [0.553, 0.62]] {
        let vent = Frame::along(Vec3::new(x, 0.765, z), Vec3::NEG_X);
        mesh.lathe(&vent, &[[0.045, -0.01], [0.045, 0.012], [0.036, 0.012], [0.034, -0.01]], 28, paint.chrome);
        for i in 0..5 {
            let blade = vent.moved(Vec3::new(0.0, 0.0, 0.013 * (i as f32 - 2.0)));
            mesh.cuboid(&blade, Vec3::new(0.062, 0.012, 0.002), paint.black);
        }
    }
}

/// Adds the steering wheel and its column, before the left seat.
fn steering_wheel(mesh: &mut Mesh, paint: &Paint) {
    const RADIUS: f32 = 0.178;
    let axis = Vec3::new(-0.92, 0.40, 0.0);
    let frame = Frame::along(Vec3::new(0.36, 0.80, 0.37), axis);
    let ring = 64;
    mesh.grid(
        [ring, 14],
        |row, column| {
            let (c, s) = circle(TAU * (row % ring) as f32 / ring as f32);
            let (u, v) = circle(TAU * (column % 14) as f32 / 14.0);
            let r = RADIUS + 0.0145 * u;
            frame.point(Vec3::new(r * s, 0.0145 * v, r * c))
        },
        |_, _| paint.leather_dark,
    );
    cushion(mesh, &frame.moved(Vec3::Y * -0.01), Vec3::new(0.06, 0.025, 0.06), 0.7, [12, 28], paint.black);
    for turn in [0.0, 0.5 * PI, PI] {
        let (c, s) = circle(turn + 0.5 * PI);
        let to = |r: f32, y: f32| frame.point(Vec3::new(r * c, y, r * s));
        for side in [-0.1, 0.1] {
            let (c2, s2) = circle(turn + 0.5 * PI + side);
            let end = frame.point(Vec3::new(RADIUS * c2, 0.0, RADIUS * s2));
            mesh.tube(&[to(0.04, -0.015), (to(0.11, -0.012) + end) * 0.5, end], |_| 0.007, 8, paint.alloy);
        }
    }
    mesh.bar(frame.point(Vec3::Y * -0.02), frame.point(Vec3::Y * -0.3), 0.035, 16, paint.black);
}

/// Adds the tunnel between the seats with gear lever, knob and handbrake.
fn console(mesh: &mut Mesh, paint: &Paint) {
    let tunnel = Frame::at(Vec3::new(0.05, 0.36, 0.0));
    cushion(mesh, &tunnel, Vec3::new(0.72, 0.14, 0.105), 0.35, [16, 48], paint.leather_dark);
    let stack = Frame::at(Vec3::new(0.64, 0.62, 0.0)).rolled(-0.25);
    cushion(mesh, &stack, Vec3::new(0.05, 0.18, 0.12), 0.4, [14, 36], paint.black);
    let foot = Vec3::new(0.32, 0.49, 0.0);
    let knob = Vec3::new(0.29, 0.64, 0.0);
    mesh.bar(foot, knob, 0.008, 10, paint.chrome);
    cushion(mesh, &Frame::at(knob), Vec3::splat(0.026), 1.0, [12, 24], paint.chrome);
    let gaiter = [[0.055, 0.0], [0.045, 0.02], [0.034, 0.025], [0.03, 0.045], [0.02, 0.05], [0.01, 0.075]];
    mesh.lathe(&Frame::at(foot), &gaiter, 24, paint.leather);
    mesh.tube(
        &[Vec3::new(-0.02, 0.5, 0.02), Vec3::new(0.1, 0.54, 0.02), Vec3::new(0.2, 0.57, 0.02)],
        |_| 0.014,
        12,
        paint.black,
    );
}
