//! Box tests that give the same bits with any instructions.
//!
//! Written out axis by axis: a closure is compiled without the instructions of the function around it.

use crate::lanes::{Floats as _, Floats8 as _, Floats16, Level, Slots as _};
use crate::order::order;
use crate::packet::{Planes, ways};
use crate::rays::{Group, Set};
use crate::stack::Stack;
use rt_bvh::BlockNode;

/// What box tests know of the rays of a group that are in one octant.
pub(super) struct Slabs<F> {
    reciprocal: [F; 3],
    /// Padded origins, as the planes see them through which the rays enter, and leave.
    enter: [F; 3],
    leave: [F; 3],
    begin: F,
    pub(super) limit: F,
}

impl<F: Floats16> Slabs<F> {
    #[inline(always)]
    pub(super) fn of<L: Level<F16 = F>>(level: L, group: &Group, octant: usize) -> Self {
        let [x, y, z] = ways(&group.padded, octant);
        let [i, j, k] = &group.reciprocal;
        Self {
            reciprocal: [level.load(i), level.load(j), level.load(k)],
            enter: [level.load(x[0]), level.load(y[0]), level.load(z[0])],
            leave: [level.load(x[1]), level.load(y[1]), level.load(z[1])],
            begin: level.load(&group.begin),
            limit: level.load(&group.limit),
        }
    }

    /// Where the rays enter the box in a slot, and which of them do.
    #[inline(always)]
    pub(super) fn enter<L: Level<F16 = F>>(&self, level: L, [x, y, z]: Planes<'_>, slot: usize) -> (F, Set) {
        let slot = slot & 7;
        let Self { reciprocal: r, enter, leave, begin, limit } = self;
        let near = ((level.splat(x[0][slot]) - enter[0]) * r[0]).greater((level.splat(y[0][slot]) - enter[1]) * r[1]);
        let near = near.greater(((level.splat(z[0][slot]) - enter[2]) * r[2]).greater(*begin));
        let far = ((level.splat(x[1][slot]) - leave[0]) * r[0]).lesser((level.splat(y[1][slot]) - leave[1]) * r[1]);
        let far = far.lesser(((level.splat(z[1][slot]) - leave[2]) * r[2]).lesser(*limit));
        (near, near.not_above(far))
    }
}

/// The same of one ray, with eight boxes at a time.
pub(super) struct Single {
    octant: usize,
    enter: [f32; 3],
    leave: [f32; 3],
    reciprocal: [f32; 3],
    pub(super) begin: f32,
    pub(super) limit: f32,
}

impl Single {
    #[inline(always)]
    pub(super) fn of(group: &Group, lane: usize, octant: usize) -> Self {
        let [x, y, z] = ways(&group.padded, octant);
        let [i, j, k] = &group.reciprocal;
        Self {
            octant,
            enter: [x[0].0[lane], y[0].0[lane], z[0].0[lane]],
            leave: [x[1].0[lane], y[1].0[lane], z[1].0[lane]],
            reciprocal: [i.0[lane], j.0[lane], k.0[lane]],
            begin: group.begin.0[lane],
            limit: group.limit.0[lane],
        }
    }

    /// Where the ray enters and leaves a node's boxes: those that it enters are those where the first is not above the
    /// second.
    #[inline(always)]
    pub(super) fn distances<L: Level>(&self, level: L, [x, y, z]: Planes<'_>) -> (L::F8, L::F8) {
        let Self { enter, leave, reciprocal: [i, j, k], .. } = self;
        let (i, j, k) = (level.splat8(*i), level.splat8(*j), level.splat8(*k));
        let near = ((level.load8(x[0]) - level.splat8(enter[0])) * i)
            .greater((level.load8(y[0]) - level.splat8(enter[1])) * j);
        let near = near.greater(((level.load8(z[0]) - level.splat8(enter[2])) * k).greater(level.splat8(self.begin)));
        let far =
            ((level.load8(x[1]) - level.splat8(leave[0])) * i).lesser((level.load8(y[1]) - level.splat8(leave[1])) * j);
        let far = far.lesser(((level.load8(z[1]) - level.splat8(leave[2])) * k).lesser(level.splat8(self.limit)));
        (near, far)
    }

    /// Puts the children that the ray enters on the stack, the first to visit uppermost, and says how many.
    #[inline(always)]
    pub(super) fn enter<L: Level, const ANY: bool>(&self, level: L, node: &BlockNode, stack: &mut Stack) -> usize {
        let (near, far) = self.distances(level, ways(node.planes(), self.octant));
        let (slots, count) = near.not_above_in_order(far, order::<ANY>(node, self.octant));
        let (entries, children) = stack.room();
        near.pick(slots).store(entries);
        slots.pick(node.children(), children);
        count
    }
}
