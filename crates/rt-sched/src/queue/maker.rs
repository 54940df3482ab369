//! What makes a queue for each stream: the seam for a queue of one's own.

use super::pace::does_mend;
use super::{CentralQueue, HybridQueue, StaticQueue, TaskQueue};
use crate::Schedule;
use crate::policy::{Policy, mean_model};
use crate::uninformed::{Regime, central_excess, hybrid_excess, unlike_excess};
use alloc::boxed::Box;
use alloc::vec::Vec;
use core::fmt::Debug;
use rt_core::{CostModel, Work};

/// What a queue needs of a [`Policy`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Needs {
    /// A list of tasks for each device.
    Lists,
    /// One list of all tasks, for whichever device is free.
    Order,
    /// Nothing: no policy has any effect.
    Nothing,
}

/// What a queue is made of.
#[derive(Clone, Copy, Debug)]
pub struct Dealt<'a> {
    /// What the policy says: a list for each device, or one of all tasks, or none, as the queue [`Needs`].
    pub schedule: &'a Schedule,
    /// What is left of each task.
    pub work: &'a [Work],
    /// The price list of each device.
    pub devices: &'a [CostModel],
}

/// Makes the queue of each stream.
pub trait QueueMaker: Debug + Send + Sync {
    /// Short name for reports, such as `"hybrid"`.
    fn name(&self) -> &'static str;

    /// What it needs of a policy.
    fn needs(&self) -> Needs;

    /// A queue of all tasks of a stream.
    fn make(&self, dealt: Dealt<'_>) -> Box<dyn TaskQueue>;

    /// Whether tasks that are too large for the devices to end together are cut finer ([`crate::cut::finer`]), whatever
    /// the caller said. A queue that does not say so is given the caller's.
    fn cuts(&self) -> bool {
        false
    }

    /// Whether it moves tasks when it turns out what they cost; a queue that cannot tell says that it does.
    fn moves(&self, regime: &Regime) -> bool {
        let _ = regime;
        true
    }

    /// What a stream is expected to lose when nothing is estimated, as a share of its makespan.
    ///
    /// A queue that cannot tell says 1, and estimators that ask whether they pay take it that they do.
    fn uninformed_excess(&self, regime: &Regime) -> f64 {
        let _ = regime;
        1.0
    }
}

impl dyn QueueMaker + '_ {
    /// Has `policy` deal what this queue needs of it; `None` where it deals other tasks, or to other devices.
    #[must_use]
    pub fn deal(&self, policy: &dyn Policy, work: &[Work], devices: &[CostModel]) -> Option<Schedule> {
        let [ray, boxes, triangles, divergence] = mean_model(devices);
        let mean = CostModel::new(0.0, ray, boxes, triangles).and_then(|mean| mean.with_divergence(divergence));
        let mean = [mean.unwrap_or_default()];
        let devices = match self.needs() {
            Needs::Lists => devices,
            Needs::Order => &mean[..],
            Needs::Nothing => return Schedule::new(Vec::new(), work, &[]).ok(),
        };
        let schedule = policy.schedule(work, devices);
        (schedule.lists().len() == devices.len() && schedule.tasks() == work.len()).then_some(schedule)
    }
}

/// The queues of this crate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum QueueKind {
    /// [`StaticQueue`]: one launch per device with its whole share.
    Static,
    /// [`CentralQueue`]: one task per launch, in the policy's order.
    Central,
    /// [`HybridQueue`]: static shares in geometric launches, with stealing. The default.
    #[default]
    Hybrid,
}

impl QueueKind {
    /// The name used by the command line and in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Static => "static",
            Self::Central => "central",
            Self::Hybrid => "hybrid",
        }
    }
}

