//! Rays against triangles: a filter in single precision, then the reference test in double precision, lane by lane.
//!
//! # The filter
//!
//! It rejects what the reference test would certainly reject, by the bound that `rt_bvh`'s filter for single rays
//! derives: with m the reach, X and Y the largest sheared coordinates, an edge function in single precision is within E
//! = 18·u·m·(X + Y + 5·u·m) of the exact one. Products that are fused with a sum round once less: the bound holds.
//!
//! # The reference test
//!
//! [`rt_core::intersect`] defines a hit, and how double precision meets the definition. Here eight rays are tested at
//! once, each with a triangle of its own. Edge functions and weights are computed by the very operations of [`Shear`],
//! in their order, each rounded once; so a lane whose edge functions have certain signs, and whose distance is certain
//! to the last bit, gets the bits that [`Shear::hit`] gives. Any other lane asks [`Shear::hit`] itself. What only
//! bounds errors, and distances within them, may be fused.

use crate::lanes::{Alike, Choice, Doubles8 as _, Floats as _, Floats8 as _, Floats16 as _, Half, LANES, Level, Part};
use crate::rays::{Frame, Group, Set};
use rt_bvh::Block;
use rt_core::intersect::{CLEAR, EPSILON, ERROR, Shear};
use rt_core::{Hit, Ray, Triangle};

/// For each dominant axis, the axes in which triangles are looked at, and itself.
pub(crate) const AXES: [[usize; 3]; 3] = [[1, 2, 0], [2, 0, 1], [0, 1, 2]];

/// Tests rays of a group, whose dominant axis is `axes[2]`, against a block of so many triangles, and returns those
/// that have a nearer hit now; `given` are the group's rays as the caller gave them.
#[inline(always)]
pub(crate) fn nearest<L: Level>(
    level: L,
    frame: &Frame,
    group: &mut Group,
    given: &[Ray],
    (block, count): (&Block, u32),
    axes: [usize; 3],
    rays: Set,
) -> Set {
    // All are tested before anyone looks, so that fewer branches go either way.
    let mut open = candidates(level, group, block, count, axes, rays);
    let mut improved = 0;
    while open.0 != 0 {
        let (lane, some) = open.first();
        if some.count_ones() > L::FEW_ALIKE {
            improved |= confirm_alike(level, frame, group, given, block, axes, lane, some);
            open = open.without(Pairs::of(lane, some));
        } else {
            let (pairs, part) = open.some(level);
            improved |= confirm_mixed(level, frame, group, given, block, axes, pairs, part);
            open = open.without(pairs);
        }
    }
    improved
}

/// The same for rays that end with any hit, and returns those that end.
#[inline(always)]
pub(crate) fn any<L: Level>(
    level: L,
    frame: &Frame,
    group: &mut Group,
    given: &[Ray],
    (block, count): (&Block, u32),
    axes: [usize; 3],
    rays: Set,
) -> Set {
    let few = rays.count_ones() < count;
    let known = if few { candidates(level, group, block, count, axes, rays) } else { Pairs(0) };
    let (mut rest, mut open) = (rays, Pairs(0));
    for lane in 0..count as usize {
        let some = if few { known.rays(lane) & rest } else { may_hit(level, group, block, lane & 3, axes, rest) };
        if some.count_ones() > L::FEW_ALIKE {
            rest &= !confirm_alike(level, frame, group, given, block, axes, lane, some);
            if rest == 0 {
                return rays;
            }
        } else {
            open.0 |= Pairs::of(lane, some).0;
        }
    }
    if L::FEW_ALIKE > 0 {
        open.0 &= Pairs::all(rest).0;
        while open.0 != 0 {
            let (pairs, part) = open.some(level);
            rest &= !confirm_mixed(level, frame, group, given, block, axes, pairs, part);
            open.0 &= Pairs::all(rest).0 & !pairs.0;
        }
    }
    rays & !rest
}

/// Triangles of a block and rays of a group that may meet: bit 16 · lane of the block + ray.
#[derive(Clone, Copy)]
struct Pairs(u64);

impl Pairs {
    /// Rays with the triangle in a lane.
    #[inline(always)]
    fn of(lane: usize, rays: Set) -> Self {
        Self(u64::from(rays) << (LANES * lane))
    }

    /// Rays with all triangles.
    #[inline(always)]
    fn all(rays: Set) -> Self {
        Self(u64::from(rays) * 0x0001_0001_0001_0001)
    }

