//! Estimates put to the test of measured seconds.

use super::ARMS;
use crate::calibrate::cross_predicted;
use crate::metrics::EstimateErrors;
use crate::sample::Fraction;
use alloc::vec;
use alloc::vec::Vec;
use rt_core::{LaunchRecord, Observation, RayStream, Task, TaskId, TaskOutcome, TestCounts, Work, random};

/// Some of a stream's tasks: enough of them to tell which estimate is better.
#[derive(Clone, Debug)]
pub(super) struct Part {
    ids: Vec<TaskId>,
    pub(super) tasks: Vec<Task>,
}

/// Tasks of a part come in runs of so many, a square of the picture, in which a map is as dense as in all of it.
const RUN: usize = 16;

/// Of so many runs, one is chosen.
const ONE_IN: usize = 4;

/// Streams with fewer tasks are tried as a whole: a quarter of them would say little.
const LEAST_TASKS: usize = 128;

/// Keeps the choice of runs apart from that of samples.
const DIMENSION: u32 = 0x10_0c0a;

impl Part {
    /// The part of a stream that is tried by `fraction` of its rays: all of it where only whole launches are timed, and
    /// where tasks are smaller than a sample.
    pub(super) fn of(stream: RayStream<'_>, fraction: Fraction, per_task: bool) -> Self {
        let smallest = stream.tasks.iter().map(|task| task.rays).min().unwrap_or(0);
        let some = per_task && stream.tasks.len() >= LEAST_TASKS && f64::from(smallest) * fraction.value() >= 1.0;
        let first = random::below(ONE_IN as u32, stream.seed, stream.wave, DIMENSION) as usize;
        let chosen = |at: &usize| !some || (at / RUN) % ONE_IN == first;
        let of = |at: usize| Some((TaskId::try_from(at).ok()?, *stream.tasks.get(at)?));
        let (ids, tasks) = (0..stream.tasks.len()).filter(chosen).filter_map(of).unzip();
        Self { ids, tasks }
    }

    /// Its share of the stream's rays.
    pub(super) fn share_of(&self, stream: RayStream<'_>) -> f64 {
        let own: f64 = self.tasks.iter().map(|task| f64::from(task.rays)).sum();
        own / f64::from(stream.rays().max(1))
    }

    pub(super) fn is_less_than(&self, stream: RayStream<'_>) -> bool {
        self.tasks.len() < stream.tasks.len()
    }

    /// Those of a stream's samples that are its tasks'.
    pub(super) fn of_samples(&self, seen: Observation<'_>) -> (Vec<u32>, Vec<TestCounts>) {
        let mut tasks = self.tasks.iter().peekable();
        let own = |(ray, _): &(u32, TestCounts)| {
            while tasks.next_if(|task| task.range().end <= *ray).is_some() {}
            tasks.peek().is_some_and(|task| task.first <= *ray)
        };
        seen.rays.iter().copied().zip(seen.counts.iter().copied()).filter(own).unzip()
    }

    /// An estimate of its tasks as one of all tasks, of which others are nothing; one of all tasks as it is.
    pub(super) fn spread(&self, work: Vec<Work>, stream: RayStream<'_>) -> Vec<Work> {
        if work.len() == stream.tasks.len() {
            return work;
        }
        let mut all = vec![Work::default(); stream.tasks.len()];
        for (&id, work) in self.ids.iter().zip(work) {
            all[id as usize] = work;
        }
        all
    }
}

/// What each arm says of a stream, and what was measured.
#[derive(Clone, Debug, Default)]
pub(super) struct Trial {
    pub(super) says: [Option<Vec<Work>>; ARMS.len()],
    /// What is tried; `None`: nothing.
    pub(super) part: Option<Part>,
    measured: Vec<Measured>,
}

/// A task, or a whole launch where only that was timed.
#[derive(Clone, Debug)]
struct Measured {
    device: usize,
    tasks: Vec<TaskId>,
    seconds: f64,
}

impl Trial {
    /// Takes down a launch.
    pub(super) fn measure(&mut self, launch: &LaunchRecord<'_>) {
        let Some(part) = &self.part else { return };
        let device = launch.device;
        // Ids are in increasing order.
        let tried = |o: &&TaskOutcome| part.ids.binary_search(&o.task).is_ok();
        if launch.per_task {
            let one = |o: &TaskOutcome| Measured { device, tasks: [o.task].into(), seconds: o.measured_s };
            self.measured.extend(launch.outcomes.iter().filter(tried).map(one));
        } else if launch.outcomes.iter().all(|o| tried(&o)) {
            let tasks = launch.outcomes.iter().map(|o| o.task).collect();
            let seconds = launch.outcomes.iter().map(|o| o.measured_s).sum();
            self.measured.push(Measured { device, tasks, seconds });
        }
    }

    /// Mean relative error of each arm against what was measured; `None` of those that say nothing.
    pub(super) fn errors(&self) -> [Option<f64>; ARMS.len()] {
        core::array::from_fn(|arm| self.says[arm].as_ref().and_then(|work| mean_error(work, &self.measured)))
    }
}

/// Mean relative error of an estimate against measured seconds, by prices fitted on the other half of what each device
/// traced.
fn mean_error(work: &[Work], measured: &[Measured]) -> Option<f64> {
    let devices = measured.iter().map(|m| m.device + 1).max()?;
    let of = |m: &Measured| -> Work {
        m.tasks.iter().filter_map(|&task| work.get(task as usize)).fold(Work::default(), |sum, own| sum.plus(own))
    };
    let (mut sum, mut weight) = (0.0, 0.0);
    for device in 0..devices {
        let own = || measured.iter().filter(|m| m.device == device);
        let (estimated, truth): (Vec<Work>, Vec<f64>) = own().map(|m| (of(m), m.seconds)).unzip();
        // The scale is fitted to the same tasks: with one there is no error left.
        let errors = EstimateErrors::new(&cross_predicted(&estimated, &truth), &truth);
        if let Some(errors) = errors.filter(|errors| errors.tasks > 1) {
            sum += errors.mean_relative * errors.tasks as f64;
            weight += errors.tasks as f64;
        }
    }
    (weight > 0.0).then(|| sum / weight)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::{Coherence, StreamKind, tasks_of};

    /// Mutants: no early return, which would give the part's tasks the estimates of the stream's first ones; one
    /// always, which would take the part's estimates for the first tasks'.
    #[test]
    fn an_estimate_of_a_part_is_its_tasks_and_one_of_all_stays() {
        let tasks = tasks_of(256 * 1_024, 1_024);
        let kind = StreamKind::Diffuse(0);
        let stream = RayStream {
            kind,
            coherence: Coherence::Unknown,
            tasks: &tasks,
            seed: 3,
            wave: 0,
            source: None,
            devices: 2,
            uninformed_excess: 1.0,
        };
        let part = Part::of(stream, Fraction::new(1.0 / 64.0).expect("valid"), true);
        assert!(part.is_less_than(stream) && !part.ids.is_empty());
        let cost = |task: TaskId| Work::new(1.0, task as f32 + 1.0, 0.0);
        let all: Vec<Work> = (0..256).map(cost).collect();
        assert_eq!(part.spread(all.clone(), stream), all);
        let spread = part.spread(part.ids.iter().copied().map(cost).collect(), stream);
        let expected = |id: TaskId| if part.ids.contains(&id) { cost(id) } else { Work::default() };
        assert_eq!(spread, (0..256).map(expected).collect::<Vec<_>>());
    }
}
