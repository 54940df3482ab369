//! The house: walls with openings, door, windows with shutters, chimney. The roof is in `roof`.

use super::paint::Paint;
use crate::builtin::mesh::{Colour, Dice, Frame, Mesh, bump};
use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_PI_2, PI};

/// Where the house stands: the lower left corner of its front, which faces +z. Metres, like all below.
pub(super) const CORNER: Vec3 = Vec3::new(2.0, 0.0, -7.4);
/// Width of the front.
pub(super) const WIDTH: f32 = 8.4;
/// From the front to the back.
pub(super) const DEPTH: f32 = 6.4;
/// Height of the eaves.
pub(super) const EAVES: f32 = 2.95;
/// Rise from the eaves to the ridge.
pub(super) const RISE: f32 = 2.35;
/// Thickness of the walls.
const WALL: f32 = 0.32;

/// An opening in a wall: from its lower left to its upper right corner, as distance along the wall and height.
#[derive(Clone, Copy, Debug)]
struct Opening {
    low: Vec2,
    high: Vec2,
}

const fn opening(left: f32, sill: f32, width: f32, height: f32) -> Opening {
    Opening { low: Vec2::new(left, sill), high: Vec2::new(left + width, sill + height) }
}

/// The door; its sill is one step above the terrace.
const DOOR: Opening = opening(2.35, 0.16, 1.0, 2.1);
/// The windows of the front.
const WINDOWS: [Opening; 3] =
    [opening(0.75, 0.95, 1.0, 1.3), opening(4.4, 0.95, 1.25, 1.3), opening(6.6, 0.95, 1.0, 1.3)];

/// Adds the house without its roof.
pub(super) fn house(mesh: &mut Mesh, paint: &Paint) {
    let front = Frame::at(CORNER);
    let openings = [WINDOWS[0], DOOR, WINDOWS[1], WINDOWS[2]];
    wall(mesh, paint, &front, WIDTH, &openings);
    let gable_window = [opening(2.7, 0.95, 1.0, 1.3)];
    // Each of the other walls is built like the front, turned about a corner.
    let left = Frame::at(CORNER - Vec3::Z * DEPTH).turned(-FRAC_PI_2);
    wall(mesh, paint, &left, DEPTH, &gable_window);
    let right = Frame::at(CORNER + Vec3::X * WIDTH).turned(FRAC_PI_2);
    wall(mesh, paint, &right, DEPTH, &gable_window);
    let back = Frame::at(CORNER + Vec3::new(WIDTH, 0.0, -DEPTH)).turned(PI);
    wall(mesh, paint, &back, WIDTH, &[]);
    for x in [0.0, WIDTH] {
        gable(mesh, paint, x);
    }
    for window in WINDOWS {
        fit_window(mesh, paint, &front, window);
        shutters(mesh, paint, &front, window);
    }
    fit_window(mesh, paint, &left, gable_window[0]);
    fit_window(mesh, paint, &right, gable_window[0]);
    fit_door(mesh, paint, &front);
    chimney(mesh, paint);
}

/// Adds a wall in the plane z = 0 of `frame`, its outside towards +z: strips between openings, and what is above and
/// below each of them. Openings are given from left to right.
fn wall(mesh: &mut Mesh, paint: &Paint, frame: &Frame, length: f32, openings: &[Opening]) {
    let mut piece = |low: Vec2, high: Vec2, colour: Colour, out: f32| {
        let centre = ((low + high) * 0.5).extend(out - 0.5 * WALL);
        mesh.cuboid(&frame.moved(centre), (high - low).extend(WALL), colour);
    };
    let mut x = 0.0;
    for o in openings {
        piece(Vec2::new(x, 0.0), Vec2::new(o.low.x, EAVES), paint.plaster, 0.0);
        if o.low.y > 0.5 {
            piece(Vec2::new(o.low.x, 0.0), Vec2::new(o.high.x, o.low.y), paint.plaster, 0.0);
        }
        piece(Vec2::new(o.low.x, o.high.y), Vec2::new(o.high.x, EAVES), paint.plaster, 0.0);
        x = o.high.x;
    }
    piece(Vec2::new(x, 0.0), Vec2::new(length, EAVES), paint.plaster, 0.0);
    // A stone plinth stands out by 4 cm; the door interrupts it.
    let mut x = -0.04;
    for o in openings.iter().filter(|o| o.low.y < 0.5) {
        piece(Vec2::new(x, 0.0), Vec2::new(o.low.x, 0.42), paint.plinth, 0.04);
        x = o.high.x;
    }
    piece(Vec2::new(x, 0.0), Vec2::new(length + 0.04, 0.42), paint.plinth, 0.04);
}

/// Adds the triangle of wall below the roof at distance `x` along the front.
fn gable(mesh: &mut Mesh, paint: &Paint, x: f32) {
    let corner = |z: f32, y: f32| CORNER + Vec3::new(x, EAVES + y, -z);
    let [a, b, c] = [corner(0.0, 0.0), corner(DEPTH, 0.0), corner(0.5 * DEPTH, RISE)];
    let outline = if x > 0.0 { [a, b, c] } else { [b, a, c] };
    mesh.face(&outline, paint.plaster);
}

