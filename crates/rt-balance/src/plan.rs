//! Turns an estimate into a queue.

use crate::device_state::{DeviceState, all_lost};
use crate::estimate::Estimated;
use crate::models::{Key, models_for};
use crate::{BalanceError, Scheduling, Stream};
use rt_core::{CostModel, RayMask, TaskId, Work};
use rt_sched::queue::{Dealt, TaskQueue};
use std::sync::Arc;

/// Who may trace what, before anything runs.
#[derive(Debug)]
pub(crate) struct Plan {
    /// Positions of the devices that are ready among all members, increasing: the queue's device 0 is `workers[0]`.
    pub(crate) workers: Vec<usize>,
    /// The cost model of each worker.
    pub(crate) models: Vec<CostModel>,
    /// Work that is left of each task, without the rays whose hits are known.
    pub(crate) left: Vec<Work>,
    /// Rays whose hits are known.
    pub(crate) kept: Option<Arc<RayMask>>,
    pub(crate) queue: Box<dyn TaskQueue>,
    pub(crate) queue_name: &'static str,
}

impl Plan {
    /// Predicted seconds of a task on a worker, without the launch.
    pub(crate) fn seconds(&self, worker: usize, task: TaskId) -> f64 {
        self.models[worker].seconds(&self.left[task as usize])
    }
}

pub(crate) fn plan_of(
    members: &[DeviceState],
    stream: &Stream,
    scheduling: &Scheduling,
    estimated: &Estimated,
) -> Result<Plan, BalanceError> {
    let workers: Vec<usize> = (0..members.len()).filter(|&i| members[i].is_ready()).collect();
    if workers.is_empty() {
        return Err(all_lost(members, stream.tasks.len()));
    }
    let left = left_of(stream, estimated);
    let models = models_for(members, &workers, Key::of(&*scheduling.estimator, stream), &left);
    let (maker, policy) = (&*scheduling.queue, scheduling.policy()?);
    let schedule = maker.deal(policy, &left, &models).ok_or_else(|| BalanceError::Policy {
        policy: policy.name(),
        mistake: "it deals other tasks than it was given, or to other devices".to_owned(),
    })?;
    let queue = maker.make(Dealt { schedule: &schedule, work: &left, devices: &models });
    Ok(Plan { workers, models, left, kept: estimated.kept.clone(), queue, queue_name: maker.name() })
}

/// The estimated work without the rays whose hits were kept: a task's sampled rays are taken to be like its others.
fn left_of(stream: &Stream, estimated: &Estimated) -> Vec<Work> {
    let Some(mask) = &estimated.kept else { return estimated.work.clone() };
    let left = |(task, work): (&rt_core::Task, &Work)| {
        let kept = mask.count_in(task.range()) as f32;
        work.part(1.0 - kept / (task.rays.max(1) as f32))
    };
    stream.tasks.iter().zip(&estimated.work).map(left).collect()
}
