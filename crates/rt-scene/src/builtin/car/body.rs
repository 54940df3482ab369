//! The painted body below the windows: cut out of one smooth shell.

use super::cabin;
use super::paint::Paint;
use super::shape::{ARCH, AXLES, WHEEL, body, stations};
use super::surface::{Surface, flange, rounded};
use crate::builtin::mesh::{Frame, Mesh, circle};
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// Strips along and around the left half of the shell: about 2 cm by 1.5 cm.
const STRIPS: [u32; 2] = [228, 76];
/// Half the width of the gaps around doors and lids: a little more than cars have, to show at a distance.
const GAP: f32 = 0.0045;
/// How far inside the wheel houses reach: their inner wall's z.
const INNER_WALL: f32 = 0.50;

/// Adds the left half of the body.
pub(super) fn half_body(mesh: &mut Mesh, paint: &Paint) {
    let vs: Vec<f32> = (0..=STRIPS[1]).map(|j| j as f32 / STRIPS[1] as f32).collect();
    let mut shell = Surface::loft(&stations(STRIPS[0]), &vs, body);
    for axle in AXLES {
        wheel_house(mesh, paint, &mut shell, axle);
    }
    let rim = shell.remove(|p, _| cabin::footprint(p.x, p.z).max(0.7 - p.y));
    flange(mesh, &rim, paint.black, |p| p - Vec3::Y * 0.05);
    nose(mesh, paint, &mut shell);
    tail(mesh, paint, &mut shell);
    gaps(mesh, paint, &mut shell);
    // Below the sill line the body is black plastic.
    shell.colour(mesh, paint.black, |p, _| p.y - 0.225 - 0.05 * (p.x / 2.2) * (p.x / 2.2));
    shell.add_to(mesh, paint.body);
}

/// Cuts a wheel arch and adds the wheel house behind it.
fn wheel_house(mesh: &mut Mesh, paint: &Paint, shell: &mut Surface, axle: f32) {
    let seam = shell.remove(|p, _| {
        let r = Vec2::new(p.x - axle, p.y - WHEEL).length() - ARCH;
        r.max(INNER_WALL - p.z)
    });
    flange(mesh, &seam, paint.black, |p| p.with_z(INNER_WALL));
    // A lip of paint, 12 mm deep, as pressed steel has.
    let outer: Vec<[Vec3; 2]> = seam.iter().copied().filter(|[a, b]| a.z.min(b.z) > 0.7).collect();
    flange(mesh, &outer, paint.body, |p| {
        let centre = Vec3::new(axle, WHEEL, p.z);
        centre + (p - centre) * 0.985 - Vec3::Z * 0.004
    });
    let wall: Vec<Vec3> = (0..=24)
        .map(|i| {
            let (c, s) = circle(PI * i as f32 / 24.0);
            Vec3::new(axle + ARCH * c, WHEEL + ARCH * s, INNER_WALL)
        })
        .collect();
    mesh.face(&wall, paint.black);
}

/// The openings of the nose in front view (z, y): the middle grille, the side intakes, the headlights.
pub(super) fn grille_field(p: Vec3) -> f32 {
    let narrow = 0.9 - 0.5 * (p.y - 0.36);
    rounded(Vec2::new(p.z.abs() * narrow, p.y), Vec2::new(0.0, 0.375), Vec2::new(0.42, 0.085), 0.05).max(1.5 - p.x)
}

pub(super) fn intake_field(p: Vec3) -> f32 {
    let skew = Vec2::new(p.z - 0.25 * (p.y - 0.36), p.y);
    rounded(skew, Vec2::new(0.655, 0.355), Vec2::new(0.085, 0.075), 0.03).max(1.5 - p.x)
}

fn headlight_field(p: Vec3) -> f32 {
    // Rises outwards, and reaches back along the fender.
    let skew = Vec2::new(p.z, p.y - 0.28 * (p.z - 0.6));
    rounded(skew, Vec2::new(0.635, 0.585), Vec2::new(0.155, 0.052), 0.04).max(1.45 - p.x)
}

