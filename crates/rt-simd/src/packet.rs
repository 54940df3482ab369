//! Up to 64 rays that walk the tree together.
//!
//! After I. Wald, P. Slusallek, C. Benthin and M. Wagner, *Interactive Rendering with Coherent Ray Tracing* (2001), and
//! for the bounds of packets S. Boulos, I. Wald and P. Shirley, *Geometric and Arithmetic Culling Methods for Entire
//! Ray Packets* (2006). The rays of each octant walk by themselves. A node's eight boxes are tested against the bounds
//! of all rays at once (the module `frustum`); of the children that these let through, each is tested with sixteen rays
//! at a time, or of scattered rays all of them with one ray at a time where these are fewer, and goes on the stack
//! with the set of those that enter it. A single child is not tested: that costs more than the few rays save that do
//! not enter it. Where few are left they go on one by one (the module `single`), scattered ones several in turns (the
//! module `turns`).
//!
//! Which boxes are visited, and when, depends on a ray's company. Its hit does not: see the module `rays`.

use crate::frustum::Frustum;
use crate::lanes::{Floats8 as _, Floats16, LANES, Level, Sets as _, Slots as _};
use crate::rays::{Frame, Group, Set};
use crate::single::{self, enter_each};
use crate::stack::Stack;
use crate::triangles::{AXES, any, nearest};
use crate::turns::{Company, Turns};
use rt_bvh::{Block, BlockChild, BlockNode, BlockTree};
use rt_core::Ray;

/// Groups of a packet. Measured: 64 rays are up to half faster than 16, and 128 no faster than 64.
pub(crate) const GROUPS: usize = 4;

/// Rays of a packet.
pub(crate) const RAYS: usize = GROUPS * LANES;

/// Bytes of a tree that stays in the nearest caches.
const NEAR: u64 = 1 << 18;

/// A packet, and what it needs on its way.
#[derive(Clone, Debug)]
pub(crate) struct Packet {
    pub(crate) groups: [Group; GROUPS],
    stack: Stack,
    turns: Turns,
}

impl Packet {
    pub(crate) fn new() -> Self {
        Self { groups: [const { Group::EMPTY }; GROUPS], stack: Stack::new(), turns: Turns::new() }
    }

    /// Traces valid rays that are not extreme, of which there are at most [`RAYS`]. Where no more than `few` are left
    /// to enter a node, they go on alone; rays that are `SCATTERED` soon leave each other. The nearest hits, or with
    /// `ANY` whichever are found first, are in the groups.
    #[inline(always)]
    pub(crate) fn trace<L: Level, const ANY: bool, const SCATTERED: bool>(
        &mut self,
        level: L,
        tree: &BlockTree,
        frame: &Frame,
        rays: &[Ray],
        few: u32,
    ) {
        let Self { groups, stack, turns } = self;
        let groups = &mut groups[..rays.len().div_ceil(LANES)];
        let far = tree.bytes() > NEAR;
        // Most packets have rays of one octant.
        let mut ways = [[0; 2]; 3];
        for group in &*groups {
            for (axis, [up, down]) in ways.iter_mut().enumerate() {
                *up |= group.valid & !group.down[axis];
                *down |= group.valid & group.down[axis];
            }
        }
        for octant in 0..8 {
            if (0..3).any(|axis| ways[axis][octant >> axis & 1] == 0) {
                continue;
            }
            let open = in_octant(groups, octant);
            if open == [0; GROUPS] {
                continue;
            }
            let frustum = Frustum::around(level, groups, &open, octant);
            let mut walk = Walk { tree, far, frame, rays, few, groups, open, octant };
            walk.run::<L, ANY, SCATTERED>(level, frustum, stack, turns);
        }
    }
}

/// Puts rays into groups; returns those that are extreme, a bit each. `excluded` has an entry for each ray, or none.
#[inline(always)]
pub(crate) fn fill<L: Level>(level: L, frame: &Frame, groups: &mut [Group], rays: &[Ray], excluded: &[u32]) -> u64 {
    let mut extreme = 0;
    let mut excluded = excluded.chunks(LANES);
    for (i, (group, rays)) in groups.iter_mut().zip(rays.chunks(LANES)).enumerate() {
        group.set(level, frame, rays, excluded.next().unwrap_or_default());
        extreme |= u64::from(group.extreme) << (LANES * i);
    }
    extreme
}

/// The rays of an octant, by group.
#[inline(always)]
pub(crate) fn in_octant(groups: &[Group], octant: usize) -> [Set; GROUPS] {
    let mut sets = [0; GROUPS];
    for (set, group) in sets.iter_mut().zip(groups) {
        *set = group.in_octant(octant);
    }
    sets
}

