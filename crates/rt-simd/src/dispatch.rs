//! The kernels, compiled once for each set of instructions.
#![cfg_attr(
    target_arch = "x86_64",
    expect(unsafe_code, reason = "whether the processor has the instructions is known only at run time")
)]

use crate::isa::Found;
use crate::lanes::portable::Portable;
use crate::lanes::{LANES, Level};
#[cfg(target_arch = "x86_64")]
use crate::lanes::{avx2::Avx2, avx512::Avx512};
use crate::packet::{Packet, RAYS, fill};
use crate::rays::Frame;
use glam::Vec3;
use rt_bvh::BlockTree;
use rt_core::bounce::Surfaces;
use rt_core::{Hit, Query, Ray, RaySource};

/// Rays to trace in packets, in the order in which they are.
pub(crate) struct Batch<'a> {
    pub(crate) tree: &'a BlockTree,
    pub(crate) frame: &'a Frame,
    pub(crate) packet: &'a mut Packet,
    pub(crate) query: Query,
    /// Where so few rays of a packet are left they go on alone.
    pub(crate) few: u32,
    /// Whether neighbours soon leave each other.
    pub(crate) scattered: bool,
    pub(crate) rays: &'a [Ray],
    /// An entry for each ray, or none.
    pub(crate) excluded: &'a [u32],
    pub(crate) hits: &'a mut [Hit],
}

/// What is compiled for each set of instructions, in a function of its own: what is changed for one kind of work must
/// not change how another is compiled.
pub(crate) trait Work {
    /// Does it. To be inlined, so that it is compiled for the instructions of its caller.
    fn run<L: Level>(self, level: L);
}

impl Found {
    /// Traces a batch.
    pub(crate) fn trace(self, batch: Batch<'_>) {
        match (batch.query, batch.scattered) {
            (Query::Closest | Query::All { .. }, false) => self.run(Tracing::<false, false>(batch)),
            (Query::Closest | Query::All { .. }, true) => self.run(Tracing::<false, true>(batch)),
            (Query::Any, false) => self.run(Tracing::<true, false>(batch)),
            (Query::Any, true) => self.run(Tracing::<true, true>(batch)),
        }
    }

    /// Does something with these instructions.
    pub(crate) fn run<W: Work>(self, work: W) {
        match self {
            Self::Portable(level) => run_portable(level, work),
            // SAFETY: the proof says that the processor has what the function is compiled for.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(level) => unsafe { run_avx2(level, work) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(level) => unsafe { run_avx512(level, work) },
        }
    }
}

#[inline(never)]
fn run_portable<W: Work>(level: Portable, work: W) {
    work.run(level);
}

#[cfg(target_arch = "x86_64")]
#[inline(never)]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn run_avx2<W: Work>(level: Avx2, work: W) {
    work.run(level);
}

#[cfg(target_arch = "x86_64")]
#[inline(never)]
#[target_feature(enable = "avx512f,avx512dq,avx512bw,avx512vl,avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn run_avx512<W: Work>(level: Avx512, work: W) {
    work.run(level);
}

/// Work that is written in plain loops, which compilers turn into words of what they compile it for.
pub trait Loops {
    /// What comes of it.
    type Output;

    /// Does it. To be marked `#[inline(always)]`, as all that it calls in its loops: what is not inlined is compiled
    /// for the least processor.
    fn run(self) -> Self::Output;
}

/// Loops, and where their result goes.
pub(crate) struct Looping<'a, W: Loops>(pub(crate) W, pub(crate) &'a mut Option<W::Output>);

impl<W: Loops> Work for Looping<'_, W> {
    #[inline(always)]
    fn run<L: Level>(self, _: L) {
        *self.1 = Some(self.0.run());
    }
}

/// Rays to make.
pub(crate) struct Making<'a> {
    pub(crate) source: &'a RaySource,
    pub(crate) which: Which<'a>,
    pub(crate) rays: &'a mut [Ray],
    pub(crate) origins: &'a mut [u32],
}

/// Numbers of rays.
pub(crate) enum Which<'a> {
    /// As many as there is room for.
    From(u32),
    These(&'a [u32]),
}

impl Loops for Making<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        match self.which {
            Which::From(first) => self.source.rays(first, self.rays, self.origins),
            Which::These(numbers) => self.source.rays_of(numbers, self.rays, self.origins),
        }
    }
}

/// Primitives, and where their unit normals go.
pub(crate) struct Facing<'a> {
    pub(crate) surfaces: &'a Surfaces,
    pub(crate) primitives: &'a [u32],
    pub(crate) normals: &'a mut [Vec3],
}

impl Loops for Facing<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        self.surfaces.normals(self.primitives, self.normals);
    }
}

/// A batch, by its query and by whether its rays are scattered.
struct Tracing<'a, const ANY: bool, const SCATTERED: bool>(Batch<'a>);

impl<const ANY: bool, const SCATTERED: bool> Work for Tracing<'_, ANY, SCATTERED> {
    // Inlined, as all below, so that it is compiled for the instructions of its caller.
    #[inline(always)]
    fn run<L: Level>(self, level: L) {
        self.0.trace::<L, ANY, SCATTERED>(level);
    }
}

impl Batch<'_> {
    #[inline(always)]
    fn trace<L: Level, const ANY: bool, const SCATTERED: bool>(self, level: L) {
        let Self { tree, frame, packet, few, query, mut excluded, .. } = self;
        let mut next = self.rays.chunks(RAYS).skip(1);
        for (rays, hits) in self.rays.chunks(RAYS).zip(self.hits.chunks_mut(RAYS)) {
            // What a caller has in memory is seldom in the cache.
            level.fetch(bytemuck::cast_slice(hits));
            level.fetch(bytemuck::cast_slice(next.next().unwrap_or_default()));
            let (own, others) = excluded.split_at(excluded.len().min(rays.len()));
            excluded = others;
            let mut extreme = fill(level, frame, &mut packet.groups, rays, own);
            packet.trace::<L, ANY, SCATTERED>(level, tree, frame, rays, few);
            for (group, hits) in packet.groups.iter().zip(hits.chunks_mut(LANES)) {
                group.write(level, hits);
            }
            while extreme != 0 {
                let i = extreme.trailing_zeros() as usize;
                extreme &= extreme - 1;
                let excluded = own.get(i).copied().unwrap_or(u32::MAX);
                hits[i] = crate::alone::trace(tree, frame, &rays[i], excluded, query);
            }
        }
    }
}
