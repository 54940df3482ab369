//! The ground and what lies and stands on it: lawn, terrace, stepping stones, beds, fence.

use super::paint::Paint;
use crate::builtin::mesh::{Colour, Dice, Frame, Mesh, circle};
use glam::{Vec2, Vec3};
use std::f32::consts::TAU;

/// The lawn's lower and upper corner in the plane (x, z), in metres.
pub(super) const LAWN: [Vec2; 2] = [Vec2::new(-13.0, -13.0), Vec2::new(13.0, 16.0)];

/// Adds a level rectangle that faces up.
fn level(mesh: &mut Mesh, [low, high]: [Vec2; 2], y: f32, colour: Colour) {
    let at = |x: f32, z: f32| Vec3::new(x, y, z);
    mesh.face(&[at(low.x, high.y), at(high.x, high.y), at(high.x, low.y), at(low.x, low.y)], colour);
}

/// Adds the lawn in mown stripes, and a meadow around it that reaches to the horizon.
pub(super) fn lawn(mesh: &mut Mesh, paint: &Paint) {
    let [low, high] = LAWN;
    // Few and long: every piece more is nodes that each ray to the lawn must pass.
    let stripes = 12;
    let width = (high.x - low.x) / stripes as f32;
    for i in 0..stripes {
        let x = low.x + i as f32 * width;
        let stripe = [Vec2::new(x, low.y), Vec2::new(x + width, high.y)];
        level(mesh, stripe, 0.0, paint.lawn[i % 2]);
    }
    let far = 120.0;
    level(mesh, [Vec2::new(-far, -far), Vec2::new(far, low.y)], 0.0, paint.meadow);
    level(mesh, [Vec2::new(-far, high.y), Vec2::new(far, far)], 0.0, paint.meadow);
    level(mesh, [Vec2::new(-far, low.y), Vec2::new(low.x, high.y)], 0.0, paint.meadow);
    level(mesh, [Vec2::new(high.x, low.y), Vec2::new(far, high.y)], 0.0, paint.meadow);
}

/// Adds a terrace of slabs of about 60 cm with open joints, from `low` to `high` in the plane (x, z).
pub(super) fn terrace(mesh: &mut Mesh, paint: &Paint, [low, high]: [Vec2; 2]) {
    let mut dice = Dice::new(91);
    level(mesh, [low, high], 0.012, paint.soil);
    let count = ((high - low) / 0.6).round();
    let size = (high - low) / count;
    for i in 0..count.x as u32 {
        for j in 0..count.y as u32 {
            let corner = low + size * Vec2::new(i as f32, j as f32);
            let top = 0.04 + dice.between(0.0, 0.006);
            let joint = 0.007;
            let from = Vec3::new(corner.x + joint, 0.0, corner.y + joint);
            let to = Vec3::new(corner.x + size.x - joint, top, corner.y + size.y - joint);
            mesh.block(from, to, dice.pick(paint.slabs));
        }
    }
}

/// Adds flat stones along a path of points in the plane (x, z).
pub(super) fn stepping_stones(mesh: &mut Mesh, paint: &Paint, path: &[Vec2]) {
    let mut dice = Dice::new(92);
    for &p in path {
        let sides = 11;
        let [long, wide] = [dice.between(0.34, 0.42), dice.between(0.25, 0.31)];
        let turn = dice.between(-0.4, 0.4);
        let colour = dice.pick(paint.stones);
        let rim: Vec<Vec3> = (0..sides)
            .map(|i| {
                let (c, s) = circle(-(i as f32) / sides as f32 * TAU);
                let r = dice.between(0.88, 1.08);
                let (tc, ts) = circle(turn);
                let [x, z] = [long * r * c, wide * r * s];
                Vec3::new(p.x + x * tc - z * ts, 0.035, p.y + x * ts + z * tc)
            })
            .collect();
        mesh.face(&rim, colour);
        for i in 0..sides {
            let [a, b] = [rim[i], rim[(i + 1) % sides]];
            // The edge widens downwards, as if half buried.
            let out = |q: Vec3| q + (q - Vec3::new(p.x, q.y, p.y)) * 0.05 - Vec3::Y * 0.04;
            mesh.face(&[a, out(a), out(b), b], colour);
        }
    }
}

/// Adds a mound of soil, a closed outline of half-axes `radii` around `centre` in the plane (x, z).
pub(super) fn bed(mesh: &mut Mesh, paint: &Paint, centre: Vec2, radii: Vec2) {
    let rings = 4;
    mesh.grid(
        [rings, 36],
        |row, column| {
            let (c, s) = circle((column % 36) as f32 / 36.0 * TAU);
            let t = 1.0 - row as f32 / rings as f32;
            let wobble = 1.0 + 0.05 * libm::sinf(5.0 * (column % 36) as f32 / 36.0 * TAU);
            let y = if row == 0 { -0.02 } else { 0.09 * (1.0 - t * t) };
            Vec3::new(centre.x + radii.x * t * wobble * s, y, centre.y + radii.y * t * wobble * c)
        },
        |_, _| paint.soil,
    );
}

/// Adds a picket fence between two points of the plane (x, z): posts, rails and pointed pales.
pub(super) fn fence(mesh: &mut Mesh, paint: &Paint, from: Vec2, to: Vec2) {
    let length = from.distance(to);
    let along = (to - from) / length;
    let u = Vec3::new(along.x, 0.0, along.y);
    let out = Vec3::new(-along.y, 0.0, along.x);
    let start = Vec3::new(from.x, 0.0, from.y);
    let at = |distance: f32| start + u * distance;
    let turn = libm::atan2f(-along.y, along.x);
    let posts = (length / 2.0).ceil() as u32;
    for i in 0..=posts {
        let foot = at(length * i as f32 / posts as f32) - out * 0.06;
        let post = Frame::at(foot).turned(turn);
        mesh.cuboid(&post.moved(Vec3::Y * 0.5), Vec3::new(0.09, 1.0, 0.09), paint.white);
        mesh.taper(&post.moved(Vec3::Y * 1.03), Vec3::new(0.12, 0.06, 0.12), 0.15, paint.white);
    }
    for y in [0.28, 0.72] {
        let rail = Frame::at(at(0.5 * length) + Vec3::Y * y - out * 0.03).turned(turn);
        mesh.cuboid(&rail, Vec3::new(length, 0.07, 0.03), paint.white);
    }
    let pales = (length / 0.125) as u32;
    for i in 0..pales {
        let foot = at((i as f32 + 0.5) * length / pales as f32);
        pale(mesh, paint, foot, u, out);
    }
}

/// Adds one pale of a fence: 7.5 cm wide, 0.9 m high, with a pointed head.
fn pale(mesh: &mut Mesh, paint: &Paint, foot: Vec3, along: Vec3, out: Vec3) {
    let outline = [[-0.0375, 0.06], [0.0375, 0.06], [0.0375, 0.84], [0.0, 0.92], [-0.0375, 0.84]];
    let at = |[x, y]: [f32; 2], z: f32| foot + along * x + Vec3::Y * y + out * z;
    let front: Vec<Vec3> = outline.iter().map(|&p| at(p, 0.018)).collect();
    let back: Vec<Vec3> = outline.iter().rev().map(|&p| at(p, 0.0)).collect();
    mesh.face(&front, paint.white);
    mesh.face(&back, paint.white);
    for i in 0..outline.len() {
        let [p, q] = [outline[i], outline[(i + 1) % outline.len()]];
        mesh.face(&[at(p, 0.018), at(p, 0.0), at(q, 0.0), at(q, 0.018)], paint.white);
    }
}