    /// A ray with some triangles, a bit each.
    #[inline(always)]
    const fn with(triangles: u32, ray: u32) -> Self {
        let triangles = triangles as u64 & 0xf;
        Self(((triangles | triangles << 15 | triangles << 30 | triangles << 45) & 0x0001_0001_0001_0001) << ray)
    }

    #[inline(always)]
    const fn without(self, others: Self) -> Self {
        Self(self.0 & !others.0)
    }

    /// Those of a lane.
    #[inline(always)]
    const fn rays(self, lane: usize) -> Set {
        (self.0 >> (LANES * lane)) as Set
    }

    /// The first lane that has rays, and those.
    #[inline(always)]
    const fn first(self) -> (usize, Set) {
        let lane = self.0.trailing_zeros() as usize / LANES % 4;
        (lane, self.rays(lane))
    }

    /// Some of them, no ray twice, and where their rays are.
    #[inline(always)]
    fn some<L: Level>(self, level: L) -> (Self, L::Part) {
        let all = self.0 | self.0 >> (2 * LANES);
        let part = level.part((all | all >> LANES) as Set);
        let mut rest = part.set(u8::MAX);
        let mut some = Self(0);
        for lane in 0..4 {
            let rays = self.rays(lane) & rest;
            rest &= !rays;
            some.0 |= Self::of(lane, rays).0;
        }
        (some, part)
    }
}

/// Tests rays against the triangle in a lane of a block, as [`confirm`].
#[expect(clippy::too_many_arguments, reason = "all in registers")]
#[inline(always)]
fn confirm_alike<L: Level>(
    level: L,
    frame: &Frame,
    group: &mut Group,
    given: &[Ray],
    block: &Block,
    axes: [usize; 3],
    lane: usize,
    rays: Set,
) -> Set {
    let mut improved = 0;
    for part in [Half::lower(level), Half::upper(level)] {
        let members = part.members(rays);
        if members != 0 {
            let pairs = Pairs::of(lane, part.set(members));
            let lanes = (part, Alike { level, choice: lane & 3 }, members);
            improved |= confirm(level, frame, group, given, block, axes, pairs, lanes);
        }
    }
    improved
}

/// Tests pairs whose rays are in a part, no ray twice, as [`confirm`].
#[expect(clippy::too_many_arguments, reason = "all in registers")]
#[inline(always)]
fn confirm_mixed<L: Level>(
    level: L,
    frame: &Frame,
    group: &mut Group,
    given: &[Ray],
    block: &Block,
    axes: [usize; 3],
    pairs: Pairs,
    part: L::Part,
) -> Set {
    let members = |lane: usize| part.members(pairs.rays(lane));
    let sets = [members(0), members(1), members(2), members(3)];
    let lanes = (part, level.choice(sets), sets[0] | sets[1] | sets[2] | sets[3]);
    confirm(level, frame, group, given, block, axes, pairs, lanes)
}

/// The rays of `rays`, whose dominant axis is `axes[2]`, and triangles of a block, of which there are so many, that may
/// meet.
///
/// All rays are tested with one triangle at a time or, where they are fewer than the triangles, all triangles with one
/// ray.
#[inline(always)]
fn candidates<L: Level>(level: L, group: &Group, block: &Block, count: u32, axes: [usize; 3], rays: Set) -> Pairs {
    let mut open = Pairs(0);
    if rays.count_ones() >= count {
        for lane in 0..count as usize {
            open.0 |= Pairs::of(lane, may_hit(level, group, block, lane & 3, axes, rays)).0;
        }
        return open;
    }
    let mut rest = rays;
    while rest != 0 {
        let ray = rest.trailing_zeros();
        open.0 |= Pairs::with(may_be_hit(level, group, ray as usize, block, axes), ray).0;
        rest &= rest - 1;
    }
    open
}

/// The rays of `rays`, whose dominant axis is `axes[2]`, that may hit the triangle in a lane of a block.
#[inline(always)]
fn may_hit<L: Level>(level: L, group: &Group, block: &Block, lane: usize, axes: [usize; 3], rays: Set) -> Set {
    let origin =
        [level.load(&group.origin[axes[0]]), level.load(&group.origin[axes[1]]), level.load(&group.origin[axes[2]])];
    let shear = [level.load(&group.shear[0]), level.load(&group.shear[1])];
    let (x, y, z) = (&block.axes[axes[0]], &block.axes[axes[1]], &block.axes[axes[2]]);
    let [ax, ay] = sheared(level, origin, shear, x.a[lane], y.a[lane], z.a[lane]);
    let [bx, by] = sheared(level, origin, shear, x.b[lane], y.b[lane], z.b[lane]);
    let [cx, cy] = sheared(level, origin, shear, x.c[lane], y.c[lane], z.c[lane]);
    let u = cx.mul_sub(by, cy * bx);
    let v = ax.mul_sub(cy, ay * cx);
    let w = bx.mul_sub(ay, by * ax);
    let size = ax.abs().greater(bx.abs()).greater(cx.abs()) + ay.abs().greater(by.abs()).greater(cy.abs());
    let error = (size + level.load(&group.floor)) * level.load(&group.error);
    let (least, greatest) = (u.lesser(v).lesser(w), u.greater(v).greater(w));
    let negative = least.below(level.splat(0.0) - error);
    let positive = error.below(greatest);
    rays & !(negative & positive)
}

