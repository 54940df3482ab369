//! The cabin: roof, pillars and window frames. Its windows are open.

use super::paint::Paint;
use super::shape::deck;
use super::surface::{Surface, flange, rounded};
use crate::builtin::mesh::Mesh;
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// Height where the cabin's shell starts, below the body's upper side, and its own height above that.
const BASE: f32 = 0.78;
const HEIGHT: f32 = 0.50;
/// Where the roof is highest along the car, and how far windscreen and rear window reach from there at the base.
const PEAK: f32 = -0.30;
const FRONT: f32 = 1.42;
const REAR: f32 = 1.62;
/// Half the width at the base.
const HALF_WIDTH: f32 = 0.785;
/// Exponent of the horizontal outline: squarish, its corners are the pillars.
const SQUARE: f32 = 3.4;
/// Strips around the left half and from the base to the roof.
const STRIPS: [u32; 2] = [160, 54];

/// Front reach, rear reach and half width of the horizontal outline at `h`, 0 at the base and 1 at the roof.
fn reach(h: f32) -> [f32; 3] {
    let left = (1.0 - h).max(0.0);
    let width = HALF_WIDTH * (1.0 - 0.20 * h) * libm::sqrtf((1.0 - libm::powf(h, 7.0)).max(0.0));
    [FRONT * libm::powf(left, 0.56), REAR * libm::powf(left, 0.62), width]
}

/// The left half: `turn` from 0 at the front to π at the rear, `h` from 0 at the base to 1 at the roof.
fn cabin(turn: f32, h: f32) -> Vec3 {
    let [front, rear, width] = reach(h);
    let power = 2.0 / SQUARE;
    let c = libm::cosf(turn);
    let along = if c > 0.0 { front } else { rear };
    let x = PEAK + c.signum() * along * libm::powf(c.abs(), power);
    let z = if turn >= PI { 0.0 } else { width * libm::powf(libm::sinf(turn).max(0.0), power) };
    Vec3::new(x, BASE + HEIGHT * h, z)
}

/// Below zero inside the cabin's outline on the body, 2 cm in from its foot.
pub(super) fn footprint(x: f32, z: f32) -> f32 {
    let [front, rear, width] = reach(0.13);
    let along = if x > PEAK { front } else { rear } - 0.03;
    let [u, v] = [(x - PEAK).abs() / along, z.abs() / (width - 0.03)];
    libm::powf(libm::powf(u, SQUARE) + libm::powf(v, SQUARE), 1.0 / SQUARE) - 1.0
}

/// Adds the left half of the cabin.
pub(super) fn half_cabin(mesh: &mut Mesh, paint: &Paint) {
    // From the rear, so that the outside is outside.
    let us: Vec<f32> = (0..=STRIPS[0]).rev().map(|i| PI * i as f32 / STRIPS[0] as f32).collect();
    // Finer towards the roof, where the shell turns level.
    let vs: Vec<f32> = (0..=STRIPS[1])
        .map(|j| {
            let left = 1.0 - j as f32 / STRIPS[1] as f32;
            1.0 - left * left
        })
        .collect();
    let mut shell = Surface::loft(&us, &vs, cabin);
    let foot = shell.remove(|p, _| p.y - deck(p.x, p.z) + 0.004);
    flange(mesh, &foot, paint.black, |p| p + Vec3::new(0.0, -0.03, -0.01));
    // Every window in the plane of turn (radians) and height: in it the pillars are straight.
    let windows: [&dyn Fn(Vec3, Vec2) -> f32; 4] = [
        &|_, q| rounded(q, Vec2::new(0.0, 0.46), Vec2::new(0.70, 0.335), 0.06),
        &|p, q| rounded(q, Vec2::new(1.55, 0.50), Vec2::new(0.66, 0.285), 0.10).max(-0.40 - p.x),
        &|p, q| rounded(q, Vec2::new(1.55, 0.50), Vec2::new(0.66, 0.285), 0.10).max(p.x + 0.47),
        &|_, q| rounded(q, Vec2::new(PI, 0.56), Vec2::new(0.66, 0.28), 0.08),
    ];
    for window in windows {
        let seam = shell.remove(window);
        flange(mesh, &seam, paint.black, |p| {
            let middle = Vec3::new(PEAK, 0.95, 0.0);
            p + (middle - p).normalize() * 0.035
        });
        // A black seal around the opening.
        shell.colour(mesh, paint.black, |p, q| window(p, q) - 0.018);
    }
    shell.add_to(mesh, paint.body);
}
