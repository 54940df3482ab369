//! Extreme rays: those whose numbers are beyond what single precision holds with room to spare.
//!
//! Directions of 10⁻⁴⁰ or 10³⁹, origins that are 10²⁰ scenes away, scenes whose coordinates span most of single
//! precision. One ray at a time, in double precision, whose exponents have room for all products of single-precision
//! numbers that occur here. Slow, but right; and plain, so that tests compare the other kernels with it.

use crate::order::order;
use crate::rays::Frame;
use crate::triangles::reference;
use glam::DVec3;
use rt_bvh::{BlockChild, BlockTree};
use rt_core::scale::pow2;
use rt_core::{Aabb, Hit, Query, Ray, ReducedWalk, TestCounts, Walk};

/// How much wider than their numbers boxes are taken to be, relative to distances of planes: far more than the few
/// roundings of double precision.
const SLACK: f64 = 1.0 / (1_u64 << 45) as f64;

/// How much further than a limit boxes are visited, relative to it: a hit's distance was rounded to single precision.
const ROUNDED: f64 = 1.0 / (1_u64 << 22) as f64;

/// The same for the smallest distances: the least number.
const LEAST: f64 = pow2(-149);

/// The hit of a valid ray.
pub(crate) fn trace(tree: &BlockTree, frame: &Frame, ray: &Ray, excluded: u32, query: Query) -> Hit {
    count(tree, frame, ray, excluded, Walk::Full, query).0
}

/// The hit of a valid ray, and its tests: what the crate's documentation says, with boxes tested in double precision.
#[cold]
#[inline(never)]
pub(crate) fn count(
    tree: &BlockTree,
    frame: &Frame,
    ray: &Ray,
    excluded: u32,
    walk: Walk,
    query: Query,
) -> (Hit, TestCounts) {
    let scale = pow2(-frame.scale_exponent);
    let (origin, direction) = (ray.origin.as_dvec3() * scale, ray.direction.as_dvec3());
    let octant = (0..3).fold(0, |octant, axis| octant | usize::from(direction[axis].is_sign_negative()) << axis);
    // Distances are given ones times the scale, in what follows.
    let slack = |t: f32| (f64::from(t.abs()) * ROUNDED + LEAST) * scale;
    let begin = f64::from(ray.tmin) * scale - slack(ray.tmin);
    let mut best = Hit::MISS;
    let mut counts = TestCounts::default();
    let mut limit = f64::from(ray.tmax) * scale + slack(ray.tmax);
    let mut open: Vec<(f64, u32)> = [(begin, 0)].into();
    while let Some((entry, child)) = open.pop() {
        if entry > limit {
            continue;
        }
        match BlockChild::of(child) {
            BlockChild::Node(index) => {
                counts.boxes = counts.boxes.saturating_add(8);
                let node = &tree.nodes()[index as usize];
                let order = match (walk, query) {
                    (Walk::Full, Query::Any) => order::<true>(node, octant),
                    _ => order::<false>(node, octant),
                };
                let mut nearest = limit;
                for slot in (0..8).map(|place| order as usize >> (3 * place) & 7) {
                    let child = BlockChild::of(node.children()[slot]);
                    if child == BlockChild::Empty {
                        continue;
                    }
                    let Some(entry) = enters(origin, direction, &node.bounds(slot), begin, limit) else { continue };
                    match (walk, child) {
                        (Walk::Reduced(kind), BlockChild::Block { count, .. }) => {
                            counts.triangles = counts.triangles.saturating_add(count);
                            if kind == ReducedWalk::LeafAsHit {
                                nearest = nearest.min(entry);
                            }
                        }
                        _ => open.push((entry, node.children()[slot])),
                    }
                }
                limit = nearest;
            }
            BlockChild::Block { index, count } => {
                counts.triangles = counts.triangles.saturating_add(count);
                let block = &tree.blocks()[index as usize];
                for lane in 0..count as usize {
                    let id = block.id(lane);
                    if id != excluded
                        && let Some(hit) = reference(frame, ray, &block.triangle(lane), id)
                        && hit.is_before(&best)
                    {
                        best = hit;
                        limit = f64::from(hit.t) * scale + slack(hit.t);
                    }
                }
                if query == Query::Any && best.is_hit() {
                    return (best, counts);
                }
            }
            BlockChild::Empty => {}
        }
    }
    (best, counts)
}

/// Where the ray may enter a box between two distances.
fn enters(origin: DVec3, direction: DVec3, bounds: &Aabb, begin: f64, limit: f64) -> Option<f64> {
    let (mut near, mut far) = (begin, limit);
    for axis in 0..3 {
        let ways = [bounds.min[axis], bounds.max[axis]].map(|plane| f64::from(plane) - origin[axis]);
        let slack = SLACK * ways[0].abs().max(ways[1].abs());
        let [low, high] = [ways[0] - slack, ways[1] + slack];
        let d = direction[axis];
        if d == 0.0 {
            if low > 0.0 || high < 0.0 {
                return None;
            }
            continue;
        }
        let (a, b) = (low / d, high / d);
        near = near.max(a.min(b));
        far = far.min(a.max(b));
    }
    (near <= far).then_some(near)
}
