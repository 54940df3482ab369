//! Costs from what was measured before.

use super::Sampled;
use alloc::boxed::Box;
use alloc::vec::Vec;
use rt_core::{
    CostEstimator, CountsToken, LaunchRecord, Observation, RayStream, Step, StreamKind, StreamRecord, Task,
    TaskOutcome, Walk, Work,
};

/// Predicts a stream from the last one of its kind and wave, corrected by how long its tasks really took.
///
/// Each task's tests are multiplied by measured over predicted seconds, as Blender Cycles' `work_balancer` corrects its
/// devices' shares from frame to frame, but per task: against what the same device did in the mean, so that a device
/// that was slow does not make its tasks expensive. When tasks were cut differently, the old costs per ray are read
/// at the same relative positions of the stream. A kind that was never traced is left to another estimator.
#[derive(Debug)]
pub struct History {
    inner: Box<dyn CostEstimator>,
    pasts: Pasts,
}

/// Largest correction of a task from one stream to the next, without a unit. A single launch that was disturbed, say
/// by a page fault or another program, must not spoil the next frame; real changes get through in a few.
const LARGEST_CORRECTION: f64 = 4.0;

/// The same of tasks of which nothing was known: real pictures have some of twenty times the mean.
const LARGEST_DISCOVERY: f64 = 64.0;

/// Fewest measured tasks that say how far predictions are off.
const LEAST_OUTCOMES: f64 = 8.0;

/// The last stream of each kind and wave.
#[derive(Debug, Default)]
pub(super) struct Pasts {
    all: Vec<Past>,
}

/// What the past says of a stream.
#[derive(Debug)]
pub(super) struct Recalled {
    pub(super) work: Vec<Work>,
    /// What its counts have in common with those that it began with.
    pub(super) counts: CountsToken,
}

/// A traced stream.
#[derive(Debug)]
struct Past {
    kind: StreamKind,
    wave: u32,
    rays: Vec<u32>,
    work: Vec<Work>,
    counts: CountsToken,
    /// What was measured of it so far, and where.
    outcomes: Vec<(usize, TaskOutcome)>,
    misses: Misses,
}

impl Pasts {
    fn of(&self, stream: RayStream<'_>) -> Option<usize> {
        self.all.iter().position(|past| (past.kind, past.wave) == (stream.kind, stream.wave))
    }

    /// What the past says of a stream; `None` where it has not seen its kind and wave.
    ///
    /// The standard error of a task is how far the last stream's prediction was off, relative to it, over all tasks.
    pub(super) fn recall(&self, stream: RayStream<'_>) -> Option<Recalled> {
        let past = &self.all[self.of(stream)?];
        let work = past.seen_by(stream.tasks).into_iter();
        let off = past.misses.typical().map_or(f32::NAN, |off| off as f32);
        Some(Recalled { work: work.map(|w| w.with_std_error(off * w.tests())).collect(), counts: past.counts })
    }

    /// Keeps the estimate that a stream is scheduled by, to be corrected by what is measured. A stream without tasks
    /// tells nothing of the next one.
    pub(super) fn remember(&mut self, stream: RayStream<'_>, work: &[Work], counts: CountsToken) {
        if stream.tasks.is_empty() {
            return;
        }
        let rays = stream.tasks.iter().map(|t| t.rays).collect();
        let (kind, wave, work) = (stream.kind, stream.wave, work.to_vec());
        let new = Past { kind, wave, rays, work, counts, outcomes: Vec::new(), misses: Misses::default() };
        match self.of(stream) {
            Some(old) => self.all[old] = new,
            None => self.all.push(new),
        }
    }

    pub(super) fn learn(&mut self, launch: &LaunchRecord<'_>) {
        let Some(past) = self.of(launch.stream) else { return };
        self.all[past].outcomes.extend(launch.outcomes.iter().map(|outcome| (launch.device, *outcome)));
    }

    /// Corrects the past of a stream, of which all is known now.
    pub(super) fn finish(&mut self, stream: RayStream<'_>) {
        if let Some(past) = self.of(stream) {
            self.all[past].correct();
        }
    }
}

impl History {
    /// History that asks `inner` about streams of a kind that it has not seen.
    #[must_use]
    pub fn new(inner: Box<dyn CostEstimator>) -> Self {
        Self { inner, pasts: Pasts::default() }
    }
}

impl Default for History {
    /// History that begins with the default sample of exact counts.
    fn default() -> Self {
        Self::new(Box::new(Sampled::default()))
    }
}

impl CostEstimator for History {
    fn name(&self) -> &'static str {
        "history"
    }

    fn counts(&self) -> CountsToken {
        self.inner.counts()
    }

    fn walk(&self) -> Option<Walk> {
        self.inner.walk()
    }

    fn next(&mut self, stream: RayStream<'_>, seen: Observation<'_>) -> Step {
        let step = match self.pasts.recall(stream) {
            Some(recalled) => Step::Done(recalled.work),
            None => self.inner.next(stream, seen),
        };
        if let Step::Done(work) = &step {
            self.pasts.remember(stream, work, self.inner.counts());
        }
        step
    }

    fn learn(&mut self, launch: &LaunchRecord<'_>) {
        self.inner.learn(launch);
        self.pasts.learn(launch);
    }

    fn finish(&mut self, record: &StreamRecord<'_>) {
        self.pasts.finish(record.stream);
        self.inner.finish(record);
    }
}

