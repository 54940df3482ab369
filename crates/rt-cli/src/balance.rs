//! From the command line's balancing options to a schedule and devices.

use crate::args::{BalanceArgs, EstimateArgs, EstimatorArg, PolicyArg, QueueArg, ReducedArg};
use crate::exit::{OrUsage, usage};
use crate::frame::TaskCut;
use anyhow::{Context, Result};
use rt_balance::{DEFAULT_TASK_SIZE, QueueKind, Scheduling};
use rt_core::{CostEstimator, ReducedWalk, Walk};
use rt_sched::estimate::{Adaptive, Auto, Field, History, Sampled, Uniform};
use rt_sched::policy::{Block, Lpt, Policy, RoundRobin};
use rt_sched::sample::Fraction;

/// Share of the trace that the estimator `auto` may spend: half a percent.
const DEFAULT_BUDGET: f64 = 0.005;

impl EstimateArgs {
    /// The estimator asked for.
    ///
    /// # Errors
    /// When an option has no meaning for the estimator.
    pub(crate) fn estimator(&self) -> Result<Box<dyn CostEstimator>> {
        self.check()?;
        let given = self.fraction.and_then(Fraction::new);
        let fraction = given.unwrap_or(Fraction::SIXTY_FOURTH);
        let reduced = match self.reduced.unwrap_or(ReducedArg::Leaf) {
            ReducedArg::Leaf => ReducedWalk::LeafAsHit,
            ReducedArg::Unshortened => ReducedWalk::Unshortened,
            ReducedArg::Plane => ReducedWalk::LeafPlane,
            ReducedArg::Truncated => ReducedWalk::Truncated,
        };
        let exact = || Box::new(Sampled::new(Walk::Full, fraction));
        Ok(match self.estimator {
            EstimatorArg::Auto => Box::new(Auto::new(self.budget.unwrap_or(DEFAULT_BUDGET))),
            EstimatorArg::Adaptive => given.map_or_else(Box::<Adaptive>::default, |f| Box::new(Adaptive::new(f))),
            EstimatorArg::Field => Box::new(Field::new(fraction)),
            EstimatorArg::Uniform => Box::new(Uniform),
            EstimatorArg::Reduced => Box::new(Sampled::new(Walk::Reduced(reduced), fraction)),
            EstimatorArg::Exact => exact(),
            EstimatorArg::History => Box::new(History::new(exact())),
        })
    }

    /// Refuses options that would be ignored.
    fn check(&self) -> Result<()> {
        match self.estimator {
            EstimatorArg::Auto if self.fraction.is_some() => {
                return Err(usage(
                    "--fraction has no meaning for the estimator auto: give --budget, or --estimator exact",
                ));
            }
            EstimatorArg::Uniform if self.fraction.is_some() => {
                return Err(usage("--fraction has no meaning for the estimator uniform, which samples nothing"));
            }
            _ => {}
        }
        if self.budget.is_some() && self.estimator != EstimatorArg::Auto {
            return Err(usage("--budget has a meaning for the estimator auto only: give --fraction"));
        }
        if self.reduced.is_some() && self.estimator != EstimatorArg::Reduced {
            return Err(usage("--reduced has a meaning for the estimator reduced only: give --estimator reduced"));
        }
        Ok(())
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
        scheduling.policy().context("--policy").or_usage()?;
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
