//! One ray of a group, alone: what becomes of the last few of a packet.
//!
//! A node's eight boxes are tested at once, and so are a block's four triangles.

use crate::lanes::{Floats as _, Floats8 as _, Floats16 as _, LANES, Level, Slots as _};
use crate::rays::{Frame, Group};
use crate::stack::Stack;
use crate::triangles::{AXES, reference, triangle};
use rt_bvh::{Block, BlockChild, BlockNode, BlockTree};
use rt_core::{Hit, Ray};

/// What tests know of the ray.
struct Single {
    /// By axis: which planes of a box it enters through, 0 for the lower ones.
    near: [usize; 3],
    /// For those planes, and for those through which it leaves: padded origin times reciprocal.
    offset: [[f32; 2]; 3],
    reciprocal: [f32; 3],
    begin: f32,
    limit: f32,
    octant: usize,
    origin: [f32; 3],
    shear: [f32; 2],
    error: f32,
    floor: f32,
    axes: [usize; 3],
}

impl Single {
    #[inline(always)]
    fn of(group: &Group, lane: usize) -> Self {
        let near = [0, 1, 2].map(|axis: usize| usize::from(group.down[axis] >> lane & 1));
        let dominant = usize::from(group.dominant[1] >> lane & 1) + 2 * usize::from(group.dominant[2] >> lane & 1);
        let offset = |axis: usize| {
            let sides = &group.offset[axis];
            [sides[near[axis] & 1].0[lane], sides[near[axis] & 1 ^ 1].0[lane]]
        };
        Self {
            near,
            offset: [offset(0), offset(1), offset(2)],
            reciprocal: [group.reciprocal[0].0[lane], group.reciprocal[1].0[lane], group.reciprocal[2].0[lane]],
            begin: group.begin.0[lane],
            limit: group.limit.0[lane],
            octant: near[0] | near[1] << 1 | near[2] << 2,
            origin: [group.origin[0].0[lane], group.origin[1].0[lane], group.origin[2].0[lane]],
            shear: [group.shear[0].0[lane], group.shear[1].0[lane]],
            error: group.error.0[lane],
            floor: group.floor.0[lane],
            axes: AXES[dominant % 3],
        }
    }

    /// Puts the children that the ray enters on the stack, the first to visit uppermost.
    #[inline(always)]
    fn enter<L: Level>(&self, level: L, node: &BlockNode, stack: &mut Stack) {
        let planes = node.planes();
        let plane = |axis: usize, side: usize| {
            let reciprocal = level.splat8(self.reciprocal[axis]);
            let offset = level.splat8(self.offset[axis][side]);
            level.load8(&planes[axis][(self.near[axis] ^ side) & 1]).mul_sub(reciprocal, offset)
        };
        let near = plane(0, 0).greater(plane(1, 0)).greater(plane(2, 0).greater(level.splat8(self.begin)));
        let far = plane(0, 1).lesser(plane(1, 1)).lesser(plane(2, 1).lesser(level.splat8(self.limit)));
        let (slots, count) = near.not_above_in_order(far, node.orders()[self.octant & 7]);
        let (entries, children) = stack.room();
        near.pick(slots).store(entries);
        slots.pick(node.children(), children);
        stack.grow(count);
    }

    /// The triangles of a block that the line may meet, a bit each.
    #[inline(always)]
    fn may_hit<L: Level>(&self, level: L, block: &Block) -> u32 {
        let coordinate = |axis: usize| {
            let numbers: &[f32; LANES] = bytemuck::cast_ref(&block.axes[axis]);
            level.load12(numbers) - level.splat(self.origin[axis])
        };
        let z = coordinate(self.axes[2]);
        let x = z.neg_mul_add(level.splat(self.shear[0]), coordinate(self.axes[0]));
        let y = z.neg_mul_add(level.splat(self.shear[1]), coordinate(self.axes[1]));
        // Groups of lanes: first, second and third vertices, and nothing. An edge is that of two others.
        let (xp, xq, yp, yq) = (x.groups_cab(), x.groups_bca(), y.groups_cab(), y.groups_bca());
        let edges = xp.mul_sub(yq, yp * xq);
        let size = x.abs().greater(xp.abs()).greater(xq.abs()) + y.abs().greater(yp.abs()).greater(yq.abs());
        let error = (size + level.splat(self.floor)) * level.splat(self.error);
        let negative = u32::from(edges.below(level.splat(0.0) - error));
        let positive = u32::from(error.below(edges));
        let any = |edges: u32| edges | edges >> 4 | edges >> 8;
        !(any(negative) & any(positive)) & 0xf
    }
}

/// Visits what hangs below a child with one ray of a group, whose hit becomes the nearest so far, or with `ANY` the
/// first.
///
/// The stack is used from its top on, and left as it was.
#[inline(always)]
pub(crate) fn walk<L: Level, const ANY: bool>(
    level: L,
    tree: &BlockTree,
    frame: &Frame,
    group: &mut Group,
    (lane, given): (usize, &Ray),
    child: u32,
    stack: &mut Stack,
) {
    let lane = lane % LANES;
    let mut ray = Single::of(group, lane);
    let bottom = stack.len();
    stack.push(ray.begin, child, 0);
    while stack.len() > bottom {
        let (entry, child, _) = stack.pop();
        if entry > ray.limit {
            continue;
        }
        match BlockChild::of(child) {
            BlockChild::Node(index) => ray.enter(level, &tree.nodes()[index as usize], stack),
            BlockChild::Block { index, count } => {
                let block = &tree.blocks()[index as usize];
                let mut open = ray.may_hit(level, block) & ((1 << count) - 1);
                while open != 0 {
                    let triangle = open.trailing_zeros() as usize;
                    open &= open - 1;
                    if meets(frame, group, lane, given, block, triangle) {
                        if ANY {
                            stack.cut(bottom);
                            return;
                        }
                        ray.limit = group.limit.0[lane];
                    }
                }
            }
            BlockChild::Empty => {}
        }
    }
}

/// The reference test; whether the triangle is the best hit so far, which is noted.
#[inline(always)]
fn meets(frame: &Frame, group: &mut Group, lane: usize, given: &Ray, block: &Block, place: usize) -> bool {
    let id = block.id(place);
    if group.excluded.0[lane].to_bits() == id {
        return false;
    }
    match reference(frame, given, &triangle(block, place), id) {
        Some(hit) if hit.is_before(&group.best(lane).unwrap_or(Hit::MISS)) => {
            group.put(lane, &hit);
            true
        }
        _ => false,
    }
}