impl QueueMaker for QueueKind {
    fn name(&self) -> &'static str {
        Self::name(*self)
    }

    fn needs(&self) -> Needs {
        match self {
            Self::Static | Self::Hybrid => Needs::Lists,
            Self::Central => Needs::Order,
        }
    }

    fn make(&self, dealt: Dealt<'_>) -> Box<dyn TaskQueue> {
        let Dealt { schedule, work, devices } = dealt;
        match self {
            Self::Static => Box::new(StaticQueue::new(schedule)),
            Self::Central => Box::new(CentralQueue::in_order(schedule, work, devices)),
            Self::Hybrid => Box::new(HybridQueue::new(schedule, work, devices)),
        }
    }

    /// Only where launches have several tasks and these are moved: the others are the paper's, whose size of a task is
    /// a question.
    fn cuts(&self) -> bool {
        *self == Self::Hybrid
    }

    fn moves(&self, regime: &Regime) -> bool {
        match self {
            Self::Static => false,
            Self::Central => true,
            Self::Hybrid => {
                let tasks = regime.tasks as f64 / regime.devices.max(1) as f64;
                does_mend(tasks, regime.devices, regime.launch)
            }
        }
    }

    fn uninformed_excess(&self, regime: &Regime) -> f64 {
        match self {
            Self::Static => regime.of_lists(),
            Self::Central => central_excess(regime.tasks, regime.devices),
            Self::Hybrid if self.moves(regime) => {
                let of = |excess: fn(usize, usize) -> f64| excess(regime.tasks, regime.devices);
                let unlike = if regime.are_speeds_known || regime.are_alike { 0.0 } else { of(unlike_excess) };
                of(hybrid_excess) + unlike
            }
            Self::Hybrid => regime.of_lists(),
        }
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;
    use crate::policy::{Block, Lpt, RoundRobin};
    use crate::queue::Pop;
    use alloc::vec;
    use rt_core::TaskId;

    fn costs() -> (Vec<Work>, Vec<CostModel>) {
        let work = [3.0, 9.0, 1.0, 9.0, 4.0, 0.0, 7.0].map(|boxes| Work::new(1.0, boxes, 0.0));
        let fast = CostModel::new(0.0, 1e-9, 1e-9, 1e-9).expect("a model");
        (work.to_vec(), vec![CostModel::UNIT, fast, CostModel::new(1e-6, 1e-9, 3e-9, 0.0).expect("a model")])
    }

    /// The tasks in the order in which one device after the other is given them.
    fn popped(queue: &dyn TaskQueue, devices: usize) -> Vec<TaskId> {
        let (mut all, mut out) = (Vec::new(), Vec::new());
        for device in (0..devices).cycle() {
            if queue.pop(device, &mut out) == Pop::Done {
                return all;
            }
            queue.finish(device, &out);
            all.extend_from_slice(&out);
        }
        all
    }

    /// Whatever the policy, every queue hands out every task.
    ///
    /// Mutants: `Needs` of two queues exchanged; a queue without the last list; the central queue in the order of the
    /// tasks.
    #[test]
    fn any_policy_goes_with_any_queue() {
        let (work, models) = costs();
        for kind in [QueueKind::Static, QueueKind::Central, QueueKind::Hybrid] {
            for policy in [&Lpt as &dyn Policy, &Block, &RoundRobin] {
                let maker: &dyn QueueMaker = &kind;
                let schedule = maker.deal(policy, &work, &models).expect("dealt");
                let queue = maker.make(Dealt { schedule: &schedule, work: &work, devices: &models });
                let mut all = popped(&*queue, models.len());
                if kind == QueueKind::Central {
                    let wanted = if policy.name() == "lpt" { [1, 3, 6, 4, 0, 2, 5] } else { [0, 1, 2, 3, 4, 5, 6] };
                    assert_eq!(all, wanted, "{}", policy.name());
                }
                all.sort_unstable();
                assert!(all.iter().copied().eq(0..7), "{kind:?}, {}: {all:?}", policy.name());
            }
        }
    }

    /// The order of [`Lpt`] over the mean device is that of [`CentralQueue::new`].
    #[test]
    fn the_central_queue_begins_with_the_most_expensive() {
        let (work, models) = costs();
        let maker: &dyn QueueMaker = &QueueKind::Central;
        let schedule = maker.deal(&Lpt, &work, &models).expect("dealt");
        let [dealt, own] = [CentralQueue::in_order(&schedule, &work, &models), CentralQueue::new(&work, &models)];
        assert_eq!(popped(&dealt, 3), popped(&own, 3));
    }
}
