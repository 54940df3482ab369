//! The single-precision filter in front of the reference test, for all rays of a packet at once.

use super::super::lanes::{LANES, Lanes, Numbers, gathered, greater};
use super::super::triangle::Filter;
use rt_core::Triangle;

/// What the filter knows of the rays.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct PacketFilter {
    origin: [Numbers; 3],
    shear: [Numbers; 2],
    error: Numbers,
    floor: Numbers,
    /// The rays whose dominant axis this is.
    dominant: [Lanes; 3],
}

impl PacketFilter {
    pub(super) const EMPTY: Self = Self {
        origin: [[0.0; LANES]; 3],
        shear: [[0.0; LANES]; 2],
        error: [0.0; LANES],
        floor: [0.0; LANES],
        dominant: [0; 3],
    };

    pub(super) fn clear(&mut self) {
        self.dominant = [0; 3];
    }

    /// Puts a ray into a lane.
    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, filter: &Filter) {
        for axis in 0..3 {
            self.origin[axis][lane] = filter.origin[axis];
        }
        for (numbers, factor) in self.shear.iter_mut().zip(filter.shear) {
            numbers[lane] = factor;
        }
        (self.error[lane], self.floor[lane]) = (filter.error, filter.floor);
        self.dominant[filter.dominant] |= 1 << lane;
    }

    /// The largest part of some rays that has a dominant axis in common, and the axis.
    #[inline(always)]
    pub(super) fn largest_part(&self, rays: Lanes) -> (Lanes, usize) {
        let mut best = (0, 0);
        for (axis, dominant) in self.dominant.iter().enumerate() {
            let part: Lanes = dominant & rays;
            if part.count_ones() > Lanes::count_ones(best.0) {
                best = (part, axis);
            }
        }
        best
    }

    /// The rays with this dominant axis whose lines certainly miss the triangle; other rays' bits mean nothing.
    #[inline(always)]
    pub(super) fn misses(&self, dominant: usize, triangle: &Triangle) -> Lanes {
        // One loop for each axis, so that coordinates are picked at compile time.
        match dominant {
            0 => self.misses_along::<1, 2, 0>(triangle),
            1 => self.misses_along::<2, 0, 1>(triangle),
            _ => self.misses_along::<0, 1, 2>(triangle),
        }
    }

    #[inline(always)]
    fn misses_along<const X: usize, const Y: usize, const Z: usize>(&self, triangle: &Triangle) -> Lanes {
        let [a, b, c] = triangle.vertices().map(|p| p.to_array());
        let mut missed = [0; LANES];
        for i in 0..LANES {
            let project = |p: [f32; 3]| {
                let z = p[Z] - self.origin[Z][i];
                [(p[X] - self.origin[X][i]) - z * self.shear[0][i], (p[Y] - self.origin[Y][i]) - z * self.shear[1][i]]
            };
            let ([ax, ay], [bx, by], [cx, cy]) = (project(a), project(b), project(c));
            let (u, v, w) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
            let x = greater(greater(ax.abs(), bx.abs()), cx.abs());
            let y = greater(greater(ay.abs(), by.abs()), cy.abs());
            let error = (x + y + self.floor[i]) * self.error[i];
            let negative = (u < -error) | (v < -error) | (w < -error);
            let positive = (u > error) | (v > error) | (w > error);
            missed[i] = u8::from(negative & positive);
        }
        gathered(&missed)
    }
}
