//! What is compared: queue, policy, and what is known of tasks and devices.

use crate::contenders::{
    CENTRAL, CENTRAL_COST, Contender, HYBRID, HYBRID_COST, LIFELINES, PERMUTED, ROUND_ROBIN, STATIC_COST,
};

/// One of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Strategy {
    pub(super) name: &'static str,
    pub(super) contender: Contender,
    pub(super) knows: Knows,
}

/// What is known before the first launch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Knows {
    /// Neither costs nor speeds.
    Nothing,
    /// Speeds, and what a launch costs.
    Speeds,
    /// The same, and costs by samples of this stream, whose price counts.
    Samples,
    /// The same, and costs as an earlier run of the same tasks measured them, for nothing.
    Past,
    /// What the default estimator decides on for a first stream: nothing, or samples.
    First,
}

const fn strategy(name: &'static str, contender: Contender, knows: Knows) -> Strategy {
    Strategy { name, contender, knows }
}

impl Strategy {
    /// Every strategy; the last two are the default's, of its first stream and of later ones.
    pub(super) const ALL: [Self; 12] = [
        strategy("static round robin", ROUND_ROBIN, Knows::Nothing),
        strategy("permuted regions, speeds", PERMUTED, Knows::Speeds),
        strategy("lifelines", LIFELINES, Knows::Nothing),
        strategy("static LPT, samples", STATIC_COST, Knows::Samples),
        strategy("static LPT, past", STATIC_COST, Knows::Past),
        strategy("central", CENTRAL, Knows::Nothing),
        strategy("central, samples", CENTRAL_COST, Knows::Samples),
        strategy("hybrid", HYBRID, Knows::Nothing),
        strategy("hybrid, speeds", HYBRID, Knows::Speeds),
        strategy("hybrid, samples", HYBRID_COST, Knows::Samples),
        strategy("default, first stream", HYBRID_COST, Knows::First),
        strategy("default, later ones", HYBRID_COST, Knows::Past),
    ];
}