/// The triangles of a block, a bit each, that one ray of a group, whose dominant axis is `axes[2]`, may hit. Spare
/// lanes of the block are like its first.
#[inline(always)]
pub(crate) fn may_be_hit<L: Level>(level: L, group: &Group, lane: usize, block: &Block, axes: [usize; 3]) -> u32 {
    let lane = lane % LANES;
    let coordinate = |axis: usize| {
        let numbers: &[f32; LANES] = bytemuck::cast_ref(&block.axes[axis]);
        level.load12(numbers) - level.splat(group.origin[axis].0[lane])
    };
    let z = coordinate(axes[2]);
    let x = z.neg_mul_add(level.splat(group.shear[0].0[lane]), coordinate(axes[0]));
    let y = z.neg_mul_add(level.splat(group.shear[1].0[lane]), coordinate(axes[1]));
    // Groups of lanes: first, second and third vertices, and nothing. An edge is that of two others.
    let (xp, xq, yp, yq) = (x.groups_cab(), x.groups_bca(), y.groups_cab(), y.groups_bca());
    let edges = xp.mul_sub(yq, yp * xq);
    let size = x.abs().greater(xp.abs()).greater(xq.abs()) + y.abs().greater(yp.abs()).greater(yq.abs());
    let error = (size + level.splat(group.floor.0[lane])) * level.splat(group.error.0[lane]);
    let negative = u32::from(edges.below(level.splat(0.0) - error));
    let positive = u32::from(error.below(edges));
    let any = |edges: u32| edges | edges >> 4 | edges >> 8;
    !(any(negative) & any(positive)) & 0xf
}

#[inline(always)]
fn sheared<L: Level>(level: L, origin: [L::F16; 3], shear: [L::F16; 2], x: f32, y: f32, z: f32) -> [L::F16; 2] {
    let depth = level.splat(z) - origin[2];
    [depth.neg_mul_add(shear[0], level.splat(x) - origin[0]), depth.neg_mul_add(shear[1], level.splat(y) - origin[1])]
}

