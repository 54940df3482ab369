//! Everything green but trees: leaves, bushes, hedges, climbers, flowers, grass.

use super::paint::Paint;
use crate::builtin::mesh::{Colour, Dice, Frame, Mesh, circle};
use glam::{Vec2, Vec3};
use std::f32::consts::TAU;

/// Adds a leaf of two triangles, folded along its midrib, from its stalk at `base`.
///
/// Its surface faces `facing` as far as the direction it points in allows.
pub(super) fn leaf(mesh: &mut Mesh, base: Vec3, pointing: Vec3, facing: Vec3, length: f32, width: f32, colour: Colour) {
    let along = pointing.normalize();
    let mut side = along.cross(facing);
    if side.length_squared() < 1e-4 {
        side = along.cross(Vec3::new(0.6, 0.1, 0.8));
    }
    let side = side.normalize();
    let up = side.cross(along);
    // The widest place is before the middle, and the halves rise by a fifth of the width from the midrib.
    let middle = base + along * (0.42 * length) + up * (0.2 * width);
    let first = mesh.vertex(base);
    mesh.vertex(middle + side * (0.5 * width));
    mesh.vertex(base + along * length);
    mesh.vertex(middle - side * (0.5 * width));
    mesh.triangle([first, first + 1, first + 2], colour);
    mesh.triangle([first, first + 2, first + 3], colour);
}

/// Adds a leaf that points somewhere near `outwards`, a little down, its surface mostly to the sky.
pub(super) fn loose_leaf(mesh: &mut Mesh, dice: &mut Dice, base: Vec3, outwards: Vec3, length: f32, colour: Colour) {
    let away = outwards.normalize_or_zero();
    let pointing = away + dice.in_ball() * 0.9 - Vec3::Y * 0.25;
    let pointing = if pointing.length_squared() < 1e-3 { Vec3::X } else { pointing };
    let facing = Vec3::Y + away * 0.5 + dice.in_ball() * 0.8;
    leaf(mesh, base, pointing, facing, length, 0.58 * length, colour);
}

/// Adds a bush of `leaves` leaves in a flattened ball of `radius` metres, with blossoms in one colour.
pub(super) fn bush(
    mesh: &mut Mesh,
    paint: &Paint,
    [foot, radii]: [Vec3; 2],
    leaves: u32,
    blossom: Option<Colour>,
    seed: u32,
) {
    let mut dice = Dice::new(seed);
    let centre = foot + Vec3::Y * (0.85 * radii.y);
    for _ in 0..14 {
        let to = centre + dice.in_ball() * radii * 0.7;
        mesh.tube(&[foot, (foot + to) * 0.5 + dice.in_ball() * 0.06, to], |i| 0.014 - 0.004 * i as f32, 3, paint.bark);
    }
    for i in 0..leaves {
        // Most leaves sit near the surface, where the light is; lumps come from a second, coarser throw.
        let d = dice.in_ball().normalize_or(Vec3::Y);
        let lump = 1.0 + 0.1 * libm::sinf(d.x * 7.0 + seed as f32) * libm::cosf(d.z * 6.0 + d.y * 5.0);
        let p = centre + d * radii * (dice.between(0.5, 1.0) * lump);
        if p.y < foot.y + 0.03 {
            continue;
        }
        let colour = dice.pick(paint.bush);
        match blossom {
            Some(petal) if i % 24 == 0 && d.y > -0.2 => {
                blossom_head(mesh, &mut dice, p + d * 0.03, d, 0.035, petal, paint)
            }
            _ => loose_leaf(mesh, &mut dice, p, d, 0.13, colour),
        }
    }
}

/// Adds petals of `length` metres around a yellow middle, open towards `facing`.
fn blossom_head(mesh: &mut Mesh, dice: &mut Dice, at: Vec3, facing: Vec3, length: f32, petal: Colour, paint: &Paint) {
    const PETALS: u32 = 7;
    let frame = Frame::along(at, facing);
    let first = dice.between(0.0, TAU);
    for i in 0..PETALS {
        let (c, s) = circle(first + i as f32 / PETALS as f32 * TAU);
        let outwards = frame.vector(Vec3::new(c, 0.35, s));
        leaf(mesh, at + outwards * (0.25 * length), outwards, facing, length, 0.8 * length, petal);
    }
    let r = 0.3 * length;
    mesh.lathe(&frame, &[[r, 0.1 * r], [0.7 * r, 0.7 * r], [0.0, r]], 6, paint.pollen);
}

/// Adds a clipped hedge: leaves all over a box with a dark core. Lower and upper corner, and leaves per square metre.
pub(super) fn hedge(mesh: &mut Mesh, paint: &Paint, [low, high]: [Vec3; 2], density: f32, seed: u32) {
    let mut dice = Dice::new(seed);
    mesh.block(low + Vec3::new(0.08, 0.0, 0.08), high - Vec3::splat(0.08), paint.hedge_core);
    let size = high - low;
    // The faces one can see: the top and the two long and two short sides; the ground has none.
    let faces = [(Vec3::Y, size.x * size.z), (Vec3::X, size.y * size.z), (Vec3::Z, size.x * size.y)];
    for (axis, area) in faces {
        for sign in [-1.0, 1.0] {
            let outwards = axis * sign;
            if outwards == Vec3::NEG_Y {
                continue;
            }
            for _ in 0..(area * density) as u32 {
                let at = Vec3::new(dice.between(0.0, 1.0), dice.between(0.0, 1.0), dice.between(0.0, 1.0));
                let face = if sign > 0.0 { high } else { low };
                let p = (low + at * size) * (Vec3::ONE - axis) + face * axis;
                let p = p + outwards * dice.between(-0.07, 0.02);
                let colour = dice.pick(paint.hedge);
                loose_leaf(mesh, &mut dice, p, outwards, 0.11, colour);
            }
        }
    }
}

