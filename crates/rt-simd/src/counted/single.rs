//! One ray of a group, alone, counted.

use super::Kind;
use super::slabs::Single;
use crate::lanes::{LANES, Level};
use crate::packet::fetch;
use crate::rays::{Frame, Group};
use crate::single::meets_any;
use crate::stack::Stack;
use rt_bvh::{BlockChild, BlockTree};
use rt_core::{Ray, TestCounts};

/// Of the children that come next, so many are asked for ahead: those of a ray that has no neighbours are seldom in a
/// cache.
const FETCHED: usize = 2;

/// Visits what hangs below a child, which the ray visits, with one ray of a group, and counts; the ray's hit and limit
/// in the group come down.
///
/// The stack is used from its top on, and left as it was.
#[inline(always)]
pub(super) fn walk<L: Level, K: Kind>(
    level: L,
    (tree, frame): (&BlockTree, &Frame),
    group: &mut Group,
    (lane, given, octant): (usize, &Ray, usize),
    child: u32,
    stack: &mut Stack,
) -> TestCounts {
    let lane = lane % LANES;
    let mut ray = Single::of(group, lane, octant);
    let axes = group.axes_of(lane);
    let (mut nodes, mut triangles) = (0_u32, 0_u32);
    let bottom = stack.len();
    let mut shear = None;
    stack.push(ray.begin, child, 0);
    while stack.len() > bottom {
        let (entry, child, _) = stack.pop();
        if entry > ray.limit {
            continue;
        }
        match BlockChild::of(child) {
            BlockChild::Node(index) => {
                nodes = nodes.saturating_add(1);
                let node = &tree.nodes()[index as usize];
                let entered = if K::ANY {
                    ray.enter::<L, true>(level, node, stack)
                } else {
                    ray.enter::<L, false>(level, node, stack)
                };
                if K::FULL {
                    stack.grow(entered);
                } else {
                    triangles = triangles.saturating_add(leaves::<K>(&mut ray, entered, stack));
                }
                stack.next(FETCHED.min(stack.len() - bottom)).iter().for_each(|&child| fetch(level, tree, child));
            }
            BlockChild::Block { index, count } => {
                triangles = triangles.saturating_add(count);
                let block = (&tree.blocks()[index as usize], count);
                if meets_any::<L, false>(level, frame, group, (lane, given), block, axes, &mut shear) {
                    ray.limit = group.limit.0[lane];
                }
                if K::ANY && group.found >> lane & 1 == 1 {
                    stack.cut(bottom);
                }
            }
            BlockChild::Empty => {}
        }
    }
    if K::SHORTENS && !K::FULL {
        group.limit.0[lane] = ray.limit;
    }
    TestCounts { boxes: nodes.saturating_mul(8), triangles }
}

/// Takes the blocks from among the children that are entered, keeps the nodes on the stack, and counts the triangles of
/// the blocks.
#[inline(always)]
fn leaves<K: Kind>(ray: &mut Single, entered: usize, stack: &mut Stack) -> u32 {
    let (mut triangles, mut kept) = (0, 0);
    let (entries, children) = stack.room();
    for i in 0..entered & 15 {
        let i = i & 7;
        match BlockChild::of(children[i]) {
            BlockChild::Block { count, .. } => {
                triangles += count;
                if K::SHORTENS && entries[i] < ray.limit {
                    ray.limit = entries[i];
                }
            }
            _ => {
                (entries[kept & 7], children[kept & 7]) = (entries[i], children[i]);
                kept += 1;
            }
        }
    }
    stack.grow(kept);
    triangles
}
