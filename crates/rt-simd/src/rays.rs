//! Sixteen rays, prepared for box tests, the filter and the reference test.
//!
//! # Local coordinates
//!
//! Those of the tree, in which a ray's direction is scaled by a power of two so that its largest component is in [1,
//! 2). A local distance is a given one times a power of two of the ray's own. A ray for which that power, its reach or
//! its direction is beyond what single precision holds with room to spare is *extreme*: the module `alone` traces it in
//! double precision.
//!
//! # Why box tests are conservative
//!
//! Let u = 2⁻²⁴; o and d the local origin and direction; p a plane of axis k; M_k the greatest distance along k from o
//! to a plane of the scene's box, and M, the reach, the greatest of the three. A point of the scene at local distance t
//! has |t| ≤ M and
//! |t·d_k| ≤ M_k, since the largest component of d is at least 1.
//!
//! With r the computed reciprocal and o′ = o ± pad, the distance to a plane is computed in one of two ways: as (p −
//! o′)·r, or as p·r − (o′·r) where the last product and difference may be one operation. Components of d below 2⁻⁶⁰ are
//! replaced by that. The errors, in units of length along k (times r they are distances):
//!
//! * o is a given number scaled, without loss, as a ray for which it becomes subnormal is extreme; o ± pad is rounded:
//!   u·|o_k| + u·pad.
//! * r is off by u of itself: u·(M_k + pad). Replacing a component moves points of the ray by at most 2⁻⁶⁰·M.
//! * (p − o′)·r rounds twice: 2.01·u·(M_k + pad).
//! * p·r − o′·r rounds both products, of |p| ≤ M_k + |o_k| and |o′|, and their difference: u·(2·|o_k| + 2.01·M_k +
//!   2.01·pad).
//! * The hit's distance was rounded to single precision: u·|t| ≤ u·M_k·r, or by less than 2⁻¹⁴⁹ in the given unit where
//!   it is that small, which is at most 2⁻⁴⁹·M·r, as the factor to the local unit is at most 2¹⁰⁰·M.
//!
//! All together at most u·(4.1·M_k + 3.1·|o_k| + 4.1·pad) + 2⁻⁴⁸·M. The padding is pad = u·(8·M_k + 4·|o_k| + 2⁻¹⁷·M),
//! computed with a relative error of 8·u, which is more. It moves the planes through which a ray enters towards the
//! origin, and those through which it leaves away from it, so a box that holds the point of a hit is entered before
//! that hit's own distance, and left behind it, whatever the sign of t. Distances that vanish are off by less than
//! 2⁻¹²⁵, which is far below pad·r ≥ 2⁻⁸³, as M is taken to be at least 2⁻⁴⁰; and nothing overflows, as M,
//! |o_k| and r are at most 2⁶⁰. (Planes of empty slots make infinities of the right sign.)
//!
//! So boxes are entered by every ray that has a hit in them which is not behind its limit: hits do not depend on the
//! tree.

use crate::lanes::{Doubles8 as _, Floats as _, Floats8 as _, Floats16 as _, LANES, Lanes, Level, WideLanes};
use crate::triangles::AXES;
use glam::Vec3;
use rt_bvh::BlockTree;
use rt_core::scale::pow2;
use rt_core::{Aabb, Hit, Ray};

/// Unit roundoff of single precision.
const U: f32 = 1.0 / (1 << 24) as f32;

/// Smallest magnitude of a direction's component, where the largest is at least 1.
const SMALLEST: f32 = 1.0 / (1_u64 << 60) as f32;

/// Smallest and largest reach of a ray that is not extreme, whose origin is no further from 0 than that either. Below
/// the first the padding is that of the first.
const REACH: [f32; 2] = [1.0 / (1_u64 << 40) as f32, (1_u64 << 60) as f32];

/// Smallest and largest power of two between a given and a local distance of a ray that is not extreme; and the largest
/// one relative to the reach.
const FACTOR: [f32; 2] = [pow2(-100) as f32, pow2(100) as f32];