/// Tests pairs of a group and a block, in which the dominant axis is `axes[2]`. Returns the rays for which theirs is
/// the best hit so far. `given` are the group's rays as the caller gave them; `lanes` are where the pairs' rays are,
/// which triangle each has, and which of these eight lanes there are.
#[expect(clippy::too_many_arguments, reason = "all in registers")]
#[inline(always)]
fn confirm<L, P, C>(
    level: L,
    frame: &Frame,
    group: &mut Group,
    given: &[Ray],
    block: &Block,
    axes: [usize; 3],
    pairs: Pairs,
    (part, choice, members): (P, C, u8),
) -> Set
where
    L: Level,
    P: Part<Narrow = L::F8, Wide = L::D8>,
    C: Choice<Narrow = L::F8, Wide = L::D8>,
{
    let id = choice.bits_of(block.ids());
    let members = members & !part.of(&group.excluded).same_bits(id);
    if members == 0 {
        return 0;
    }
    let origin = [
        part.of(&group.origin[axes[0]]).widen(),
        part.of(&group.origin[axes[1]]).widen(),
        part.of(&group.origin[axes[2]]).widen(),
    ];
    let factors = [part.of_wide(&group.factors[0]), part.of_wide(&group.factors[1])];
    let (x, y, z) = (&block.axes[axes[0]], &block.axes[axes[1]], &block.axes[axes[2]]);
    let [ax, ay, az] = projected::<L, C>(origin, factors, choice, [&x.a, &y.a, &z.a]);
    let [bx, by, bz] = projected::<L, C>(origin, factors, choice, [&x.b, &y.b, &z.b]);
    let [cx, cy, cz] = projected::<L, C>(origin, factors, choice, [&x.c, &y.c, &z.c]);
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    let (least, greatest) = (u.lesser(v).lesser(w), u.greater(v).greater(w));
    let size = ax.abs().greater(bx.abs()).greater(cx.abs()) + ay.abs().greater(by.abs()).greater(cy.abs());
    let zero = level.splat_wide(0.0);
    let (nearest, farthest) = (az.lesser(bz).lesser(cz), az.greater(bz).greater(cz));
    let depth = farthest.greater(zero - nearest);
    let reach = size.mul_add(level.splat_wide(0.5), depth);
    let error = level.splat_wide(ERROR) * reach * reach.mul_add(level.splat_wide(5.0 * EPSILON), size);
    let open = members & !error.below((zero - least).lesser(greatest));
    if open == 0 {
        return 0;
    }
    // All of one sign, and a determinant that is beyond `CLEAR` times the error.
    let determinant = u + v + w;
    let margin = least.greater(zero - greatest).lesser(determinant.abs() * level.splat_wide(1.0 / CLEAR));
    let certain = error.below(margin);

    let scale = part.of_wide(&group.factors[2]);
    let reciprocal = level.splat_wide(1.0) / determinant;
    let t = w.mul_add(cz, v.mul_add(bz, u * az)) * reciprocal * scale;
    let error = level.splat_wide(4.0) * (farthest - nearest) * error * reciprocal.abs();
    let error = depth.mul_add(level.splat_wide(13.0 * EPSILON), error) * scale.abs();
    let (low, high) = ((t - error).narrow(), (t + error).narrow());
    let (tmin, cap) = (part.of(&group.tmin), part.of(&group.t));
    // Out of range whatever the last bit is.
    let open = open & !(certain & (high.below(tmin) | cap.below(low)));
    // Distances that vanish or overflow are left to the reference test.
    let size = low.abs();
    let settled =
        certain & high.not_above(low) & level.splat8(0.0).below(size) & size.below(level.splat8(f32::INFINITY));

    // Ties go to the lower id. What is no nearer than a limit that is no hit's is as far.
    let found = part.members(group.found);
    let mut nearer = open & settled & (low.below(cap) | !found);
    let ties = open & settled & !nearer;
    if ties != 0 {
        nearer |= ties & id.lesser_bits(part.of(&group.primitive));
    }
    let mut improved = 0;
    if nearer != 0 {
        // Adding zero turns −0 into +0.
        let zero = level.splat8(0.0);
        let (u, v) = ((v / determinant).narrow() + zero, (w / determinant).narrow() + zero);
        part.put(nearer, low, &mut group.t);
        part.put(nearer, u, &mut group.u);
        part.put(nearer, v, &mut group.v);
        part.put(nearer, low * part.of(&group.factor), &mut group.limit);
        part.put(nearer, id, &mut group.primitive);
        improved = part.set(nearer);
        group.found |= improved;
    }
    let doubtful = open & !settled;
    if doubtful != 0 {
        improved |= settle(frame, group, given, block, pairs, part.set(doubtful));
    }
    improved
}

#[inline(always)]
fn projected<L: Level, C: Choice<Wide = L::D8>>(
    origin: [L::D8; 3],
    factors: [L::D8; 2],
    choice: C,
    vertex: [&[f32; 4]; 3],
) -> [L::D8; 3] {
    let depth = choice.of(vertex[2]) - origin[2];
    [
        choice.of(vertex[0]) - origin[0] - factors[0] * depth,
        choice.of(vertex[1]) - origin[1] - factors[1] * depth,
        depth,
    ]
}

/// Asks the reference test for some rays of pairs, and returns the ones for which theirs is the best hit so far.
#[cold]
#[inline(never)]
fn settle(frame: &Frame, group: &mut Group, given: &[Ray], block: &Block, pairs: Pairs, rays: Set) -> Set {
    let mut rest = pairs.0 & Pairs::all(rays).0;
    let mut improved = 0;
    while rest != 0 {
        let first = rest.trailing_zeros() as usize;
        let (lane, ray) = (first / LANES, first % LANES);
        rest &= rest - 1;
        if let Some(given) = given.get(ray)
            && let Some(hit) = reference(frame, given, &block.triangle(lane), block.id(lane))
            && hit.is_before(&group.best(ray).unwrap_or(Hit::MISS))
        {
            group.put(ray, &hit);
            improved |= 1 << ray;
        }
    }
    improved
}

/// The reference test.
pub(crate) fn reference(frame: &Frame, ray: &Ray, triangle: &Triangle, id: u32) -> Option<Hit> {
    Shear::new(ray, frame.scale_exponent, f64::INFINITY).hit(triangle, [ray.tmin, ray.tmax], id)
}
