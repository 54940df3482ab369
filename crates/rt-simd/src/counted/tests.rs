//! Counts of every level, packet and order against a walk written down as the definition has it.

use super::*;
use crate::lanes::portable::Portable;
use crate::rays::Group;
use crate::tests::{bits, expected, hard_rays, kernels, scaled, scene_of};
use crate::{Scratch, triangles};
use rt_bvh::BlockChild;
use rt_core::{Coherence, Triangle, random};
use rt_verify::shapes;

const WALKS: [(Walk, Query); 4] = [
    (Walk::Full, Query::Closest),
    (Walk::Full, Query::Any),
    (Walk::Reduced(ReducedWalk::LeafAsHit), Query::Closest),
    (Walk::Reduced(ReducedWalk::Unshortened), Query::Any),
];

/// One ray and what it found, walked as the module's documentation says, number by number.
struct Reference<'a> {
    tree: &'a BlockTree,
    frame: &'a Frame,
    ray: &'a Ray,
    excluded: u32,
    group: Group,
    walk: Walk,
    query: Query,
    octant: usize,
    limit: f32,
    hit: Hit,
    counts: TestCounts,
}

impl Reference<'_> {
    /// `None` for a ray that is not to be walked in single precision.
    fn count(
        (tree, frame): (&BlockTree, &Frame),
        ray: &Ray,
        excluded: u32,
        walk: Walk,
        query: Query,
    ) -> Option<(Hit, TestCounts)> {
        let mut group = Group::EMPTY;
        group.set(Portable, frame, &[*ray], &[]);
        if group.extreme & 1 == 1 {
            return None;
        }
        let (hit, counts) = (Hit::MISS, TestCounts::default());
        if group.valid & 1 == 0 {
            return Some((hit, counts));
        }
        let octant = (0..3).fold(0, |octant, axis| octant | usize::from(group.down[axis] & 1) << axis);
        let limit = group.limit.0[0];
        let mut walker = Reference { tree, frame, ray, excluded, group, walk, query, octant, limit, hit, counts };
        walker.node(0);
        Some((walker.hit, walker.counts))
    }

    fn ends(&self) -> bool {
        self.query == Query::Any && self.hit.is_hit()
    }

    fn enters(&self, node: usize, slot: usize) -> Option<f32> {
        let bounds = self.tree.nodes()[node].bounds(slot);
        let (mut near, mut far) = (self.group.begin.0[0], self.limit);
        for axis in 0..3 {
            let mut planes = [bounds.min[axis], bounds.max[axis]];
            let [lower, upper] = &self.group.padded[axis];
            let mut origins = [lower.0[0], upper.0[0]];
            if self.octant >> axis & 1 == 1 {
                planes.reverse();
                origins.reverse();
            }
            let reciprocal = self.group.reciprocal[axis].0[0];
            near = near.max((planes[0] - origins[0]) * reciprocal);
            far = far.min((planes[1] - origins[1]) * reciprocal);
        }
        (near <= far).then_some(near)
    }

    fn node(&mut self, index: usize) {
        self.counts.boxes += 8;
        let node = &self.tree.nodes()[index];
        let any = self.walk == Walk::Full && self.query == Query::Any;
        let order = if any { 0o7654_3210 } else { node.orders()[self.octant] };
        // The first to visit is the last of the order.
        let slots = (0..8).rev().map(|place| order as usize >> (3 * place) & 7);
        let entered: Vec<(usize, f32)> = slots.filter_map(|slot| Some((slot, self.enters(index, slot)?))).collect();
        let children = *node.children();
        if let Walk::Reduced(kind) = self.walk {
            for &(slot, entry) in &entered {
                if let BlockChild::Block { count, .. } = BlockChild::of(children[slot]) {
                    self.counts.triangles += count;
                    if kind == ReducedWalk::LeafAsHit {
                        self.limit = self.limit.min(entry);
                    }
                }
            }
        }
        for (slot, entry) in entered {
            if entry > self.limit || self.ends() {
                continue;
            }
            match BlockChild::of(children[slot]) {
                BlockChild::Node(child) => self.node(child as usize),
                BlockChild::Block { index, count } if self.walk == Walk::Full => self.block(index as usize, count),
                _ => {}
            }
        }
    }

    fn block(&mut self, index: usize, count: u32) {
        self.counts.triangles += count;
        let block = &self.tree.blocks()[index];
        for lane in 0..count as usize {
            let id = block.id(lane);
            if id != self.excluded
                && let Some(hit) = triangles::reference(self.frame, self.ray, &block.triangle(lane), id)
                && hit.is_before(&self.hit)
            {
                self.hit = hit;
                self.limit = hit.t * self.group.factor.0[0];
            }
        }
    }
}

