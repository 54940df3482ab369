//! From the command line's balancing options to a schedule and devices.

use crate::args::{BalanceArgs, EstimateArgs, EstimatorArg, PolicyArg, QueueArg, ReducedArg};
use crate::frame::TaskCut;
use anyhow::{Context, Result};
use rt_balance::{DEFAULT_TASK_SIZE, QueueKind, Scheduling};
use rt_core::{CostEstimator, ReducedWalk, Walk};
use rt_sched::estimate::{History, Sampled, Uniform};
use rt_sched::policy::{Block, Lpt, Policy, RoundRobin};
use rt_sched::sample::Fraction;

impl EstimateArgs {
    /// The estimator asked for.
    ///
    /// # Errors
    /// When the fraction is none.
    pub(crate) fn estimator(&self) -> Result<Box<dyn CostEstimator>> {
        let fraction = Fraction::new(self.fraction).context("--fraction must be from 1/4096 to 1")?;
        let reduced = match self.reduced {
            ReducedArg::Leaf => ReducedWalk::LeafAsHit,
            ReducedArg::Unshortened => ReducedWalk::Unshortened,
        };
        let exact = || Box::new(Sampled::new(Walk::Full, fraction));
        Ok(match self.estimator {
            EstimatorArg::Uniform => Box::new(Uniform),
            EstimatorArg::Reduced => Box::new(Sampled::new(Walk::Reduced(reduced), fraction)),
            EstimatorArg::Exact => exact(),
            EstimatorArg::History => Box::new(History::new(exact())),
        })
    }
}

impl BalanceArgs {
    /// The estimator, policy and queue asked for.
    ///
    /// # Errors
    /// When the policy has no meaning for the queue.
    pub(crate) fn scheduling(&self) -> Result<Scheduling> {
        let estimator = self.estimate.estimator()?;
        let policy = self.policy.map(|policy| -> Box<dyn Policy> {
            match policy {
                PolicyArg::Block => Box::new(Block),
                PolicyArg::RoundRobin => Box::new(RoundRobin),
                PolicyArg::Lpt => Box::new(Lpt),
            }
        });
        let queue = match self.queue {
            QueueArg::Static => QueueKind::Static,
            QueueArg::Central => QueueKind::Central,
            QueueArg::Hybrid => QueueKind::Hybrid,
        };
        let scheduling = Scheduling { estimator, policy, queue, ..Scheduling::default() };
        scheduling.policy().context("--policy")?;
        Ok(scheduling)
    }

    /// How streams are cut into tasks.
    pub(crate) fn cut(&self) -> TaskCut {
        match (self.tasks, self.task_size) {
            (Some(tasks), _) => TaskCut::Count(tasks),
            (None, size) => TaskCut::Size(size.unwrap_or(DEFAULT_TASK_SIZE)),
        }
    }
}
