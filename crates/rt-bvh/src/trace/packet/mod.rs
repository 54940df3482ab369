//! Packets: sixteen rays that walk the two-wide tree together.
//!
//! I. Wald, P. Slusallek, C. Benthin and M. Wagner, *Interactive Rendering with Coherent Ray Tracing* (2001): a node is
//! fetched once for all rays, and its boxes are tested with all rays at once, a ray in each SIMD lane. Where few rays
//! of a packet are left they go on alone, as in C. Benthin and others, *Combining Single and Packet-Ray Tracing for
//! Arbitrary Ray Distributions on the Intel MIC Architecture* (2012), so that incoherent rays lose next to nothing.
//!
//! # Why hits and counts are those of single rays
//!
//! We deviate in the order. Usually one ray decides for the packet which child is visited first. Here every ray visits
//! the nodes in its own order: where rays disagree, those of the majority enter one child, all of them the other one,
//! and then the minority the first. So a packet is nothing but many single walks, interleaved: each ray makes the same
//! tests, in the same order, under the same limits, and reports the same hit (with [`rt_core::Query::Any`], too) and
//! the same counts. Samples can be counted in packets, and packets be used or not, without changing an estimate.

#![expect(clippy::needless_range_loop, reason = "a lane is an index into several arrays at once")]

mod filter;
mod slabs;
mod walk;

use super::lanes::LANES;
use super::slabs::Frame;
use super::stack::Stack;
use super::walk::{Visitor, each_in as each_alone, is_whole};
use rt_core::{Hit, Node, Ray, Scene, TestCounts};
use walk::Packet;

/// The single rays' `each_in`, in packets of consecutive rays.
#[inline(always)]
pub(super) fn each_in<'a, V, R, S>(
    scene: &Scene,
    nodes: &[Node],
    data: &'a V::Data,
    stack: &mut Stack,
    mut rays: R,
    mut sink: S,
) where
    V: Visitor<'a>,
    R: Iterator<Item = (Ray, u32)>,
    S: FnMut(Hit, TestCounts),
{
    if !is_whole(nodes) {
        return each_alone::<V, R, S>(scene, nodes, data, stack, rays, sink);
    }
    stack.fit_packets(scene);
    let frame = Frame::of(scene);
    let mut packet = Packet::<V>::new();
    loop {
        // Rays taken, and which of them are valid.
        let (mut taken, mut valid) = (0, 0_u32);
        packet.clear();
        while taken < LANES
            && let Some((ray, excluded)) = rays.next()
        {
            if let Some(ray) = frame.localize(&ray) {
                valid |= 1 << taken;
                packet.push(V::begin(data, ray, excluded));
            }
            taken += 1;
        }
        if taken == 0 {
            return;
        }
        packet.walk(scene, nodes, stack);
        let mut visitors = packet.visitors.drain(..);
        for i in 0..taken {
            let visitor = if valid >> i & 1 == 1 { visitors.next() } else { None };
            let (hit, counts) = visitor.map_or((Hit::MISS, TestCounts::default()), Visitor::finish);
            sink(hit, counts);
        }
    }
}
