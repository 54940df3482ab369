//! Walks that count: what a ray costs, told by the ray alone.
//!
//! What is counted the crate's documentation says. Where a box is entered is computed as (p − o′)·r, each operation
//! rounded once (see the module `rays`), and so to the same bits with any instructions: tracing fuses operations where
//! it can, and may enter another box that a ray hardly touches.
//!
//! # Why a packet counts like its rays
//!
//! Rays of an octant visit children in one order, whatever they have hit, and a ray's limit depends on what it visited
//! before. So a packet that visits what any of its rays visits, in that order, with the set of those that do, visits
//! for each of them what it would visit alone. The set is made when the parent is visited, and so is where each ray
//! enters the box; when the child's turn comes, those leave the set whose limits have come down below that. What bounds
//! of the whole packet leave out (the module `frustum`) no ray of it enters.

mod packet;
mod single;
mod slabs;
#[cfg(test)]
mod tests;

pub(crate) use packet::Counter;

use crate::dispatch::Work;
use crate::isa::Found;
use crate::lanes::{LANES, Level};
use crate::packet::{RAYS, fill};
use crate::rays::Frame;
use core::marker::PhantomData;
use rt_bvh::BlockTree;
use rt_core::{Hit, Query, Ray, ReducedWalk, TestCounts, Walk};

/// A kind of walk, so that each is compiled by itself.
trait Kind {
    /// Whether triangles are tested.
    const FULL: bool;
    /// Whether any hit ends a ray.
    const ANY: bool = false;
    /// Whether limits come down.
    const SHORTENS: bool = true;
}

struct Closest;
struct Any;
struct LeafAsHit;
struct Unshortened;

impl Kind for Closest {
    const FULL: bool = true;
}

impl Kind for Any {
    const FULL: bool = true;
    const ANY: bool = true;
    const SHORTENS: bool = false;
}

impl Kind for LeafAsHit {
    const FULL: bool = false;
}

impl Kind for Unshortened {
    const FULL: bool = false;
    const SHORTENS: bool = false;
}

/// Rays to count in packets, in the order in which they are.
pub(crate) struct CountBatch<'a> {
    pub(crate) tree: &'a BlockTree,
    pub(crate) frame: &'a Frame,
    pub(crate) counter: &'a mut Counter,
    pub(crate) walk: Walk,
    /// Of full walks.
    pub(crate) query: Query,
    /// Where so few rays of a packet are left they go on alone.
    pub(crate) few: u32,
    pub(crate) rays: &'a [Ray],
    /// An entry for each ray, or none.
    pub(crate) excluded: &'a [u32],
    pub(crate) counts: &'a mut [TestCounts],
    /// Of full walks, one for each ray, or none.
    pub(crate) hits: &'a mut [Hit],
}

/// A batch, by the kind of its walk.
struct Counting<'a, K>(CountBatch<'a>, PhantomData<K>);

impl<K: Kind> Work for Counting<'_, K> {
    // Inlined, as all below, so that it is compiled for the instructions of its caller.
    #[inline(always)]
    fn run<L: Level>(self, level: L) {
        self.0.count::<L, K>(level);
    }
}

/// Counts a batch.
pub(crate) fn run(found: Found, batch: CountBatch<'_>) {
    match (batch.walk, batch.query) {
        (Walk::Full, Query::Closest | Query::All { .. }) => found.run(Counting::<Closest>(batch, PhantomData)),
        (Walk::Full, Query::Any) => found.run(Counting::<Any>(batch, PhantomData)),
        (Walk::Reduced(ReducedWalk::LeafAsHit), _) => found.run(Counting::<LeafAsHit>(batch, PhantomData)),
        (Walk::Reduced(ReducedWalk::Unshortened), _) => found.run(Counting::<Unshortened>(batch, PhantomData)),
    }
}

impl CountBatch<'_> {
    #[inline(always)]
    fn count<L: Level, K: Kind>(self, level: L) {
        let Self { tree, frame, counter, walk, query, few, mut excluded, mut hits, .. } = self;
        for (rays, counts) in self.rays.chunks(RAYS).zip(self.counts.chunks_mut(RAYS)) {
            let (own, others) = excluded.split_at(excluded.len().min(rays.len()));
            excluded = others;
            let hits = hits.split_off_mut(..rays.len().min(hits.len())).unwrap_or_default();
            let mut extreme = fill(level, frame, &mut counter.groups, rays, own);
            counter.count::<L, K>(level, tree, frame, rays, few);
            let tallies = counter.tallies.iter_mut().zip(counts.chunks_mut(LANES));
            tallies.for_each(|(tally, counts)| tally.take(counts));
            for (group, hits) in counter.groups.iter().zip(hits.chunks_mut(LANES)) {
                group.write(level, hits);
            }
            while extreme != 0 {
                let i = extreme.trailing_zeros() as usize;
                extreme &= extreme - 1;
                let excluded = own.get(i).copied().unwrap_or(u32::MAX);
                let (hit, count) = crate::alone::count(tree, frame, &rays[i], excluded, walk, query);
                counts[i] = count;
                if let Some(to) = hits.get_mut(i) {
                    *to = hit;
                }
            }
        }
    }
}
