//! The ways to schedule that experiments compare: queue, policy and estimate.

use crate::lifelines::Lifelines;
use rt_balance::catalogue::{ESTIMATORS, Estimator, POLICIES, find};
use rt_balance::policies::Policy;
use rt_balance::queues::QueueMaker;
use rt_balance::{QueueKind, Scheduling};
use rt_core::CostEstimator;

/// One of them.
#[derive(Clone, Copy, Debug)]
pub struct Contender {
    /// The name, as tables and files have it.
    pub name: &'static str,
    /// The queue.
    pub queue: MakeQueue,
    /// Name of the policy; `None`: the queue's own.
    pub policy: Option<&'static str>,
    /// What is known of the tasks.
    pub estimate: Estimate,
}

/// How what makes queues is made.
pub type MakeQueue = fn() -> Box<dyn QueueMaker>;

const STATIC: MakeQueue = || Box::new(QueueKind::Static);
const CENTRAL_QUEUE: MakeQueue = || Box::new(QueueKind::Central);
const HYBRID_QUEUE: MakeQueue = || Box::new(QueueKind::Hybrid);

/// What is known of the tasks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Estimate {
    /// Nothing: every ray counts the same.
    None,
    /// What the estimator says that the experiment is about.
    Asked,
}

const fn contender(
    name: &'static str,
    queue: MakeQueue,
    policy: Option<&'static str>,
    estimate: Estimate,
) -> Contender {
    Contender { name, queue, policy, estimate }
}

/// Static queues of contiguous blocks: what needs neither estimate nor thought.
pub const BLOCKS: Contender = contender("static blocks", STATIC, Some("block"), Estimate::None);
/// Static queues dealt in turn: the paper's regular static queues.
pub const ROUND_ROBIN: Contender = contender("static round robin", STATIC, Some("round-robin"), Estimate::None);
/// The paper's cost-initialised static queues.
pub const STATIC_COST: Contender = contender("static LPT, cost-initialised", STATIC, Some("lpt"), Estimate::Asked);
/// The paper's regular central queue.
pub const CENTRAL: Contender = contender("central", CENTRAL_QUEUE, None, Estimate::None);
/// The paper's cost-initialised central queue.
pub const CENTRAL_COST: Contender = contender("central, cost-initialised", CENTRAL_QUEUE, None, Estimate::Asked);
/// The hybrid queue that knows nothing: the rival of every estimate.
pub const HYBRID: Contender = contender("hybrid", HYBRID_QUEUE, None, Estimate::None);

/// The hybrid queue with costs.
pub const HYBRID_COST: Contender = contender("hybrid, cost-initialised", HYBRID_QUEUE, None, Estimate::Asked);

/// Permuted regions, whose shares go by speeds: a rival.
pub const PERMUTED: Contender = contender("permuted regions", STATIC, Some("permuted-regions"), Estimate::None);
/// Work stealing with lifelines, from contiguous blocks: a rival.
pub const LIFELINES: Contender = contender("lifelines", || Box::new(Lifelines), Some("block"), Estimate::None);

impl Contender {
    /// A new estimator; `asked` is the one that the experiment is about.
    #[must_use]
    pub fn estimator(&self, asked: &Estimator) -> Box<dyn CostEstimator> {
        match self.estimate {
            Estimate::None => uninformed(),
            Estimate::Asked => asked.make(),
        }
    }

    /// The policy; `None`: the queue's own.
    #[must_use]
    pub fn policy(&self) -> Option<Box<dyn Policy>> {
        self.policy.map(|name| (find(POLICIES, name).expect("contenders name policies of the catalogue").make)())
    }

    /// All of it.
    #[must_use]
    pub fn scheduling(&self, asked: &Estimator) -> Scheduling {
        let (estimator, policy) = (self.estimator(asked), self.policy());
        Scheduling { estimator, policy, queue: (self.queue)(), ..Scheduling::default() }
    }
}

/// The estimator that knows nothing: of plain traces, and of what estimates must beat.
#[must_use]
pub fn uninformed() -> Box<dyn CostEstimator> {
    find(ESTIMATORS, "uniform").expect("the catalogue has it").usual().make()
}

/// Devices that makespans are replayed on: their name, and their speeds relative to the measured one.
pub const MACHINES: [(&str, &[f64]); 4] =
    [("2 devices", &[1.0; 2]), ("3 devices", &[1.0; 3]), ("8 devices", &[1.0; 8]), ("1:2:4", &[1.0, 2.0, 4.0])];

#[cfg(test)]
mod tests {
    use super::*;

    /// Mutants: a contender that names what the catalogue does not have; a policy that its queue would ignore.
    #[test]
    fn every_contender_can_be_scheduled() {
        let asked = ESTIMATORS[0].usual();
        for contender in
            [BLOCKS, ROUND_ROBIN, STATIC_COST, CENTRAL, CENTRAL_COST, HYBRID, HYBRID_COST, PERMUTED, LIFELINES]
        {
            let scheduling = contender.scheduling(&asked);
            assert!(scheduling.policy().is_ok(), "{}", contender.name);
            assert_eq!(scheduling.estimator.name() == "uniform", contender.estimate == Estimate::None);
        }
    }
}
