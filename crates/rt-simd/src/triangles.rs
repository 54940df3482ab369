//! Rays against triangles: a filter in single precision, then the reference test in double precision, lane by lane.
//!
//! # The filter
//!
//! It rejects what the reference test would certainly reject, by the bound that `rt_bvh`'s filter for single rays
//! derives: with m the reach, X and Y the largest sheared coordinates, an edge function in single precision is within E
//! = 18·u·m·(X + Y + 5·u·m) of the exact one. Products that are fused with a sum round once less: the bound holds.
//! Beyond the error of one subtraction that it counts for a coordinate relative to the origin, the origin itself may
//! have been rounded to a subnormal number: by 2⁻¹⁵⁰, which is far below u·m.
//!
//! # The reference test
//!
//! [`rt_core::intersect`] defines a hit, and how double precision meets the definition. Here eight rays are tested at
//! once by the very operations of [`Shear`], in their order, each rounded once; so a lane whose edge functions have
//! certain signs, and whose distance is certain to the last bit, gets the bits that [`Shear::hit`] gives. Any other
//! lane asks [`Shear::hit`] itself.

use crate::lanes::{Doubles8 as _, Floats as _, Floats8 as _, Floats16 as _, LANES, Lanes, Level};
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
    let mut improved = 0;
    // All are tested before anyone looks, so that fewer branches go either way.
    let open = candidates(level, group, block, count, axes, rays);
    for (lane, &open) in open.iter().enumerate().take(count as usize) {
        if open != 0 {
            improved |= confirm(level, frame, group, given, (block, lane), axes, open);
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
    let known = if few { candidates(level, group, block, count, axes, rays) } else { [0; 4] };
    let mut rest = rays;
    for (lane, &known) in known.iter().enumerate().take(count as usize) {
        let open = if few { known & rest } else { may_hit(level, group, block, lane, axes, rest) };
        if open != 0 {
            rest &= !confirm(level, frame, group, given, (block, lane), axes, open);
            if rest == 0 {
                break;
            }
        }
    }
    rays & !rest
}

/// By lane of a block, of which so many hold a triangle: the rays of `rays`, whose dominant axis is `axes[2]`, that may
/// hit it.
///
/// All rays are tested with one triangle at a time or, where they are fewer than the triangles, all triangles with one
/// ray.
#[inline(always)]
fn candidates<L: Level>(level: L, group: &Group, block: &Block, count: u32, axes: [usize; 3], rays: Set) -> [Set; 4] {
    let mut open = [0; 4];
    let used = open.iter_mut().enumerate().take(count as usize);
    if rays.count_ones() >= count {
        for (lane, open) in used {
            *open = may_hit(level, group, block, lane, axes, rays);
        }
        return open;
    }
    let mut rest = rays;
    while rest != 0 {
        let ray = rest.trailing_zeros();
        let triangles = may_be_hit(level, group, ray as usize, block, axes);
        for (lane, open) in open.iter_mut().enumerate() {
            *open |= ((triangles >> lane & 1) as Set) << ray;
        }
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

/// Tests rays of a group, whose dominant axis is `axes[2]`, against the triangle in a lane of a block. Returns those
/// for which it is the best hit so far; `given` are the group's rays as the caller gave them.
#[inline(always)]
fn confirm<L: Level>(
    level: L,
    frame: &Frame,
    group: &mut Group,
    given: &[Ray],
    (block, lane): (&Block, usize),
    axes: [usize; 3],
    rays: Set,
) -> Set {
    let id = block.id(lane);
    let mut improved = 0;
    for half in 0..2 {
        let some = (rays >> (8 * half)) as u8;
        if some != 0 {
            improved |=
                Set::from(confirm_half(level, frame, group, given, (block, lane, id), axes, half, some)) << (8 * half);
        }
    }
    improved
}

#[expect(clippy::too_many_arguments, reason = "half of `confirm`, which is all in registers")]
#[inline(always)]
fn confirm_half<L: Level>(
    level: L,
    frame: &Frame,
    group: &mut Group,
    given: &[Ray],
    (block, lane, id): (&Block, usize, u32),
    axes: [usize; 3],
    half: usize,
    rays: u8,
) -> u8 {
    let rays = rays & !level.load8(group.excluded.half(half)).same_bits(id);
    if rays == 0 {
        return 0;
    }
    let origin = [
        level.load_wide(group.exact_origin[axes[0]].half(half)),
        level.load_wide(group.exact_origin[axes[1]].half(half)),
        level.load_wide(group.exact_origin[axes[2]].half(half)),
    ];
    let factors = [level.load_wide(group.factors[0].half(half)), level.load_wide(group.factors[1].half(half))];
    let (x, y, z) = (&block.axes[axes[0]], &block.axes[axes[1]], &block.axes[axes[2]]);
    let [ax, ay, az] = projected(level, origin, factors, x.a[lane], y.a[lane], z.a[lane]);
    let [bx, by, bz] = projected(level, origin, factors, x.b[lane], y.b[lane], z.b[lane]);
    let [cx, cy, cz] = projected(level, origin, factors, x.c[lane], y.c[lane], z.c[lane]);
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    let (least, greatest) = (u.lesser(v).lesser(w), u.greater(v).greater(w));
    let size = ax.abs().greater(bx.abs()).greater(cx.abs()) + ay.abs().greater(by.abs()).greater(cy.abs());
    let depth = az.abs().greater(bz.abs()).greater(cz.abs());
    let zero = level.splat_wide(0.0);
    let reach = depth + level.splat_wide(0.5) * size;
    let error = level.splat_wide(ERROR) * reach * (size + level.splat_wide(5.0 * EPSILON) * reach);
    let open = rays & !error.below((zero - least).lesser(greatest));
    if open == 0 {
        return 0;
    }
    // All of one sign, and a determinant that is beyond `CLEAR` times the error.
    let determinant = u + v + w;
    let margin = least.greater(zero - greatest).lesser(determinant.abs() * level.splat_wide(1.0 / CLEAR));
    let certain = error.below(margin);

    let scale = level.load_wide(group.factors[2].half(half));
    let reciprocal = level.splat_wide(1.0) / determinant;
    let t = (u * az + v * bz + w * cz) * reciprocal * scale;
    let (za, zb, zc) = (f64::from(z.a[lane]), f64::from(z.b[lane]), f64::from(z.c[lane]));
    let spread = greater(greater(za, zb), zc) - lesser(lesser(za, zb), zc);
    let error = level.splat_wide(4.0 * spread) * error * reciprocal.abs() + level.splat_wide(13.0 * EPSILON) * depth;
    let error = error * scale.abs();
    let (low, high) = ((t - error).narrow(), (t + error).narrow());
    let (tmin, cap) = (level.load8(group.tmin.half(half)), level.load8(group.t.half(half)));
    // Out of range whatever the last bit is.
    let open = open & !(certain & (high.below(tmin) | cap.below(low)));
    // Distances that vanish or overflow are left to the reference test.
    let size = low.abs();
    let settled =
        certain & high.not_above(low) & level.splat8(0.0).below(size) & size.below(level.splat8(f32::INFINITY));

    let mut improved = 0;
    let mut nearer = open & settled & low.below(cap);
    // Ties go to the lower id. What is no nearer than a limit that is no hit's is as far.
    let found = (group.found >> (8 * half)) as u8;
    nearer |= open & settled & !found;
    for i in each(open & settled & !nearer) {
        let other = group.primitive.half(half)[i].to_bits();
        nearer |= u8::from(id < other) << i;
    }
    if nearer != 0 {
        // Adding zero turns −0 into +0.
        let zero = level.splat8(0.0);
        let (u, v) = ((v / determinant).narrow() + zero, (w / determinant).narrow() + zero);
        let limit = low * level.load8(group.factor.half(half));
        put(level, &mut group.t, half, nearer, low);
        put(level, &mut group.u, half, nearer, u);
        put(level, &mut group.v, half, nearer, v);
        put(level, &mut group.limit, half, nearer, limit);
        put(level, &mut group.primitive, half, nearer, level.splat8(f32::from_bits(id)));
        group.found |= Set::from(nearer) << (8 * half);
        improved = nearer;
    }
    let doubtful = open & !settled;
    if doubtful != 0 {
        improved |= settle(frame, group, given, &block.triangle(lane), id, half, doubtful);
    }
    improved
}

/// The lesser number; one instruction, unlike `f64::min`, which must care for NaN.
#[inline(always)]
fn lesser(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

#[inline(always)]
fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[inline(always)]
fn projected<L: Level>(level: L, origin: [L::D8; 3], factors: [L::D8; 2], x: f32, y: f32, z: f32) -> [L::D8; 3] {
    let depth = level.splat_wide(z.into()) - origin[2];
    [
        level.splat_wide(x.into()) - origin[0] - factors[0] * depth,
        level.splat_wide(y.into()) - origin[1] - factors[1] * depth,
        depth,
    ]
}

/// Writes the numbers of some lanes.
#[inline(always)]
fn put<L: Level>(level: L, to: &mut Lanes, half: usize, lanes: u8, numbers: L::F8) {
    let to = to.half_mut(half);
    numbers.or_else(lanes, level.load8(to)).store(to);
}

/// Asks the reference test for some lanes, and returns those for which the triangle is the best hit so far.
#[cold]
#[inline(never)]
fn settle(frame: &Frame, group: &mut Group, given: &[Ray], triangle: &Triangle, id: u32, half: usize, lanes: u8) -> u8 {
    let mut improved = 0;
    for i in each(lanes) {
        let lane = 8 * half + i;
        if let Some(ray) = given.get(lane)
            && let Some(hit) = reference(frame, ray, triangle, id)
            && hit.is_before(&group.best(lane).unwrap_or(Hit::MISS))
        {
            group.put(lane, &hit);
            improved |= 1 << i;
        }
    }
    improved
}

/// The reference test.
pub(crate) fn reference(frame: &Frame, ray: &Ray, triangle: &Triangle, id: u32) -> Option<Hit> {
    Shear::new(ray, frame.scale_exponent, f64::INFINITY).hit(triangle, [ray.tmin, ray.tmax], id)
}

/// The members of a set, in order.
#[inline(always)]
fn each(mut set: u8) -> impl Iterator<Item = usize> {
    core::iter::from_fn(move || {
        let lane = set.trailing_zeros();
        // Takes the lowest bit away; nothing can be taken from 0.
        set &= set.checked_sub(1)?;
        Some(lane as usize)
    })
}