/// Largest component of a direction, at least and at most, for which its power of two and that one's reciprocal are
/// normal numbers.
const DIRECTION: [f32; 2] = [f32::MIN_POSITIVE, pow2(126) as f32];

/// A set of the rays of one group, a bit each.
pub(crate) type Set = u16;

/// What all rays of a scene have in common.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    bounds: Aabb,
    /// Local lengths are given ones times this.
    unscale: f64,
    /// Given lengths are local ones times this.
    scale: f64,
    pub(crate) scale_exponent: i32,
}

impl Frame {
    pub(crate) fn of(tree: &BlockTree) -> Self {
        let scale_exponent = tree.scale_exponent();
        Self { bounds: tree.bounds(), unscale: pow2(-scale_exponent), scale: pow2(scale_exponent), scale_exponent }
    }
}

/// Sixteen rays and what they have found. By axis where there are three.
#[derive(Clone, Debug)]
pub(crate) struct Group {
    /// Local origin, not rounded.
    pub(crate) origin: [Lanes; 3],
    /// The origin as the lower planes of boxes see it, and as the upper ones do: moved apart by the padding.
    pub(crate) padded: [[Lanes; 2]; 3],
    /// Those times the reciprocal.
    pub(crate) offset: [[Lanes; 2]; 3],
    /// One over the local direction.
    pub(crate) reciprocal: [Lanes; 3],
    /// Where the ray begins, in local distance.
    pub(crate) begin: Lanes,
    /// Boxes entered beyond this local distance are passed by.
    pub(crate) limit: Lanes,
    /// Local distances are given ones times this.
    pub(crate) factor: Lanes,
    /// Of the filter: how much x and y change with z.
    pub(crate) shear: [Lanes; 2],
    /// Of the filter: 18·u·m, where m is the reach.
    pub(crate) error: Lanes,
    /// Of the filter: 5·u·m.
    pub(crate) floor: Lanes,
    /// Of the reference test: the shear in double precision, and the given distance of a local unit along the dominant
    /// axis.
    pub(crate) factors: [WideLanes; 3],
    /// As given.
    pub(crate) tmin: Lanes,
    /// Distance of the best hit, else the given `tmax`.
    pub(crate) t: Lanes,
    /// Of the best hit; means nothing where there is none.
    pub(crate) u: Lanes,
    /// Likewise.
    pub(crate) v: Lanes,
    /// Primitive of the best hit, likewise, as bits: they are moved, never computed with.
    pub(crate) primitive: Lanes,
    /// The primitive that each ray starts on and must not hit, as bits; those of [`NONE`]: none.
    pub(crate) excluded: Lanes,
    /// Rays whose largest component is along each axis.
    pub(crate) dominant: [Set; 3],
    /// Rays that go down along each axis.
    pub(crate) down: [Set; 3],
    /// Rays to trace here.
    pub(crate) valid: Set,
    /// Valid rays that are not to be traced here.
    pub(crate) extreme: Set,
    /// Rays that have a hit.
    pub(crate) found: Set,
}

/// As bits, what stands for no primitive.
const NONE: f32 = f32::from_bits(u32::MAX);

impl Group {
    pub(crate) const EMPTY: Self = Self {
        origin: [Lanes::ZERO; 3],
        padded: [[Lanes::ZERO; 2]; 3],
        offset: [[Lanes::ZERO; 2]; 3],
        reciprocal: [Lanes::ZERO; 3],
        begin: Lanes::ZERO,
        limit: Lanes::ZERO,
        factor: Lanes::ZERO,
        shear: [Lanes::ZERO; 2],
        error: Lanes::ZERO,
        floor: Lanes::ZERO,
        factors: [WideLanes::ZERO; 3],
        tmin: Lanes::ZERO,
        t: Lanes::ZERO,
        u: Lanes::ZERO,
        v: Lanes::ZERO,
        primitive: Lanes::ZERO,
        excluded: Lanes([NONE; LANES]),
        dominant: [0; 3],
        down: [0; 3],
        valid: 0,
        extreme: 0,
        found: 0,
    };