/// Adds frame, glazing bars, pane, curtains and sill of a window.
fn fit_window(mesh: &mut Mesh, paint: &Paint, wall: &Frame, o: Opening) {
    let size = o.high - o.low;
    let centre = (o.low + o.high) * 0.5;
    // The frame sits 10 cm behind the wall's face.
    let inner = wall.moved(centre.extend(-0.1));
    bars(mesh, &inner, size, 0.07, 0.06, paint.white);
    mesh.cuboid(&inner, Vec3::new(0.06, size.y - 0.14, 0.05), paint.white);
    for y in [-0.17, 0.17] {
        for x in [-0.25, 0.25] {
            let width = 0.5 * size.x - 0.1;
            mesh.cuboid(
                &inner.moved(Vec3::new(x * size.x, y * size.y, 0.0)),
                Vec3::new(width, 0.025, 0.03),
                paint.white,
            );
        }
    }
    let half = size * 0.5;
    let quad = [[-half.x, -half.y], [half.x, -half.y], [half.x, half.y], [-half.x, half.y]];
    let pane: Vec<Vec3> = quad.iter().map(|&[x, y]| inner.point(Vec3::new(x, y, -0.09))).collect();
    mesh.face(&pane, paint.pane);
    for side in [-1.0, 1.0] {
        curtain(mesh, paint, &inner, half, side);
    }
    let sill = wall.moved(Vec3::new(centre.x, o.low.y - 0.03, 0.03));
    mesh.cuboid(&sill, Vec3::new(size.x + 0.16, 0.06, 0.22), paint.plinth);
}

/// Adds a curtain, gathered to one side of a window.
fn curtain(mesh: &mut Mesh, paint: &Paint, inner: &Frame, half: Vec2, side: f32) {
    mesh.grid(
        [8, 24],
        |row, column| {
            let (t, s) = (row as f32 / 8.0, column as f32 / 24.0);
            let s = if side > 0.0 { 1.0 - s } else { s };
            // Gathered at a third of the height, free above.
            let width = half.x * (0.55 - 0.25 * bump(0.35, 0.25, t));
            let fold = 0.015 * libm::sinf(s * 44.0);
            inner.point(Vec3::new(side * (half.x - width * s), half.y * (2.0 * t - 1.0), -0.06 + fold))
        },
        |_, _| paint.curtain,
    );
}

/// Adds four bars around an opening of `size`, `width` wide and `depth` deep, inside it.
fn bars(mesh: &mut Mesh, frame: &Frame, size: Vec2, width: f32, depth: f32, colour: Colour) {
    for side in [-0.5, 0.5] {
        let x = side * (size.x - width);
        mesh.cuboid(&frame.moved(Vec3::X * x), Vec3::new(width, size.y, depth), colour);
        let y = side * (size.y - width);
        mesh.cuboid(&frame.moved(Vec3::Y * y), Vec3::new(size.x - 2.0 * width, width, depth), colour);
    }
}

/// Adds a pair of louvred shutters, open against the wall.
fn shutters(mesh: &mut Mesh, paint: &Paint, wall: &Frame, o: Opening) {
    let size = o.high - o.low;
    let leaf = Vec2::new(0.5 * size.x, size.y + 0.06);
    for side in [-1.0, 1.0] {
        let x = 0.5 * (o.low.x + o.high.x) + side * (0.5 * size.x + 0.5 * leaf.x + 0.02);
        let frame = wall.moved(Vec3::new(x, 0.5 * (o.low.y + o.high.y), 0.035));
        bars(mesh, &frame, leaf, 0.06, 0.04, paint.shutter);
        mesh.cuboid(&frame, Vec3::new(leaf.x - 0.12, 0.07, 0.038), paint.shutter);
        for half in [-1.0, 1.0] {
            for slat in 0..11 {
                let y = half * (0.06 + (slat as f32 + 0.3) / 11.0 * (0.5 * leaf.y - 0.13));
                let slat = frame.moved(Vec3::Y * y).pitched(0.7);
                mesh.cuboid(&slat, Vec3::new(leaf.x - 0.12, 0.045, 0.008), paint.shutter);
            }
        }
    }
}

