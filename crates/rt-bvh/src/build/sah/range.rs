//! Ranges of references, and how they are split.

use super::super::bounds::Bounds;
use super::super::gather::Reference;
use super::binning::{BINS, Binning, Bins, CHUNK, Chunks, Split};
use crate::parallel::each;
use crate::stats::{NODE_COST, TRIANGLE_COST};
use alloc::vec::Vec;
use rt_core::MAX_DEPTH;

/// Consecutive references that become one subtree: their box, and the box of their centroids.
#[derive(Clone, Copy)]
pub(super) struct Range {
    pub first: u32,
    pub count: u32,
    pub bounds: Bounds,
    pub centroids: Bounds,
}

impl Range {
    pub(super) const fn empty(first: u32) -> Self {
        Self { first, count: 0, bounds: Bounds::EMPTY, centroids: Bounds::EMPTY }
    }

    pub(super) fn around(references: &[Reference]) -> Self {
        let parts = each(references.chunks(CHUNK).collect(), |chunk| {
            let mut part = Self::empty(0);
            chunk.iter().for_each(|reference| part.add(reference));
            part
        });
        parts.into_iter().fold(Self::empty(0), Self::with)
    }

    /// This range and another that follows it.
    fn with(mut self, other: Self) -> Self {
        self.count += other.count;
        self.bounds.add(&other.bounds);
        self.centroids.add(&other.centroids);
        self
    }

    fn add(&mut self, reference: &Reference) {
        self.count += 1;
        self.bounds.add(&Bounds::from(reference));
        self.add_centroid(reference);
    }

    #[inline]
    pub(super) fn add_centroid(&mut self, reference: &Reference) {
        // Twice the centroid: only positions relative to each other matter.
        let [min, max] = reference.corners();
        let centroid = min + max;
        self.centroids.add(&Bounds { min: centroid, max: centroid });
    }

    /// The two parts that this range is best split into, in its place, or `None` when it is best left a leaf.
    pub(super) fn split(&self, own: &mut [Reference], max_leaf: u32, depth: u32) -> Option<[Self; 2]> {
        let best = |binning: Binning| match binning.bins() {
            ..=4 => binning.best(self, &binning.fill::<4>(own)),
            5..=8 => binning.best(self, &binning.fill::<8>(own)),
            _ => binning.best(self, &binning.fill::<BINS>(own)),
        };
        match self.choice(max_leaf, depth, best)? {
            Some(split) => Some(split.apply(own)),
            None => Some(self.halves(own)),
        }
    }

    /// The same of a large range by all threads, into another buffer.
    pub(super) fn split_apart(&self, chunks: Chunks<'_>, max_leaf: u32, depth: u32) -> Option<[Self; 2]> {
        let mut filled = Vec::new();
        let choice = self.choice(max_leaf, depth, |binning| {
            filled = each(chunks.from.chunks(CHUNK).collect(), |chunk| binning.fill(chunk));
            let mut all: Bins<BINS> = filled[0];
            filled[1..].iter().for_each(|some| all.add(some));
            binning.best(self, &all)
        })?;
        match choice {
            Some(split) => Some(split.apply_apart(chunks, &filled)),
            None => {
                chunks.to.copy_from_slice(chunks.from);
                Some(self.halves(chunks.from))
            }
        }
    }

    /// The best plane; `Some(None)` where there is none and the range is to be halved, and `None` where it is best left
    /// a leaf.
    fn choice(&self, max_leaf: u32, depth: u32, best: impl FnOnce(Binning) -> Option<Split>) -> Option<Option<Split>> {
        // A node alone costs as much as two triangles.
        let few = self.count as f32 * TRIANGLE_COST <= NODE_COST;
        if self.count == 1 || few && self.count <= max_leaf {
            return None;
        }
        // A subtree of n triangles that is halved all the way down needs ⌈log₂ n⌉ levels. As long as one more than
        // that is left after this node, any split will do.
        let halving = u32::BITS - (self.count - 1).leading_zeros();
        let may_choose = depth + halving < MAX_DEPTH;
        match Binning::new(self).filter(|_| may_choose).and_then(best) {
            Some(split) if self.count > max_leaf || split.cost < self.leaf_cost() => Some(Some(split)),
            None if self.count > max_leaf => Some(None),
            _ => None,
        }
    }

    /// Expected cost of intersecting all triangles, times the area of the box.
    fn leaf_cost(&self) -> f32 {
        TRIANGLE_COST * self.count as f32 * self.bounds.half_area()
    }

    /// What there is before and behind the middle.
    fn halves(&self, range: &[Reference]) -> [Self; 2] {
        let middle = range.len() / 2;
        let mut halves = [Self::empty(self.first), Self::empty(self.first + middle as u32)];
        for (i, reference) in range.iter().enumerate() {
            halves[usize::from(i >= middle)].add(reference);
        }
        halves
    }
}
