//! What raybalance promises about its hits.

use serde::Serialize;
use std::fmt;

/// One of the ten promises, by its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(into = "u8")]
pub enum Promise {
    /// No ray gets through a closed surface.
    Watertight = 1,
    /// No mesh makes the builder panic, hang or exceed the depth that traversal has room for.
    AnyMesh = 2,
    /// Every ray has the one right hit, to the last bit of its distance. Tracers that follow another definition of a
    /// hit are held to it on rays that are not ambiguous to them, and to the candidates on others.
    Agreement = 3,
    /// Of hits at the same distance the lowest primitive id is reported.
    Ties = 4,
    /// Scaling by a power of two changes no bit of a hit but the exponent of its distance.
    ScaleInvariance = 5,
    /// Robust tracing is at most 25% slower than fast tracing.
    PriceOfRobustness = 6,
    /// A ray that leaves a surface does not hit what it leaves.
    SelfHits = 7,
    /// An invalid ray misses, and costs no more than a valid one.
    InvalidRays = 8,
    /// Every box of a tree holds what is below it.
    Containment = 9,
    /// Intervals of estimated costs hold the true cost as often as they say.
    EstimateCoverage = 10,
}

impl Promise {
    /// All of them, in the order of their numbers.
    pub const ALL: [Self; 10] = [
        Self::Watertight,
        Self::AnyMesh,
        Self::Agreement,
        Self::Ties,
        Self::ScaleInvariance,
        Self::PriceOfRobustness,
        Self::SelfHits,
        Self::InvalidRays,
        Self::Containment,
        Self::EstimateCoverage,
    ];

    /// Its number, 1 to 10.
    #[must_use]
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// The promise in one line.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::Watertight => "no ray gets through a closed surface",
            Self::AnyMesh => "no mesh makes a build panic, hang or too deep",
            Self::Agreement => "every hit is the exact one",
            Self::Ties => "ties go to the lowest primitive id",
            Self::ScaleInvariance => "powers of two change no bit of a hit",
            Self::PriceOfRobustness => "robust is at most 25% slower than fast",
            Self::SelfHits => "no ray hits the surface it leaves",
            Self::InvalidRays => "invalid rays miss and cost nothing extra",
            Self::Containment => "boxes hold what is below them",
            Self::EstimateCoverage => "95% intervals of estimates hold 93–97% of the time",
        }
    }
}

impl From<Promise> for u8 {
    fn from(promise: Promise) -> Self {
        promise.number()
    }
}

impl fmt::Display for Promise {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.number().to_string())
    }
}
