//! The ways to schedule that are compared.

use super::Options;
use anyhow::Result;
use rt_balance::Scheduling;
use rt_balance::catalogue::{ESTIMATORS, Entry, Estimator, Make, MakePolicy, POLICIES, QUEUES, find};
use rt_balance::devices::Opened;
use rt_balance::{QueueKind, sample::Fraction};
use rt_report::usage::{OrUsage, usage};

/// One of them.
#[derive(Clone, Debug)]
pub(super) struct Way {
    pub(super) queue: &'static Entry<QueueKind>,
    pub(super) policy: &'static Entry<MakePolicy>,
    pub(super) estimator: Estimator,
    /// Whether its estimator has seen the rounds before, as it has in later frames of an animation; else it is new in
    /// each, as for the first picture.
    pub(super) later: bool,
}

/// What is compared unless something is named: raybalance's default, which comes first whatever is named, what knows
/// nothing, the paper's queues with and without costs, and what renderers do.
const USUAL: [(&str, &str, &str); 10] = [
    ("hybrid", "lpt", "auto"),
    ("hybrid", "lpt", "uniform"),
    ("hybrid", "lpt", "exact"),
    ("central", "lpt", "uniform"),
    ("central", "lpt", "exact"),
    ("static", "block", "uniform"),
    ("static", "round-robin", "uniform"),
    ("static", "permuted-regions", "uniform"),
    ("static", "lpt", "exact"),
    ("static", "lpt", "reduced"),
];

impl Way {
    /// A scheduling that has learnt nothing.
    pub(super) fn scheduling(&self) -> Scheduling {
        let policy = Some((self.policy.make)());
        Scheduling {
            estimator: self.estimator.make(),
            policy,
            queue: Box::new(self.queue.make),
            ..Scheduling::default()
        }
    }

    /// What tables call its estimate.
    pub(super) fn estimate(&self) -> String {
        format!("{}{}", self.estimator.label(), if self.later { ", later frames" } else { "" })
    }

    /// All of it.
    pub(super) fn label(&self) -> String {
        format!("{}, {}, {}", self.queue.name, self.policy.name, self.estimate())
    }

    /// The options with which `render` takes it; empty for the default.
    pub(super) fn options(&self) -> String {
        let mut options = Vec::new();
        if self.queue.name != QUEUES[0].name {
            options.push(format!("--queue {}", self.queue.name));
        }
        if self.policy.name != POLICIES[0].name {
            options.push(format!("--policy {}", self.policy.name));
        }
        let (name, share) = self.estimator.label().split_once(' ').unwrap_or((self.estimator.label(), ""));
        if name != ESTIMATORS[0].name {
            options.push(format!("--estimator {name}"));
        }
        if !share.is_empty() {
            options.push(format!("--fraction {share}"));
        }
        options.join(" ")
    }
}

/// The ways that the options name, the default first.
///
/// # Errors
/// When an option has no meaning for any of them.
pub(super) fn ways(options: &Options) -> Result<Vec<Way>> {
    let Options { queues, policies, estimators, .. } = options;
    let mut named: Vec<(&'static Entry<QueueKind>, &'static Entry<MakePolicy>, &'static Entry<Make>)> =
        vec![(&QUEUES[0], &POLICIES[0], &ESTIMATORS[0])];
    if queues.is_empty() && policies.is_empty() && estimators.is_empty() {
        named.extend(USUAL.iter().map(|&(queue, policy, estimator)| {
            let known = "the usual ways are of the catalogue";
            let (queue, policy) = (find(QUEUES, queue).expect(known), find(POLICIES, policy).expect(known));
            (queue, policy, find(ESTIMATORS, estimator).expect(known))
        }));
    }
    for queue in or_first(queues, QUEUES) {
        for policy in or_first(policies, POLICIES) {
            named.extend(or_first(estimators, ESTIMATORS).map(|estimator| (queue, policy, estimator)));
        }
    }
    if options.fraction.is_some() && named.iter().all(|(.., estimator)| matches!(estimator.make, Make::Plain(_))) {
        let message = "--fraction has no meaning for the estimators named: name one that samples so many rays, such as \
                       --estimator exact";
        return Err(usage(message).into());
    }
    let mut ways: Vec<Way> = Vec::new();
    for (queue, policy, entry) in named {
        let chosen = options.fraction.and_then(Fraction::new).and_then(|fraction| entry.sampling(fraction));
        let estimator = chosen.unwrap_or_else(|| entry.usual());
        for later in [false, true].into_iter().take(1 + usize::from(entry.learns())) {
            let way = Way { queue, policy, estimator: estimator.clone(), later };
            if ways.iter().all(|known| known.label() != way.label()) {
                way.scheduling().policy().or_usage("--policy")?;
                ways.push(way);
            }
        }
    }
    Ok(ways)
}

/// Takes away the ways whose estimators cannot do without samples that none of the devices walks; returns their labels.
pub(super) fn leave_out(ways: &mut Vec<Way>, devices: &[Opened]) -> Vec<String> {
    let has = |walk| devices.iter().any(|opened| opened.device.info().capabilities.has_walk(walk));
    let is_served = |way: &mut Way| {
        let estimator = way.estimator.make();
        !estimator.needs_samples() || estimator.walk().is_none_or(has)
    };
    ways.extract_if(.., |way| !is_served(way)).map(|way| way.label()).collect()
}

/// What was named, or the default.
fn or_first<T>(named: &[&'static Entry<T>], all: &'static [Entry<T>]) -> impl Iterator<Item = &'static Entry<T>> {
    let first = named.is_empty().then(|| &all[0]);
    named.iter().copied().chain(first)
}

#[cfg(test)]
mod tests {
    use super::super::tests::options;
    use super::*;

    fn labels(options: &Options) -> Vec<String> {
        ways(options).unwrap().iter().map(Way::label).collect()
    }

    /// Mutants: a usual way that names what the catalogue does not have, or that is there twice; the default not first.
    #[test]
    fn the_usual_ways_are_there_with_their_rivals() {
        let labels = labels(&options());
        assert_eq!(labels[..2], ["hybrid, lpt, auto", "hybrid, lpt, auto, later frames"]);
        assert_eq!(labels.len(), USUAL.len() + 1);
        assert!(labels.iter().any(|label| label == "static, permuted-regions, uniform"), "{labels:?}");
        for way in ways(&options()).unwrap() {
            assert!(way.scheduling().policy().is_ok());
            let options = way.options();
            assert_eq!(options.is_empty(), way.label().starts_with("hybrid, lpt, auto"), "{options}");
        }
    }

    /// Mutants: named ones instead of combined; the default left out; a fraction given to what samples nothing.
    #[test]
    fn what_is_named_is_combined() {
        let estimator = |name| find(ESTIMATORS, name).unwrap();
        let options = Options {
            queues: vec![&QUEUES[1], &QUEUES[2]],
            estimators: vec![estimator("uniform"), estimator("exact")],
            fraction: Some(1.0 / 32.0),
            ..options()
        };
        let found = labels(&options);
        assert_eq!(found[0], "hybrid, lpt, auto");
        assert_eq!(
            found[2..],
            ["static, lpt, uniform", "static, lpt, exact 1/32", "central, lpt, uniform", "central, lpt, exact 1/32"]
        );
        assert_eq!(ways(&options).unwrap()[3].options(), "--queue static --estimator exact --fraction 1/32");
        let none = Options { estimators: vec![estimator("uniform")], ..options };
        assert!(ways(&none).unwrap_err().to_string().contains("--fraction"));
    }
}
