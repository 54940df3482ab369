//! Devices whose answers are not true.

use crate::fixture::{
    QUEUES, balancer, beside_a_good_one, faulty, patient, sampling, trace, trace_well, uniform, until_it_fails,
};
use rt_balance::middleware::{Failure, Fault, FaultyCall, Lie};
use rt_balance::{Audit, BalanceError, Control, Device, QueueKind, Scheduling};
use std::sync::Arc;

/// Lies that no scene could make true.
const IMPOSSIBLE: [Lie; 4] = [Lie::Primitive, Lie::NotANumber, Lie::Distance, Lie::TooFew];

/// Mutants: any of the four comparisons left out; what the device brought before the lie is kept; hits that it walked
/// for the estimate are kept.
#[test]
fn what_cannot_be_true_is_seen_without_an_audit() {
    for queue in QUEUES {
        for lie in IMPOSSIBLE {
            for (call, after) in [(FaultyCall::Wait, 0), (FaultyCall::Wait, 2), (FaultyCall::Walk, 0)] {
                if (call, lie) == (FaultyCall::Walk, Lie::TooFew) {
                    // A walk writes into a slice.
                    continue;
                }
                let what = format!("{queue:?}, {lie:?} at {call:?} after {after}");
                let (_bad, mut balancer) = beside_a_good_one(Fault::new(call, after, Failure::Lie(lie)));
                let mut scheduling = Scheduling { audit: Audit::OFF, ..sampling(queue, patient()) };
                if after == 0 {
                    let told = until_it_fails(&what, &mut balancer, &mut scheduling);
                    assert!(told.contains("cannot be true") || told.contains("came back with"), "{what}: {told}");
                } else {
                    trace_well(&what, &mut balancer, &mut scheduling);
                }
            }
        }
    }
}

/// Mutants: the audit looks at hits alone, or at misses alone; walks are not audited; earlier launches are kept.
#[test]
fn what_is_not_true_is_seen_by_an_audit() {
    for queue in QUEUES {
        for lie in [Lie::Misses, Lie::Shifted] {
            for (call, after) in [(FaultyCall::Wait, 0), (FaultyCall::Wait, 2), (FaultyCall::Walk, 0)] {
                let what = format!("{queue:?}, {lie:?} at {call:?} after {after}");
                let (_bad, mut balancer) = beside_a_good_one(Fault::new(call, after, Failure::Lie(lie)));
                let mut scheduling = Scheduling { audit: Audit::ALL, ..sampling(queue, patient()) };
                if after == 0 {
                    let told = until_it_fails(&what, &mut balancer, &mut scheduling);
                    // Some rays may have got what cannot be true of them.
                    let seen = lie == Lie::Shifted && told.contains("cannot be true") || told.contains("traced again");
                    assert!(seen, "{what}: {told}");
                } else {
                    trace_well(&what, &mut balancer, &mut scheduling);
                }
            }
        }
    }
}

/// A device whose kernels do nothing is found out by the audit that everybody has: one ray of each launch is looked at,
/// and about half of them hit.
///
/// Mutant: launches of fewer rays than the audit's period are not looked at.
#[test]
fn a_dead_device_is_seen_by_the_default_audit() {
    let (_bad, mut balancer) = beside_a_good_one(Fault::new(FaultyCall::Wait, 0, Failure::Lie(Lie::Misses)));
    let mut scheduling = uniform(QueueKind::Central, patient());
    let told = (0..crate::fixture::TRIES).find_map(|_| {
        // What it brings before it is found out may be wrong.
        let mut hits = vec![crate::fixture::UNTOUCHED; crate::fixture::fixture().hits.len()];
        let stream = &crate::fixture::fixture().stream;
        let mut counts = vec![rt_balance::TestCounts::default(); hits.len()];
        let run = balancer.trace(stream, &mut scheduling, &mut hits, Some(&mut counts), Control::default());
        run.expect("the other one does it").report.devices[0].error.clone()
    });
    assert!(told.expect("found out").contains("traced again"));
    trace_well("after it", &mut balancer, &mut scheduling);
}

/// Mutants: the device is dropped for one hit; the hit is counted but not replaced.
#[test]
fn one_wrong_hit_is_replaced_and_counted() {
    for call in [FaultyCall::Wait, FaultyCall::Walk] {
        let what = format!("one wrong hit at {call:?}");
        let (_bad, mut balancer) = beside_a_good_one(Fault::new(call, 0, Failure::Lie(Lie::OneMiss)));
        let mut scheduling = Scheduling { audit: Audit::ALL, ..sampling(QueueKind::Static, patient()) };
        let run = trace_well(&what, &mut balancer, &mut scheduling);
        let [bad, good] = &run.report.devices[..] else { panic!("two devices") };
        assert!(bad.error.is_none() && bad.refused > 0 && bad.refused < bad.audited, "{what}: {bad:?}");
        assert!(good.refused == 0 && good.audited > 0, "{what}: {good:?}");
    }
}

#[test]
fn where_all_lie_nothing_is_believed() {
    for lie in IMPOSSIBLE {
        let devices = [0, 1].map(|_| faulty(Fault::new(FaultyCall::Wait, 1, Failure::Lie(lie))) as Arc<dyn Device>);
        let mut balancer = balancer(&devices);
        let what = format!("all say {lie:?}");
        match trace(&what, &mut balancer, &mut uniform(QueueKind::Central, patient()), Control::default()) {
            Err(BalanceError::AllDevicesLost { unfinished, failures }) => {
                assert!(failures.len() == 2 && unfinished > 0, "{what}: {failures:?}");
            }
            other => panic!("{what}: {other:?}"),
        }
    }
}

#[test]
fn shares_of_an_audit_are_shares() {
    assert_eq!([-0.1, 1.1, f64::NAN].map(Audit::share), [None; 3]);
    assert_eq!([0.0, 1.0].map(Audit::share), [Some(Audit::OFF), Some(Audit::ALL)]);
}
