//! Up to 64 rays that walk the tree together.
//!
//! After I. Wald, P. Slusallek, C. Benthin and M. Wagner, *Interactive Rendering with Coherent Ray Tracing* (2001), and for the
//! bounds of packets S. Boulos, I. Wald and P. Shirley, *Geometric and Arithmetic Culling Methods for Entire Ray Packets* (2006).
//! The rays of each octant walk by themselves. A node's eight boxes are tested against the bounds of all rays at once (the
//! module `frustum`); of the children that these let through, each is tested with sixteen rays at a time, and goes on the stack
//! with the set of those that enter it. Where few are left they go on one by one (the module `single`).
//!
//! Rays with an origin in common make tight bounds. They skip the tests of sixteen, which would find little more.
//!
//! Which boxes are visited, and when, depends on a ray's company. Its hit does not: see the module `rays`.

use crate::frustum::Frustum;
use crate::lanes::{Floats as _, Floats16 as _, Floats8 as _, LANES, Level, Slots as _};
use crate::rays::{Frame, Group, Set};
use crate::single;
use crate::stack::Stack;
use crate::triangles::{AXES, confirm, may_hit};
use rt_bvh::{Block, BlockChild, BlockNode, BlockTree};
use rt_core::Ray;

/// Groups of a packet. Measured: 64 rays are up to half faster than 16, and 128 no faster than 64.
pub(crate) const GROUPS: usize = 4;

/// Rays of a packet.
pub(crate) const RAYS: usize = GROUPS * LANES;

/// A packet, and what it needs on its way.
#[derive(Clone, Debug)]
pub(crate) struct Packet {
    pub(crate) groups: [Group; GROUPS],
    stack: Stack,
}

impl Packet {
    pub(crate) fn new() -> Self {
        Self { groups: [const { Group::EMPTY }; GROUPS], stack: Stack::new() }
    }

    /// Traces valid rays that are not extreme, of which there are at most [`RAYS`]. Where no more than `few` are left to enter a
    /// node, they go on alone. The nearest hits, or with `ANY` whichever are found first, are in the groups.
    #[inline(always)]
    pub(crate) fn trace<L: Level, const ANY: bool>(&mut self, level: L, tree: &BlockTree, frame: &Frame, rays: &[Ray], few: u32) {
        let Self { groups, stack } = self;
        let groups = &mut groups[..rays.len().div_ceil(LANES)];
        for octant in 0..8 {
            let mut open = [0; GROUPS];
            for (open, group) in open.iter_mut().zip(&*groups) {
                *open = group.in_octant(octant);
            }
            if open == [0; GROUPS] {
                continue;
            }
            let mut walk = Walk { tree, frame, rays, few, groups, open, octant };
            walk.run::<L, ANY>(level, stack);
        }
    }
}

/// Rays of one octant on their way.
struct Walk<'a> {
    tree: &'a BlockTree,
    frame: &'a Frame,
    /// As given.
    rays: &'a [Ray],
    few: u32,
    groups: &'a mut [Group],
    /// Rays that go on, by group.
    open: [Set; GROUPS],
    octant: usize,
}

