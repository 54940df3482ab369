//! Asks an estimator what a stream's tasks will cost, and the devices what it wants to know.

use crate::device_state::{DeviceState, cancelled};
use crate::limits::Limits;
use crate::output::Output;
use crate::record::WalkDone;
use crate::walk::{Found, walk_on_all};
use crate::{BalanceError, Control, Stream, clock};
use rt_core::{CostEstimator, Observation, RayMask, RayStream, Step, Walk, Work};
use std::ops::Range;
use std::sync::Arc;

/// What the tasks of a stream are expected to cost.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Expected work of each task.
    pub work: Vec<Work>,
    /// For each device, in the order they were given: predicted seconds of each task there, without the launch and
    /// without rays that were walked for the estimate. `None` for a device that does not take part.
    pub predicted_s: Vec<Option<Vec<f64>>>,
    /// Share of the rays that was walked, without a unit.
    pub fraction: f64,
    /// Wall seconds that it took.
    pub seconds: f64,
}

/// What the estimation phase found.
#[derive(Debug)]
pub(crate) struct Estimated {
    /// Expected work of each task, all its rays.
    pub(crate) work: Vec<Work>,
    /// Rays whose hits are known already.
    pub(crate) kept: Option<Arc<RayMask>>,
    /// Who found those hits.
    pub(crate) finders: Vec<Finders>,
    /// Rays walked, over all steps.
    pub(crate) walked: u64,
    pub(crate) walks: Vec<WalkDone>,
    /// What was expected to be lost without it.
    pub(crate) uninformed_excess: f64,
    /// Whether the queue moves tasks when it turns out what they cost.
    pub(crate) moves: bool,
    /// Wall seconds that it took.
    pub(crate) seconds: f64,
}

/// Rays that were walked in full, and by which devices.
#[derive(Debug)]
pub(crate) struct Finders {
    rays: Arc<Vec<u32>>,
    by: Vec<(Range<usize>, usize)>,
}

impl Finders {
    /// The rays that a device has walked.
    pub(crate) fn rays_of(&self, member: usize) -> impl Iterator<Item = u32> {
        let own = self.by.iter().filter(move |(_, by)| *by == member);
        own.flat_map(|(range, _)| self.rays[range.clone()].iter().copied())
    }
}

/// Runs the estimator until it is done. Hits of full walks go to `output`.
///
/// # Errors
/// When the caller cancels, the estimator asks or answers what makes no sense, or nobody can walk.
pub(crate) fn estimate(
    members: &mut [DeviceState],
    stream: &Stream,
    estimator: &mut dyn CostEstimator,
    (uninformed_excess, moves): (f64, bool),
    output: &mut Output<'_>,
    limits: &Limits,
    control: Control<'_>,
) -> Result<Estimated, BalanceError> {
    let mut kept: Option<RayMask> = None;
    let (mut walks, mut finders) = (Vec::new(), Vec::new());
    let mut walked = 0;
    let (mut rays, mut counts) = (Arc::new(Vec::new()), Vec::new());
    let devices = members.iter().filter(|member| member.is_ready()).count();
    let walk = estimator.walk().unwrap_or(Walk::Full);
    let has_walks = members.iter().any(|member| member.is_ready() && member.info.capabilities.has_walk(walk));
    let view = RayStream { has_walks, ..stream.view(devices, uninformed_excess, moves) };
    let begin = clock::now();
    loop {
        if control.is_cancelled() {
            return Err(cancelled());
        }
        match estimator.next(view, Observation { rays: &rays, counts: &counts }) {
            Step::Done(work) => {
                check_work(estimator, stream, &work)?;
                let seconds = clock::now().saturating_sub(begin).as_secs_f64();
                let kept = kept.map(Arc::new);
                return Ok(Estimated { work, kept, finders, walked, walks, uninformed_excess, moves, seconds });
            }
            Step::Sample { rays: wanted, walk } => {
                check_sample(estimator, stream, &wanted)?;
                rays = Arc::new(wanted);
                let found = walk_on_all(members, &rays, walk, limits, control)?;
                walked += rays.len() as u64;
                // A walk brings one hit of a ray at most.
                if walk == Walk::Full && stream.spec.query.hits_per_ray() == 1 {
                    keep(kept.get_or_insert_with(|| RayMask::new(stream.source.len())), &rays, &found, output);
                    finders.push(Finders { rays: Arc::clone(&rays), by: found.by });
                }
                walks.extend(found.walks);
                counts = found.counts;
            }
        }
    }
}

/// Keeps the hits of rays that were walked in full.
fn keep(mask: &mut RayMask, rays: &[u32], found: &Found, output: &mut Output<'_>) {
    for ((&ray, &hit), &count) in rays.iter().zip(&found.hits).zip(&found.counts) {
        mask.insert(ray);
        output.set(ray, hit, count);
    }
}

/// Has the rays whose hits are not believed walked by others.
///
/// # Errors
/// When the caller cancels, or there are no others.
pub(crate) fn find_again(
    members: &mut [DeviceState],
    finders: &[Finders],
    liars: &[usize],
    output: &mut Output<'_>,
    limits: &Limits,
    control: Control<'_>,
) -> Result<Vec<WalkDone>, BalanceError> {
    let rays = finders.iter().flat_map(|finders| liars.iter().flat_map(|&liar| finders.rays_of(liar)));
    let rays: Arc<Vec<u32>> = Arc::new(rays.collect());
    if rays.is_empty() {
        return Ok(Vec::new());
    }
    let found = walk_on_all(members, &rays, Walk::Full, limits, control)?;
    for ((&ray, &hit), &count) in rays.iter().zip(&found.hits).zip(&found.counts) {
        output.set(ray, hit, count);
    }
    Ok(found.walks)
}

/// Refuses rays that the stream does not have, before a device sees them.
fn check_sample(estimator: &dyn CostEstimator, stream: &Stream, wanted: &[u32]) -> Result<(), BalanceError> {
    let rays = stream.source.len();
    match wanted.iter().find(|&&ray| ray >= rays) {
        None => Ok(()),
        Some(ray) => Err(BalanceError::Estimator {
            estimator: estimator.name(),
            mistake: format!("it asks for ray {ray}, but the stream has {rays} rays: name rays below that"),
        }),
    }
}

/// Refuses an answer that is not one entry for each task.
fn check_work(estimator: &dyn CostEstimator, stream: &Stream, work: &[Work]) -> Result<(), BalanceError> {
    let (found, tasks) = (work.len(), stream.tasks.len());
    if found == tasks {
        return Ok(());
    }
    let mistake = format!("it estimates {found} tasks, but the stream has {tasks}: give one entry for each, in order");
    Err(BalanceError::Estimator { estimator: estimator.name(), mistake })
}
