//! Bins of centroids along every axis, the best plane between them, and splitting there.

use super::super::bounds::Bounds;
use super::super::gather::Reference;
use super::range::Range;
use crate::parallel::each;
use crate::stats::{NODE_COST, TRIANGLE_COST};
use alloc::vec::Vec;
use core::mem::take;
use glam::Vec4;

/// Most bins along an axis. Wald finds little gain beyond 16.
pub(super) const BINS: usize = 16;

/// References that a thread bins and moves at a time, of a range that all work on.
pub(super) const CHUNK: usize = 1 << 12;

/// A large range, and as many places in another buffer.
pub(super) struct Chunks<'a> {
    pub from: &'a [Reference],
    pub to: &'a mut [Reference],
}

/// What is in every one of `N` bins of every axis: a box, and how many references.
#[derive(Clone, Copy)]
pub(super) struct Bins<const N: usize>([[(Bounds, u32); N]; 3]);

impl<const N: usize> Bins<N> {
    pub(super) fn add(&mut self, other: &Self) {
        for (own, other) in self.0.iter_mut().flatten().zip(other.0.iter().flatten()) {
            own.0.add(&other.0);
            own.1 += other.1;
        }
    }
}

/// How centroids map to bins along every axis. Wald only bins the axis on which they spread most; all three
/// cost about a third more time, and trees of scenes with long triangles trace with up to 15% fewer box tests.
#[derive(Clone, Copy)]
pub(super) struct Binning {
    bins: usize,
    origin: Vec4,
    scale: Vec4,
}

/// A plane between two bins, its expected cost times the area of the range's box, and what is on either side but for
/// centroids.
pub(super) struct Split {
    binning: Binning,
    axis: usize,
    /// First bin on the far side.
    bin: usize,
    pub cost: f32,
    sides: [Range; 2],
}

/// Numbers from here to twice as much have no fraction in single precision.
const WHOLE: f32 = (1 << 23) as f32;

impl Binning {
    /// `None` when all centroids are equal.
    pub(super) fn new(range: &Range) -> Option<Self> {
        let extent = (range.centroids.max - range.centroids.min).truncate();
        // Small ranges are many: few bins keep them cheap (the rule is that of Embree's builder).
        let bins = (4 + range.count as usize / 20).min(BINS);
        // Finite also where the extent is zero or subnormal, so that no position is NaN.
        let scale = extent.map(|e| if e > 0.0 { (bins as f32 / e).min(f32::MAX) } else { 0.0 });
        (extent.max_element() > 0.0).then(|| Self { bins, origin: range.centroids.min, scale: scale.extend(0.0) })
    }

    /// The number of bins there are.
    pub(super) const fn bins(&self) -> usize {
        self.bins
    }

    /// The bins along the three axes of the box with these corners, as whole numbers above 2²³: so they are in the
    /// lowest bits of the mantissa, which is faster than three saturating casts.
    #[inline]
    fn position(&self, [min, max]: [Vec4; 2]) -> Vec4 {
        let position = (min + max - self.origin) * self.scale - 0.5;
        position.clamp(Vec4::ZERO, Vec4::splat(self.bins as f32 - 1.0)) + Vec4::splat(WHOLE)
    }

    /// Fills `N` bins, a power of two and no less than there are.
    #[inline]
    pub(super) fn fill<const N: usize>(&self, references: &[Reference]) -> Bins<N> {
        let mut bins = [[(Bounds::EMPTY, 0_u32); N]; 3];
        for reference in references {
            let [min, max] = reference.corners();
            let position = self.position([min, max]);
            let of_axes = [position.x, position.y, position.z].map(|x| x.to_bits() as usize % N);
            for (bins, bin) in bins.iter_mut().zip(of_axes) {
                let (bounds, count) = &mut bins[bin];
                bounds.add(&Bounds { min, max });
                *count += 1;
            }
        }
        Bins(bins)
    }

