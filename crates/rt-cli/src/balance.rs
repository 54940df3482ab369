//! From the command line's balancing options to a schedule.

use crate::args::{BalanceArgs, EstimateArgs};
use anyhow::Result;
use rt_balance::catalogue::{Estimator, Make};
use rt_balance::{Limits, Scheduling};
use rt_render::TaskCut;
use rt_report::usage::{OrUsage, usage};
use rt_sched::sample::Fraction;

/// The estimator whose walks `--reduced` tells apart.
const REDUCED: &str = "reduced";

impl EstimateArgs {
    /// The estimator asked for.
    ///
    /// # Errors
    /// When an option has no meaning for the estimator.
    pub(crate) fn chosen(&self) -> Result<Estimator> {
        let entry = self.estimator;
        let unused = |option, instead| {
            Err(usage(format!("{option} has no meaning for the estimator {}: {instead}", entry.name)).into())
        };
        if self.fraction.is_some() && !matches!(entry.make, Make::Sampling(..) | Make::Beginning(..)) {
            return unused("--fraction", "name one that samples so many rays, such as --estimator exact");
        }
        if self.reduced.is_some() && entry.name != REDUCED {
            return unused("--reduced", "give --estimator reduced");
        }
        let entry = self.reduced.unwrap_or(entry);
        let chosen = match entry.make {
            Make::Plain(_) => None,
            Make::Sampling(..) | Make::Beginning(..) => {
                self.fraction.and_then(Fraction::new).and_then(|fraction| entry.sampling(fraction))
            }
        };
        Ok(chosen.unwrap_or_else(|| entry.usual()))
    }
}

impl BalanceArgs {
    /// The estimator, policy and queue asked for.
    ///
    /// # Errors
    /// When the policy has no meaning for the queue.
    pub(crate) fn scheduling(&self) -> Result<Scheduling> {
        self.device.check(self.devices.as_deref())?;
        let estimator = self.estimate.chosen()?.make();
        let policy = self.policy.map(|policy| (policy.make)());
        let limits = Limits::within(self.device_limit);
        let queue = Box::new(self.queue.make);
        let scheduling = Scheduling { estimator, policy, queue, limits, ..Scheduling::default() };
        scheduling.policy().or_usage("--policy")?;
        Ok(scheduling)
    }

    /// How streams are cut into tasks.
    pub(crate) fn cut(&self) -> TaskCut {
        TaskCut::of_options(self.tasks, self.task_size)
    }
}
