//! Tracing in the SIMD words of processors.
//!
//! [`Kernel`] finds hits of rays in a [`rt_bvh::BlockTree`]: nearest or any, those of [`rt_bvh::trace()`] bit for bit,
//! by packets of 64 rays in words of AVX-512, AVX2 or whatever the target has. Where the caller does not say whether
//! neighbours go alike, it looks. [`Kernel::count`] finds what rays cost as well, or alone.
//!
//! # What is counted
//!
//! A ray's counts are those of a walk that it makes alone, whatever its company; so they are the same numbers with any
//! instructions, in any packet and on any thread.
//!
//! * It walks depth first. Children of a node come in the order that [`rt_bvh::BlockNode::orders`] has for the octant
//!   of its direction, and in the order of slots where any hit will do.
//! * A child is visited if the ray enters its box when the parent is visited, and at a distance that is not beyond the
//!   ray's limit when the child's turn comes. The limit is that of the ray, or its nearest hit so far. Every valid ray
//!   visits the root.
//! * A visited node costs eight box tests, whatever is in its slots. A visited block costs as many triangle tests as it
//!   holds triangles; the nearest of those that a ray hits there ends it, where any hit will do.
//! * Reduced walks do not look at blocks: those of a node that the ray enters when the node is visited are counted
//!   there and then. If leaves are taken for hits, the nearest of these boxes becomes the ray's limit.
//!
//! # Current state and limits
//!
//! * `unsafe` is in the modules of intrinsics, and where the kernels compiled for them are called; it rests on a proof
//!   that only finding the instructions makes. Beside that, the system is asked for large pages.
//! * No kernel for [`rt_core::Precision::Fast`].
#![deny(unsafe_code)]

mod alone;
mod counted;
mod dispatch;
mod frustum;
mod isa;
mod lanes;
mod order;
mod packet;
mod pages;
mod rays;
mod single;
mod stack;
#[cfg(test)]
mod tests;
mod triangles;
mod turns;

pub use dispatch::Loops;
pub use isa::{Isa, UnknownIsa};
pub use pages::use_large_pages;

use counted::{CountBatch, Counter};
use dispatch::{Batch, Facing, Looping, Making, Which};
use glam::Vec3;
use isa::Found;
use order::{Sorted, WINDOW};
use packet::Packet;
use rays::Frame;
use rt_bvh::BlockTree;
use rt_core::bounce::Surfaces;
use rt_core::{Coherence, Hit, Query, Ray, RaySource, TestCounts, Walk};
use stack::Stack;

/// The kernels for one set of instructions.
#[derive(Clone, Copy, Debug)]
pub struct Kernel(Found);

/// What a thread needs to trace with: allocate it once.
#[derive(Clone, Debug)]
pub struct Scratch {
    packet: Box<Packet>,
    sorted: Sorted,
    counting: Option<Box<Counting>>,
}

/// What counting needs beside that.
#[derive(Clone, Debug)]
struct Counting {
    counter: Counter,
    /// Of sorted rays.
    counts: Vec<TestCounts>,
}

impl Default for Scratch {
    fn default() -> Self {
        Self { packet: Box::new(Packet::new()), sorted: Sorted::new(), counting: None }
    }
}

impl Kernel {
    /// Those for some instructions; `None` where the processor lacks them.
    #[must_use]
    pub fn new(isa: Isa) -> Option<Self> {
        Found::look_for(isa).map(Self)
    }

    /// The fastest that the processor has.
    #[must_use]
    pub fn best() -> Self {
        let portable = Found::Portable(lanes::portable::Portable);
        Self(Isa::ALL.into_iter().rev().find_map(Found::look_for).unwrap_or(portable))
    }

    /// Which instructions they use.
    #[must_use]
    pub const fn isa(self) -> Isa {
        self.0.isa()
    }

    /// Does work that is written in plain loops with these instructions.
    pub fn run<W: Loops>(self, work: W) -> W::Output {
        let mut output = None;
        self.0.run(Looping(work, &mut output));
        output.expect("the work was done")
    }

    /// Makes rays of a source: as [`RaySource::rays`] with these instructions, the same bits.
    ///
    /// # Panics
    /// As that.
    pub fn make(self, source: &RaySource, first: u32, rays: &mut [Ray], origins: &mut [u32]) {
        self.run(Making { source, which: Which::From(first), rays, origins });
    }

    /// Makes the rays of these numbers: as [`RaySource::rays_of`].
    ///
    /// # Panics
    /// As that.
    pub fn make_of(self, source: &RaySource, numbers: &[u32], rays: &mut [Ray], origins: &mut [u32]) {
        self.run(Making { source, which: Which::These(numbers), rays, origins });
    }

    /// The unit normals of primitives: as [`Surfaces::normals`] with these instructions.
    ///
    /// # Panics
    /// As that.
    pub fn normals(self, surfaces: &Surfaces, primitives: &[u32], normals: &mut [Vec3]) {
        self.run(Facing { surfaces, primitives, normals });
    }