/// Cuts the openings of the nose and adds their walls.
fn nose(mesh: &mut Mesh, paint: &Paint, shell: &mut Surface) {
    let seam = shell.remove(|p, _| grille_field(p));
    flange(mesh, &seam, paint.black, |p| p - Vec3::X * 0.10);
    let seam = shell.remove(|p, _| intake_field(p));
    flange(mesh, &seam, paint.black, |p| p - Vec3::X * 0.12);
    let split = shell.split(|p, _| headlight_field(p));
    flange(mesh, &split.seam, paint.black, |p| p + Vec3::new(-0.07, -0.03, -0.02));
    // The lamp's reflector is the same piece of surface, pushed in.
    let mut bowl = Mesh::default();
    split.inside.add_to(&mut bowl, paint.black);
    mesh.append(&bowl, &Frame::at(Vec3::new(-0.07, -0.03, -0.02)));
    *shell = split.outside;
}

/// Colours the tail's lights and cuts the place of its number plate.
fn tail(mesh: &mut Mesh, paint: &Paint, shell: &mut Surface) {
    let rear = |p: Vec3| p.x + 1.72;
    let light = |p: Vec3, grow: f32| {
        rounded(Vec2::new(p.z, p.y), Vec2::new(0.62, 0.735), Vec2::new(0.26 + grow, 0.052 + grow), 0.04).max(rear(p))
    };
    shell.colour(mesh, paint.tail_bright, |p, _| light(p, -0.022));
    shell.colour(mesh, paint.tail, |p, _| light(p, 0.0));
    shell.colour(mesh, paint.black, |p, _| light(p, 0.01));
    let seam = shell
        .remove(|p, _| rounded(Vec2::new(p.z, p.y), Vec2::new(0.0, 0.5), Vec2::new(0.29, 0.085), 0.03).max(rear(p)));
    flange(mesh, &seam, paint.body, |p| p + Vec3::X * 0.05);
    shell.colour(mesh, paint.black, |p, _| (p.y - 0.385).max(rear(p)).max(p.z - 0.80));
}

/// The gaps of doors, bonnet, boot lid, fuel flap and front bumper: a line each, and where it is drawn (below zero).
fn gaps(mesh: &mut Mesh, paint: &Paint, shell: &mut Surface) {
    type Field<'a> = &'a dyn Fn(Vec3) -> f32;
    let door = |p: Vec3| {
        let lean = Vec2::new(p.x + 0.10 * (p.y - 0.55), p.y);
        rounded(lean, Vec2::new(0.16, 0.66), Vec2::new(0.62, 0.385), 0.10)
    };
    let bonnet = |p: Vec3| {
        let half = 0.665 - 0.05 * (p.x - 1.0);
        rounded(Vec2::new(p.x, p.z), Vec2::new(1.25, 0.0), Vec2::new(0.66, half), 0.12)
    };
    let boot = |p: Vec3| rounded(Vec2::new(p.x, p.z), Vec2::new(-1.82, 0.0), Vec2::new(0.30, 0.60), 0.10);
    let flap = |p: Vec3| Vec2::new(p.x + 1.32, p.y - 0.80).length() - 0.07;
    let bumper = |p: Vec3| p.x - 1.86 + 0.25 * (p.y - 0.45);
    let lines: [(Field<'_>, Field<'_>); 5] = [
        (&door, &|p| 0.70 - p.z),
        (&bonnet, &|p| 0.55 - p.y),
        (&boot, &|p| 0.8 - p.y),
        (&flap, &|p| 0.5 - p.z),
        (&bumper, &|p| (0.25 - p.y).max(p.y - 0.545).max(0.6 - p.z)),
    ];
    for (line, limit) in lines {
        shell.score(|p, _| line(p));
        shell.colour(mesh, paint.gap, |p, _| (line(p).abs() - GAP).max(limit(p)));
    }
}