/// The rays of all groups as one set.
#[inline(always)]
pub(crate) fn joined(sets: &[Set; GROUPS]) -> u64 {
    sets.iter().rev().fold(0, |all, &rays| all << LANES | u64::from(rays))
}

/// Asks for a child that will be visited soon.
#[inline(always)]
pub(crate) fn fetch<L: Level>(level: L, tree: &BlockTree, child: u32) {
    match BlockChild::of(child) {
        BlockChild::Node(index) => level.fetch(bytemuck::bytes_of(&tree.nodes()[index as usize])),
        BlockChild::Block { index, .. } => level.fetch(bytemuck::bytes_of(&tree.blocks()[index as usize])),
        BlockChild::Empty => {}
    }
}

/// By axis, the planes of a node's boxes through which rays enter, and those through which they leave.
pub(crate) type Planes<'n> = [[&'n [f32; 8]; 2]; 3];

/// Whether so few rays of a group visit a node that each is tested with all of its boxes, instead of each of so many
/// children with all of the rays.
#[inline(always)]
pub(crate) fn is_for_each(rays: Set, children: usize) -> bool {
    rays.count_ones() as usize <= children
}

/// By axis, what belongs to the planes through which rays of an octant enter a box, and to those through which they
/// leave it, of what belongs to its lower and its upper planes.
#[inline(always)]
pub(crate) fn ways<T>([x, y, z]: &[[T; 2]; 3], octant: usize) -> [[&T; 2]; 3] {
    let [i, j, k] = [octant & 1, octant >> 1 & 1, octant >> 2 & 1];
    [[&x[i], &x[i ^ 1]], [&y[j], &y[j ^ 1]], [&z[k], &z[k ^ 1]]]
}

