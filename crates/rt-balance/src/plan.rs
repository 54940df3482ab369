//! Turns an estimate into a queue.

use crate::estimate::Estimated;
use crate::member::{Member, all_lost};
use crate::models::{Key, models_for};
use crate::{BalanceError, QueueKind, Scheduling, Stream};
use rt_core::{CostModel, RayMask, TaskId, Work};
use rt_sched::Schedule;
use rt_sched::policy::Policy;
use rt_sched::queue::{CentralQueue, HybridQueue, StaticQueue, TaskQueue};
use std::sync::Arc;

/// Who may trace what, before anything runs.
#[derive(Debug)]
pub(crate) struct Plan {
    /// Positions of the devices that are ready among all members, increasing: the queue's device 0 is `lanes[0]`.
    pub(crate) lanes: Vec<usize>,
    /// The cost model of each lane.
    pub(crate) models: Vec<CostModel>,
    /// Work that is left of each task, without the rays whose hits are known.
    pub(crate) left: Vec<Work>,
    /// Rays whose hits are known.
    pub(crate) kept: Option<Arc<RayMask>>,
    pub(crate) queue: Box<dyn TaskQueue>,
    pub(crate) queue_name: &'static str,
}

impl Plan {
    /// Predicted seconds of a task on a lane, without the launch.
    pub(crate) fn seconds(&self, lane: usize, task: TaskId) -> f64 {
        self.models[lane].seconds(&self.left[task as usize])
    }
}

pub(crate) fn plan_of(
    members: &[Member],
    stream: &Stream,
    scheduling: &Scheduling,
    estimated: &Estimated,
) -> Result<Plan, BalanceError> {
    let lanes: Vec<usize> = (0..members.len()).filter(|&i| members[i].is_ready()).collect();
    if lanes.is_empty() {
        return Err(all_lost(members, stream.tasks.len()));
    }
    let left = left_of(stream, estimated);
    let models = models_for(members, &lanes, Key::of(&*scheduling.estimator, stream.kind), &left);
    let queue: Box<dyn TaskQueue> = match scheduling.queue {
        QueueKind::Central => Box::new(CentralQueue::new(&left, &models)),
        QueueKind::Static => Box::new(StaticQueue::new(&deal(scheduling.policy()?, &left, &models)?)),
        QueueKind::Hybrid => {
            let schedule = deal(scheduling.policy()?, &left, &models)?;
            Box::new(HybridQueue::new(&schedule, &left, &models))
        }
    };
    Ok(Plan { lanes, models, left, kept: estimated.kept.clone(), queue, queue_name: scheduling.queue.name() })
}

/// Has a policy deal the tasks, and sees that it dealt these to these devices.
fn deal(policy: &dyn Policy, work: &[Work], models: &[CostModel]) -> Result<Schedule, BalanceError> {
    let schedule = policy.schedule(work, models);
    let (lists, tasks) = (schedule.lists().len(), schedule.tasks());
    if (lists, tasks) == (models.len(), work.len()) {
        return Ok(schedule);
    }
    let (devices, all) = (models.len(), work.len());
    let mistake = format!("it deals {tasks} tasks to {lists} devices, but there are {all} and {devices}");
    Err(BalanceError::Policy { policy: policy.name(), mistake })
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
