//! From the command line's balancing options to a schedule and devices.

use crate::args::{BalanceArgs, EstimateArgs, EstimatorArg, PolicyArg, QueueArg, ReducedArg};
use crate::frame::TaskCut;
use anyhow::{Context, Result, bail};
use rt_balance::{DEFAULT_TASK_SIZE, Limits, QueueKind, Scheduling};
use rt_core::{CostEstimator, ReducedWalk, Walk};
use rt_sched::estimate::{Adaptive, Auto, Field, History, Sampled, Uniform};
use rt_sched::policy::{Block, Lpt, Policy, RoundRobin};
use rt_sched::sample::Fraction;

impl EstimateArgs {
    /// The estimator asked for.
    ///
    /// # Errors
    /// When the fraction is none, or has no meaning for the estimator.
    pub(crate) fn estimator(&self) -> Result<Box<dyn CostEstimator>> {
        let given =
            self.fraction.map(|f| Fraction::new(f).context("--fraction must be from 1/4096 to 1")).transpose()?;
        if given.is_some() && self.estimator == EstimatorArg::Auto {
            bail!("--fraction has no meaning for the estimator auto: give --budget, or --estimator exact");
        }
        let fraction = given.unwrap_or(Fraction::SIXTY_FOURTH);
        let reduced = match self.reduced {
            ReducedArg::Leaf => ReducedWalk::LeafAsHit,
            ReducedArg::Unshortened => ReducedWalk::Unshortened,
            ReducedArg::Plane => ReducedWalk::LeafPlane,
            ReducedArg::Truncated => ReducedWalk::Truncated,
        };
        let exact = || Box::new(Sampled::new(Walk::Full, fraction));
        Ok(match self.estimator {
            EstimatorArg::Auto => Box::new(Auto::new(self.budget)),
            EstimatorArg::Adaptive => given.map_or_else(Box::<Adaptive>::default, |f| Box::new(Adaptive::new(f))),
            EstimatorArg::Field => Box::new(Field::new(fraction)),
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
        let limits = Limits::within(self.device_limit);
        let scheduling = Scheduling { estimator, policy, queue, limits, ..Scheduling::default() };
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
