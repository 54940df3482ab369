//! Estimators, policies and queues by name: the one list of them, from which commands, experiments and pages choose.
//!
//! Whatever takes one of them by choice takes an [`Estimator`], so that one's own can stand where ours do
//! ([`Estimator::custom`]); policies and queues are objects anyway, and the lists here only name ours.

use crate::QueueKind;
use rt_core::{CostEstimator, ReducedWalk, Walk};
use rt_sched::estimate::{Auto, History, Sampled, Uniform};
use rt_sched::policy::{Block, Lpt, PermutedRegions, Policy, RoundRobin};
use rt_sched::sample::Fraction;
use std::error::Error;
use std::fmt;
use std::sync::Arc;

/// Something that can be chosen by its name.
#[derive(Clone, Copy, Debug)]
pub struct Entry<T> {
    /// The name, as commands and reports have it.
    pub name: &'static str,
    /// What it is, in a phrase.
    pub what: &'static str,
    /// What was chosen.
    pub make: T,
}

const fn entry<T>(name: &'static str, what: &'static str, make: T) -> Entry<T> {
    Entry { name, what, make }
}

/// How an estimator is made.
#[derive(Clone, Copy, Debug)]
pub enum Make {
    /// It takes nothing.
    Plain(fn() -> Box<dyn CostEstimator>),
    /// It takes the share of the rays that it samples; the second is the usual one.
    Sampling(fn(Fraction) -> Box<dyn CostEstimator>, Fraction),
    /// It takes the share of the rays that it samples at first, and goes on by itself; the second is the usual one.
    Beginning(fn(Fraction) -> Box<dyn CostEstimator>, Fraction),
}

/// Every estimator, the default one first.
pub const ESTIMATORS: &[Entry<Make>] = &[
    entry(
        "auto",
        "The measured past; without one, samples where they win more than they cost, else nothing",
        Make::Plain(|| Box::<Auto>::default()),
    ),
    entry("uniform", "All rays cost the same", Make::Plain(|| Box::new(Uniform))),
    entry(
        "exact",
        "Full traversal of sampled rays, whose hits are kept",
        Make::Sampling(|fraction| Box::new(Sampled::new(Walk::Full, fraction)), Fraction::SIXTY_FOURTH),
    ),
    entry(
        "history",
        "Measured times of the previous pass or frame",
        Make::Beginning(
            |fraction| Box::new(History::new(Box::new(Sampled::new(Walk::Full, fraction)))),
            Fraction::SIXTY_FOURTH,
        ),
    ),
    entry(
        "reduced",
        "Box and triangle tests of sampled rays, without triangles: a leaf entered counts as the hit",
        Make::Sampling(|fraction| reduced(ReducedWalk::LeafAsHit, fraction), Fraction::SIXTY_FOURTH),
    ),
    entry(
        "reduced-unshortened",
        "As reduced, but the ray is never shortened",
        Make::Sampling(|fraction| reduced(ReducedWalk::Unshortened, fraction), Fraction::SIXTY_FOURTH),
    ),
];

/// How a policy is made.
pub type MakePolicy = fn() -> Box<dyn Policy>;

/// Every policy, the default one first.
pub const POLICIES: &[Entry<MakePolicy>] = &[
    entry("lpt", "Most expensive remaining task to the device that would finish it first", || Box::new(Lpt)),
    entry("block", "Contiguous blocks of tasks", || Box::new(Block)),
    entry("round-robin", "Tasks in turn", || Box::new(RoundRobin)),
    entry(
        "permuted-regions",
        "Tasks in bit-reversed order, contiguous shares by speed (van Antwerpen, Seibert, Keller 2019)",
        || Box::new(PermutedRegions),
    ),
];

/// Every queue, the default one first.
pub const QUEUES: &[Entry<QueueKind>] = &[
    entry("hybrid", "Static shares in geometric launches, with stealing", QueueKind::Hybrid),
    entry("static", "One launch per device with its whole share", QueueKind::Static),
    entry("central", "One task per launch, most expensive first", QueueKind::Central),
];

fn reduced(walk: ReducedWalk, fraction: Fraction) -> Box<dyn CostEstimator> {
    Box::new(Sampled::new(Walk::Reduced(walk), fraction))
}

/// The estimators that walk without triangles.
pub fn reduced_estimators() -> impl Iterator<Item = &'static Entry<Make>> {
    ESTIMATORS.iter().filter(|entry| entry.walks_reduced())
}

impl Entry<Make> {
    /// The estimator with its usual parameter.
    #[must_use]
    pub fn usual(&'static self) -> Estimator {
        let make = match self.make {
            Make::Plain(make) => return Estimator::custom(self.name, make),
            Make::Sampling(make, fraction) | Make::Beginning(make, fraction) => {
                Arc::new(move || make(fraction)) as Maker
            }
        };
        Estimator { label: self.name.to_owned(), make }
    }

    /// The estimator that samples this share of the rays; `None` if it takes none.
    #[must_use]
    pub fn sampling(&'static self, fraction: Fraction) -> Option<Estimator> {
        let (Make::Sampling(make, _) | Make::Beginning(make, _)) = self.make else { return None };
        Some(Estimator { label: labelled(self.name, fraction.value()), make: Arc::new(move || make(fraction)) })
    }

