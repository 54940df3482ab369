//! A garden with a house on a summer's day. Metres, y up; the picture looks towards −z.

mod furniture;
mod grounds;
mod house;
mod paint;
mod plants;
mod roof;
mod tree;

use super::mesh::{Dice, Frame, Mesh, Palette, circle};
use crate::{Model, View};
use glam::{Vec2, Vec3};
use paint::Paint;
use tree::{Habit, tree};

/// Number of triangles: that of the backyard in the paper this project follows.
pub(super) const TRIANGLES: usize = 213_802;

/// Builds the garden.
pub(super) fn build() -> Model {
    let mut palette = Palette::default();
    let paint = Paint::new(&mut palette);
    let mut mesh = Mesh::default();
    grounds(&mut mesh, &paint);
    house::house(&mut mesh, &paint);
    roof::roof(&mut mesh, &paint);
    terrace(&mut mesh, &paint);
    trees(&mut mesh, &paint);
    shrubs(&mut mesh, &paint);
    flowers(&mut mesh, &paint);
    grass(&mut mesh, &paint);
    let view =
        View { eye: Vec3::new(-0.7, 1.65, 12.8), target: Vec3::new(-0.5, 3.05, -4.0), up: Vec3::Y, fov_degrees: 44.0 };
    mesh.into_model("builtin:yard", palette, view)
}

/// Middle of the bed in the lawn, in the plane (x, z), and its half-axes.
const BED: [Vec2; 2] = [Vec2::new(-1.7, -1.6), Vec2::new(1.5, 0.8)];
/// Feet of the trees.
const OAK: Vec3 = Vec3::new(-5.2, 0.0, -1.9);
const BIRCH: Vec3 = Vec3::new(-10.9, 0.0, -8.2);
const CHERRY: Vec3 = Vec3::new(-1.6, 0.0, -10.0);

fn grounds(mesh: &mut Mesh, paint: &Paint) {
    grounds::lawn(mesh, paint);
    let path: Vec<Vec2> = (0..20)
        .map(|i| {
            let t = i as f32 / 19.0;
            // From the terrace towards the viewer, in a bow.
            Vec2::new(4.0 - 1.7 * t + 0.9 * libm::sinf(3.0 * t), -3.1 + 13.2 * t)
        })
        .collect();
    grounds::stepping_stones(mesh, paint, &path);
    grounds::bed(mesh, paint, BED[0], BED[1]);
    grounds::fence(mesh, paint, Vec2::new(-12.6, -12.0), Vec2::new(1.9, -12.0));
}

fn terrace(mesh: &mut Mesh, paint: &Paint) {
    grounds::terrace(mesh, paint, [Vec2::new(3.0, -7.35), Vec2::new(9.6, -3.75)]);
    let floor = 0.045;
    let table = Frame::at(Vec3::new(6.5, floor, -5.3)).turned(0.2);
    furniture::table(mesh, paint, &table);
    for (i, [x, z, turn]) in
        [[-0.45, 0.72, 0.1], [0.5, 0.85, -0.2], [-0.4, -0.75, 3.1], [0.45, -0.72, 3.3], [1.2, 0.05, 1.5]]
            .into_iter()
            .enumerate()
    {
        furniture::chair(mesh, paint, &table.moved(Vec3::new(x, 0.0, z)).turned(turn), 101 + i as u32);
    }
    furniture::parasol(mesh, paint, &table.moved(Vec3::new(-0.1, 0.0, -0.2)));
    furniture::bench(mesh, paint, &Frame::at(Vec3::new(-1.7, 0.0, -7.6)).turned(0.15));
    for (i, (x, z, size)) in
        [(3.3, -6.8, 0.62), (3.3, -4.1, 0.55), (9.2, -4.15, 0.7), (5.6, -7.0, 0.5)].into_iter().enumerate()
    {
        furniture::pot(mesh, paint, Vec3::new(x, floor, z), size, 330, 110 + i as u32);
    }
}

fn trees(mesh: &mut Mesh, paint: &Paint) {
    let oak = Habit {
        trunk: 2.15,
        girth: 0.3,
        shrink: 0.67,
        spread: 0.85,
        lift: 0.05,
        forks: 4,
        generations: 5,
        leaves: 25_000,
        leaf: 0.115,
        reach: 0.26,
        foliage: &paint.oak,
        bark: paint.bark,
    };
    tree(mesh, &oak, OAK, 121);
    let birch = Habit {
        trunk: 3.3,
        girth: 0.14,
        shrink: 0.62,
        spread: 0.6,
        lift: 0.08,
        forks: 4,
        generations: 4,
        leaves: 7_000,
        leaf: 0.125,
        reach: 0.3,
        foliage: &paint.birch,
        bark: paint.birch_bark[0],
    };
    tree(mesh, &birch, BIRCH, 122);
    let cherry = Habit {
        trunk: 1.2,
        girth: 0.12,
        shrink: 0.68,
        spread: 0.8,
        lift: 0.03,
        forks: 4,
        generations: 4,
        leaves: 7_000,
        leaf: 0.085,
        reach: 0.2,
        foliage: &paint.cherry,
        bark: paint.bark,
    };
    tree(mesh, &cherry, CHERRY, 123);
}

