//! Up to 64 rays that walk the tree together, each counted as if it walked alone.

use super::slabs::{Single, Slabs};
use super::{Kind, single};
use crate::frustum::Frustum;
use crate::lanes::{Floats as _, Floats8 as _, Floats16 as _, LANES, Lanes, Level, Sets as _, Slots as _};
use crate::packet::{GROUPS, Planes, RAYS, fetch, in_octant, is_for_each, joined, ways};
use crate::rays::{Frame, Group, Set};
use crate::stack::Stack;
use crate::triangles::{AXES, nearest};
use rt_bvh::{Block, BlockChild, BlockNode, BlockTree};
use rt_core::{Ray, TestCounts};

/// Rays, what they have cost, and what they need on their way.
#[derive(Clone, Debug)]
pub(crate) struct Counter {
    pub(crate) groups: [Group; GROUPS],
    pub(crate) tallies: [Tally; GROUPS],
    stack: Stack,
    distances: Distances,
}

/// Where each ray of a packet enters a box.
type Entries = [Lanes; GROUPS];

/// Where rays enter the boxes of children that are left to visit: limits come down before those children's turn.
#[derive(Clone, Debug)]
struct Distances {
    /// By place on the stack; beside them, how often limits had come down.
    pending: Vec<(Entries, u32)>,
    /// Of the node that is being visited, by child: of rays that were tested together.
    here: [Entries; 8],
    /// By ray and slot: of those that were tested one by one.
    each: [[f32; 8]; RAYS],
}

/// A node's blocks, which reduced walks only count.
#[derive(Clone, Copy)]
struct Leaves {
    /// Their slots, a bit each.
    slots: u8,
    /// How many triangles are in each.
    triangles: [f32; 8],
}

impl Leaves {
    const NONE: Self = Self { slots: 0, triangles: [0.0; 8] };

    /// Takes a child if it is a block, and says whether it is.
    #[inline(always)]
    fn take(&mut self, slot: u32, child: u32) -> bool {
        let triangles = match BlockChild::of(child) {
            BlockChild::Block { count, .. } => count,
            _ => 0,
        };
        self.slots |= u8::from(triangles > 0) << (slot & 7);
        self.triangles[slot as usize & 7] = triangles as f32;
        triangles > 0
    }
}

/// What the rays of a group have cost.
#[derive(Clone, Debug)]
pub(crate) struct Tally {
    /// Visited nodes, in numbers that are far from where single precision no longer holds each.
    nodes: Lanes,
    /// Tests of triangles, likewise.
    triangles: Lanes,
    /// What comes on top.
    more: [TestCounts; LANES],
}

/// Nodes that are visited before numbers are moved to where they cannot overflow: each costs at most 32 triangle
/// tests, and single precision holds every number up to 2²⁴.
const MOVE_AFTER: u32 = 1 << 19;

impl Tally {
    const ZERO: Self =
        Self { nodes: Lanes::ZERO, triangles: Lanes::ZERO, more: [TestCounts { boxes: 0, triangles: 0 }; LANES] };

    fn settle(&mut self) {
        for (lane, more) in self.more.iter_mut().enumerate() {
            more.boxes = more.boxes.saturating_add(8 * self.nodes.0[lane] as u32);
            more.triangles = more.triangles.saturating_add(self.triangles.0[lane] as u32);
        }
        (self.nodes, self.triangles) = (Lanes::ZERO, Lanes::ZERO);
    }

    /// Tells what each ray has cost, of as many as there is room for; forgets it.
    pub(crate) fn take(&mut self, counts: &mut [TestCounts]) {
        self.settle();
        counts.copy_from_slice(&self.more[..counts.len()]);
        self.more = Self::ZERO.more;
    }

    fn add(&mut self, lane: usize, counts: TestCounts) {
        let more = &mut self.more[lane % LANES];
        more.boxes = more.boxes.saturating_add(counts.boxes);
        more.triangles = more.triangles.saturating_add(counts.triangles);
    }
}

/// Adds to the numbers of some rays.
#[inline(always)]
fn add<L: Level>(level: L, to: &mut Lanes, rays: Set, what: f32) {
    (level.load(to) + level.splat(what).or_else(rays, level.splat(0.0))).store(to);
}