/// How far tasks' measured seconds lay from what was predicted, as relative errors.
#[derive(Clone, Copy, Debug, Default)]
struct Misses {
    squares: f64,
    count: f64,
}

impl Misses {
    fn add(&mut self, factor: f64) {
        let off = factor.clamp(1.0 / LARGEST_CORRECTION, LARGEST_CORRECTION) - 1.0;
        (self.squares, self.count) = (self.squares + off * off, self.count + 1.0);
    }

    /// Their root mean square; `None` of too few to say.
    fn typical(&self) -> Option<f64> {
        (self.count >= LEAST_OUTCOMES).then(|| libm::sqrt(self.squares / self.count))
    }
}

/// Measured over predicted seconds; `None` unless both were positive numbers.
fn factor(outcome: &TaskOutcome) -> Option<f64> {
    let factor = outcome.measured_s / outcome.predicted_s;
    (factor.is_finite() && factor > 0.0).then_some(factor)
}

/// The factor below which half of the predicted seconds lie: one that a few disturbed tasks do not change.
fn typical(outcomes: &[(usize, TaskOutcome)]) -> f64 {
    let mut factors: Vec<(f64, f64)> = outcomes.iter().filter_map(|(_, o)| Some((factor(o)?, o.predicted_s))).collect();
    factors.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let half = factors.iter().map(|(_, seconds)| seconds).sum::<f64>() / 2.0;
    let mut sum = 0.0;
    let at_half = factors.iter().find(|(_, seconds)| {
        sum += seconds;
        sum >= half
    });
    at_half.map_or(1.0, |(factor, _)| *factor)
}

impl Past {
    /// Corrects the work by what was measured. All together stays what it was: what a test takes is told by prices.
    fn correct(&mut self) {
        // Where nothing was known of tasks, that they differ is no miss.
        let alike = self.work.windows(2).filter(|pair| pair[0] == pair[1]).count();
        let knew = 2 * alike <= self.work.len();
        let largest = if knew { LARGEST_CORRECTION } else { LARGEST_DISCOVERY };
        let tests = |work: &[Work]| work.iter().map(|work| f64::from(work.tests())).sum::<f64>();
        let before = tests(&self.work);
        self.outcomes.sort_by_key(|(device, _)| *device);
        for own in self.outcomes.chunk_by(|(a, _), (b, _)| a == b) {
            let typical = typical(own);
            for (_, outcome) in own {
                let (Some(work), Some(factor)) = (self.work.get_mut(outcome.task as usize), factor(outcome)) else {
                    continue;
                };
                let factor = factor / typical;
                if knew {
                    self.misses.add(factor);
                }
                *work = work.scaled(factor.clamp(1.0 / largest, largest) as f32);
            }
        }
        let scale = before / tests(&self.work);
        if !self.outcomes.is_empty() && scale.is_finite() && scale > 0.0 {
            self.work.iter_mut().for_each(|work| *work = work.scaled(scale as f32));
        }
        self.outcomes = Vec::new();
    }

    /// The old costs as those of `tasks`.
    fn seen_by(&self, tasks: &[Task]) -> Vec<Work> {
        if self.rays.iter().eq(tasks.iter().map(|t| &t.rays)) {
            return self.work.clone();
        }
        let old_rays: f64 = self.rays.iter().copied().map(f64::from).sum();
        let new_rays: f64 = tasks.iter().map(|t| f64::from(t.rays)).sum();
        // Old rays that one new ray stands for.
        let ratio = if new_rays > 0.0 { old_rays / new_rays } else { 0.0 };
        let mut old = self.rays.iter().zip(&self.work).filter(|(rays, _)| **rays > 0);
        let mut left = 0.0;
        // Of each of `Work::parts`.
        let mut density = [0.0; 4];
        let resample = |task: &Task| {
            let mut sum = [0.0; 4];
            let mut wanted = f64::from(task.rays) * ratio;
            while wanted > 0.0 {
                if left <= 0.0 {
                    let Some((&rays, work)) = old.next() else { break };
                    left = f64::from(rays);
                    density = work.parts().map(|part| part / left);
                }
                let part = wanted.min(left);
                sum = core::array::from_fn(|i| sum[i] + density[i] * part);
                wanted -= part;
                left -= part;
            }
            let parts = sum.map(|part| if ratio > 0.0 { (part / ratio) as f32 } else { 0.0 });
            let [rays, boxes, triangles, divergence] = parts;
            Work::new(rays, boxes, triangles).with_divergence(divergence)
        };
        tasks.iter().map(resample).collect()
    }
}
