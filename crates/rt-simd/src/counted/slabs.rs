//! Box tests that give the same bits with any instructions.

use crate::lanes::{Floats as _, Floats8 as _, Floats16, Level, Slots as _};
use crate::order::order;
use crate::rays::{Group, Set};
use crate::stack::Stack;
use rt_bvh::BlockNode;

/// By axis, the planes of a node's boxes through which rays of an octant enter, and those through which they leave.
pub(super) struct Planes<'n>([[&'n [f32; 8]; 2]; 3]);

impl<'n> Planes<'n> {
    #[inline(always)]
    pub(super) fn of(node: &'n BlockNode, octant: usize) -> Self {
        let [x, y, z] = node.planes();
        let pair = |axis: usize, planes: &'n [[f32; 8]; 2]| {
            let enter = octant >> axis & 1;
            [&planes[enter], &planes[enter ^ 1]]
        };
        Self([pair(0, x), pair(1, y), pair(2, z)])
    }
}

/// What box tests know of the rays of a group that are in one octant.
pub(super) struct Slabs<F> {
    reciprocal: [F; 3],
    /// Padded origins, for the planes through which the rays enter, and leave.
    origin: [[F; 3]; 2],
    begin: F,
    pub(super) limit: F,
}

impl<F: Floats16> Slabs<F> {
    #[inline(always)]
    pub(super) fn of<L: Level<F16 = F>>(level: L, group: &Group, octant: usize) -> Self {
        // Lower planes see an origin that was moved up, upper ones one that was moved down.
        let origin = |axis: usize, leave: usize| {
            let (origin, pad) = (level.load(&group.origin[axis]), level.load(&group.pad[axis]));
            if (octant >> axis ^ leave) & 1 == 0 { origin + pad } else { origin - pad }
        };
        let reciprocal = |axis: usize| level.load(&group.reciprocal[axis]);
        Self {
            reciprocal: [reciprocal(0), reciprocal(1), reciprocal(2)],
            origin: [0, 1].map(|leave| [origin(0, leave), origin(1, leave), origin(2, leave)]),
            begin: level.load(&group.begin),
            limit: level.load(&group.limit),
        }
    }

    /// Where the rays enter the box in a slot, and which of them do.
    #[inline(always)]
    pub(super) fn enter<L: Level<F16 = F>>(&self, level: L, planes: &Planes<'_>, slot: usize) -> (F, Set) {
        let slot = slot & 7;
        let distance = |axis: usize, leave: usize| {
            (level.splat(planes.0[axis][leave][slot]) - self.origin[leave][axis]) * self.reciprocal[axis]
        };
        let near = distance(0, 0).greater(distance(1, 0)).greater(distance(2, 0).greater(self.begin));
        let far = distance(0, 1).lesser(distance(1, 1)).lesser(distance(2, 1).lesser(self.limit));
        (near, near.not_above(far))
    }
}

/// The same of one ray, with eight boxes at a time.
pub(super) struct Single {
    octant: usize,
    origin: [[f32; 2]; 3],
    reciprocal: [f32; 3],
    pub(super) begin: f32,
    pub(super) limit: f32,
}

impl Single {
    #[inline(always)]
    pub(super) fn of(group: &Group, lane: usize, octant: usize) -> Self {
        let origin = |axis: usize, leave: usize| {
            let (origin, pad) = (group.origin[axis].0[lane], group.pad[axis].0[lane]);
            if (octant >> axis ^ leave) & 1 == 0 { origin + pad } else { origin - pad }
        };
        Self {
            octant,
            origin: [0, 1, 2].map(|axis| [origin(axis, 0), origin(axis, 1)]),
            reciprocal: [0, 1, 2].map(|axis| group.reciprocal[axis].0[lane]),
            begin: group.begin.0[lane],
            limit: group.limit.0[lane],
        }
    }

    /// Puts the children that the ray enters on the stack, the first to visit uppermost, and says how many.
    #[inline(always)]
    pub(super) fn enter<L: Level, const ANY: bool>(&self, level: L, node: &BlockNode, stack: &mut Stack) -> usize {
        let planes = Planes::of(node, self.octant);
        let distance = |axis: usize, leave: usize| {
            let way = level.load8(planes.0[axis][leave]) - level.splat8(self.origin[axis][leave]);
            way * level.splat8(self.reciprocal[axis])
        };
        let near = distance(0, 0).greater(distance(1, 0)).greater(distance(2, 0).greater(level.splat8(self.begin)));
        let far = distance(0, 1).lesser(distance(1, 1)).lesser(distance(2, 1).lesser(level.splat8(self.limit)));
        let (slots, count) = near.not_above_in_order(far, order::<ANY>(node, self.octant));
        let (entries, children) = stack.room();
        near.pick(slots).store(entries);
        slots.pick(node.children(), children);
        count
    }
}