/// Rays of one octant on their way.
struct Walk<'a> {
    tree: &'a BlockTree,
    /// Whether what hangs below a node is worth asking for ahead.
    far: bool,
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
    fn run<L: Level, const ANY: bool, const SCATTERED: bool>(
        &mut self,
        level: L,
        mut frustum: Frustum,
        stack: &mut Stack,
        turns: &mut Turns,
    ) {
        stack.cut(0);
        stack.push(frustum.begin(), 0, joined(&self.open));
        while stack.len() > 0 {
            let (entry, child, mut rays) = stack.pop();
            if entry > frustum.limit {
                continue;
            }
            if ANY {
                rays &= joined(&self.open);
            }
            if rays.count_ones() <= self.few {
                if SCATTERED {
                    turns.keep(entry, child, rays);
                    if turns.is_enough() {
                        self.in_turns::<L, ANY>(level, turns);
                    }
                } else if rays != 0 {
                    self.alone::<L, ANY>(level, stack, child, rays);
                }
                continue;
            }
            match BlockChild::of(child) {
                BlockChild::Node(index) => {
                    let node = &self.tree.nodes()[index as usize];
                    self.node::<L, ANY, SCATTERED>(level, &frustum, node, rays, stack);
                }
                BlockChild::Block { index, count } => {
                    if self.block::<L, ANY>(level, &self.tree.blocks()[index as usize], count, rays) {
                        frustum.shorten(level, self.groups, &self.open);
                    }
                }
                BlockChild::Empty => {}
            }
        }
        if SCATTERED {
            self.in_turns::<L, ANY>(level, turns);
        }
    }

    /// Single rays go where they are to go. The bounds' limit is left as it is.
    #[inline(always)]
    fn in_turns<L: Level, const ANY: bool>(&mut self, level: L, turns: &mut Turns) {
        if ANY {
            turns.keep_only(joined(&self.open));
        }
        let Self { tree, frame, rays, octant, .. } = *self;
        turns.run::<L, ANY>(level, &mut Company { tree, frame, groups: self.groups, rays, octant });
        if ANY {
            for (open, group) in self.open.iter_mut().zip(&*self.groups) {
                *open &= !group.found;
            }
        }
    }

    /// Puts on the stack which children which rays enter.
    #[inline(always)]
    fn node<L: Level, const ANY: bool, const SCATTERED: bool>(
        &self,
        level: L,
        frustum: &Frustum,
        node: &BlockNode,
        rays: u64,
        stack: &mut Stack,
    ) {
        let (near, slots, count) = frustum.enter::<L, ANY>(level, node);
        let (mut entries, mut numbers) = ([0.0; 8], [0; 8]);
        near.store(&mut entries);
        slots.store(&mut numbers);
        let child = |j: usize| node.children()[numbers[j & 7] as usize & 7];
        if self.far {
            for j in 0..count {
                fetch(level, self.tree, child(j));
            }
        }
        if count == 1 {
            stack.push(entries[0], child(0), rays);
            return;
        }
        let (mut entered, mut by_slot) = ([0; 8], level.no_rays());
        let planes = ways(node.planes(), self.octant);
        for (i, group) in self.groups.iter().enumerate() {
            let some = (rays >> (LANES * i)) as Set;
            if some == 0 {
                continue;
            }
            // Coherent rays, which are seldom few, are spared the question and what it keeps in words.
            if SCATTERED && is_for_each(some, count) {
                by_slot = enter_each(level, (group, LANES * i), self.octant, planes, some, by_slot);
            } else {
                let slabs = Slabs::of(level, group, self.octant);
                for (&slot, entered) in numbers.iter().zip(&mut entered).take(count) {
                    let slot = slot as usize & 7;
                    let plane = |axis: usize, side: usize| planes[axis][side][slot];
                    let near = [plane(0, 0), plane(1, 0), plane(2, 0)];
                    let far = [plane(0, 1), plane(1, 1), plane(2, 1)];
                    *entered |= u64::from(some & slabs.enter(level, near, far)) << (LANES * i);
                }
            }
        }
        let mut each = [0; 8];
        if SCATTERED {
            by_slot.store(&mut each);
        }
        for j in 0..count {
            let rays = entered[j & 7] | each[numbers[j & 7] as usize & 7];
            stack.push_if(rays != 0, entries[j & 7], child(j), rays);
        }
    }

    /// Tests the triangles of a block; whether limits have come down.
    #[inline(always)]
    fn block<L: Level, const ANY: bool>(&mut self, level: L, block: &Block, count: u32, rays: u64) -> bool {
        let bounds = [block.axes[0].bounds, block.axes[1].bounds, block.axes[2].bounds];
        let [x, y, z] = ways(&bounds, self.octant);
        let (near, far) = ([*x[0], *y[0], *z[0]], [*x[1], *y[1], *z[1]]);
        let mut shorter = false;
        for (i, (group, given)) in self.groups.iter_mut().zip(self.rays.chunks(LANES)).enumerate() {
            let some = (rays >> (LANES * i)) as Set;
            if some == 0 {
                continue;
            }
            // Again: limits may have come down since.
            let some = if ANY {
                some & self.open[i]
            } else {
                some & Slabs::of(level, group, self.octant).enter(level, near, far)
            };
            if some == 0 {
                continue;
            }
            for axes in AXES {
                let some = some & group.dominant[axes[2]];
                if some == 0 {
                    continue;
                }
                let better = if ANY {
                    any(level, self.frame, group, given, (block, count), axes, some)
                } else {
                    nearest(level, self.frame, group, given, (block, count), axes, some)
                };
                shorter |= better != 0;
                if ANY {
                    self.open[i] &= !better;
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
            let ray = (lane, &self.rays[ray], self.octant);
            single::walk::<L, ANY>(level, self.tree, self.frame, group, ray, child, stack);
            if ANY {
                self.open[i] &= !group.found;
            }
        }
    }
}

/// What box tests know of the rays of a group that are in one octant.
struct Slabs<F> {
    reciprocal: [F; 3],
    /// Padded origins times reciprocals, for the planes through which the rays enter, and leave.
    near: [F; 3],
    far: [F; 3],
    begin: F,
    limit: F,
}

impl<F: Floats16> Slabs<F> {
    #[inline(always)]
    fn of<L: Level<F16 = F>>(level: L, group: &Group, octant: usize) -> Self {
        let offset = |axis: usize, leave: usize| &group.offset[axis][(octant >> axis ^ leave) & 1];
        Self {
            reciprocal: [
                level.load(&group.reciprocal[0]),
                level.load(&group.reciprocal[1]),
                level.load(&group.reciprocal[2]),
            ],
            near: [level.load(offset(0, 0)), level.load(offset(1, 0)), level.load(offset(2, 0))],
            far: [level.load(offset(0, 1)), level.load(offset(1, 1)), level.load(offset(2, 1))],
            begin: level.load(&group.begin),
            limit: level.load(&group.limit),
        }
    }

    /// The rays that enter a box, given its planes by axis.
    #[inline(always)]
    fn enter<L: Level<F16 = F>>(&self, level: L, near: [f32; 3], far: [f32; 3]) -> Set {
        let Self { reciprocal, near: n, far: f, begin, limit } = self;
        let enter = level
            .splat(near[0])
            .mul_sub(reciprocal[0], n[0])
            .greater(level.splat(near[1]).mul_sub(reciprocal[1], n[1]));
        let enter = enter.greater(level.splat(near[2]).mul_sub(reciprocal[2], n[2]).greater(*begin));
        let leave =
            level.splat(far[0]).mul_sub(reciprocal[0], f[0]).lesser(level.splat(far[1]).mul_sub(reciprocal[1], f[1]));
        let leave = leave.lesser(level.splat(far[2]).mul_sub(reciprocal[2], f[2]).lesser(*limit));
        enter.not_above(leave)
    }
}