    /// Prepares up to sixteen rays. `excluded` has an entry for each of them, or none.
    #[inline(always)]
    pub(crate) fn set<L: Level>(&mut self, level: L, frame: &Frame, rays: &[Ray], excluded: &[u32]) {
        match excluded.first_chunk::<LANES>() {
            Some(excluded) => self.excluded.0 = bytemuck::cast(*excluded),
            None => {
                self.excluded.0 = [NONE; LANES];
                self.excluded.0[..excluded.len()].copy_from_slice(bytemuck::cast_slice(excluded));
            }
        }
        match rays.first_chunk::<LANES>() {
            Some(rays) => self.set_all(level, frame, bytemuck::cast_ref(rays)),
            None => {
                // Rays that are not valid.
                let mut all = [Ray::new(Vec3::ZERO, Vec3::ZERO); LANES];
                all[..rays.len()].copy_from_slice(rays);
                self.set_all(level, frame, bytemuck::cast_ref(&all));
            }
        }
    }

    #[inline(always)]
    fn set_all<L: Level>(&mut self, level: L, frame: &Frame, rays: &[[f32; 8]; LANES]) {
        let [ox, oy, oz, tmin, dx, dy, dz, tmax] = level.columns(rays);
        let (given, direction) = ([ox, oy, oz], [dx, dy, dz]);
        let size = [dx.abs(), dy.abs(), dz.abs()];
        let largest = size[0].greater(size[1]).greater(size[2]);
        let finite = |x: L::F16| x.below(level.splat(f32::INFINITY));
        let mut valid = level.splat(0.0).below(largest) & tmin.not_above(tmax);
        let mut ordinary = level.splat(DIRECTION[0]).not_above(largest) & largest.not_above(level.splat(DIRECTION[1]));

        let power = largest.power_below();
        let unpower = power.reciprocal_of_power();
        let unscale = level.splat(frame.unscale as f32);
        let factor = power * unscale;
        let origin = [ox * unscale, oy * unscale, oz * unscale];
        let mut reaches = origin;
        for axis in 0..3 {
            valid &= finite(given[axis].abs()) & finite(size[axis]);
            let low = (level.splat(frame.bounds.min[axis]) - origin[axis]).abs();
            let high = (level.splat(frame.bounds.max[axis]) - origin[axis]).abs();
            reaches[axis] = low.greater(high);
            // Powers of two are lossless factors above the subnormal numbers.
            let normal = level.splat(f32::MIN_POSITIVE).not_above(origin[axis].abs());
            ordinary &= normal | given[axis].abs().not_above(level.splat(0.0));
        }
        let reach = reaches[0].greater(reaches[1]).greater(reaches[2]).greater(level.splat(REACH[0]));
        ordinary &= level.splat(FACTOR[0]).not_above(factor);
        ordinary &= factor.not_above(level.splat(FACTOR[1]).lesser(level.splat(FACTOR[1]) * reach));
        let farthest = origin[0].abs().greater(origin[1].abs()).greater(origin[2].abs()).greater(reach);
        ordinary &= farthest.not_above(level.splat(REACH[1]));

        for axis in 0..3 {
            let o = origin[axis];
            let pad = reaches[axis] * level.splat(8.0) + o.abs() * level.splat(4.0);
            let pad = (pad + reach * level.splat(1.0 / (1 << 17) as f32)) * level.splat(U);
            let local = direction[axis] * unpower;
            let reciprocal = level.splat(1.0) / local.abs().greater(level.splat(SMALLEST)).with_sign_of(local);
            let (lower, upper) = (o + pad, o - pad);
            o.store(&mut self.origin[axis]);
            lower.store(&mut self.padded[axis][0]);
            upper.store(&mut self.padded[axis][1]);
            (lower * reciprocal).store(&mut self.offset[axis][0]);
            (upper * reciprocal).store(&mut self.offset[axis][1]);
            reciprocal.store(&mut self.reciprocal[axis]);
            self.down[axis] = reciprocal.below(level.splat(0.0));
        }
        factor.store(&mut self.factor);
        (tmin * factor).store(&mut self.begin);
        (tmax * factor).store(&mut self.limit);
        (self.valid, self.extreme) = (valid & ordinary, valid & !ordinary);

        // As `shear_axes` has it.
        let x = size[1].not_above(size[0]) & size[2].not_above(size[0]);
        let y = !x & size[2].not_above(size[1]);
        self.dominant = [x, y, !x & !y];
        let sheared =
            [dy.or_else(x, dz.or_else(y, dx)), dz.or_else(x, dx.or_else(y, dy)), dx.or_else(x, dy.or_else(y, dz))];
        (sheared[0] / sheared[2]).store(&mut self.shear[0]);
        (sheared[1] / sheared[2]).store(&mut self.shear[1]);
        (reach * level.splat(18.0 * U)).store(&mut self.error);
        (reach * level.splat(5.0 * U)).store(&mut self.floor);
        for half in 0..2 {
            let depth = sheared[2].half(half).widen();
            (sheared[0].half(half).widen() / depth).store(self.factors[0].half_mut(half));
            (sheared[1].half(half).widen() / depth).store(self.factors[1].half_mut(half));
            (level.splat_wide(frame.scale) / depth).store(self.factors[2].half_mut(half));
        }
        tmin.store(&mut self.tmin);
        tmax.store(&mut self.t);
        self.found = 0;
    }