fn shrubs(mesh: &mut Mesh, paint: &Paint) {
    plants::hedge(mesh, paint, [Vec3::new(-12.9, 0.0, -11.5), Vec3::new(-12.0, 1.6, -3.0)], 140.0, 131);
    let front = house::CORNER;
    plants::climber(mesh, paint, front + Vec3::new(0.03, 0.0, 0.0), [1.7, 3.0], 1_700, 132);
    let bushes = [
        (Vec3::new(9.9, 0.0, -6.8), Vec3::new(0.75, 0.7, 0.65), Some(5)),
        (Vec3::new(1.3, 0.0, -7.1), Vec3::new(0.7, 0.6, 0.6), Some(3)),
        (Vec3::new(2.3, 0.0, -6.5), Vec3::new(0.5, 0.42, 0.5), Some(2)),
        (Vec3::new(-9.8, 0.0, -6.6), Vec3::new(0.9, 0.8, 0.8), None),
        (Vec3::new(-8.6, 0.0, -10.6), Vec3::new(1.0, 0.9, 0.8), Some(0)),
        (Vec3::new(-4.6, 0.0, -11.0), Vec3::new(0.9, 0.7, 0.7), None),
        (Vec3::new(10.6, 0.0, -3.6), Vec3::new(0.9, 0.85, 0.8), None),
    ];
    for (i, (foot, radii, blossom)) in bushes.into_iter().enumerate() {
        let leaves = (1_900.0 * radii.x * radii.y) as u32 + 350;
        plants::bush(mesh, paint, [foot, radii], leaves, blossom.map(|i: usize| paint.petals[i]), 140 + i as u32);
    }
}

fn flowers(mesh: &mut Mesh, paint: &Paint) {
    let mut dice = Dice::new(151);
    for _ in 0..190 {
        let (c, s) = circle(dice.between(0.0, std::f32::consts::TAU));
        let r = libm::sqrtf(dice.between(0.0, 0.85));
        let p = BED[0] + BED[1] * Vec2::new(r * c, r * s);
        // Drifts of one colour: the colour depends on the place, with some strays.
        let drift = (p.x * 1.7 + p.y * 1.3 + 10.0 + dice.between(-0.4, 0.4)) as usize % 6;
        plants::flower(mesh, paint, &mut dice, Vec3::new(p.x, 0.07 * (1.0 - r * r), p.y), paint.petals[drift]);
    }
}

/// Fills what is left of the triangles with grass: long along fence, hedge and bed, short around the trunks.
fn grass(mesh: &mut Mesh, paint: &Paint) {
    let mut dice = Dice::new(161);
    while mesh.len() < TRIANGLES {
        let (foot, height) = match dice.between(0.0, 1.0) {
            // Along the fence and the hedge.
            k if k < 0.25 => (Vec2::new(dice.between(-12.0, 1.5), dice.between(-12.4, -11.6)), dice.between(0.15, 0.4)),
            k if k < 0.4 => {
                (Vec2::new(dice.between(-12.0, -11.6), dice.between(-11.0, -3.0)), dice.between(0.12, 0.35))
            }
            // A rim around the bed.
            k if k < 0.65 => {
                let (c, s) = circle(dice.between(0.0, std::f32::consts::TAU));
                (BED[0] + BED[1] * Vec2::new(c, s) * dice.between(0.99, 1.12), dice.between(0.07, 0.2))
            }
            // Tufts at the feet of the trees, thinning outwards.
            k => {
                let (tree, reach) = if k < 0.85 {
                    (OAK, 1.3)
                } else if k < 0.93 {
                    (CHERRY, 0.9)
                } else {
                    (BIRCH, 1.0)
                };
                let (c, s) = circle(dice.between(0.0, std::f32::consts::TAU));
                let r = reach * dice.between(0.12, 1.0) * dice.between(0.3, 1.0);
                (Vec2::new(tree.x + r * c, tree.z + r * s), dice.between(0.08, 0.28) * (1.2 - r / reach))
            }
        };
        let triangles = (TRIANGLES - mesh.len()).min(3);
        plants::blade(mesh, paint, &mut dice, foot, height, triangles);
    }
}
