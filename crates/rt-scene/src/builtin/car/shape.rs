//! The shape of the body below the windows: curves along the car, and the sections they span. The nose points to +x,
//! the left side is +z, wheels stand on y = 0. Metres.

use crate::builtin::mesh::{bump, smooth};
use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_PI_2, PI};

/// Half the length of the car.
pub(super) const HALF_LENGTH: f32 = 2.23;
/// Where the axles are along the car, front and rear.
pub(super) const AXLES: [f32; 2] = [1.34, -1.30];
/// Radius of a tyre.
pub(super) const WHEEL: f32 = 0.335;
/// Radius of a wheel arch: room for the wheel to move.
pub(super) const ARCH: f32 = 0.385;
/// The height towards which nose and tail close.
const TIP: f32 = 0.46;
/// Exponents of the superellipses that close the body in plan and in side view: higher is blunter.
const BLUNT: [f32; 2] = [5.0, 8.0];

/// A smooth curve through `(x, y)` knots with ascending x: cubic Hermite pieces with the slopes of E. Catmull and R.
/// Rom, *A Class of Local Interpolating Splines* (1974), flat beyond the ends.
pub(super) fn curve(knots: &[[f32; 2]], x: f32) -> f32 {
    let last = knots.len() - 1;
    let i = knots.partition_point(|k| k[0] <= x).clamp(1, last);
    let slope = |k: usize| {
        let [a, b] = [knots[k.saturating_sub(1)], knots[(k + 1).min(last)]];
        (b[1] - a[1]) / (b[0] - a[0])
    };
    let [[x0, y0], [x1, y1]] = [knots[i - 1], knots[i]];
    let width = x1 - x0;
    let t = ((x - x0) / width).clamp(0.0, 1.0);
    let s = 1.0 - t;
    y0 * (1.0 + 2.0 * t) * s * s + y1 * (1.0 + 2.0 * s) * t * t + width * s * t * (slope(i - 1) * s - slope(i) * t)
}

/// How far nose and tail have closed at `x`, from 1 in the middle to 0 at the tips.
fn closing(x: f32, blunt: f32) -> f32 {
    let t = (x / HALF_LENGTH).abs().min(1.0);
    libm::powf((1.0 - libm::powf(t, blunt)).max(0.0), 1.0 / blunt)
}

/// The measures of one section.
#[derive(Clone, Copy, Debug)]
struct Section {
    /// Half the greatest width, and the height where it is.
    widest: Vec2,
    bottom: f32,
    top: f32,
    /// Exponent of the superellipse from the widest place to the top: higher is squarer.
    square: f32,
}

fn section(x: f32) -> Section {
    let half_width = curve(
        &[
            [-2.23, 0.84],
            [-1.9, 0.895],
            [-1.3, 0.945],
            [-0.4, 0.905],
            [0.5, 0.895],
            [1.34, 0.94],
            [1.8, 0.895],
            [2.23, 0.79],
        ],
        x,
    );
    let top = curve(
        &[
            [-2.23, 0.90],
            [-2.1, 0.945],
            [-1.75, 0.945],
            [-1.2, 0.92],
            [-0.4, 0.885],
            [0.5, 0.87],
            [0.95, 0.845],
            [1.4, 0.785],
            [1.8, 0.70],
            [2.05, 0.63],
            [2.23, 0.57],
        ],
        x,
    );
    let shoulder = curve(&[[-2.23, 0.70], [-1.3, 0.70], [0.0, 0.645], [1.34, 0.60], [1.9, 0.52], [2.23, 0.47]], x);
    let bottom = curve(&[[-2.23, 0.30], [-1.9, 0.23], [-1.3, 0.19], [1.4, 0.17], [2.23, 0.19]], x);
    let square = curve(&[[-2.23, 3.2], [-0.5, 3.0], [0.9, 2.8], [1.6, 2.7], [2.23, 3.0]], x);
    let [plan, side] = BLUNT.map(|b| closing(x, b));
    let close = |y: f32| TIP + (y - TIP) * side;
    Section { widest: Vec2::new(half_width * plan, close(shoulder)), bottom: close(bottom), top: close(top), square }
}