    /// Traces rays, and writes the hit of each where it is in the order of the rays; `excluded` holds the primitive
    /// that each starts on and must not hit (`u32::MAX`: none), or nothing. Invalid rays miss.
    ///
    /// With [`Query::Closest`] ties go to the lowest primitive id; so with [`Query::All`], of which the nearest is
    /// found here. With [`Query::Any`] the hit is one of the candidates, and which one depends on the other rays. What
    /// is said of the rays' `coherence` costs time where it is wrong, less than twice as much, and changes no nearest
    /// hit.
    ///
    /// # Panics
    /// When `hits` is not as long as `rays`, or `excluded` neither that nor empty.
    pub fn trace(
        self,
        tree: &BlockTree,
        scratch: &mut Scratch,
        (query, coherence): (Query, Coherence),
        rays: &[Ray],
        excluded: &[u32],
        hits: &mut [Hit],
    ) {
        self.trace_in(coherence, FEW, tree, scratch, query, (rays, excluded, hits));
    }

    /// [`Kernel::trace`] with all choices.
    fn trace_in(
        self,
        coherence: Coherence,
        few: u32,
        tree: &BlockTree,
        scratch: &mut Scratch,
        query: Query,
        (rays, mut excluded, hits): (&[Ray], &[u32], &mut [Hit]),
    ) {
        assert_eq!(rays.len(), hits.len(), "a hit for each ray");
        assert!(excluded.is_empty() || excluded.len() == rays.len(), "a primitive for each ray, or none");
        // Builders keep trees far below that.
        assert!(tree.depth() <= Stack::DEPTH, "the tree is deeper than any scene's");
        let frame = Frame::of(tree);
        let Scratch { packet, sorted, .. } = scratch;
        for (rays, hits) in rays.chunks(WINDOW).zip(hits.chunks_mut(WINDOW)) {
            let (own, others) = excluded.split_at(excluded.len().min(rays.len()));
            excluded = others;
            let scattered = order::are_to_be_sorted(coherence, rays);
            let batch = Batch { tree, frame: &frame, packet, query, few, scattered, rays, excluded: own, hits };
            if scattered {
                sorted.take(rays, own);
                self.0.trace(Batch {
                    rays: &sorted.rays[..rays.len()],
                    excluded: &sorted.excluded[..own.len()],
                    hits: &mut sorted.hits[..rays.len()],
                    ..batch
                });
                sorted.give(&sorted.hits, hits);
            } else {
                self.0.trace(batch);
            }
        }
    }

    /// Walks rays and writes the tests of each (as the crate's documentation says), and its hit unless `hits` is empty:
    /// of full walks with [`Query::Closest`] that of [`Kernel::trace`], of reduced ones a miss. Hits and counts do not
    /// depend on a ray's company, on the instructions or on what is said of `coherence`.
    ///
    /// # Panics
    /// When `counts` is not as long as `rays`, or `hits` or `excluded` neither that nor empty.
    #[expect(clippy::too_many_arguments, reason = "a ray's parts and results, each in an array of its own")]
    pub fn count(
        self,
        tree: &BlockTree,
        scratch: &mut Scratch,
        walk: Walk,
        how: (Query, Coherence),
        rays: &[Ray],
        excluded: &[u32],
        counts: &mut [TestCounts],
        hits: &mut [Hit],
    ) {
        self.count_in(FEW, tree, scratch, walk, how, (rays, excluded, counts, hits));
    }

    /// [`Kernel::count`] with all choices.
    fn count_in(
        self,
        few: u32,
        tree: &BlockTree,
        scratch: &mut Scratch,
        walk: Walk,
        (query, coherence): (Query, Coherence),
        (rays, mut excluded, counts, mut hits): (&[Ray], &[u32], &mut [TestCounts], &mut [Hit]),
    ) {
        assert_eq!(rays.len(), counts.len(), "counts for each ray");
        assert!(hits.is_empty() || hits.len() == rays.len(), "a hit for each ray, or none");
        assert!(excluded.is_empty() || excluded.len() == rays.len(), "a primitive for each ray, or none");
        assert!(tree.depth() <= Stack::DEPTH, "the tree is deeper than any scene's");
        let frame = Frame::of(tree);
        let Scratch { sorted, counting, .. } = scratch;
        let Counting { counter, counts: sorted_counts } = &mut **counting.get_or_insert_with(|| {
            Box::new(Counting { counter: Counter::new(), counts: vec![TestCounts::default(); WINDOW] })
        });
        for (rays, counts) in rays.chunks(WINDOW).zip(counts.chunks_mut(WINDOW)) {
            let (own, others) = excluded.split_at(excluded.len().min(rays.len()));
            excluded = others;
            let hits = hits.split_off_mut(..rays.len().min(hits.len())).unwrap_or_default();
            if order::are_to_be_sorted(coherence, rays) {
                sorted.take(rays, own);
                let sorted_counts = &mut sorted_counts[..rays.len()];
                counted::run(
                    self.0,
                    CountBatch {
                        tree,
                        frame: &frame,
                        counter,
                        walk,
                        query,
                        few,
                        rays: &sorted.rays[..rays.len()],
                        excluded: &sorted.excluded[..own.len()],
                        counts: &mut *sorted_counts,
                        hits: &mut sorted.hits[..hits.len()],
                    },
                );
                sorted.give(sorted_counts, counts);
                sorted.give(&sorted.hits, hits);
            } else {
                let frame = &frame;
                counted::run(
                    self.0,
                    CountBatch { tree, frame, counter, walk, query, few, rays, excluded: own, counts, hits },
                );
            }
        }
    }
}

/// Where so few rays of a packet enter a node together they go on alone. Measured: 2 to 4 are alike for sorted diffuse
/// rays, 8 and more slower.
const FEW: u32 = 2;
