//! The roof: two slopes of curved tiles, ridge, fascias, gutters.

use super::house::{CORNER, DEPTH, EAVES, RISE, WIDTH};
use super::paint::Paint;
use crate::builtin::mesh::{Dice, Frame, Mesh, circle};
use glam::Vec3;
use std::f32::consts::{PI, TAU};

/// How far the roof stands out over the eaves and over the gables, in metres.
const OVERHANG: f32 = 0.42;
/// Width of a tile, and how much of its length shows, in metres.
const TILE: [f32; 2] = [0.23, 0.34];
/// Strips across a tile, whose section is one wave: a trough and a crest.
const STRIPS: u32 = 4;

/// Adds the roof.
pub(super) fn roof(mesh: &mut Mesh, paint: &Paint) {
    let half = 0.5 * DEPTH;
    let slope = libm::atan2f(RISE, half);
    let length = libm::sqrtf(half * half + RISE * RISE) + OVERHANG;
    let ridge = CORNER + Vec3::new(0.5 * WIDTH, EAVES + RISE + 0.1, -half);
    for (side, turn) in [(0, 0.0), (1, PI)] {
        // In a slope's frame x runs along the ridge, z down the slope and y out of it.
        let frame = Frame::at(ridge).turned(turn).pitched(slope);
        tiles(mesh, paint, &frame, length, 71 + side);
        boards(mesh, paint, &frame, length);
    }
    ridge_tiles(mesh, paint, ridge);
    for side in [-1.0, 1.0] {
        gutter(mesh, paint, side);
    }
}

/// Adds the tiles of one slope; each row overlaps the row below.
fn tiles(mesh: &mut Mesh, paint: &Paint, frame: &Frame, length: f32, seed: u32) {
    let mut dice = Dice::new(seed);
    let width = WIDTH + 2.0 * OVERHANG;
    let columns = (width / TILE[0]) as u32;
    let rows = (length / TILE[1]) as u32;
    let [across, down] = [width / columns as f32, length / rows as f32];
    for row in 0..rows {
        for column in 0..columns {
            let x = (column as f32 + 0.5) * across - 0.5 * width;
            let tile = frame.moved(Vec3::new(x, 0.02 + dice.between(0.0, 0.006), (row as f32 + 0.5) * down));
            let colour = dice.pick(paint.tiles);
            // Pitched up at its lower end by a tile's thickness, where it lies on the next row.
            mesh.grid(
                [2, STRIPS],
                |r, c| {
                    let s = c as f32 / STRIPS as f32;
                    let wave = 0.022 * libm::sinf(s * TAU);
                    // Up the slope: the rim of the front edge, which shows; the front edge; the back edge.
                    let [y, z] = [[0.002, 0.52], [0.022, 0.52], [0.0, -0.54]][r as usize];
                    tile.point(Vec3::new((s - 0.5) * across * 1.02, wave + y, z * down))
                },
                |_, _| colour,
            );
        }
    }
}

/// Adds the boarding below the tiles and the fascias along the eaves and the gables.
fn boards(mesh: &mut Mesh, paint: &Paint, frame: &Frame, length: f32) {
    let width = WIDTH + 2.0 * OVERHANG;
    let deck = frame.moved(Vec3::new(0.0, -0.03, 0.5 * length));
    mesh.cuboid(&deck, Vec3::new(width - 0.06, 0.05, length - 0.04), paint.roof_board);
    for side in [-0.5, 0.5] {
        let board = frame.moved(Vec3::new(side * (width - 0.02), -0.06, 0.5 * length));
        mesh.cuboid(&board, Vec3::new(0.04, 0.2, length), paint.white);
    }
    for rafter in 0..13 {
        let x = (rafter as f32 - 6.0) * (WIDTH / 12.0);
        let at = frame.moved(Vec3::new(x, -0.12, length - 0.3));
        mesh.cuboid(&at, Vec3::new(0.08, 0.12, 0.5), paint.white);
    }
}

/// Adds the row of half-round tiles on the ridge.
fn ridge_tiles(mesh: &mut Mesh, paint: &Paint, ridge: Vec3) {
    let mut dice = Dice::new(73);
    let width = WIDTH + 2.0 * OVERHANG;
    let count = 26;
    for i in 0..count {
        let x = (i as f32 + 0.5) / count as f32 * width - 0.5 * width;
        let colour = dice.pick(paint.tiles);
        let length = width / count as f32;
        mesh.grid(
            [1, 8],
            |row, column| {
                // The wider end of each lies over the narrower end of the next.
                let radius = if row == 0 { 0.15 } else { 0.125 };
                let (c, s) = circle(PI * column as f32 / 8.0);
                let along = (row as f32 - 0.5) * length * 1.1;
                ridge + Vec3::new(x + along, radius * s - 0.06, -radius * c)
            },
            |_, _| colour,
        );
    }
}

/// Adds a half-round gutter along the eaves, and its downpipe at the left end; `side` is 1 for the front.
fn gutter(mesh: &mut Mesh, paint: &Paint, side: f32) {
    let drop = OVERHANG * RISE / libm::sqrtf(0.25 * DEPTH * DEPTH + RISE * RISE);
    let out = 0.5 * DEPTH + OVERHANG * 0.5 * DEPTH / libm::sqrtf(0.25 * DEPTH * DEPTH + RISE * RISE) + 0.06;
    let middle = CORNER + Vec3::new(0.5 * WIDTH, EAVES - drop + 0.06, -0.5 * DEPTH + side * out);
    let length = WIDTH + 2.0 * OVERHANG;
    let radius = 0.065;
    mesh.grid(
        [24, 8],
        |row, column| {
            let (c, s) = circle(PI * column as f32 / 8.0);
            middle + Vec3::new((row as f32 / 24.0 - 0.5) * length, -radius * s, -radius * c)
        },
        |_, _| paint.zinc,
    );
    let wall = -0.5 * DEPTH + side * (0.5 * DEPTH + 0.06);
    let pipe = [
        middle + Vec3::new(0.5 * WIDTH - 0.15, -0.05, 0.0),
        middle + Vec3::new(0.5 * WIDTH - 0.15, -0.12, 0.0),
        Vec3::new(CORNER.x + WIDTH - 0.15, EAVES - 0.5, CORNER.z + wall),
        Vec3::new(CORNER.x + WIDTH - 0.15, 0.02, CORNER.z + wall),
    ];
    mesh.tube(&pipe, |_| 0.04, 10, paint.zinc);
}