/// Adds a climber on a wall that faces +z: `leaves` leaves, dense at the corner `foot` and thinning out up and along.
pub(super) fn climber(mesh: &mut Mesh, paint: &Paint, foot: Vec3, [along, up]: [f32; 2], leaves: u32, seed: u32) {
    let mut dice = Dice::new(seed);
    for stem in 0..9 {
        let lean = along * (0.06 + 0.1 * stem as f32);
        let top = up * dice.between(0.55, 0.95) * (1.0 - 0.06 * stem as f32);
        let path: Vec<Vec3> = (0..=8)
            .map(|i| {
                let t = i as f32 / 8.0;
                let x = lean * (0.3 + 0.7 * t) + 0.05 * libm::sinf(9.0 * t + stem as f32);
                foot + Vec3::new(x, top * t, 0.02)
            })
            .collect();
        mesh.tube(&path, |i| 0.014 - 0.001 * i as f32, 3, paint.bark);
    }
    for _ in 0..leaves {
        let t = dice.between(0.0, 1.0);
        let height = up * (1.0 - t * t) * dice.between(0.9, 1.0);
        // The outline waves, so that no straight edge shows.
        let reach = along * (1.0 - 0.75 * height / up) * (0.82 + 0.18 * libm::sinf(7.0 * height));
        let x = reach * dice.between(0.0, 1.0) * dice.between(0.35, 1.0);
        let p = foot + Vec3::new(x, height, dice.between(0.02, 0.09));
        let colour = dice.pick(paint.ivy);
        let pointing = Vec3::new(dice.between(-0.7, 0.7), dice.between(-1.2, -0.2), 0.35);
        let facing = Vec3::new(dice.between(-0.5, 0.5), 0.4, 1.0);
        leaf(mesh, p, pointing, facing, 0.09, 0.08, colour);
    }
}

/// Adds one flower on a bent stem with two leaves.
pub(super) fn flower(mesh: &mut Mesh, paint: &Paint, dice: &mut Dice, foot: Vec3, petal: Colour) {
    let height = dice.between(0.22, 0.42);
    let lean = Vec3::new(dice.between(-0.08, 0.08), 0.0, dice.between(-0.08, 0.08));
    let top = foot + Vec3::Y * height + lean;
    let middle = foot + Vec3::Y * (0.55 * height) + lean * 0.3;
    mesh.tube(&[foot, middle, top], |_| 0.004, 3, paint.stem);
    for side in [-1.0, 1.0] {
        let pointing = Vec3::new(side * dice.between(0.3, 1.0), 0.8, dice.between(-0.6, 0.6));
        leaf(mesh, foot + Vec3::Y * 0.02, pointing, Vec3::Y, 0.6 * height, 0.05, paint.stem);
    }
    let facing = Vec3::new(lean.x * 4.0, 1.0, lean.z * 4.0 + 0.5);
    blossom_head(mesh, dice, top, facing, 0.05, petal, paint);
}

/// Adds a blade of grass of 1, 2 or 3 triangles: a tip, with a folded foot, with a flat foot.
pub(super) fn blade(mesh: &mut Mesh, paint: &Paint, dice: &mut Dice, foot: Vec2, height: f32, triangles: usize) {
    let (c, s) = circle(dice.between(0.0, TAU));
    let side = Vec3::new(c, 0.0, s) * (0.006 + 0.012 * height);
    let bend = Vec3::new(-s, 0.0, c) * (height * dice.between(0.1, 0.55));
    let foot = Vec3::new(foot.x, 0.0, foot.y);
    let colour = dice.pick(paint.grass);
    let middle = foot + Vec3::Y * (0.6 * height) + bend * 0.3;
    let tip = foot + Vec3::Y * height + bend;
    let first = mesh.vertex(foot - side);
    mesh.vertex(foot + side);
    match triangles {
        1 => {
            mesh.vertex(tip);
            mesh.triangle([first, first + 1, first + 2], colour);
        }
        2 => {
            mesh.vertex(middle);
            mesh.vertex(tip);
            mesh.triangle([first, first + 1, first + 2], colour);
            mesh.triangle([first + 2, first + 1, first + 3], colour);
        }
        _ => {
            mesh.vertex(middle + side * 0.7);
            mesh.vertex(middle - side * 0.7);
            mesh.vertex(tip);
            mesh.triangle([first, first + 1, first + 2], colour);
            mesh.triangle([first, first + 2, first + 3], colour);
            mesh.triangle([first + 3, first + 2, first + 4], colour);
        }
    }
}
