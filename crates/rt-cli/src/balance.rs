//! From the command line's balancing options to a schedule.

use crate::args::{BalanceArgs, EstimateArgs};
use crate::frame::TaskCut;
use anyhow::{Context, Result, bail};
use rt_balance::catalogue::{Entry, Estimator, Make};
use rt_balance::{DEFAULT_TASK_SIZE, Limits, Scheduling};
use rt_sched::sample::Fraction;

impl EstimateArgs {
    /// The estimator asked for.
    ///
    /// # Errors
    /// When the fraction is none, or has no meaning for the estimator.
    pub(crate) fn chosen(&self) -> Result<Estimator> {
        let given =
            self.fraction.map(|f| Fraction::new(f).context("--fraction must be from 1/4096 to 1")).transpose()?;
        let entry = self.entry();
        let chosen = match entry.make {
            Make::Plain(_) => None,
            Make::Spending(..) if given.is_some() => {
                bail!("--fraction has no meaning for the estimator {}: give --budget, or --estimator exact", entry.name)
            }
            Make::Spending(..) => entry.spending(self.budget),
            Make::Sampling(..) | Make::Beginning(..) => given.and_then(|fraction| entry.sampling(fraction)),
        };
        Ok(chosen.unwrap_or_else(|| entry.usual()))
    }

    /// What `--estimator` and `--reduced` name together.
    fn entry(&self) -> &'static Entry<Make> {
        if self.estimator.name == "reduced" { self.reduced } else { self.estimator }
    }
}

impl BalanceArgs {
    /// The estimator, policy and queue asked for.
    ///
    /// # Errors
    /// When the policy has no meaning for the queue.
    pub(crate) fn scheduling(&self) -> Result<Scheduling> {
        let estimator = self.estimate.chosen()?.make();
        let policy = self.policy.map(|policy| (policy.make)());
        let limits = Limits::within(self.device_limit);
        let scheduling = Scheduling { estimator, policy, queue: self.queue.make, limits, ..Scheduling::default() };
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
