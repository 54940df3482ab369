//! The box test for all rays of a packet at once.
//!
//! Lane by lane it is the arithmetic of [`Slabs`], so every ray gets the numbers that it would get alone; only the sign
//! of a zero may differ, which no comparison sees.

use super::super::lanes::{LANES, Lanes, Numbers, gathered, greater, lesser};
use super::super::slabs::Slabs;
use rt_core::Aabb;

/// What the box test knows of the rays. Lanes without a ray enter nothing.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct PacketSlabs {
    /// By axis: the origin as lower planes of boxes see it.
    lower: [Numbers; 3],
    /// By axis: the origin as upper planes see it.
    upper: [Numbers; 3],
    reciprocal: [Numbers; 3],
    tmin: Numbers,
    /// Boxes entered beyond this distance are passed by.
    pub(super) limit: Numbers,
}

impl PacketSlabs {
    pub(super) const EMPTY: Self = Self {
        lower: [[0.0; LANES]; 3],
        upper: [[0.0; LANES]; 3],
        reciprocal: [[1.0; LANES]; 3],
        tmin: [f32::INFINITY; LANES],
        limit: [f32::NEG_INFINITY; LANES],
    };

    /// Puts a ray into a lane.
    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, slabs: &Slabs, limit: f32) {
        let [lower, upper] = slabs.origins();
        let reciprocal = slabs.reciprocal();
        for axis in 0..3 {
            self.lower[axis][lane] = lower[axis];
            self.upper[axis][lane] = upper[axis];
            self.reciprocal[axis][lane] = reciprocal[axis];
        }
        (self.tmin[lane], self.limit[lane]) = (slabs.tmin(), limit);
    }

    /// Where each ray enters the box, and which rays do so before their limit.
    #[inline(always)]
    pub(super) fn enter(&self, bounds: &Aabb) -> (Numbers, Lanes) {
        let (min, max) = (bounds.min, bounds.max);
        let mut entry = [0.0; LANES];
        let mut entered = [0; LANES];
        for i in 0..LANES {
            let axis = |axis: usize, min: f32, max: f32| {
                let a = (min - self.lower[axis][i]) * self.reciprocal[axis][i];
                let b = (max - self.upper[axis][i]) * self.reciprocal[axis][i];
                // Rounding is monotone and the lower plane is never above the upper one, so the ray enters at the
                // smaller one whichever way it goes.
                (lesser(a, b), greater(a, b))
            };
            let (x, y, z) = (axis(0, min.x, max.x), axis(1, min.y, max.y), axis(2, min.z, max.z));
            let near = greater(greater(x.0, y.0), greater(z.0, self.tmin[i]));
            let far = lesser(lesser(x.1, y.1), lesser(z.1, self.limit[i]));
            entry[i] = near;
            entered[i] = u8::from(near <= far);
        }
        (entry, gathered(&entered))
    }
}
