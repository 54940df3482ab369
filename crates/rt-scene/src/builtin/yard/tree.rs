//! Trees: a branching skeleton of tapered tubes, and leaves around its twigs.

use super::plants::loose_leaf;
use crate::builtin::mesh::{Colour, Dice, Mesh, circle};
use glam::Vec3;
use std::f32::consts::TAU;

/// What a kind of tree looks like.
#[derive(Clone, Copy, Debug)]
pub(super) struct Habit<'a> {
    /// Length of the trunk below the first fork, in metres.
    pub(super) trunk: f32,
    /// Radius of the trunk at the ground, in metres.
    pub(super) girth: f32,
    /// Length of a branch over that of its parent.
    pub(super) shrink: f32,
    /// Angle between a branch and its parent, in radians.
    pub(super) spread: f32,
    /// How strongly branches bend upwards at each of their points; negative hangs.
    pub(super) lift: f32,
    /// Branches from each branch.
    pub(super) forks: u32,
    /// Generations of branches after the trunk.
    pub(super) generations: u32,
    /// Number of leaves.
    pub(super) leaves: u32,
    /// Length of a leaf in metres.
    pub(super) leaf: f32,
    /// Greatest distance between a leaf and its twig, in metres.
    pub(super) reach: f32,
    /// Colours of the leaves.
    pub(super) foliage: &'a [Colour],
    /// Colour of trunk and branches.
    pub(super) bark: Colour,
}

/// Points of a branch after its first; a twig makes do with two.
const STEPS: u32 = 4;
const TWIG_STEPS: u32 = 2;

/// Adds a tree that stands at `foot`.
pub(super) fn tree(mesh: &mut Mesh, habit: &Habit<'_>, foot: Vec3, seed: u32) {
    let first_triangle = mesh.len();
    let mut grower = Grower { mesh, habit, dice: Dice::new(seed), twigs: Vec::new() };
    // The trunk starts a little below the lawn, so that no gap shows where the ground is uneven.
    let start = foot - Vec3::Y * 0.05;
    grower.branch(start, Vec3::Y, habit.trunk, habit.girth, habit.generations);
    let Grower { mut dice, twigs, mesh, .. } = grower;
    for _ in 0..habit.leaves {
        let twig = twigs[(dice.between(0.0, twigs.len() as f32) as usize).min(twigs.len() - 1)];
        let offset = dice.in_ball() * habit.reach;
        let colour =
            habit.foliage[(dice.between(0.0, habit.foliage.len() as f32) as usize).min(habit.foliage.len() - 1)];
        let length = habit.leaf * dice.between(0.7, 1.25);
        loose_leaf(mesh, &mut dice, twig + offset, offset, length, colour);
    }
    mesh.plant(first_triangle, foot);
}

/// A tree that is growing.
struct Grower<'a, 'h> {
    mesh: &'a mut Mesh,
    habit: &'a Habit<'h>,
    dice: Dice,
    /// Points of the last two generations, where leaves sit.
    twigs: Vec<Vec3>,
}

impl Grower<'_, '_> {
    /// Adds a branch and all that grow from it.
    fn branch(&mut self, start: Vec3, direction: Vec3, length: f32, radius: f32, generations: u32) {
        let mut path = vec![start];
        let mut heading = direction;
        let is_trunk = generations == self.habit.generations;
        let wander = if is_trunk { 0.06 } else { 0.22 };
        let steps = if generations == 0 { TWIG_STEPS } else { STEPS };
        for _ in 0..steps {
            heading = (heading + self.dice.in_ball() * wander + Vec3::Y * self.habit.lift).normalize();
            path.push(path[path.len() - 1] + heading * (length / steps as f32));
        }
        if generations < 2 {
            self.twigs.extend_from_slice(&path[1..]);
        }
        // A flare at the roots of the trunk; everything tapers to 0.6 of its radius.
        let taper = |i: usize| {
            let t = i as f32 / steps as f32;
            radius * (1.0 - 0.4 * t) * if is_trunk && i == 0 { 1.35 } else { 1.0 }
        };
        let sides = [3, 4, 5, 7, 9, 12][generations.min(5) as usize];
        self.mesh.tube(&path, taper, sides, self.habit.bark);
        if generations == 0 {
            return;
        }
        let first = self.dice.between(0.0, TAU);
        for fork in 0..self.habit.forks {
            // Forks leave from the upper part of the branch, evenly around it; the last one continues it.
            let last = fork + 1 == self.habit.forks;
            let from = path[(if last { steps } else { steps - fork % 2 }) as usize];
            let spread = if last { 0.3 } else { self.habit.spread } * self.dice.between(0.75, 1.25);
            let turn = first + fork as f32 * TAU / (self.habit.forks - 1).max(1) as f32 + self.dice.between(-0.4, 0.4);
            let across = any_across(heading);
            let (c, s) = circle(turn);
            let side = across * c + heading.cross(across) * s;
            let (c, s) = circle(spread);
            let child = (heading * c + side * s).normalize();
            let shrink = self.habit.shrink * self.dice.between(0.8, 1.15);
            self.branch(from, child, length * shrink, radius * 0.58, generations - 1);
        }
    }
}

/// A unit vector square to `v`.
fn any_across(v: Vec3) -> Vec3 {
    let other = if v.y.abs() < 0.9 { Vec3::Y } else { Vec3::X };
    v.cross(other).normalize()
}
