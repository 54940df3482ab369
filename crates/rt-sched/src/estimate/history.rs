//! Costs from what was measured before.

use super::Sampled;
use alloc::boxed::Box;
use alloc::vec::Vec;
use rt_core::{CostEstimator, LaunchRecord, Observation, RayStream, Step, StreamKind, StreamRecord, Task, Walk, Work};

/// Predicts a stream from the last one of its kind and wave, corrected by how long its tasks really took.
///
/// Each task's tests are multiplied by measured over predicted seconds, as Blender Cycles' `work_balancer` corrects its
/// devices' shares from frame to frame, but per task. When tasks were cut differently, the old costs per ray are read
/// at the same relative positions of the stream. A kind that was never traced is left to another estimator.
#[derive(Debug)]
pub struct History {
    inner: Box<dyn CostEstimator>,
    past: Vec<Past>,
}

/// Largest correction of a task from one stream to the next, without a unit. A single launch that was disturbed, say
/// by a page fault or another program, must not spoil the next frame; real changes get through in a few.
const LARGEST_CORRECTION: f64 = 4.0;

/// Fewest measured tasks that say how far predictions are off.
const LEAST_OUTCOMES: f64 = 8.0;

/// A traced stream.
#[derive(Debug)]
struct Past {
    kind: StreamKind,
    wave: u32,
    rays: Vec<u32>,
    work: Vec<Work>,
    misses: Misses,
}

impl History {
    /// History that asks `inner` about streams of a kind that it has not seen.
    #[must_use]
    pub fn new(inner: Box<dyn CostEstimator>) -> Self {
        Self { inner, past: Vec::new() }
    }

    /// What the past says of a stream; `None` where it has not seen its kind and wave.
    ///
    /// The standard error of a task is how far the last stream's prediction was off, relative to it, over all tasks.
    pub(super) fn recall(&self, stream: RayStream<'_>) -> Option<Vec<Work>> {
        let past = self.past.iter().find(|past| (past.kind, past.wave) == (stream.kind, stream.wave))?;
        let work = past.seen_by(stream.tasks).into_iter();
        let off = past.misses.typical();
        Some(work.map(|w| w.with_std_error(off.map_or(f32::NAN, |off| w.tests() * off as f32))).collect())
    }

    /// Keeps the estimate that a stream is scheduled by, to be corrected by what is measured.
    pub(super) fn remember(&mut self, stream: RayStream<'_>, work: &[Work]) {
        let rays = stream.tasks.iter().map(|t| t.rays).collect();
        let new = Past { kind: stream.kind, wave: stream.wave, rays, work: work.to_vec(), misses: Misses::default() };
        match self.past.iter_mut().find(|past| (past.kind, past.wave) == (stream.kind, stream.wave)) {
            Some(old) => *old = new,
            None => self.past.push(new),
        }
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

    fn walk(&self) -> Option<Walk> {
        self.inner.walk()
    }

    fn next(&mut self, stream: RayStream<'_>, seen: Observation<'_>) -> Step {
        let step = match self.recall(stream) {
            Some(work) => Step::Done(work),
            None => self.inner.next(stream, seen),
        };
        if let Step::Done(work) = &step {
            self.remember(stream, work);
        }
        step
    }

    fn learn(&mut self, launch: &LaunchRecord<'_>) {
        self.inner.learn(launch);
        let Some(past) =
            self.past.iter_mut().find(|past| (past.kind, past.wave) == (launch.stream.kind, launch.stream.wave))
        else {
            return;
        };
        for outcome in launch.outcomes {
            let task = outcome.task as usize;
            let (Some(new), Some(old)) = (past.work.get_mut(task), launch.work.get(task)) else { continue };
            let factor = outcome.measured_s / outcome.predicted_s;
            if factor.is_finite() && factor > 0.0 {
                past.misses.add(factor);
                *new = old.scaled(factor.clamp(1.0 / LARGEST_CORRECTION, LARGEST_CORRECTION) as f32);
            }
        }
    }

    fn finish(&mut self, record: &StreamRecord<'_>) {
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

impl Past {
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
        // Of box tests, triangle tests and divergence.
        let mut density = [0.0; 3];
        let resample = |task: &Task| {
            let mut sum = [0.0; 3];
            let mut wanted = f64::from(task.rays) * ratio;
            while wanted > 0.0 {
                if left <= 0.0 {
                    let Some((&rays, work)) = old.next() else { break };
                    left = f64::from(rays);
                    density = [work.boxes(), work.triangles(), work.divergence()].map(|part| f64::from(part) / left);
                }
                let part = wanted.min(left);
                sum = core::array::from_fn(|i| sum[i] + density[i] * part);
                wanted -= part;
                left -= part;
            }
            let [boxes, triangles, divergence] = sum.map(|part| if ratio > 0.0 { (part / ratio) as f32 } else { 0.0 });
            Work::new(task.rays as f32, boxes, triangles).with_divergence(divergence)
        };
        tasks.iter().map(resample).collect()
    }
}