/// Asserts that every kernel counts as the definition says, with rays in any company.
fn assert_counts(given: &[Triangle], rays: &[Ray], excluded: &[u32], name: &str) {
    let scene = &*scene_of(given);
    let tree = BlockTree::new(scene).expect("few blocks");
    let frame = Frame::of(&tree);
    let mut scratch = Scratch::default();
    for (walk, query) in WALKS {
        let mut extreme = None;
        let (mut counts, mut hits) = (vec![TestCounts::default(); rays.len()], vec![Hit::MISS; rays.len()]);
        let right = expected(scene, query, rays, excluded);
        for kernel in kernels() {
            for (coherence, few) in [
                (Coherence::Coherent, 0),
                (Coherence::Coherent, 64),
                (Coherence::Coherent, 3),
                (Coherence::Incoherent, 2),
                (Coherence::Unknown, 5),
            ] {
                counts.fill(TestCounts { boxes: 1, triangles: 1 });
                hits.fill(Hit { t: -1.0, u: 7.0, v: 7.0, primitive: 7 });
                kernel.count_in(
                    few,
                    &tree,
                    &mut scratch,
                    walk,
                    (query, coherence),
                    (rays, excluded, &mut counts, &mut hits),
                );
                for (i, ray) in rays.iter().enumerate() {
                    let context = || {
                        format!("{name}, {walk:?}, {query:?}, {}, {coherence:?}, {few}: ray {i}, {ray:?}", kernel.isa())
                    };
                    let start = excluded.get(i).copied().unwrap_or(u32::MAX);
                    match Reference::count((&tree, &frame), ray, start, walk, query) {
                        Some((hit, count)) => {
                            assert_eq!(counts[i], count, "{}", context());
                            assert_eq!(bits(&hits[i]), bits(&hit), "{}", context());
                        }
                        // Extreme rays are walked in double precision: all alike, and none for nothing.
                        None => assert!(counts[i].boxes >= 8 && counts[i].boxes % 8 == 0, "{}", context()),
                    }
                    match walk {
                        Walk::Full if query == Query::Closest => {
                            assert_eq!(bits(&hits[i]), bits(&right[i]), "{}", context());
                        }
                        Walk::Full => assert_eq!(hits[i].is_hit(), right[i].is_hit(), "{}", context()),
                        Walk::Reduced(_) => assert_eq!(bits(&hits[i]), bits(&Hit::MISS), "{}", context()),
                    }
                }
                let found = extreme.get_or_insert_with(|| counts.clone());
                assert_eq!(*found, counts, "{name}, {walk:?}, {query:?}, {}, {coherence:?}, {few}", kernel.isa());
            }
        }
    }
}

// Fails when a packet's sets are not made again where limits have come down, when a child's distance is rounded
// otherwise than a single ray's, when blocks that are taken for hits cut rays of other boxes, and when a count is put
// down to another lane.
#[test]
fn rays_count_as_if_they_walked_alone() {
    let soup = shapes::soup(1_000, 0.3, 1);
    for (name, given) in [
        ("one", soup[..1].to_vec()),
        ("nine", soup[..9].to_vec()),
        ("soup", soup.clone()),
        ("small soup", shapes::soup(3_000, 0.03, 2)),
        ("grid", shapes::grid(16, 0.2, 3)),
        ("cube", shapes::box_grid(6)),
        ("mixed scales", shapes::mixed_scales(500, 5)),
        ("twice", [&soup[..200], &soup[..200]].concat()),
        ("tiny", scaled(&soup[..300], -100)),
        ("huge", scaled(&soup[..300], 100)),
    ] {
        assert_counts(&given, &hard_rays(&given, 700, 6), &[], name);
    }
    let one = Ray::new(glam::Vec3::ZERO, glam::Vec3::X);
    assert_counts(&[], &[one; 70], &[], "none");
}

// Fails when an exclusion is forgotten, which would leave hits and limits nearer.
#[test]
fn excluded_primitives_are_counted_and_not_hit() {
    let given = shapes::soup(500, 0.4, 7);
    let rays = hard_rays(&given, 700, 8);
    let first = expected(&scene_of(&given), Query::Closest, &rays, &[]);
    let excluded: Vec<u32> =
        first.iter().enumerate().map(|(i, hit)| if i % 3 == 0 { u32::MAX } else { hit.primitive }).collect();
    assert_counts(&given, &rays, &excluded, "exclusions");
}

// Fails when a packet's octants are mixed up, or rays beyond the last whole packet are forgotten.
#[test]
fn neighbours_of_any_number_count_alike() {
    let given = shapes::icosphere(4);
    let rays: Vec<Ray> = (0..300)
        .map(|i| {
            let [x, y] = [i % 20, i / 20].map(|i| i as f32 / 10.0 - 1.0);
            Ray::new([3.0 * x, 3.0 * y, -5.0].into(), [-2.0 * x, 0.1 - 2.0 * y, 5.0].into())
        })
        .collect();
    for count in [0, 1, 15, 16, 17, 63, 64, 65, 129, 300] {
        if count > 0 {
            assert_counts(&given, &rays[..count], &[], "neighbours");
        }
    }
    let mixed: Vec<Ray> = (0..300).map(|i| rays[random::below(300, 3, i, 0) as usize]).collect();
    assert_counts(&given, &mixed, &[], "mixed");
}
