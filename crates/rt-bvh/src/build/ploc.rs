//! Bottom-up construction by clustering neighbours on a space-filling curve.
//!
//! After D. Meister and J. Bittner, *Parallel Locally-Ordered Clustering for Bounding Volume Hierarchy Construction*
//! (2018): clusters lie in Morton order of their centroids, each looks for the best partner a few places before and
//! behind it, and those that are each other's best become one. Then the tree is improved by [`super::reinsert`], small
//! subtrees become leaves, and it is improved again. We deviate in two ways, without which some inputs take quadratic
//! time:
//!
//! * Of partners that are equally good, a cluster at an even place takes the next and one at an odd place the one
//!   before, so that rows of equal boxes pair at once, and not one pair in each pass.
//! * A pass that joins few clusters ([`FEW`]) joins neighbours two by two instead: of nested boxes nearly all find that
//!   the next smaller one is their best partner, which is not mutual.

use super::bounds::Bounds;
use super::draft::{Branch, Draft};
use super::gather::Reference;
use super::{BuildError, Control, Tree, filled, reinsert, reserved};
use crate::PlocQuality;
use crate::parallel::{each, sort};
use alloc::vec::Vec;
use glam::{DVec3, Vec4};

/// A pass that joins fewer than one pair among this many clusters is replaced by one that joins every two: so there are
/// at most log n / log(16/15) passes, eleven times the log₂ n of a builder that halves. Ordinary scenes join one pair
/// in three or four.
const FEW: usize = 16;

/// Clusters for which a thread seeks partners at a time.
const CHUNK: usize = 1 << 12;

/// Bits of a coordinate in the Morton order.
const BITS: u32 = 21;

/// How a tree is made.
struct Preset {
    /// How many places before and behind it a cluster looks for a partner.
    radius: usize,
    /// The first passes look at the next place alone: there most clusters are, and most find a partner.
    narrow_passes: u32,
    /// Share of all nodes that are tried elsewhere before leaves are made, and behind it; 0: none.
    reinserted: [f32; 2],
    /// Most triangles in a leaf.
    leaf: u32,
}

impl Preset {
    /// Those of the crate `obvhs` 0.4, without spatial splits.
    const fn of(quality: PlocQuality) -> Self {
        let (radius, narrow_passes, reinserted, leaf) = match quality {
            PlocQuality::Fastest => (1, 0, [0.0; 2], 1),
            PlocQuality::VeryFast => (1, 0, [0.01, 0.0], 8),
            PlocQuality::Fast => (6, 2, [0.02, 0.0], 8),
            PlocQuality::Medium => (14, 3, [0.05, 0.1], 8),
            PlocQuality::Slow => (24, 2, [0.2, 0.4], 8),
            PlocQuality::VerySlow => (14, 1, [1.0; 2], 8),
        };
        Self { radius, narrow_passes, reinserted, leaf }
    }
}

/// The tree, or `None` if it is too deep.
pub(super) fn build(
    references: &[Reference],
    quality: PlocQuality,
    max_leaf: u32,
    control: &mut Control<'_>,
) -> Result<Option<Tree>, BuildError> {
    if references.is_empty() {
        return Ok(Some(Tree::empty()));
    }
    let preset = Preset::of(quality);
    // Clustering takes about half of the time, and moving nodes a quarter each time.
    let mut draft = cluster(references, &preset, control)?;
    reinsert::improve(&mut draft, preset.reinserted[0], control, [0.5, 0.75])?;
    draft = draft.with_leaves(preset.leaf.min(max_leaf))?;
    reinsert::improve(&mut draft, preset.reinserted[1], control, [0.75, 1.0])?;
    draft.into_tree()
}

fn cluster(references: &[Reference], preset: &Preset, control: &mut Control<'_>) -> Result<Draft, BuildError> {
    let all = references.len();
    let (order, mut clusters) = in_morton_order(references)?;
    let mut nodes = filled(Branch::EMPTY, 2 * all - 1, "nodes")?;
    let mut partners = filled((0_u32, f32::INFINITY), all, "the partners of clusters")?;
    let mut pass = 0;
    // Nodes are placed from behind, so that those near the root lie in front.
    let mut free = nodes.len();
    while clusters.len() > 1 {
        let count = clusters.len();
        let partners = &mut partners[..count];
        let radius = if pass < preset.narrow_passes { 1 } else { preset.radius };
        control.worked((count * radius) as u64)?;
        if seek(&clusters, radius, partners) * FEW < count {
            (0..).zip(partners.iter_mut()).for_each(|(own, partner): (u32, _)| partner.0 = own ^ 1);
        }
        let mut kept = 0;
        for own in 0..count {
            let other = partners[own].0 as usize;
            // The last of an odd number may have none.
            let mutual = other < count && partners[other].0 as usize == own;
            if mutual && other < own {
                continue;
            }
            clusters[kept] = clusters[own];
            if mutual {
                free -= 2;
                [nodes[free], nodes[free + 1]] = [clusters[own], clusters[other]];
                let bounds = clusters[own].bounds.union(&clusters[other].bounds);
                clusters[kept] = Branch { bounds, first: free as u32, count: 0 };
            }
            kept += 1;
        }
        clusters.truncate(kept);
        control.reached(0.5 * (all - kept) as f32 / all as f32);
        pass += 1;
    }
    nodes[0] = clusters[0];
    Draft::new(nodes, order)
}