    /// The cheapest plane with something on both sides.
    #[inline]
    pub(super) fn best<const N: usize>(self, whole: &Range, Bins(bins): &Bins<N>) -> Option<Split> {
        let visit = NODE_COST * whole.bounds.half_area();
        let mut best = None;
        let mut least = f32::INFINITY;
        for (axis, bins) in bins.iter().enumerate() {
            // Area times count of everything from bin i on.
            let mut far = [(0.0_f32, 0_u32); N];
            let (mut bounds, mut count) = (Bounds::EMPTY, 0);
            for i in (1..self.bins).rev() {
                bounds.add(&bins[i].0);
                count += bins[i].1;
                far[i] = (if count == 0 { 0.0 } else { bounds.half_area() * count as f32 }, count);
            }
            (bounds, count) = (Bounds::EMPTY, 0);
            for i in 1..self.bins {
                bounds.add(&bins[i - 1].0);
                count += bins[i - 1].1;
                let (far_cost, far_count) = far[i];
                if count == 0 || far_count == 0 {
                    continue;
                }
                let cost = visit + TRIANGLE_COST * (bounds.half_area() * count as f32 + far_cost);
                if cost < least {
                    (best, least) = (Some((axis, i)), cost);
                }
            }
        }
        let (axis, bin) = best?;
        let (near, far) = bins[axis][..self.bins].split_at(bin);
        let side = |first, bins: &[(Bounds, u32)]| {
            let mut side = Range::empty(first);
            for (bounds, count) in bins {
                side.bounds.add(bounds);
                side.count += count;
            }
            side
        };
        let near = side(whole.first, near);
        let sides = [near, side(whole.first + near.count, far)];
        Some(Split { binning: self, axis, bin, cost: least, sides })
    }
}

impl Split {
    /// Whether a reference goes to the far side of a plane across an axis.
    #[inline]
    fn far<const AXIS: usize>(&self, reference: &Reference) -> bool {
        self.binning.position(reference.corners()).to_array()[AXIS] >= WHOLE + self.bin as f32
    }

    /// Reorders `own` so that the near side comes first.
    pub(super) fn apply(&self, own: &mut [Reference]) -> [Range; 2] {
        match self.axis {
            0 => self.apply_across::<0>(own),
            1 => self.apply_across::<1>(own),
            _ => self.apply_across::<2>(own),
        }
    }

    fn apply_across<const AXIS: usize>(&self, own: &mut [Reference]) -> [Range; 2] {
        let [mut near, mut far] = self.sides;
        let (mut begin, mut end) = (0, own.len());
        while begin < end {
            if self.far::<AXIS>(&own[begin]) {
                far.add_centroid(&own[begin]);
                end -= 1;
                own.swap(begin, end);
            } else {
                near.add_centroid(&own[begin]);
                begin += 1;
            }
        }
        [near, far]
    }

    /// Moves the near side to the front of the other buffer and the far side behind it, both in their order; `filled`
    /// are the bins of each chunk.
    pub(super) fn apply_apart(&self, chunks: Chunks<'_>, filled: &[Bins<BINS>]) -> [Range; 2] {
        match self.axis {
            0 => self.apply_apart_across::<0>(chunks, filled),
            1 => self.apply_apart_across::<1>(chunks, filled),
            _ => self.apply_apart_across::<2>(chunks, filled),
        }
    }

    fn apply_apart_across<const AXIS: usize>(&self, chunks: Chunks<'_>, filled: &[Bins<BINS>]) -> [Range; 2] {
        let (mut fronts, mut backs) = chunks.to.split_at_mut(self.sides[0].count as usize);
        let mut jobs = Vec::with_capacity(filled.len());
        for (chunk, Bins(bins)) in chunks.from.chunks(CHUNK).zip(filled) {
            let near = bins[AXIS][..self.bin].iter().map(|(_, count)| *count as usize).sum();
            let (front, rest) = take(&mut fronts).split_at_mut(near);
            fronts = rest;
            let (back, rest) = take(&mut backs).split_at_mut(chunk.len() - near);
            backs = rest;
            jobs.push((chunk, front, back));
        }
        let parts = each(jobs, |(chunk, front, back)| {
            let mut halves = [Range::empty(0); 2];
            let [mut front, mut back] = [front, back].map(<[Reference]>::iter_mut);
            for reference in chunk {
                let far = self.far::<AXIS>(reference);
                halves[usize::from(far)].add_centroid(reference);
                if let Some(place) = if far { back.next() } else { front.next() } {
                    *place = *reference;
                }
            }
            halves
        });
        let mut sides = self.sides;
        for part in parts {
            sides.iter_mut().zip(part).for_each(|(side, part)| side.centroids.add(&part.centroids));
        }
        sides
    }
}
