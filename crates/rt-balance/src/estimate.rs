//! Walks an estimator's samples on all devices in parallel.

use crate::member::{Member, Outputs, all_lost};
use crate::record::WalkDone;
use crate::{BalanceError, Stream, clock};
use rt_core::{CostEstimator, DeviceError, DeviceErrorKind, Hit, Observation, RayMask, Step, TestCounts, Walk, Work};
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

/// Fewest samples worth a call to a device: below it the hand-over (some 10 µs) costs more than the rays.
const LEAST_CHUNK: usize = 256;

/// Chunks per device when there are enough samples: fine enough that devices of different speed end together.
const CHUNKS_PER_DEVICE: usize = 6;

/// What the estimation phase found.
#[derive(Debug)]
pub(crate) struct Estimated {
    /// Expected work of each task, all its rays.
    pub(crate) work: Vec<Work>,
    /// Rays whose hits are known already.
    pub(crate) kept: Option<Arc<RayMask>>,
    /// Rays walked, over all steps.
    pub(crate) walked: u64,
    pub(crate) walks: Vec<WalkDone>,
    /// What was expected to be lost without it.
    pub(crate) blind_excess: f64,
    /// Wall seconds that it took.
    pub(crate) seconds: f64,
}

/// Runs the estimator until it is done. Hits of full walks go to `outputs`.
pub(crate) fn estimate(
    members: &mut [Member],
    stream: &Stream,
    estimator: &mut dyn CostEstimator,
    blind_excess: f64,
    outputs: &Mutex<Outputs<'_>>,
) -> Result<Estimated, BalanceError> {
    let mut kept: Option<RayMask> = None;
    let mut walks = Vec::new();
    let mut walked = 0;
    let (mut rays, mut counts) = (Vec::new(), Vec::new());
    let devices = members.iter().filter(|member| member.tracer.is_some()).count();
    let begin = clock::now();
    loop {
        match estimator.next(stream.view(devices, blind_excess), Observation { rays: &rays, counts: &counts }) {
            Step::Done(work) => {
                debug_assert_eq!(work.len(), stream.tasks.len(), "one entry for each task");
                let seconds = clock::now().saturating_sub(begin).as_secs_f64();
                return Ok(Estimated { work, kept: kept.map(Arc::new), walked, walks, blind_excess, seconds });
            }
            Step::Sample { rays: wanted, walk } => {
                let mut hits = vec![Hit::MISS; if walk == Walk::Full { wanted.len() } else { 0 }];
                counts = vec![TestCounts::default(); wanted.len()];
                walk_on_all(members, &wanted, walk, &mut counts, &mut hits, &mut walks)
                    .map_err(|unwalked| unwalked.error(members, stream.tasks.len()))?;
                walked += wanted.len() as u64;
                if walk == Walk::Full {
                    let mask = kept.get_or_insert_with(|| RayMask::new(stream.source.len()));
                    let mut out = outputs.lock().unwrap_or_else(PoisonError::into_inner);
                    for ((&ray, &hit), &count) in wanted.iter().zip(&hits).zip(&counts) {
                        mask.insert(ray);
                        out.hits[ray as usize] = hit;
                        if let Some(slot) = out.counts.as_mut().and_then(|c| c.get_mut(ray as usize)) {
                            *slot = count;
                        }
                    }
                }
                rays = wanted;
            }
        }
    }
}

/// Some samples were walked by no device: all failed, or those left have no such walk, as the last one says.
#[derive(Debug)]
struct Unwalked(Option<(usize, DeviceError)>);

impl Unwalked {
    fn error(self, members: &[Member], tasks: usize) -> BalanceError {
        match self.0 {
            Some((index, source)) => BalanceError::Refused { device: members[index].info.name.clone(), source },
            None => all_lost(members, tasks),
        }
    }
}

/// What one device brings back from its share of the samples.
#[derive(Default)]
struct Share {
    parts: Vec<(Range<usize>, Vec<TestCounts>, Vec<Hit>)>,
    walks: Vec<WalkDone>,
    error: Option<DeviceError>,
}

fn walk_on_all(
    members: &mut [Member],
    rays: &[u32],
    walk: Walk,
    counts: &mut [TestCounts],
    hits: &mut [Hit],
    walks: &mut Vec<WalkDone>,
) -> Result<(), Unwalked> {
    let chunk = (rays.len() / (members.len() * CHUNKS_PER_DEVICE)).max(LEAST_CHUNK);
    let open: Mutex<Vec<Range<usize>>> =
        Mutex::new((0..rays.len()).step_by(chunk).map(|at| at..rays.len().min(at + chunk)).rev().collect());
    // A failed device's chunk goes back to `open`, but the others may have left by then: go round until none is open.
    let mut unable: Vec<(usize, DeviceError)> = Vec::new();
    loop {
        let shares: Vec<(usize, Share)> = std::thread::scope(|scope| {
            let living = members
                .iter_mut()
                .enumerate()
                .filter(|(index, member)| member.tracer.is_some() && unable.iter().all(|(unable, _)| unable != index));
            let threads: Vec<_> = living
                .map(|(index, member)| {
                    let open = &open;
                    (index, scope.spawn(move || walk_share(index, member, rays, walk, open)))
                })
                .collect();
            threads.into_iter().filter_map(|(index, thread)| Some((index, thread.join().ok()?))).collect()
        });
        for (index, share) in shares {
            for (range, part_counts, part_hits) in share.parts {
                counts[range.clone()].copy_from_slice(&part_counts);
                if !hits.is_empty() {
                    hits[range].copy_from_slice(&part_hits);
                }
            }
            walks.extend(share.walks);
            match share.error {
                // It has no such walk, and is as it was: the others walk.
                Some(error) if error.kind() == DeviceErrorKind::Unsupported => unable.push((index, error)),
                Some(error) => members[index].fail(&error),
                None => {}
            }
        }
        if open.lock().unwrap_or_else(PoisonError::into_inner).is_empty() {
            return Ok(());
        }
        let able = |(index, member): (usize, &Member)| {
            member.tracer.is_some() && unable.iter().all(|(unable, _)| *unable != index)
        };
        if !members.iter().enumerate().any(able) {
            return Err(Unwalked(unable.pop()));
        }
    }
}

/// Takes chunks until none is left or the device fails.
fn walk_share(index: usize, member: &mut Member, rays: &[u32], walk: Walk, open: &Mutex<Vec<Range<usize>>>) -> Share {
    let mut share = Share::default();
    let Some(tracer) = &mut member.tracer else { return share };
    let next = || open.lock().unwrap_or_else(PoisonError::into_inner).pop();
    while let Some(range) = next() {
        let chosen = &rays[range.clone()];
        let mut counts = vec![TestCounts::default(); chosen.len()];
        let mut hits = vec![Hit::MISS; if walk == Walk::Full { chosen.len() } else { 0 }];
        let wanted_hits = (walk == Walk::Full).then_some(&mut hits[..]);
        match tracer.walk(chosen, walk, &mut counts, wanted_hits) {
            Ok(span) => {
                share.walks.push(WalkDone {
                    member: index,
                    span,
                    rays: chosen.len() as u32,
                    boxes: counts.iter().map(|c| u64::from(c.boxes)).sum(),
                    triangles: counts.iter().map(|c| u64::from(c.triangles)).sum(),
                });
                share.parts.push((range, counts, hits));
            }
            Err(error) => {
                open.lock().unwrap_or_else(PoisonError::into_inner).push(range);
                share.error = Some(error);
                break;
            }
        }
    }
    share
}
