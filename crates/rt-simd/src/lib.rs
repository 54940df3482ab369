//! Tracing in the SIMD words of processors.
//!
//! [`Kernel`] finds hits of rays in a [`rt_bvh::BlockTree`]: nearest or any, those of [`rt_bvh::trace()`] bit for bit, by packets of
//! 64 rays in words of AVX-512, AVX2 or whatever the target has. It chooses by what rays are like how they travel, so nobody has
//! to say; and counts nothing, since what a packet visits depends on a ray's company.
//!
//! # Current state and limits
//!
//! * `unsafe` is in the modules of intrinsics, and where the kernels compiled for them are called; it rests on a proof that only
//!   finding the instructions makes.
//! * No kernel for [`rt_core::Precision::Fast`].
#![deny(unsafe_code)]

mod alone;
mod dispatch;
mod frustum;
mod isa;
mod lanes;
mod order;
mod packet;
mod rays;
mod single;
mod stack;
mod triangles;

pub use isa::{Isa, UnknownIsa};

use dispatch::Batch;
use isa::Found;
use packet::Packet;
use rays::Frame;
use rt_bvh::BlockTree;
use rt_core::{Hit, Query, Ray};

/// The kernels for one set of instructions.
#[derive(Clone, Copy, Debug)]
pub struct Kernel(Found);

/// What a thread needs to trace with: allocate it once.
#[derive(Clone, Debug)]
pub struct Scratch {
    packet: Box<Packet>,
    sorted: order::Sorted,
}

impl Default for Scratch {
    fn default() -> Self {
        Self { packet: Box::new(Packet::new()), sorted: order::Sorted::new() }
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

    /// Traces rays; `excluded` holds the primitive that each starts on and must not hit (`u32::MAX`: none), or nothing.
    pub fn trace(
        self,
        tree: &BlockTree,
        scratch: &mut Scratch,
        query: Query,
        few: u32,
        rays: &[Ray],
        excluded: &[u32],
        hits: &mut [Hit],
    ) {
        let frame = Frame::of(tree);
        let Scratch { packet, sorted } = scratch;
        if few < 100 {
            self.0.run(Batch { tree, frame: &frame, packet, query, few, rays, excluded, hits });
            return;
        }
        let few = few - 100;
        for (i, (rays, hits)) in rays.chunks(order::WINDOW).zip(hits.chunks_mut(order::WINDOW)).enumerate() {
            let excluded = excluded.chunks(order::WINDOW).nth(i).unwrap_or_default();
            sorted.take(rays, excluded);
            let (n, m) = (rays.len(), excluded.len());
            let (rays, excluded) = (&sorted.rays[..n], &sorted.excluded[..m]);
            self.0.run(Batch { tree, frame: &frame, packet, query, few, rays, excluded, hits: &mut sorted.hits[..n] });
            sorted.give(hits);
        }
    }
}