impl Walk<'_> {
    #[inline(always)]
    fn run<L: Level, const ANY: bool>(&mut self, level: L, stack: &mut Stack) {
        let mut frustum = Frustum::around(level, self.groups, &self.open, self.octant);
        stack.cut(0);
        stack.push(frustum.begin(), 0, self.all());
        while stack.len() > 0 {
            let (entry, child, mut rays) = stack.pop();
            if entry > frustum.limit {
                continue;
            }
            if ANY {
                rays &= self.all();
            }
            if rays.count_ones() <= self.few {
                if rays != 0 {
                    self.alone::<L, ANY>(level, stack, child, rays);
                }
                continue;
            }
            match BlockChild::of(child) {
                BlockChild::Node(index) => self.node(level, &frustum, &self.tree.nodes()[index as usize], rays, stack),
                BlockChild::Block { index, count } => {
                    if self.block::<L, ANY>(level, &self.tree.blocks()[index as usize], count, rays) {
                        frustum.shorten(level, self.groups, &self.open);
                    }
                }
                BlockChild::Empty => {}
            }
        }
    }

    /// All rays that go on.
    #[inline(always)]
    fn all(&self) -> u64 {
        self.open.iter().rev().fold(0, |all, &rays| all << LANES | u64::from(rays))
    }

    /// Puts on the stack which children which rays enter.
    #[inline(always)]
    fn node<L: Level>(&self, level: L, frustum: &Frustum, node: &BlockNode, rays: u64, stack: &mut Stack) {
        let (near, slots, count) = frustum.enter(level, node);
        let (mut entries, mut numbers) = ([0.0; 8], [0; 8]);
        near.store(&mut entries);
        slots.store(&mut numbers);
        for (&entry, &slot) in entries.iter().zip(&numbers).take(count) {
            let slot = slot as usize & 7;
            let mut entered = 0;
            for (i, group) in self.groups.iter().enumerate() {
                let some = (rays >> (LANES * i)) as Set;
                if some != 0 {
                    let planes = |axis: usize| [node.planes()[axis][0][slot], node.planes()[axis][1][slot]];
                    let some = some & enter(level, group, self.octant, [planes(0), planes(1), planes(2)]);
                    entered |= u64::from(some) << (LANES * i);
                }
            }
            if entered != 0 {
                stack.push(entry, node.children()[slot], entered);
            }
        }
    }

    /// Tests the triangles of a block; whether limits have come down.
    #[inline(always)]
    fn block<L: Level, const ANY: bool>(&mut self, level: L, block: &Block, count: u32, rays: u64) -> bool {
        let bounds = |axis: usize| [block.axes[axis].low, block.axes[axis].high];
        let planes = [bounds(0), bounds(1), bounds(2)];
        let mut shorter = false;
        for (i, (group, given)) in self.groups.iter_mut().zip(self.rays.chunks(LANES)).enumerate() {
            let some = (rays >> (LANES * i)) as Set;
            if some == 0 {
                continue;
            }
            // Again: limits may have come down since.
            let some = some & enter(level, group, self.octant, planes);
            if some == 0 {
                continue;
            }
            for axes in AXES {
                let some = some & group.dominant[axes[2]];
                if some == 0 {
                    continue;
                }
                let mut open = [0; 4];
                for (lane, open) in open.iter_mut().enumerate().take(count as usize) {
                    *open = may_hit(level, group, block, lane, axes, some);
                }
                if open == [0; 4] {
                    continue;
                }
                for (lane, &open) in open.iter().enumerate().take(count as usize) {
                    let open = if ANY { open & self.open[i] } else { open };
                    if open == 0 {
                        continue;
                    }
                    let better = confirm(level, self.frame, group, given, (block, lane), axes, open);
                    if better != 0 {
                        shorter = true;
                        if ANY {
                            self.open[i] &= !better;
                        }
                    }
                }
            }
        }
        shorter
    }

    /// Sends rays one by one through what hangs below a child. The bounds' limit is left as it is.
    #[inline(always)]
    fn alone<L: Level, const ANY: bool>(&mut self, level: L, stack: &mut Stack, child: u32, rays: u64) {
        let mut rays = rays;
        while rays != 0 {
            let ray = rays.trailing_zeros() as usize;
            rays &= rays - 1;
            let (i, lane) = (ray / LANES, ray % LANES);
            let group = &mut self.groups[i];
            single::walk::<L, ANY>(level, self.tree, self.frame, group, (lane, &self.rays[ray]), child, stack);
            if ANY {
                self.open[i] &= !group.found;
            }
        }
    }
}

/// The rays of a group, all of one octant, that enter a box: its lower and upper plane by axis.
#[inline(always)]
fn enter<L: Level>(level: L, group: &Group, octant: usize, planes: [[f32; 2]; 3]) -> Set {
    let near = distance(level, group, octant, planes, 0, 0).greater(distance(level, group, octant, planes, 1, 0));
    let near = near.greater(distance(level, group, octant, planes, 2, 0).greater(level.load(&group.begin)));
    let far = distance(level, group, octant, planes, 0, 1).lesser(distance(level, group, octant, planes, 1, 1));
    let far = far.lesser(distance(level, group, octant, planes, 2, 1).lesser(level.load(&group.limit)));
    near.not_above(far)
}

/// Distances to the planes through which rays enter along an axis, or leave.
#[inline(always)]
fn distance<L: Level>(level: L, group: &Group, octant: usize, planes: [[f32; 2]; 3], axis: usize, leave: usize) -> L::F16 {
    let side = (octant >> axis ^ leave) & 1;
    level.splat(planes[axis][side]).mul_sub(level.load(&group.reciprocal[axis]), level.load(&group.offset[axis][side]))
}
