//! A launch in flight, and what becomes of a kernel's answer.

use crate::{Answer, Flight, GpuScene, RayList};
use rayon::prelude::*;
use rt_bvh::Stack;
use rt_bvh::kernel_io::KernelIo;
use rt_core::{Hit, Precision, Query, RaySource, ReducedWalk, StreamSpec, TestCounts, Ticket, Walk};
use rt_fenv::Environment;
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
    pub list: RayList,
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
            Self::Trace(StreamSpec { query: Query::Any, counts: false, .. }) => Purpose::Any,
            Self::Trace(StreamSpec { query: Query::Any, counts: true, .. }) => Purpose::AnyCounted,
            // Several hits are refused where rays are loaded.
            Self::Trace(StreamSpec { counts: false, .. }) => Purpose::Closest,
            Self::Trace(StreamSpec { counts: true, .. }) => Purpose::ClosestCounted,
            Self::Reduced(_, purpose) => purpose,
        }
    }
}

/// Where the hits and counts of a launch or walk go, by their place; either is empty where it is not wanted.
#[derive(Debug)]
pub(crate) struct Answers<'a> {
    pub hits: &'a mut [Hit],
    pub counts: &'a mut [TestCounts],
}

/// What is worth knowing of a part beside its answers.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Finished {
    /// Items that the host traced.
    pub on_host: usize,
    pub in_kernel: Duration,
    /// Those of them whose hit, by the kernel, is none.
    pub refused: usize,
    /// The first of these: the ray, and the slot of the leaf order.
    pub first_refused: Option<(u32, u32)>,
}

/// The answer for one item.
struct Given {
    hit: Hit,
    counts: TestCounts,
    /// Whether the host traced it.
    on_host: bool,
    /// The slot that the kernel named though its triangle is not hit.
    refused: Option<u32>,
}

/// Items that one thread finishes before it looks for more: some 50 µs of work.
const CHUNK: usize = 512;

/// Some items of a part, and the answers from the first one's place on.
struct Chunk<'a> {
    item: u32,
    place: u32,
    answers: Answers<'a>,
}

/// Cuts the answers into one part for each [`CHUNK`] of items. The places of a part rise with its items.
fn chunks<'a>(list: &RayList, answers: &'a mut Answers<'_>) -> Vec<Chunk<'a>> {
    let mut items: Vec<(u32, u32)> = (0..list.items())
        .step_by(CHUNK)
        .filter_map(|item| list.from(item).next().map(|(_, place)| (item, place)))
        .collect();
    // From the last one on, so that each takes what is behind its place.
    let (mut hits, mut counts) = (&mut *answers.hits, &mut *answers.counts);
    let mut chunks = Vec::with_capacity(items.len());
    while let Some((item, place)) = items.pop() {
        let answers = Answers { hits: cut(&mut hits, place), counts: cut(&mut counts, place) };
        chunks.push(Chunk { item, place, answers });
    }
    chunks.reverse();
    chunks
}

/// Takes what is at `place` and behind it off a slice.
fn cut<'a, T>(rest: &mut &'a mut [T], place: u32) -> &'a mut [T] {
    let slice = std::mem::take(rest);
    let (front, back) = slice.split_at_mut(slice.len().min(place as usize));
    *rest = front;
    back
}

/// Writes the answers to a part: computes t, u and v of what was hit, and traces what is in doubt.
pub(crate) fn finish(
    scene: &GpuScene,
    source: &RaySource,
    how: How,
    list: &RayList,
    answer: &Answer<'_>,
    answers: &mut Answers<'_>,
) -> Finished {
    let io = KernelIo::new(scene.given());
    let one = |stack: &mut Stack, item: usize, ray: u32| {
        let counts = answer.counts.get(item).copied().unwrap_or_default();
        let believed = |hit| Given { hit, counts, on_host: false, refused: None };
        let mut traced = |refused| {
            let (hit, counts) = on_host(scene, stack, how, source.ray(ray));
            Given { hit, counts, on_host: true, refused }
        };
        match answer.found[item] {
            DOUBTFUL => traced(None),
            MISS => believed(Hit::MISS),
            slot => match scene.finish(&io, &source.ray(ray).0, slot) {
                Some(hit) => believed(hit),
                None => traced(Some(slot)),
            },
        }
    };
    let parts: Vec<Finished> = chunks(list, answers)
        .into_par_iter()
        .map_init(
            || (Environment::enter(), Stack::for_scene(scene.given())),
            |(_, stack), Chunk { item, place: first, answers }| {
                let mut part = Finished::default();
                for (item, (ray, place)) in (item as usize..).zip(list.from(item)).take(CHUNK) {
                    let place = (place - first) as usize;
                    let given = one(stack, item, ray);
                    answers.hits.get_mut(place).into_iter().for_each(|out| *out = given.hit);
                    answers.counts.get_mut(place).into_iter().for_each(|out| *out = given.counts);
                    part.on_host += usize::from(given.on_host);
                    part.refused += usize::from(given.refused.is_some());
                    part.first_refused = part.first_refused.or(given.refused.map(|slot| (ray, slot)));
                }
                part
            },
        )
        .collect();
    Finished {
        on_host: parts.iter().map(|part| part.on_host).sum(),
        in_kernel: answer.in_kernel.unwrap_or_default(),
        refused: parts.iter().map(|part| part.refused).sum(),
        first_refused: parts.iter().find_map(|part| part.first_refused),
    }
}

fn on_host(scene: &GpuScene, stack: &mut Stack, how: How, ray: (rt_core::Ray, u32)) -> (Hit, TestCounts) {
    match how {
        How::Trace(spec) => scene.trace(stack, spec, ray),
        How::Reduced(kind, _) => (Hit::MISS, scene.count(stack, Walk::Reduced(kind), Precision::default(), ray)),
    }
}
