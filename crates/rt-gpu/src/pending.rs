//! A launch in flight, and what becomes of a kernel's answer.

use crate::{Answer, Flight, GpuScene, Work};
use rayon::prelude::*;
use rt_bvh::Stack;
use rt_bvh::offload::Offload;
use rt_core::{Hit, Precision, Query, RaySource, ReducedWalk, StreamSpec, TestCounts, Ticket, Walk};
use rt_shaders::{DOUBTFUL, MISS, Purpose};
use std::time::Duration;

/// A launch in flight.
#[derive(Debug)]
pub(crate) struct Pending {
    pub ticket: Ticket,
    /// None where there was nothing to trace.
    pub parts: Vec<Part>,
    /// Number of the launch's hits.
    pub total: usize,
    pub start: Duration,
}

/// A kernel in flight, over rays of one window.
#[derive(Debug)]
pub(crate) struct Part {
    pub flight: Flight,
    pub work: Work,
}

/// What was asked of the rays of a kernel.
#[derive(Clone, Copy, Debug)]
pub(crate) enum How {
    Trace(StreamSpec),
    Reduced(ReducedWalk, Purpose),
}

impl How {
    pub(crate) const fn purpose(self) -> Purpose {
        match self {
            Self::Trace(StreamSpec { query: Query::Closest, counts: false, .. }) => Purpose::Closest,
            Self::Trace(StreamSpec { query: Query::Closest, counts: true, .. }) => Purpose::ClosestCounted,
            Self::Trace(StreamSpec { query: Query::Any, counts: false, .. }) => Purpose::Any,
            Self::Trace(StreamSpec { query: Query::Any, counts: true, .. }) => Purpose::AnyCounted,
            Self::Reduced(_, purpose) => purpose,
        }
    }
}

/// What the kernel and the host found out of a part.
#[derive(Debug, Default)]
pub(crate) struct Finished {
    /// For each item its hit, its counts, and its place among the answers.
    pub hits: Vec<(Hit, TestCounts, u32)>,
    /// Items that the host traced.
    pub on_host: usize,
    pub in_kernel: Duration,
    /// The first ray whose hit, a slot of the leaf order, is none: the kernel did not work.
    pub wrong: Option<(u32, u32)>,
}

/// Items that one thread finishes before it looks for more: some 50 µs of work.
const CHUNK: usize = 512;

/// Computes t, u and v of what was hit, and traces what is in doubt.
pub(crate) fn finish(scene: &GpuScene, source: &RaySource, how: How, work: &Work, answer: &Answer<'_>) -> Finished {
    let offload = Offload::new(scene.given());
    let one = |stack: &mut Stack, item: usize, ray: u32| -> Result<(Hit, TestCounts, bool), (u32, u32)> {
        let counts = answer.counts.get(item).copied().unwrap_or_default();
        match answer.found[item] {
            DOUBTFUL => {
                let (hit, counts) = on_host(scene, stack, how, source.ray(ray));
                Ok((hit, counts, true))
            }
            MISS => Ok((Hit::MISS, counts, false)),
            slot => match scene.finish(&offload, &source.ray(ray).0, slot) {
                Some(hit) => Ok((hit, counts, false)),
                None => Err((ray, slot)),
            },
        }
    };
    let mut hits = vec![(Hit::MISS, TestCounts::default(), 0); work.items() as usize];
    let parts: Vec<(usize, Option<(u32, u32)>)> = hits
        .par_chunks_mut(CHUNK)
        .enumerate()
        .map_init(
            || Stack::for_scene(scene.given()),
            |stack, (chunk, hits)| {
                let (mut on_host, mut wrong) = (0, None);
                let first = chunk * CHUNK;
                for (i, (out, (ray, place))) in hits.iter_mut().zip(work.from(first as u32)).enumerate() {
                    match one(stack, first + i, ray) {
                        Ok((hit, counts, traced)) => {
                            *out = (hit, counts, place);
                            on_host += usize::from(traced);
                        }
                        Err(item) => wrong = wrong.or(Some(item)),
                    }
                }
                (on_host, wrong)
            },
        )
        .collect();
    Finished {
        hits,
        on_host: parts.iter().map(|(on_host, _)| on_host).sum(),
        in_kernel: answer.in_kernel.unwrap_or_default(),
        wrong: parts.iter().find_map(|(_, wrong)| *wrong),
    }
}

fn on_host(scene: &GpuScene, stack: &mut Stack, how: How, ray: (rt_core::Ray, u32)) -> (Hit, TestCounts) {
    match how {
        How::Trace(spec) => scene.trace(stack, spec, ray),
        How::Reduced(kind, _) => (Hit::MISS, scene.count(stack, Walk::Reduced(kind), Precision::default(), ray)),
    }
}