    /// The estimator with a share of whatever it takes; `None` if it takes none, or not this one.
    #[must_use]
    pub fn with(&'static self, share: f64) -> Option<Estimator> {
        match self.make {
            Make::Plain(_) => None,
            Make::Sampling(..) | Make::Beginning(..) => self.sampling(Fraction::new(share)?),
        }
    }

    /// Whether it goes by what was measured of earlier streams of a kind, so that it says another thing of the second
    /// picture than of the first.
    #[must_use]
    pub fn learns(&self) -> bool {
        matches!(self.name, "auto" | "history")
    }

    fn walks_reduced(&'static self) -> bool {
        matches!(self.usual().make().walk(), Some(Walk::Reduced(_)))
    }
}

/// `exact 1/64`, or the share as a number where it is no part of a whole.
fn labelled(name: &str, share: f64) -> String {
    let parts = 1.0 / share;
    if parts.fract() == 0.0 { format!("{name} 1/{parts}") } else { format!("{name} {share}") }
}

type Maker = Arc<dyn Fn() -> Box<dyn CostEstimator> + Send + Sync>;

/// An estimator that was chosen, and can be made as often as it is wanted.
#[derive(Clone)]
pub struct Estimator {
    label: String,
    make: Maker,
}

impl Estimator {
    /// An estimator of the caller's own.
    pub fn custom(label: impl Into<String>, make: impl Fn() -> Box<dyn CostEstimator> + Send + Sync + 'static) -> Self {
        Self { label: label.into(), make: Arc::new(make) }
    }

    /// What it is called, with its parameter where that is not the usual one: `auto`, `exact 1/64`.
    #[must_use]
    pub fn label(&self) -> &str {
        &self.label
    }

    /// A new one, which has learnt nothing.
    #[must_use]
    pub fn make(&self) -> Box<dyn CostEstimator> {
        (self.make)()
    }
}

impl fmt::Debug for Estimator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Estimator").field(&self.label).finish()
    }
}

impl std::str::FromStr for Estimator {
    type Err = UnknownEstimator;

    /// Reads a name of [`ESTIMATORS`], and behind a blank the share that it takes: `exact`, `exact 1/64`, `auto 0.005`.
    fn from_str(text: &str) -> Result<Self, UnknownEstimator> {
        let error = || UnknownEstimator { text: text.to_owned() };
        let (name, share) = match text.split_once(' ') {
            Some((name, share)) => (name, Some(share)),
            None => (text, None),
        };
        let entry = find(ESTIMATORS, name).ok_or_else(error)?;
        let Some(share) = share else { return Ok(entry.usual()) };
        let number = |text: &str| text.trim().parse::<f64>().map_err(|_| error());
        let share = match share.split_once('/') {
            Some((over, under)) => number(over)? / number(under)?,
            None => number(share)?,
        };
        entry.with(share).ok_or_else(error)
    }
}

/// The entry of a name.
#[must_use]
pub fn find<T>(entries: &'static [Entry<T>], name: &str) -> Option<&'static Entry<T>> {
    entries.iter().find(|entry| entry.name == name)
}

/// A text that chooses no estimator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownEstimator {
    text: String,
}

impl fmt::Display for UnknownEstimator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<&str> = ESTIMATORS.iter().map(|entry| entry.name).collect();
        write!(f, "`{}` is no estimator: write it as exact or exact 1/64; there are {}", self.text, names.join(", "))
    }
}

impl Error for UnknownEstimator {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scheduling;

    /// Mutants: an estimator under another's name; `usual` that makes another one than `with` its usual share.
    #[test]
    fn names_are_those_that_reports_have() {
        for entry in ESTIMATORS {
            assert_eq!(entry.usual().make().name(), entry.name);
        }
        for entry in POLICIES {
            assert_eq!((entry.make)().name(), entry.name);
        }
        for entry in QUEUES {
            assert_eq!(entry.make.name(), entry.name);
        }
        assert_eq!(reduced_estimators().count(), 2);
    }

    #[test]
    fn the_first_of_each_list_is_the_default() {
        let default = Scheduling::default();
        assert_eq!(default.estimator.name(), ESTIMATORS[0].name);
        assert_eq!(default.policy().unwrap().name(), POLICIES[0].name);
        assert_eq!(default.queue.name(), QUEUES[0].name);
    }

    /// Mutants: a share that is read upside down; one that is given to an estimator that takes none.
    #[test]
    fn texts_are_read_as_they_are_written() {
        for text in ["auto", "uniform", "exact 1/64", "reduced-unshortened 1/1", "exact 0.3"] {
            assert_eq!(text.parse::<Estimator>().unwrap().label(), text);
        }
        for bad in ["", "exakt", "uniform 1/2", "exact 2", "exact 1/0", "auto 1/2", "exact x"] {
            let message = bad.parse::<Estimator>().unwrap_err().to_string();
            assert!(message.contains(&format!("`{bad}`")) && message.contains("history"), "{message}");
        }
    }

    #[test]
    fn one_of_the_caller_s_own_stands_where_ours_do() {
        let own = Estimator::custom("mine", || Box::new(Uniform));
        assert_eq!((own.label(), own.clone().make().name()), ("mine", "uniform"));
    }
}