    /// The rays of an octant: bit k of its number says that they go down along axis k.
    #[inline(always)]
    pub(crate) fn in_octant(&self, octant: usize) -> Set {
        let along = |axis: usize| if octant >> axis & 1 == 1 { self.down[axis] } else { !self.down[axis] };
        self.valid & along(0) & along(1) & along(2)
    }

    /// The axes in which triangles are looked at with the ray in a lane, its dominant one last.
    #[inline(always)]
    pub(crate) fn axes_of(&self, lane: usize) -> [usize; 3] {
        let dominant = usize::from(self.dominant[1] >> lane & 1) + 2 * usize::from(self.dominant[2] >> lane & 1);
        AXES[dominant % 3]
    }

    /// The rays' hits.
    #[inline(always)]
    pub(crate) fn write<L: Level>(&self, level: L, hits: &mut [Hit]) {
        let columns = [
            level.load(&self.t).or_else(self.found, level.splat(Hit::MISS.t)),
            level.load(&self.u).or_else(self.found, level.splat(Hit::MISS.u)),
            level.load(&self.v).or_else(self.found, level.splat(Hit::MISS.v)),
            level.load(&self.primitive).or_else(self.found, level.splat(NONE)),
        ];
        match hits.first_chunk_mut::<LANES>() {
            Some(hits) => L::F16::store_rows(columns, bytemuck::cast_mut(hits)),
            None => {
                let mut rows = [Hit::MISS; LANES];
                L::F16::store_rows(columns, bytemuck::cast_mut(&mut rows));
                hits.copy_from_slice(&rows[..hits.len()]);
            }
        }
    }

    /// What a lane has found.
    #[inline(always)]
    pub(crate) fn best(&self, lane: usize) -> Option<Hit> {
        let lane = lane % LANES;
        let hit = Hit {
            t: self.t.0[lane],
            u: self.u.0[lane],
            v: self.v.0[lane],
            primitive: self.primitive.0[lane].to_bits(),
        };
        (self.found >> lane & 1 == 1).then_some(hit)
    }

    /// Notes a hit that is better than what a lane has found.
    #[inline(always)]
    pub(crate) fn put(&mut self, lane: usize, hit: &Hit) {
        let lane = lane % LANES;
        self.t.0[lane] = hit.t;
        self.u.0[lane] = hit.u;
        self.v.0[lane] = hit.v;
        self.primitive.0[lane] = f32::from_bits(hit.primitive);
        self.limit.0[lane] = hit.t * self.factor.0[lane];
        self.found |= 1 << lane;
    }
}
