//! One ray of a group, alone: what becomes of the last few of a packet.
//!
//! A node's eight boxes are tested at once, and so are a block's four triangles.

use crate::lanes::{Floats as _, Floats8 as _, LANES, Level, Slots as _};
use crate::order::order;
use crate::rays::{Frame, Group};
use crate::stack::Stack;
use crate::triangles::may_be_hit;
use rt_bvh::{Block, BlockChild, BlockNode, BlockTree};
use rt_core::intersect::Shear;
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
    axes: [usize; 3],
}

impl Single {
    #[inline(always)]
    fn of(group: &Group, lane: usize) -> Self {
        let near = [0, 1, 2].map(|axis: usize| usize::from(group.down[axis] >> lane & 1));
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
            axes: group.axes_of(lane),
        }
    }

    /// Puts the children that the ray enters on the stack, the first to visit uppermost.
    #[inline(always)]
    fn enter<L: Level, const ANY: bool>(&self, level: L, node: &BlockNode, stack: &mut Stack) {
        let planes = node.planes();
        let plane = |axis: usize, side: usize| {
            let reciprocal = level.splat8(self.reciprocal[axis]);
            let offset = level.splat8(self.offset[axis][side]);
            level.load8(&planes[axis][(self.near[axis] ^ side) & 1]).mul_sub(reciprocal, offset)
        };
        let near = plane(0, 0).greater(plane(1, 0)).greater(plane(2, 0).greater(level.splat8(self.begin)));
        let far = plane(0, 1).lesser(plane(1, 1)).lesser(plane(2, 1).lesser(level.splat8(self.limit)));
        let (slots, count) = near.not_above_in_order(far, order::<ANY>(node, self.octant));
        let (entries, children) = stack.room();
        near.pick(slots).store(entries);
        slots.pick(node.children(), children);
        stack.grow(count);
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
    let mut shear = None;
    stack.push(ray.begin, child, 0);
    while stack.len() > bottom {
        let (entry, child, _) = stack.pop();
        if entry > ray.limit {
            continue;
        }
        match BlockChild::of(child) {
            BlockChild::Node(index) => ray.enter::<L, ANY>(level, &tree.nodes()[index as usize], stack),
            BlockChild::Block { index, count } => {
                let block = (&tree.blocks()[index as usize], count);
                if meets_any::<L, ANY>(level, frame, group, (lane, given), block, ray.axes, &mut shear) {
                    if ANY {
                        stack.cut(bottom);
                        return;
                    }
                    ray.limit = group.limit.0[lane];
                }
            }
            BlockChild::Empty => {}
        }
    }
}

/// Tests a ray with a block of so many triangles; whether one of them is the best hit so far, which is noted. With
/// `FIRST` no triangle is tested after that. `shear` is made when the first triangle asks for it.
#[inline(always)]
pub(crate) fn meets_any<L: Level, const FIRST: bool>(
    level: L,
    frame: &Frame,
    group: &mut Group,
    (lane, given): (usize, &Ray),
    (block, count): (&Block, u32),
    axes: [usize; 3],
    shear: &mut Option<Shear>,
) -> bool {
    let mut met = false;
    let mut open = may_be_hit(level, group, lane, block, axes) & ((1 << count) - 1);
    while open != 0 {
        let triangle = open.trailing_zeros() as usize;
        open &= open - 1;
        let shear = shear.get_or_insert_with(|| Shear::new(given, frame.scale_exponent, f64::INFINITY));
        met |= meets(shear, group, lane, given, block, triangle);
        if FIRST && met {
            break;
        }
    }
    met
}

/// The reference test; whether the triangle is the best hit so far, which is noted.
#[inline(always)]
pub(crate) fn meets(shear: &Shear, group: &mut Group, lane: usize, given: &Ray, block: &Block, place: usize) -> bool {
    let id = block.id(place);
    if group.excluded.0[lane].to_bits() == id {
        return false;
    }
    match shear.hit(&block.triangle(place), [given.tmin, given.tmax], id) {
        Some(hit) if hit.is_before(&group.best(lane).unwrap_or(Hit::MISS)) => {
            group.put(lane, &hit);
            true
        }
        _ => false,
    }
}