/// Finds every cluster's best partner at most `radius` places away, and how many pairs are each other's.
fn seek(clusters: &[Branch], radius: usize, partners: &mut [(u32, f32)]) -> usize {
    let chunks = partners.chunks_mut(CHUNK).enumerate().collect();
    each(chunks, |(chunk, partners)| seek_some(clusters, radius, chunk * CHUNK, partners));
    let mutual = |own: &usize| partners[partners[*own].0 as usize].0 as usize == *own;
    (0..partners.len()).filter(mutual).count() / 2
}

/// The same for the clusters from place `first` on, as many as there are `partners`.
fn seek_some(clusters: &[Branch], radius: usize, first: usize, partners: &mut [(u32, f32)]) {
    partners.fill((0, f32::INFINITY));
    // Of those before a cluster the last that is best.
    let tell = |(partner, least): &mut (u32, f32), before: usize, cost: f32| {
        if cost <= *least {
            (*partner, *least) = (before as u32, cost);
        }
    };
    for before in first.saturating_sub(radius)..first {
        let bounds = clusters[before].bounds;
        let reached = clusters[first..].iter().take((before + radius + 1).saturating_sub(first));
        for (there, partner) in reached.zip(partners.iter_mut()) {
            tell(partner, before, bounds.union(&there.bounds).half_area());
        }
    }
    for own in first..first + partners.len() {
        let bounds = clusters[own].bounds;
        let (mut partner, mut least) = partners[own - first];
        let mut told = partners[own - first + 1..].iter_mut();
        for (other, there) in (own + 1..).zip(&clusters[own + 1..]).take(radius) {
            let cost = bounds.union(&there.bounds).half_area();
            let preferred = cost == least && other == own + 1 && own % 2 == 0;
            if cost < least || preferred {
                (partner, least) = (other as u32, cost);
            }
            if let Some(partner) = told.next() {
                tell(partner, own, cost);
            }
        }
        partners[own - first] = (partner, least);
    }
}

/// The references' positions in Morton order of their centroids, and a leaf for each.
fn in_morton_order(references: &[Reference]) -> Result<(Vec<u32>, Vec<Branch>), BuildError> {
    // Twice the centroid: only positions relative to each other matter.
    let centroid = |bounds: &Bounds| bounds.min + bounds.max;
    let (mut low, mut high) = (Vec4::MAX, Vec4::MIN);
    for bounds in references.iter().map(Bounds::from) {
        low = low.min(centroid(&bounds));
        high = high.max(centroid(&bounds));
    }
    let low = low.truncate().as_dvec3();
    let extent = high.truncate().as_dvec3() - low;
    // An axis without extent has one cell.
    let cells = f64::from(1_u32 << BITS);
    let scale = DVec3::select(extent.cmpgt(DVec3::ZERO), DVec3::splat(cells) / extent, DVec3::ZERO);
    let mut keys: Vec<(u64, u32)> = reserved(references.len(), "the Morton codes of triangles")?;
    keys.extend(references.iter().zip(0..).map(|(reference, position)| {
        let cell = (centroid(&Bounds::from(reference)).truncate().as_dvec3() - low) * scale;
        let [x, y, z] = cell.min(DVec3::splat(cells - 1.0)).to_array().map(|c| spread(c as u64));
        (x | y << 1 | z << 2, position)
    }));
    sort(&mut keys);
    let mut order = reserved(references.len(), "the order of triangles")?;
    let mut leaves = reserved(references.len(), "clusters")?;
    for (first, &(_, position)) in (0..).zip(&keys) {
        order.push(position);
        leaves.push(Branch { bounds: Bounds::from(&references[position as usize]), first, count: 1 });
    }
    Ok((order, leaves))
}

/// The low 21 bits, two zeros between each.
const fn spread(x: u64) -> u64 {
    let x = x & 0x1f_ffff;
    let x = (x | x << 32) & 0x001f_0000_0000_ffff;
    let x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    let x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    let x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}
