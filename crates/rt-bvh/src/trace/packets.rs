//! Batches of rays in packets: the same questions as of single rays.

use super::packet::each_in;
use super::reduced::ReducedTree;
use super::stack::Stack;
use super::walk::Visitor;
use super::{Layout, count_over, trace_over};
use rt_core::{Hit, Precision, Ray, ReducedWalk, Scene, StreamSpec, TestCounts, Walk as Kind};

/// What a batch of rays in packets is walked for.
#[derive(Clone, Copy, Debug)]
pub enum PacketWalk<'a> {
    /// What [`super::trace`] does.
    Trace(StreamSpec),
    /// What [`super::count`] does with a reduced walk.
    Reduced(ReducedWalk),
    /// What [`ReducedTree::count`] does.
    Tree(&'a ReducedTree),
}

/// Walks rays in packets of consecutive ones and hands hits and counts to `sink`, in order: those of single rays, bit
/// for bit. Portable code; on x86-64 it uses the SSE2 that every such processor has, and [`walk_packets_avx2`] is
/// faster.
pub fn walk_packets<R, S>(scene: &Scene, stack: &mut Stack, walk: PacketWalk<'_>, rays: R, sink: S)
where
    R: Iterator<Item = (Ray, u32)>,
    S: FnMut(Hit, TestCounts),
{
    walk_any(scene, stack, walk, rays, sink);
}

/// [`walk_packets`], compiled for processors with AVX2: the same bits. AVX-512 was measured to gain nothing more.
///
/// # Safety
/// Safe code inside; but the processor must have AVX2, BMI1, BMI2, LZCNT and POPCNT.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
pub fn walk_packets_avx2<R, S>(scene: &Scene, stack: &mut Stack, walk: PacketWalk<'_>, rays: R, sink: S)
where
    R: Iterator<Item = (Ray, u32)>,
    S: FnMut(Hit, TestCounts),
{
    walk_any(scene, stack, walk, rays, sink);
}

// Inlined, as all below, so that it is compiled for the target of its caller.
#[inline(always)]
fn walk_any<R, S>(scene: &Scene, stack: &mut Stack, walk: PacketWalk<'_>, rays: R, sink: S)
where
    R: Iterator<Item = (Ray, u32)>,
    S: FnMut(Hit, TestCounts),
{
    match walk {
        PacketWalk::Trace(spec) => trace_over(&Packets(scene), stack, spec, rays, sink),
        PacketWalk::Reduced(walk) => {
            count_over(&Packets(scene), stack, Kind::Reduced(walk), Precision::Robust, rays, sink);
        }
        PacketWalk::Tree(tree) => tree.count_in_packets(scene, stack, rays, sink),
    }
}

/// A scene whose rays walk in packets.
struct Packets<'s>(&'s Scene);

impl Layout for Packets<'_> {
    fn scene(&self) -> &Scene {
        self.0
    }

    #[inline(always)]
    fn each<'a, V, R, S>(&'a self, stack: &mut Stack, rays: R, sink: S)
    where
        V: Visitor<'a, Data = Scene>,
        R: Iterator<Item = (Ray, u32)>,
        S: FnMut(Hit, TestCounts),
    {
        each_in::<V, R, S>(self.0, self.0.nodes(), self.0, stack, rays, sink);
    }
}