/// Adds the door, its frame, steps, lantern and a small canopy.
fn fit_door(mesh: &mut Mesh, paint: &Paint, wall: &Frame) {
    let size = DOOR.high - DOOR.low;
    let frame = wall.moved(((DOOR.low + DOOR.high) * 0.5).extend(-0.12));
    bars(mesh, &frame, size, 0.08, 0.1, paint.white);
    let leaf = Vec3::new(size.x - 0.16, size.y - 0.16, 0.05);
    mesh.cuboid(&frame.moved(Vec3::Z * -0.03), leaf, paint.door);
    for (y, height) in [(-0.62, 0.5), (-0.02, 0.52)] {
        for x in [-0.2, 0.2] {
            let panel = frame.moved(Vec3::new(x, y, 0.0)).pitched(FRAC_PI_2);
            mesh.taper(&panel.moved(Vec3::Y * 0.005), Vec3::new(0.3, 0.025, height), 0.82, paint.door);
        }
    }
    let light = frame.moved(Vec3::new(0.0, 0.6, -0.002));
    bars(mesh, &light, Vec2::new(0.66, 0.46), 0.05, 0.03, paint.white);
    mesh.cuboid(&light, Vec3::new(0.56, 0.36, 0.014), paint.pane);
    let handle = frame.moved(Vec3::new(0.34, -0.1, 0.0));
    let grip: Vec<Vec3> =
        [[0.0, 0.0], [0.0, 0.05], [-0.03, 0.07], [-0.12, 0.07]].map(|[x, z]| handle.point(Vec3::new(x, 0.0, z))).into();
    mesh.tube(&grip, |_| 0.011, 8, paint.zinc);
    let step = |mesh: &mut Mesh, out: f32, height: f32, width: f32| {
        let low = Vec3::new(0.5 * (DOOR.low.x + DOOR.high.x) - 0.5 * width, 0.0, -0.1);
        let high = low + Vec3::new(width, height, out + 0.1);
        let (low, high) = (wall.point(low), wall.point(high));
        mesh.block(low, high, paint.plinth);
    };
    step(mesh, 0.35, 0.16, 1.3);
    step(mesh, 0.68, 0.08, 1.6);
    canopy(mesh, paint, wall);
    let lantern = wall.moved(Vec3::new(DOOR.high.x + 0.3, 1.85, 0.14));
    let glass = [[0.03, -0.12], [0.055, -0.08], [0.07, 0.08], [0.03, 0.14], [0.0, 0.18]];
    mesh.lathe(&lantern, &glass, 6, paint.metal);
    mesh.bar(lantern.point(Vec3::new(0.0, 0.16, 0.0)), lantern.point(Vec3::new(0.0, 0.1, -0.16)), 0.01, 6, paint.metal);
}

/// Adds a little roof of boards over the door, on two struts.
fn canopy(mesh: &mut Mesh, paint: &Paint, wall: &Frame) {
    let middle = 0.5 * (DOOR.low.x + DOOR.high.x);
    let above = wall.moved(Vec3::new(middle, DOOR.high.y + 0.32, 0.42)).pitched(0.4);
    let mut dice = Dice::new(61);
    for i in 0..9 {
        let board = above.moved(Vec3::X * ((i as f32 - 4.0) * 0.18));
        mesh.cuboid(&board, Vec3::new(0.172, 0.03, 0.98), dice.pick(paint.tiles));
    }
    for side in [-0.7, 0.7] {
        let at = |y: f32, z: f32| wall.point(Vec3::new(middle + side, DOOR.high.y + y, z));
        mesh.bar(at(-0.45, 0.0), at(0.15, 0.7), 0.03, 4, paint.white);
    }
}

/// Adds a brick chimney with a cap and two pots. Courses are single bricks, half a brick apart.
fn chimney(mesh: &mut Mesh, paint: &Paint) {
    const BRICK: Vec3 = Vec3::new(0.24, 0.075, 0.115);
    let mut dice = Dice::new(62);
    let foot = CORNER + Vec3::new(6.5, EAVES + 1.5, -0.5 * DEPTH + 0.5);
    // A core of mortar 6 mm behind the bricks' faces fills the joints.
    let size = Vec3::new(0.75, 1.95, 0.5);
    let core = size - Vec3::new(0.012, 0.0, 0.012);
    mesh.cuboid(&Frame::at(foot + Vec3::Y * (0.5 * size.y)), core, paint.mortar);
    let courses = 22;
    for course in 0..courses {
        let y = foot.y + (course as f32 + 0.5) * (size.y / courses as f32);
        let shift = if course % 2 == 0 { 0.0 } else { 0.125 };
        for i in 0..3 {
            let x = -0.25 + i as f32 * 0.25 + if i == 2 { 0.0 } else { shift };
            for z in [-1.0, 1.0] {
                let centre = Vec3::new(foot.x + x, y, foot.z + z * (0.5 * size.z - 0.5 * BRICK.z));
                mesh.cuboid(&Frame::at(centre), BRICK, dice.pick(paint.brick));
            }
        }
        for x in [-1.0, 1.0] {
            let centre = Vec3::new(foot.x + x * (0.5 * size.x - 0.05), y, foot.z);
            mesh.cuboid(&Frame::at(centre), Vec3::new(0.1, BRICK.y, 0.25), dice.pick(paint.brick));
        }
    }
    let top = foot + Vec3::Y * size.y;
    mesh.cuboid(&Frame::at(top + Vec3::Y * 0.04), Vec3::new(0.92, 0.08, 0.66), paint.plinth);
    for x in [-0.18, 0.18] {
        let pot = [[0.13, 0.08], [0.1, 0.35], [0.13, 0.37], [0.13, 0.42], [0.09, 0.42], [0.08, 0.1]];
        mesh.lathe(&Frame::at(top + Vec3::X * x), &pot, 20, paint.terracotta);
    }
}
