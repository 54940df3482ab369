//! Up to 64 rays that walk the tree together, each counted as if it walked alone.

use super::slabs::{Planes, Slabs};
use super::{Kind, single};
use crate::frustum::Frustum;
use crate::lanes::{Floats as _, Floats8 as _, Floats16 as _, LANES, Lanes, Level, Slots as _};
use crate::packet::{GROUPS, fetch, in_octant, joined};
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
    pending: Vec<Pending>,
    /// Of single rays.
    stack: Stack,
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

/// A child that is left to visit.
#[derive(Clone, Copy, Debug)]
struct Pending {
    /// Least distance at which rays enter its box.
    entry: f32,
    child: u32,
    /// Those that enter it.
    rays: u64,
    /// Its parent, and in which slot of it its box is.
    parent: u32,
    slot: u32,
    /// How often limits had come down when that was found.
    version: u32,
}

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

    /// What each ray has cost; forgets it.
    #[inline(always)]
    pub(crate) fn take(&mut self) -> [TestCounts; LANES] {
        self.settle();
        core::mem::replace(&mut self.more, Self::ZERO.more)
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
            pending: Vec::new(),
            stack: Stack::new(),
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
        let Self { groups, tallies, pending, stack } = self;
        let groups = &mut groups[..rays.len().div_ceil(LANES)];
        for octant in 0..8 {
            let open = in_octant(groups, octant);
            if open != [0; GROUPS] {
                let frustum = Frustum::around(level, groups, &open, octant);
                let visits = 0;
                let mut walk =
                    Walk { tree, frame, rays, few, groups, tallies, open, octant, frustum, version: 0, visits };
                walk.run::<L, K>(level, pending, stack);
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
    fn run<L: Level, K: Kind>(&mut self, level: L, pending: &mut Vec<Pending>, stack: &mut Stack) {
        pending.clear();
        let (entry, rays) = (self.frustum.begin(), joined(&self.open));
        pending.push(Pending { entry, child: 0, rays, parent: 0, slot: 0, version: 0 });
        while let Some(next) = pending.pop() {
            if next.entry > self.frustum.limit {
                continue;
            }
            let mut rays = next.rays;
            if K::ANY {
                rays &= joined(&self.open);
            } else if K::SHORTENS && next.version != self.version {
                rays = self.still(level, &next);
            }
            if rays.count_ones() <= self.few {
                self.alone::<L, K>(level, stack, next.child, rays);
                continue;
            }
            match BlockChild::of(next.child) {
                BlockChild::Node(index) => self.node::<L, K>(level, index, rays, pending),
                BlockChild::Block { index, count } => {
                    self.block::<L, K>(level, &self.tree.blocks()[index as usize], count, rays);
                }
                BlockChild::Empty => {}
            }
        }
    }

    /// The rays that enter a child's box before their limits of now.
    #[inline(always)]
    fn still<L: Level>(&self, level: L, next: &Pending) -> u64 {
        let planes = Planes::of(&self.tree.nodes()[next.parent as usize], self.octant);
        let mut still = 0;
        for (i, group) in self.groups.iter().enumerate() {
            let some = (next.rays >> (LANES * i)) as Set;
            if some != 0 {
                let (_, entered) = Slabs::of(level, group, self.octant).enter(level, &planes, next.slot as usize);
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

    /// Visits a node: puts on the stack which children which rays enter.
    #[inline(always)]
    fn node<L: Level, K: Kind>(&mut self, level: L, index: u32, rays: u64, pending: &mut Vec<Pending>) {
        let node: &BlockNode = &self.tree.nodes()[index as usize];
        let (near, slots, count) = if K::ANY {
            self.frustum.enter::<L, true>(level, node)
        } else {
            self.frustum.enter::<L, false>(level, node)
        };
        let (mut entries, mut numbers) = ([0.0; 8], [0; 8]);
        near.store(&mut entries);
        slots.store(&mut numbers);
        let mut entered = [0; 8];
        let planes = Planes::of(node, self.octant);
        let mut shorter = false;
        for (i, (group, tally)) in self.groups.iter_mut().zip(&mut *self.tallies).enumerate() {
            let some = (rays >> (LANES * i)) as Set;
            if some == 0 {
                continue;
            }
            add(level, &mut tally.nodes, some, 1.0);
            let mut slabs = Slabs::of(level, group, self.octant);
            if !K::FULL {
                let mut limit = slabs.limit;
                for &slot in numbers.iter().take(count) {
                    if let BlockChild::Block { count, .. } = BlockChild::of(node.children()[slot as usize & 7]) {
                        let (near, all) = slabs.enter(level, &planes, slot as usize);
                        let these = some & all;
                        if these != 0 {
                            add(level, &mut tally.triangles, these, count as f32);
                            limit = limit.lesser(near.or_else(these, limit));
                            shorter = true;
                        }
                    }
                }
                if K::SHORTENS {
                    limit.store(&mut group.limit);
                    slabs.limit = limit;
                }
            }
            for (&slot, entered) in numbers.iter().zip(&mut entered).take(count) {
                if K::FULL || matches!(BlockChild::of(node.children()[slot as usize & 7]), BlockChild::Node(_)) {
                    let (_, all) = slabs.enter(level, &planes, slot as usize);
                    *entered |= u64::from(some & all) << (LANES * i);
                }
            }
        }
        if K::SHORTENS && shorter {
            self.shorter(level);
        }
        for j in 0..count {
            let (rays, slot) = (entered[j & 7], numbers[j & 7]);
            if rays != 0 {
                let child = node.children()[slot as usize & 7];
                fetch(level, self.tree, child);
                pending.push(Pending {
                    entry: entries[j & 7],
                    child,
                    rays,
                    parent: index,
                    slot,
                    version: self.version,
                });
            }
        }
        self.visits += 1;
        if self.visits == MOVE_AFTER {
            self.visits = 0;
            self.tallies.iter_mut().for_each(Tally::settle);
        }
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
        if K::SHORTENS && !K::ANY && rays != 0 {
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
        let counts = tally.take();
        let expected = TestCounts { boxes: 24 * MOVE_AFTER + 8, triangles: 3 * (32 * MOVE_AFTER - 1) + 1 };
        assert_eq!((counts[2], counts[1]), (expected, TestCounts::default()));
        assert_eq!(tally.take()[2], TestCounts::default());
    }
}
