//! A wheel: tyre with tread, alloy rim with twin spokes, brake disc and caliper.

use super::paint::Paint;
use super::shape::WHEEL;
use crate::builtin::mesh::{Frame, Mesh, circle};
use glam::Vec3;
use std::f32::consts::{PI, TAU};

/// Radius of the rim's edge, in metres: an 18-inch wheel.
const RIM: f32 = 0.235;
/// Half the width of the tyre.
const HALF_WIDTH: f32 = 0.118;
/// Blocks around each shoulder of the tread.
const BLOCKS: u32 = 72;
/// Pairs of spokes.
const SPOKES: u32 = 7;

/// A wheel around the origin. The axle is the y axis, the outer face at +y.
pub(super) fn wheel(paint: &Paint) -> Mesh {
    let mut mesh = Mesh::default();
    let frame = Frame::IDENTITY;
    tyre(&mut mesh, paint);
    // The barrel: from the outer flange inwards to the hub side, and the lip.
    let barrel = [
        [RIM - 0.016, -0.10],
        [RIM - 0.030, -0.04],
        [RIM - 0.030, 0.05],
        [RIM - 0.020, 0.085],
        [RIM - 0.012, 0.10],
        [RIM + 0.004, 0.104],
        [RIM + 0.008, 0.097],
    ];
    let inwards: Vec<[f32; 2]> = barrel.iter().rev().copied().collect();
    mesh.lathe(&frame, &inwards, 80, paint.alloy);
    for i in 0..SPOKES {
        for side in [-1.0, 1.0] {
            spoke(&mut mesh, paint, i as f32 / SPOKES as f32 * TAU, side);
        }
    }
    hub(&mut mesh, paint);
    brake(&mut mesh, paint);
    mesh
}

/// Adds the tyre: a lathe with four grooves, and blocks on both shoulders.
fn tyre(mesh: &mut Mesh, paint: &Paint) {
    let mut profile = vec![[RIM - 0.01, -0.088], [RIM + 0.012, -0.104], [RIM + 0.045, -HALF_WIDTH]];
    profile.extend([[WHEEL - 0.04, -0.117], [WHEEL - 0.016, -0.107], [WHEEL - 0.007, -0.095]]);
    // Grooves 9 mm wide and 7 mm deep.
    for groove in [-0.06, -0.02, 0.02, 0.06_f32] {
        let crown = WHEEL - 0.25 * groove * groove;
        profile.extend([
            [crown, groove - 0.0046],
            [crown - 0.007, groove - 0.0035],
            [crown - 0.007, groove + 0.0035],
            [crown, groove + 0.0046],
        ]);
    }
    profile.extend([[WHEEL - 0.007, 0.095], [WHEEL - 0.016, 0.107], [WHEEL - 0.04, 0.117]]);
    profile.extend([[RIM + 0.045, HALF_WIDTH], [RIM + 0.02, 0.110], [RIM + 0.012, 0.104], [RIM - 0.01, 0.088]]);
    mesh.lathe(&Frame::IDENTITY, &profile, 96, paint.rubber);
    for side in [-1.0, 1.0] {
        for i in 0..BLOCKS {
            let (c, s) = circle((i as f32 + if side > 0.0 { 0.5 } else { 0.0 }) / BLOCKS as f32 * TAU);
            let out = Vec3::new(s, 0.0, c);
            let centre = out * (WHEEL - 0.0132) + Vec3::Y * (side * 0.093);
            let along = Frame::along(centre, out + Vec3::Y * (side * 0.45));
            mesh.taper(&along.turned(block_turn(&along, side)), Vec3::new(0.021, 0.012, 0.036), 0.85, paint.rubber);
        }
    }
}

/// By how much to turn a block so that its long side lies across the tread.
fn block_turn(along: &Frame, side: f32) -> f32 {
    let across = Vec3::Y * side;
    let [x, z] = [along.vector(Vec3::X).dot(across), along.vector(Vec3::Z).dot(across)];
    // `turned` takes z to x sin + z cos.
    libm::atan2f(x, z)
}

