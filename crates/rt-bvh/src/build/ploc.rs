//! Trees by the crate `obvhs`: parallel locally ordered clustering (D. Meister and J. Bittner, 2018) and parallel
//! reinsertion (the same, 2018), turned into our layout.

use super::gather::Reference;
use super::{BuildError, Control, Fallback, Tree, reserved};
use crate::PlocQuality;
use alloc::vec;
use alloc::vec::Vec;
use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::PlocBuilder;
use rt_core::{Aabb, Child, Node, random};

/// Cells along an axis of the grid on which `obvhs` sorts centroids: triangles in one cell keep no order.
const CELLS: f32 = (1 << 20) as f32;

/// Greatest mean number of triangles that a triangle shares its cell with. Clustering takes time quadratic in the
/// number of triangles in one cell, at about 40 ns a pair; ordinary scenes have a mean near 1.
const MOST_SHARED: u64 = 100;

/// A tree, or why there is none of this kind. What `obvhs` takes beside the boxes it allocates without a way to fail.
pub(super) fn build(
    references: &[Reference],
    quality: PlocQuality,
    max_leaf: u32,
    control: &mut Control<'_>,
) -> Result<Result<Tree, Fallback>, BuildError> {
    if references.len() < 3 {
        return Ok(Err(Fallback::FewTriangles));
    }
    if shares_cells(references) {
        return Ok(Err(Fallback::EqualCentroids));
    }
    let mut params = match quality {
        PlocQuality::Fastest => BvhBuildParams::fastest_build(),
        PlocQuality::VeryFast => BvhBuildParams::very_fast_build(),
        PlocQuality::Fast => BvhBuildParams::fast_build(),
        PlocQuality::Medium => BvhBuildParams::medium_build(),
        PlocQuality::Slow => BvhBuildParams::slow_build(),
        PlocQuality::VerySlow => BvhBuildParams::very_slow_build(),
    };
    params.max_prims_per_leaf = params.max_prims_per_leaf.min(max_leaf);
    let mut boxes = reserved(references.len(), "the boxes of triangles")?;
    boxes.extend(references.iter().map(untied));
    Ok(Ok(convert(&cluster(&boxes, &params, control)?, references)))
}

/// The steps of `obvhs::bvh2::builder::build_bvh2`, which in debug builds panics where a tree is deeper than `obvhs`
/// itself may traverse: nested boxes suffice for that. Whether a tree is too deep for us is for the caller to say.
fn cluster(
    boxes: &[obvhs::aabb::Aabb],
    params: &BvhBuildParams,
    control: &mut Control<'_>,
) -> Result<Bvh2, BuildError> {
    let order = (0..boxes.len() as u32).collect();
    control.ask()?;
    let mut bvh = PlocBuilder::with_capacity(boxes.len()).build(
        params.ploc_search_distance,
        boxes,
        order,
        params.sort_precision,
        params.search_depth_threshold,
    );
    control.ask()?;
    let mut optimizer = ReinsertionOptimizer::default();
    optimizer.run(&mut bvh, params.reinsertion_batch_ratio, None);
    control.ask()?;
    collapse(&mut bvh, params.max_prims_per_leaf.clamp(1, 255), params.collapse_traversal_cost);
    let ratio = params.reinsertion_batch_ratio * params.post_collapse_reinsertion_batch_ratio_multiplier;
    optimizer.run(&mut bvh, ratio, None);
    control.ask()?;
    Ok(bvh)
}

/// Whether so many centroids fall into the same cells that clustering would take forever.
fn shares_cells(references: &[Reference]) -> bool {
    let (mut low, mut high) = (Vec3A::MAX, Vec3A::MIN);
    // Twice the centroid: only positions relative to each other matter.
    let centroid = |reference: &Reference| Vec3A::from(reference.bounds().min + reference.bounds().max);
    for reference in references {
        low = low.min(centroid(reference));
        high = high.max(centroid(reference));
    }
    // An axis without extent gives 0 · ∞ = NaN, which the cast below turns to 0.
    let scale = Vec3A::splat(CELLS) / (high - low);
    // A table of counts indexed by a hash of the cell, with about as many entries as triangles: collisions of
    // different cells add 1 to the mean.
    let bits = usize::BITS - references.len().leading_zeros();
    let mut counts = vec![0_u32; 1 << bits];
    let mut pairs = 0_u64;
    for reference in references {
        let cell = (centroid(reference) - low) * scale;
        let [x, y, z] = cell.to_array().map(|c| c as u32);
        // Odd multipliers from the fractional part of the golden ratio and its powers (Knuth's multiplicative hashing).
        let key = u64::from(x) | u64::from(y) << 20 | u64::from(z) << 40;
        let hash = key.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> (u64::BITS - bits);
        let count = &mut counts[hash as usize];
        pairs += u64::from(*count);
        *count += 1;
    }
    pairs > MOST_SHARED * references.len() as u64
}

/// The reference's box, grown by less than 1% and a few rounding steps, by an amount of its own.
///
/// Clustering joins boxes that are each other's best partner. In rows of equal boxes all partners are equally good,
/// the ties all break the same way, and only one pair is joined in each pass: quadratic time.
fn untied(reference: &Reference) -> obvhs::aabb::Aabb {
    let Aabb { min, max } = reference.bounds();
    let [random, _] = random::pair(0, reference.triangle, 0);
    let growth = ((max - min) * (1.0 / 128.0) + max.abs() * (1.0 / (1 << 21) as f32)) * random;
    obvhs::aabb::Aabb { min: Vec3A::from(min), max: Vec3A::from(max + growth) }
}

/// Copies a tree of one box per node into one of two boxes per node, and fits the boxes to the references.
fn convert(bvh: &Bvh2, references: &[Reference]) -> Tree {
    let mut nodes = vec![Node::EMPTY];
    let mut order = Vec::with_capacity(bvh.primitive_indices.len());
    // Children of `obvhs`'s nodes still to be placed: the child, and where it goes.
    let mut open = vec![(0_usize, None::<(usize, usize)>)];
    while let Some((child, parent)) = open.pop() {
        let given = &bvh.nodes[child];
        let (node, side) = parent.unwrap_or((0, 0));
        if given.is_leaf() {
            let range = given.first_index as usize..(given.first_index + given.prim_count) as usize;
            let leaf = Child::Leaf { first: order.len() as u32, count: given.prim_count };
            nodes[node].set(side, Aabb::EMPTY, leaf);
            order.extend_from_slice(&bvh.primitive_indices[range]);
        } else {
            let index = if parent.is_some() { nodes.len() } else { 0 };
            if parent.is_some() {
                nodes.push(Node::EMPTY);
                nodes[node].set(side, Aabb::EMPTY, Child::Inner(index as u32));
            }
            open.push((given.first_index as usize + 1, Some((index, 1))));
            open.push((given.first_index as usize, Some((index, 0))));
        }
    }
    super::fit(&mut nodes, &order, |i| references[i as usize].bounds());
    Tree { nodes, order }
}
