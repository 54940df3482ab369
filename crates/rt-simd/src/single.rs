//! One ray of a group, alone: at a node that few of a packet visit, and all the way for the last few of it.
//!
//! A node's eight boxes are tested at once, and so are a block's four triangles.

use crate::lanes::{Floats as _, Floats8 as _, LANES, Level, Sets as _, Slots as _};
use crate::order::order;
use crate::packet::{Planes, ways};
use crate::rays::{Frame, Group, Set};
use crate::stack::Stack;
use crate::triangles::may_be_hit;
use rt_bvh::{Block, BlockChild, BlockNode, BlockTree};
use rt_core::intersect::Shear;
use rt_core::{Hit, Ray};

/// What box tests know of the ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Single {
    /// For the planes through which it enters a box, and for those through which it leaves: padded origin times
    /// reciprocal.
    enter: [f32; 3],
    leave: [f32; 3],
    reciprocal: [f32; 3],
    begin: f32,
    pub(crate) limit: f32,
    octant: usize,
}

impl Single {
    /// Of no ray.
    pub(crate) const NONE: Self =
        Self { enter: [0.0; 3], leave: [0.0; 3], reciprocal: [0.0; 3], begin: 0.0, limit: 0.0, octant: 0 };

    #[inline(always)]
    pub(crate) fn of(group: &Group, lane: usize, octant: usize) -> Self {
        let lane = lane % LANES;
        let [x, y, z] = ways(&group.offset, octant);
        let [i, j, k] = &group.reciprocal;
        Self {
            enter: [x[0].0[lane], y[0].0[lane], z[0].0[lane]],
            leave: [x[1].0[lane], y[1].0[lane], z[1].0[lane]],
            reciprocal: [i.0[lane], j.0[lane], k.0[lane]],
            begin: group.begin.0[lane],
            limit: group.limit.0[lane],
            octant,
        }
    }

    /// Where the ray enters and leaves a node's boxes: those that it enters are those where the first is not above the
    /// second.
    #[inline(always)]
    fn distances<L: Level>(&self, level: L, [x, y, z]: Planes<'_>) -> (L::F8, L::F8) {
        let Self { enter, leave, reciprocal: [i, j, k], begin, limit, .. } = self;
        let (i, j, k) = (level.splat8(*i), level.splat8(*j), level.splat8(*k));
        let near = (level.load8(x[0]).mul_sub(i, level.splat8(enter[0])))
            .greater(level.load8(y[0]).mul_sub(j, level.splat8(enter[1])));
        let near = near.greater(level.load8(z[0]).mul_sub(k, level.splat8(enter[2])).greater(level.splat8(*begin)));
        let far = (level.load8(x[1]).mul_sub(i, level.splat8(leave[0])))
            .lesser(level.load8(y[1]).mul_sub(j, level.splat8(leave[1])));
        let far = far.lesser(level.load8(z[1]).mul_sub(k, level.splat8(leave[2])).lesser(level.splat8(*limit)));
        (near, far)
    }

    /// Puts the children that the ray enters on the stack, the first to visit uppermost.
    #[inline(always)]
    fn enter<L: Level, const ANY: bool>(&self, level: L, node: &BlockNode, stack: &mut Stack) {
        let (near, far) = self.distances(level, ways(node.planes(), self.octant));
        let (slots, count) = near.not_above_in_order(far, order::<ANY>(node, self.octant));
        let (entries, children) = stack.room();
        near.pick(slots).store(entries);
        slots.pick(node.children(), children);
        stack.grow(count);
    }

    /// Visits a child with the ray in a lane of a group: what it enters goes on the stack, and its hit in the group, if
    /// that is the best so far. Whether the ray ends there, as with `ANY` it does with a hit. `shear` is made when the
    /// first triangle asks for it.
    #[expect(clippy::too_many_arguments, reason = "all in registers")]
    #[inline(always)]
    pub(crate) fn visit<L: Level, const ANY: bool>(
        &mut self,
        level: L,
        (tree, frame): (&BlockTree, &Frame),
        group: &mut Group,
        (lane, given, axes): (usize, &Ray, [usize; 3]),
        child: u32,
        shear: &mut Option<Shear>,
        stack: &mut Stack,
    ) -> bool {
        match BlockChild::of(child) {
            BlockChild::Node(index) => self.enter::<L, ANY>(level, &tree.nodes()[index as usize], stack),
            BlockChild::Block { index, count } => {
                let block = (&tree.blocks()[index as usize], count);
                if meets_any::<L, ANY>(level, frame, group, (lane, given), block, axes, shear) {
                    if ANY {
                        return true;
                    }
                    self.limit = group.limit.0[lane];
                }
            }
            BlockChild::Empty => {}
        }
        false
    }
}

/// Adds rays of a group, one after the other, to the sets of those that enter the boxes in each slot of a node. In the
/// sets the group begins with ray `first`.
#[inline(always)]
pub(crate) fn enter_each<L: Level>(
    level: L,
    (group, first): (&Group, usize),
    octant: usize,
    planes: Planes<'_>,
    rays: Set,
    mut sets: L::Sets,
) -> L::Sets {
    let mut rest = rays;
    while rest != 0 {
        let lane = rest.trailing_zeros() as usize;
        rest &= rest - 1;
        let (near, far) = Single::of(group, lane, octant).distances(level, planes);
        sets = sets.with(near.not_above(far), 1 << (first + lane));
    }
    sets
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
    (lane, given, octant): (usize, &Ray, usize),
    child: u32,
    stack: &mut Stack,
) {
    let lane = lane % LANES;
    let mut ray = Single::of(group, lane, octant);
    let axes = group.axes_of(lane);
    let bottom = stack.len();
    let mut shear = None;
    stack.push(ray.begin, child, 0);
    while stack.len() > bottom {
        let (entry, child, _) = stack.pop();
        if entry > ray.limit {
            continue;
        }
        if ray.visit::<L, ANY>(level, (tree, frame), group, (lane, given, axes), child, &mut shear, stack) {
            stack.cut(bottom);
            return;
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