/// Adds one half of a twin spoke: it leaves the hub near its twin and meets the rim apart from it.
fn spoke(mesh: &mut Mesh, paint: &Paint, turn: f32, side: f32) {
    const STEPS: u32 = 12;
    // The section: a bar with a chamfered face, 14 mm deep at the rim and 35 mm at the hub.
    const SECTION: [[f32; 2]; 8] =
        [[-1.0, 0.0], [-1.0, 0.6], [-0.55, 1.0], [0.55, 1.0], [1.0, 0.6], [1.0, 0.0], [0.6, -0.2], [-0.6, -0.2]];
    mesh.grid(
        [STEPS, 8],
        |row, column| {
            let t = row as f32 / STEPS as f32;
            let r = 0.045 + (RIM - 0.022 - 0.045) * t;
            let spread = side * (0.10 + 0.03 * t) * (0.6 + 0.4 * t);
            let (c, s) = circle(turn + spread);
            let out = Vec3::new(s, 0.0, c);
            let around = Vec3::new(c, 0.0, -s);
            let half = 0.0125 - 0.0035 * libm::sinf(PI * t);
            let [u, v] = SECTION[(column % 8) as usize];
            // Dished: the face falls back from the rim to the hub.
            let face = 0.088 - 0.03 * (1.0 - t) * (1.0 - t);
            let depth = 0.034 - 0.016 * t;
            out * r + around * (u * half) + Vec3::Y * (face + depth * (v - 1.0))
        },
        |_, _| paint.alloy,
    );
}

/// Adds hub, cap and five bolts.
fn hub(mesh: &mut Mesh, paint: &Paint) {
    let hub =
        [[0.072, -0.02], [0.072, 0.045], [0.064, 0.058], [0.036, 0.062], [0.034, 0.07], [0.026, 0.076], [0.0, 0.078]];
    mesh.lathe(&Frame::IDENTITY, &hub, 48, paint.alloy);
    for i in 0..5 {
        let (c, s) = circle(i as f32 / 5.0 * TAU);
        let at = Frame::at(Vec3::new(0.05 * s, 0.056, 0.05 * c));
        mesh.lathe(&at, &[[0.0095, 0.0], [0.0095, 0.014], [0.006, 0.018], [0.0, 0.018]], 6, paint.steel);
    }
}

/// Adds a ventilated brake disc, its vanes, and the caliper at the rear of it.
fn brake(mesh: &mut Mesh, paint: &Paint) {
    let plate = |low: f32| [[0.075, low], [0.172, low], [0.172, low + 0.009], [0.075, low + 0.009]];
    for low in [-0.03, -0.006] {
        mesh.lathe(&Frame::IDENTITY, &plate(low), 80, paint.steel);
    }
    for i in 0..48 {
        let frame = Frame::IDENTITY.turned(i as f32 / 48.0 * TAU);
        mesh.cuboid(
            &frame.moved(Vec3::new(0.13, -0.0135, 0.0)).turned(0.4),
            Vec3::new(0.075, 0.0148, 0.004),
            paint.steel,
        );
    }
    // Slots in the outer plate's face, as raised dark strips half a millimetre high.
    for i in 0..12 {
        let frame = Frame::IDENTITY.turned((i as f32 + 0.5) / 12.0 * TAU);
        mesh.cuboid(
            &frame.moved(Vec3::new(0.125, 0.0032, 0.0)).turned(0.5),
            Vec3::new(0.075, 0.001, 0.004),
            paint.black,
        );
    }
    const STEPS: u32 = 14;
    mesh.grid(
        [8, STEPS],
        |row, column| {
            let t = column as f32 / STEPS as f32;
            let (c, s) = circle(PI * (0.5 + 0.30 * (t - 0.5)) + PI);
            // The ends close to an edge, so that the caliper looks solid.
            let full = libm::sqrtf(libm::sqrtf((1.0 - (2.0 * t - 1.0) * (2.0 * t - 1.0)).max(0.0)));
            let (u, v) = circle(row as f32 % 8.0 / 8.0 * TAU + PI / 8.0);
            let r = 0.155 + 0.036 * full.max(0.15) * u;
            Vec3::new(r * s, -0.01 + 0.042 * full.max(0.15) * v, r * c)
        },
        |_, _| paint.caliper,
    );
}