impl Counter {
    pub(crate) fn new() -> Self {
        Self {
            groups: [const { Group::EMPTY }; GROUPS],
            tallies: [const { Tally::ZERO }; GROUPS],
            stack: Stack::new(),
            distances: Distances {
                pending: vec![([Lanes::ZERO; GROUPS], 0); Stack::PLACES],
                here: [[Lanes::ZERO; GROUPS]; 8],
                each: [[0.0; 8]; RAYS],
            },
        }
    }

    /// Walks valid rays that are not extreme. Where no more than `few` are left to visit a child, they go on alone.
    /// Hits are in the groups, counts in the tallies.
    #[inline(always)]
    pub(super) fn count<L: Level, K: Kind>(
        &mut self,
        level: L,
        tree: &BlockTree,
        frame: &Frame,
        rays: &[Ray],
        few: u32,
    ) {
        let Self { groups, tallies, stack, distances } = self;
        let groups = &mut groups[..rays.len().div_ceil(LANES)];
        for octant in 0..8 {
            let open = in_octant(groups, octant);
            if open != [0; GROUPS] {
                let frustum = Frustum::around(level, groups, &open, octant);
                let (version, visits) = (0, 0);
                let mut walk =
                    Walk { tree, frame, rays, few, groups, tallies, distances, open, octant, frustum, version, visits };
                walk.run::<L, K>(level, stack);
            }
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
    tallies: &'a mut [Tally],
    distances: &'a mut Distances,
    /// Rays that go on, by group.
    open: [Set; GROUPS],
    octant: usize,
    frustum: Frustum,
    /// How often limits have come down.
    version: u32,
    /// Nodes visited since numbers were moved.
    visits: u32,
}

impl Walk<'_> {
    #[inline(always)]
    fn run<L: Level, K: Kind>(&mut self, level: L, stack: &mut Stack) {
        stack.cut(0);
        stack.push(self.frustum.begin(), 0, joined(&self.open));
        self.distances.pending[0].1 = self.version;
        while stack.len() > 0 {
            let (entry, child, mut rays) = stack.pop();
            if entry > self.frustum.limit {
                continue;
            }
            if K::ANY {
                rays &= joined(&self.open);
            } else if K::SHORTENS {
                rays = self.still(level, rays, stack.len());
            }
            if rays.count_ones() <= self.few {
                self.alone::<L, K>(level, stack, child, rays);
                continue;
            }
            match BlockChild::of(child) {
                BlockChild::Node(index) => self.node::<L, K>(level, index, rays, stack),
                BlockChild::Block { index, count } => {
                    self.block::<L, K>(level, &self.tree.blocks()[index as usize], count, rays);
                }
                BlockChild::Empty => {}
            }
        }
    }

    /// Those of the rays that enter the box of the child at a place of the stack before their limits of now.
    #[inline(always)]
    fn still<L: Level>(&self, level: L, rays: u64, place: usize) -> u64 {
        let (entries, version) = &self.distances.pending[place];
        if *version == self.version {
            return rays;
        }
        let mut still = 0;
        for (i, (group, entries)) in self.groups.iter().zip(entries).enumerate() {
            let some = (rays >> (LANES * i)) as Set;
            if some != 0 {
                let entered = level.load(entries).not_above(level.load(&group.limit));
                still |= u64::from(some & entered) << (LANES * i);
            }
        }
        still
    }

    #[inline(always)]
    fn shorter<L: Level>(&mut self, level: L) {
        self.version = self.version.wrapping_add(1);
        self.frustum.shorten(level, self.groups, &self.open);
    }

    /// Visits a node: puts on the stack which children which rays enter. Of a reduced walk that is nodes alone.
    #[inline(always)]
    fn node<L: Level, K: Kind>(&mut self, level: L, index: u32, rays: u64, stack: &mut Stack) {
        let node: &BlockNode = &self.tree.nodes()[index as usize];
        let (near, slots, count) = if K::ANY {
            self.frustum.enter::<L, true>(level, node)
        } else {
            self.frustum.enter::<L, false>(level, node)
        };
        let (mut entries, mut numbers) = ([0.0; 8], [0; 8]);
        near.store(&mut entries);
        slots.store(&mut numbers);
        let child = |slot: u32| node.children()[slot as usize & 7];
        let (mut leaves, mut inner) = (Leaves::NONE, count);
        if !K::FULL {
            // The others close up.
            inner = 0;
            for j in 0..count {
                let (entry, slot) = (entries[j & 7], numbers[j & 7]);
                (entries[inner & 7], numbers[inner & 7]) = (entry, slot);
                inner += usize::from(!leaves.take(slot, child(slot)));
            }
        }
        let planes = ways(node.planes(), self.octant);
        let (mut together, mut by_slot) = ([0; 8], level.no_rays());
        let mut shorter = false;
        for i in 0..self.groups.len() {
            let some = (rays >> (LANES * i)) as Set;
            if some == 0 {
                continue;
            }
            add(level, &mut self.tallies[i].nodes, some, 1.0);
            shorter |= if is_for_each(some, count) {
                self.enter_each::<L, K>(level, i, planes, &leaves, some, &mut by_slot)
            } else {
                self.enter_together::<L, K>(level, i, planes, &leaves, (&numbers, inner), some, &mut together)
            };
        }
        if shorter {
            self.shorter(level);
        }
        let mut each = [0; 8];
        by_slot.store(&mut each);
        for j in 0..inner {
            let (slot, child) = (numbers[j & 7] as usize & 7, child(numbers[j & 7]));
            let rays = together[j & 7] | each[slot];
            if rays != 0 {
                fetch(level, self.tree, child);
                if K::SHORTENS {
                    let Distances { pending, here, each: rows } = &mut *self.distances;
                    let (entries, version) = &mut pending[stack.len()];
                    *version = self.version;
                    if together[j & 7] != 0 {
                        *entries = here[j & 7];
                    }
                    let mut rest = each[slot];
                    while rest != 0 {
                        let ray = rest.trailing_zeros() as usize % RAYS;
                        rest &= rest - 1;
                        entries[ray / LANES].0[ray % LANES] = rows[ray][slot];
                    }
                }
                stack.push(entries[j & 7], child, rays);
            }
        }
        self.visits += 1;
        if self.visits == MOVE_AFTER {
            self.visits = 0;
            self.tallies.iter_mut().for_each(Tally::settle);
        }
    }

    /// Tests rays of a group with a node's children, one child after the other. Those of the list go to `entered`; of
    /// blocks that are only counted the limits come down, which it says.
    #[expect(clippy::too_many_arguments, reason = "all in registers")]
    #[inline(always)]
    fn enter_together<L: Level, K: Kind>(
        &mut self,
        level: L,
        i: usize,
        planes: Planes<'_>,
        leaves: &Leaves,
        (slots, children): (&[u32; 8], usize),
        rays: Set,
        entered: &mut [u64; 8],
    ) -> bool {
        let (group, tally) = (&mut self.groups[i], &mut self.tallies[i]);
        let mut slabs = Slabs::of(level, group, self.octant);
        let mut shorter = 0;
        if leaves.slots != 0 {
            let (mut limit, mut triangles) = (slabs.limit, level.load(&tally.triangles));
            let mut blocks = leaves.slots;
            while blocks != 0 {
                let slot = blocks.trailing_zeros() as usize % 8;
                blocks &= blocks - 1;
                let number = leaves.triangles[slot];
                let (near, all) = slabs.enter(level, planes, slot);
                let these = rays & all;
                triangles = triangles + level.splat(number).or_else(these, level.splat(0.0));
                if K::SHORTENS {
                    limit = limit.lesser(near.or_else(these, limit));
                    shorter |= these;
                }
            }
            triangles.store(&mut tally.triangles);
            if K::SHORTENS {
                limit.store(&mut group.limit);
                slabs.limit = limit;
            }
        }
        let children = slots.iter().zip(entered).zip(&mut self.distances.here).take(children);
        for ((&slot, entered), here) in children {
            let (near, all) = slabs.enter(level, planes, slot as usize);
            *entered |= u64::from(rays & all) << (LANES * i);
            if K::SHORTENS {
                near.store(&mut here[i % GROUPS]);
            }
        }
        shorter != 0
    }

    /// The same, one ray after the other, for all slots.
    #[inline(always)]
    fn enter_each<L: Level, K: Kind>(
        &mut self,
        level: L,
        i: usize,
        planes: Planes<'_>,
        leaves: &Leaves,
        rays: Set,
        entered: &mut L::Sets,
    ) -> bool {
        let (group, tally) = (&mut self.groups[i], &mut self.tallies[i]);
        let mut shorter = false;
        let mut rest = rays;
        while rest != 0 {
            let lane = rest.trailing_zeros() as usize % LANES;
            rest &= rest - 1;
            let ray = Single::of(group, lane, self.octant);
            let (near, far) = ray.distances(level, planes);
            let mut slots = near.not_above(far);
            let row = &mut self.distances.each[(LANES * i + lane) % RAYS];
            if K::SHORTENS {
                near.store(row);
            }
            let mut blocks = slots & leaves.slots;
            if blocks != 0 {
                let (mut limit, mut triangles) = (ray.limit, 0.0);
                while blocks != 0 {
                    let slot = blocks.trailing_zeros() as usize % 8;
                    blocks &= blocks - 1;
                    triangles += leaves.triangles[slot];
                    if K::SHORTENS && row[slot] < limit {
                        limit = row[slot];
                    }
                }
                tally.triangles.0[lane] += triangles;
                if K::SHORTENS {
                    group.limit.0[lane] = limit;
                    slots &= near.not_above(level.splat8(limit));
                    shorter = true;
                }
            }
            *entered = entered.with(slots, 1 << (LANES * i + lane));
        }
        shorter
    }

    /// Visits a block.
    #[inline(always)]
    fn block<L: Level, K: Kind>(&mut self, level: L, block: &Block, count: u32, rays: u64) {
        let mut shorter = false;
        let groups = self.groups.iter_mut().zip(&mut *self.tallies);
        for (i, ((group, tally), given)) in groups.zip(self.rays.chunks(LANES)).enumerate() {
            let some = (rays >> (LANES * i)) as Set;
            if some == 0 {
                continue;
            }
            add(level, &mut tally.triangles, some, count as f32);
            for axes in AXES {
                let some = some & group.dominant[axes[2]];
                if some == 0 {
                    continue;
                }
                let better = nearest(level, self.frame, group, given, (block, count), axes, some);
                if K::ANY {
                    self.open[i] &= !better;
                } else {
                    shorter |= better != 0;
                }
            }
        }
        if shorter {
            self.shorter(level);
        }
    }

    /// Sends rays one by one through what hangs below a child. The bounds' limit is left as it is.
    #[inline(always)]
    fn alone<L: Level, K: Kind>(&mut self, level: L, stack: &mut Stack, child: u32, rays: u64) {
        let mut rest = rays;
        while rest != 0 {
            let ray = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let (i, lane) = (ray / LANES, ray % LANES);
            let group = &mut self.groups[i];
            let ray = (lane, &self.rays[ray], self.octant);
            let counts = single::walk::<L, K>(level, (self.tree, self.frame), group, ray, child, stack);
            self.tallies[i].add(lane, counts);
            if K::ANY {
                self.open[i] &= !group.found;
            }
        }
        if K::SHORTENS && rays != 0 {
            self.version = self.version.wrapping_add(1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Fails when numbers are moved twice or put down to another lane, and when more are let come together than single
    // precision holds.
    #[test]
    fn numbers_that_are_moved_are_not_lost() {
        let mut tally = Tally::ZERO;
        tally.add(2, TestCounts { boxes: 8, triangles: 1 });
        for _ in 0..3 {
            tally.nodes.0[2] = MOVE_AFTER as f32;
            tally.triangles.0[2] = (32 * MOVE_AFTER - 1) as f32;
            tally.settle();
        }
        let mut counts = [TestCounts::default(); LANES];
        tally.take(&mut counts);
        let expected = TestCounts { boxes: 24 * MOVE_AFTER + 8, triangles: 3 * (32 * MOVE_AFTER - 1) + 1 };
        assert_eq!((counts[2], counts[1]), (expected, TestCounts::default()));
        tally.take(&mut counts[..3]);
        assert_eq!(counts[2], TestCounts::default());
    }
}