/// What fenders and the bonnet's raised middle add to the height of the upper side.
fn crest(x: f32, z: f32) -> f32 {
    let fender = 0.035 * bump(AXLES[0] + 0.05, 0.5, x) * bump(0.68, 0.14, z);
    let haunch = 0.03 * bump(AXLES[1], 0.55, x) * bump(0.74, 0.12, z);
    // The bulge has flanks 5 cm wide, a crease in the light.
    let edge = 0.40 - 0.08 * (x - 1.0);
    let bulge = 0.016 * smooth(edge + 0.05, edge, z) * smooth(0.75, 1.0, x) * smooth(2.15, 1.7, x);
    fender + haunch + bulge
}

/// Height of the upper side at a place in plan.
pub(super) fn deck(x: f32, z: f32) -> f32 {
    let s = section(x);
    let t = (z.abs() / s.widest.x.max(1e-3)).min(1.0);
    let rise = libm::powf((1.0 - libm::powf(t, s.square)).max(0.0), 1.0 / s.square);
    s.widest.y + (s.top - s.widest.y) * rise + crest(x, z.abs()) * rise
}

/// Parts of a section's parameter: floor, side up to the shoulder, and the rest over the top.
const FLOOR: f32 = 0.06;
const SIDE: f32 = 0.46;

/// The left half of the body: `x` along the car, `v` from 0 below the middle around the side to 1 above it.
pub(super) fn body(x: f32, v: f32) -> Vec3 {
    let s = section(x);
    let sill = s.widest.x * 0.91;
    let p = if v < FLOOR {
        Vec3::new(x, s.bottom, sill * v / FLOOR)
    } else if v < SIDE {
        let t = (v - FLOOR) / (SIDE - FLOOR);
        let down = 1.0 - t;
        // Leans in towards the sill, most at its very bottom.
        let lean = 0.045 * down + 0.045 * down * down * down * down;
        Vec3::new(x, s.bottom + (s.widest.y - s.bottom) * t, s.widest.x * (1.0 - lean))
    } else {
        let turn = (v - SIDE) / (1.0 - SIDE) * FRAC_PI_2;
        let power = 2.0 / s.square;
        let across = if v >= 1.0 { 0.0 } else { libm::powf(libm::cosf(turn).max(0.0), power) };
        let up = libm::powf(libm::sinf(turn), power);
        let z = s.widest.x * across;
        Vec3::new(x, s.widest.y + (s.top - s.widest.y) * up + crest(x, z) * up, z)
    };
    sculpt(p)
}

/// Flares around the arches, and the hollow along the doors.
fn sculpt(p: Vec3) -> Vec3 {
    let side = smooth(0.45, 0.75, p.z);
    let flare: f32 = AXLES
        .iter()
        .map(|&axle| {
            let r = Vec2::new(p.x - axle, p.y - WHEEL).length();
            0.028 * bump(ARCH, 0.075, r) * smooth(0.75, 0.55, p.y)
        })
        .sum();
    let between = smooth(AXLES[1] + 0.45, AXLES[1] + 0.9, p.x) * smooth(AXLES[0] - 0.4, AXLES[0] - 0.75, p.x);
    let hollow = 0.03 * between * bump(0.42, 0.11, p.y);
    Vec3::new(p.x, p.y, p.z + side * (flare - hollow))
}

/// Places along the car, `count + 1` of them, evenly spaced along the body's outline seen from above.
pub(super) fn stations(count: u32) -> Vec<f32> {
    const FINE: u32 = 4000;
    // By the superellipse's own angle, so that the blunt ends are resolved too.
    let fine: Vec<Vec2> = (0..=FINE)
        .map(|i| {
            let c = libm::cosf(PI * i as f32 / FINE as f32);
            // The cosine of a quarter turn is not quite 0 in single precision, and its root far from it.
            let reach = if 2 * i == FINE { 0.0 } else { libm::powf(c.abs(), 1.0 / BLUNT[0]) };
            let x = -HALF_LENGTH * c.signum() * reach;
            Vec2::new(x, 0.9 * closing(x, BLUNT[0]))
        })
        .collect();
    let mut length = vec![0.0];
    for pair in fine.windows(2) {
        length.push(length[length.len() - 1] + pair[0].distance(pair[1]));
    }
    let whole = length[length.len() - 1];
    (0..=count)
        .map(|i| {
            let at = whole * i as f32 / count as f32;
            let k = length.partition_point(|&l| l < at).clamp(1, FINE as usize);
            let t = (at - length[k - 1]) / (length[k] - length[k - 1]);
            match i {
                0 => -HALF_LENGTH,
                _ if i == count => HALF_LENGTH,
                _ => fine[k - 1].x + (fine[k].x - fine[k - 1].x) * t,
            }
        })
        .collect()
}
