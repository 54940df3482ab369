//! Interval bounds of many rays: what a whole packet knows of a node's boxes.
//!
//! Rays of one octant go through the same planes of a box first. With the least and the greatest of their reciprocals,
//! and the outermost of their padded origins, rounding being monotone, each bound below is on the far side of what (p −
//! o′)·r is for any of them, bit for bit: what one ray enters, the frustum enters.

use crate::lanes::{Floats as _, Floats8 as _, Floats16 as _, Level};
use crate::order::order;
use crate::rays::{Group, Set};
use rt_bvh::BlockNode;

/// Bounds of the rays of a packet that are in one octant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frustum {
    octant: usize,
    /// By axis: the highest origin that lower planes see, and the lowest one that upper planes see.
    origin: [[f32; 2]; 3],
    /// By axis: the least and the greatest reciprocal.
    reciprocal: [[f32; 2]; 3],
    begin: f32,
    /// The greatest limit.
    pub(crate) limit: f32,
}

impl Frustum {
    #[inline(always)]
    pub(crate) fn around<L: Level>(level: L, groups: &[Group], rays: &[Set], octant: usize) -> Self {
        let (least, greatest) = (level.splat(f32::INFINITY), level.splat(f32::NEG_INFINITY));
        let mut frustum =
            Self { octant, origin: [[0.0; 2]; 3], reciprocal: [[0.0; 2]; 3], begin: 0.0, limit: f32::NEG_INFINITY };
        for axis in 0..3 {
            let (mut highest, mut lowest, mut low, mut high) = (greatest, least, least, greatest);
            for (group, &rays) in groups.iter().zip(rays) {
                let [lower, upper] = &group.padded[axis];
                let reciprocal = level.load(&group.reciprocal[axis]);
                highest = highest.greater(level.load(lower).or_else(rays, greatest));
                lowest = lowest.lesser(level.load(upper).or_else(rays, least));
                low = low.lesser(reciprocal.or_else(rays, least));
                high = high.greater(reciprocal.or_else(rays, greatest));
            }
            frustum.origin[axis] = [highest.greatest(), lowest.least()];
            frustum.reciprocal[axis] = [low.least(), high.greatest()];
        }
        let mut begin = least;
        for (group, &rays) in groups.iter().zip(rays) {
            begin = begin.lesser(level.load(&group.begin).or_else(rays, least));
        }
        frustum.begin = begin.least();
        frustum.shorten(level, groups, rays);
        frustum
    }

    /// Notes that the rays' limits have come down.
    #[inline(always)]
    pub(crate) fn shorten<L: Level>(&mut self, level: L, groups: &[Group], rays: &[Set]) {
        let nothing = level.splat(f32::NEG_INFINITY);
        let mut limit = nothing;
        for (group, &rays) in groups.iter().zip(rays) {
            limit = limit.greater(level.load(&group.limit).or_else(rays, nothing));
        }
        self.limit = limit.greatest();
    }

    /// Least distance at which a box is entered.
    #[inline(always)]
    pub(crate) const fn begin(&self) -> f32 {
        self.begin
    }

    /// Which children of a node rays may enter, and at which distances at least: those to be visited last come first.
    #[inline(always)]
    pub(crate) fn enter<L: Level, const ANY: bool>(
        &self,
        level: L,
        node: &BlockNode,
    ) -> (L::F8, <L::F8 as crate::lanes::Floats8>::Slots, usize) {
        let near = self.nearest(level, node, 0).greater(self.nearest(level, node, 1));
        let near = near.greater(self.nearest(level, node, 2).greater(level.splat8(self.begin)));
        let far = self.farthest(level, node, 0).lesser(self.farthest(level, node, 1));
        let far = far.lesser(self.farthest(level, node, 2).lesser(level.splat8(self.limit)));
        let (slots, count) = near.not_above_in_order(far, order::<ANY>(node, self.octant));
        (near.pick(slots), slots, count)
    }

    #[inline(always)]
    fn nearest<L: Level>(&self, level: L, node: &BlockNode, axis: usize) -> L::F8 {
        let (a, b) = self.distances(level, node, axis, 0);
        a.lesser(b)
    }

    #[inline(always)]
    fn farthest<L: Level>(&self, level: L, node: &BlockNode, axis: usize) -> L::F8 {
        let (a, b) = self.distances(level, node, axis, 1);
        a.greater(b)
    }

    /// To the planes through which the rays enter, or leave: with the least and the greatest reciprocal.
    #[inline(always)]
    fn distances<L: Level>(&self, level: L, node: &BlockNode, axis: usize, leave: usize) -> (L::F8, L::F8) {
        let side = (self.octant >> axis ^ leave) & 1;
        let way = level.load8(&node.planes()[axis][side]) - level.splat8(self.origin[axis][side]);
        let [low, high] = self.reciprocal[axis];
        (way * level.splat8(low), way * level.splat8(high))
    }
}
