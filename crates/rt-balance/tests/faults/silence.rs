//! Devices that do not answer, or not in time.

use crate::fixture::{
    FOR_EVER, QUEUES, balancer, beside_a_good_one, cpus, faulty, fixture, impatient, patient, sampling, trace,
    trace_well, uniform, until_it_fails,
};
use rt_balance::middleware::{Failure, Fault, FaultyCall};
use rt_balance::{BalanceError, Balancer, Control, Device, Limits, QueueKind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

/// Mutants: the watch ends with the stream's other tasks unfinished; a device that hangs is waited for in any of the
/// calls, or when the balancer is dropped.
#[test]
fn a_device_that_never_returns_costs_the_others_a_moment() {
    for queue in QUEUES {
        for call in FaultyCall::ALL {
            let what = format!("{queue:?}, silence at {call:?}");
            let bad = faulty(Fault::new(call, 0, Failure::Hang));
            let devices = [Arc::clone(&bad) as Arc<dyn Device>, cpus(2).remove(1)];
            let scene = Arc::clone(&fixture().scene);
            let balancer = Balancer::open(scene, &devices, &impatient(), Control::default());
            let mut balancer = balancer.unwrap_or_else(|error| panic!("{what}: {error}"));
            for _ in 0..3 {
                let run = trace_well(&what, &mut balancer, &mut sampling(queue, impatient()));
                assert!(run.report.devices.iter().all(|device| device.error.is_none()), "{what}: it is lost too soon");
            }
            // A tracer that hangs when it is dropped is no exception, but there is a limit of seconds to that.
            bad.release();
        }
    }
}

/// Mutants: a device beyond its limit is not given up; it is waited for again in the next stream.
#[test]
fn a_device_that_never_returns_is_given_up_and_named() {
    let soon = Limits { lost: Duration::from_millis(50), ..impatient() };
    for call in [FaultyCall::Prepare, FaultyCall::Load, FaultyCall::Walk, FaultyCall::Submit, FaultyCall::Wait] {
        let what = format!("silence at {call:?}");
        let (bad, mut balancer) = beside_a_good_one(Fault::new(call, 0, Failure::Hang));
        let told = until_it_fails_slowly(&what, &mut balancer, soon);
        assert!(told.contains("hangs"), "{what}: the report tells {told}");
        bad.release();

        let bad = faulty(Fault::new(call, 0, Failure::Hang));
        let mut alone = crate::fixture::balancer(&[Arc::clone(&bad) as Arc<dyn Device>]);
        match trace(&what, &mut alone, &mut sampling(QueueKind::Static, soon), Control::default()) {
            Err(BalanceError::AllDevicesLost { failures, .. }) => assert!(failures[0].1.contains("hangs"), "{what}"),
            other => panic!("{what}: {other:?}"),
        }
        bad.release();
    }
}

/// The limit is not reached before the others are done, unless there are streams enough.
fn until_it_fails_slowly(what: &str, balancer: &mut Balancer, limits: Limits) -> String {
    loop {
        let run = trace_well(what, balancer, &mut sampling(QueueKind::Hybrid, limits));
        if let Some(told) = run.report.devices[0].error.clone() {
            return told;
        }
    }
}

/// Who comes late is heard all the same, and stays.
///
/// Mutants: late answers overwrite tasks that another has finished and counts them twice; `readmit` left out, where all
/// devices are late once; a late device is dropped.
#[test]
fn late_answers_are_taken_or_ignored() {
    let late = Failure::Delay(Duration::from_millis(120));
    for queue in QUEUES {
        for call in [FaultyCall::Load, FaultyCall::Walk, FaultyCall::Submit, FaultyCall::Wait] {
            for after in [0, 2] {
                let what = format!("{queue:?}, late at {call:?} after {after}");
                let devices = [0, 1].map(|_| faulty(Fault::new(call, after, late)) as Arc<dyn Device>);
                let mut balancer = balancer(&devices);
                for _ in 0..4 {
                    let run = trace_well(&what, &mut balancer, &mut sampling(queue, impatient()));
                    assert!(run.report.devices.iter().all(|device| device.error.is_none()), "{what}");
                }
                // Both work again as soon as both are back; for ever, if one is not.
                let mut all_work = || {
                    let run = trace_well(&what, &mut balancer, &mut uniform(QueueKind::Static, patient()));
                    run.report.devices.iter().all(|device| device.tasks > 0)
                };
                while !all_work() {}
            }
        }
    }
}

/// Where all others fail, a device that was left out since it was late does it all.
///
/// Mutant: the stream ends when all devices that began it are lost.
#[test]
fn a_late_device_comes_to_help_where_all_others_fail() {
    let late = Failure::Delay(Duration::from_millis(300));
    let lost = Failure::Error(rt_core::DeviceErrorKind::Lost);
    for lateness in [FaultyCall::Prepare, FaultyCall::Load] {
        for loss in [FaultyCall::Walk, FaultyCall::Submit, FaultyCall::Wait] {
            let what = format!("late at {lateness:?}, lost at {loss:?}");
            let faults = [Fault::new(lateness, 0, late), Fault::new(loss, 0, lost)];
            let mut balancer = balancer(&faults.map(|fault| faulty(fault) as Arc<dyn Device>));
            let run = trace_well(&what, &mut balancer, &mut sampling(QueueKind::Hybrid, impatient()));
            assert!(run.report.devices[0].error.is_none(), "{what}: {:?}", run.report.devices[0]);
        }
    }
}

/// Mutants: any of the waits does not look at the flag.
#[test]
fn cancelling_does_not_wait_for_a_device() {
    for call in [FaultyCall::Prepare, FaultyCall::Load, FaultyCall::Walk, FaultyCall::Submit, FaultyCall::Wait] {
        let what = format!("cancelled at {call:?}");
        let (bad, mut balancer) = beside_a_good_one(Fault::new(call, 0, Failure::Hang));
        let cancel = AtomicBool::new(false);
        let control = Control { cancel: Some(&cancel), ..Control::default() };
        let answer = thread::scope(|scope| {
            scope.spawn(|| {
                while !bad.hangs() {
                    thread::yield_now();
                }
                cancel.store(true, Ordering::Relaxed);
            });
            // On a busy machine the other device may do all the work.
            let mut once = || trace(&what, &mut balancer, &mut sampling(QueueKind::Hybrid, patient()), control);
            std::iter::repeat_with(&mut once).find_map(Result::err)
        });
        assert!(matches!(answer, Some(BalanceError::Cancelled { .. })), "{what}: {answer:?}");
        bad.release();
        let run = trace_well(&what, &mut balancer, &mut uniform(QueueKind::Static, patient()));
        assert!(run.report.devices.iter().all(|device| device.error.is_none() && device.tasks > 0), "{what}");
    }
}

/// The scene cannot be brought anywhere, and the caller has enough.
#[test]
fn cancelling_does_not_wait_for_the_scene() {
    let bad = faulty(Fault::new(FaultyCall::Open, 0, Failure::Hang));
    let cancel = AtomicBool::new(false);
    let control = Control { cancel: Some(&cancel), ..Control::default() };
    let devices = [Arc::clone(&bad) as Arc<dyn Device>];
    let answer = thread::scope(|scope| {
        scope.spawn(|| {
            while !bad.hangs() {
                thread::yield_now();
            }
            cancel.store(true, Ordering::Relaxed);
        });
        Balancer::open(Arc::clone(&fixture().scene), &devices, &patient(), control)
    });
    assert!(matches!(answer, Err(BalanceError::Cancelled { .. })), "{answer:?}");
    bad.release();
}

/// A device that reports its own hang is dropped when it does, and one that fails is dropped at once.
#[test]
fn reported_errors_cost_the_device() {
    use rt_core::DeviceErrorKind::{Hung, Lost, OutOfMemory};
    let calls = [FaultyCall::Load, FaultyCall::Walk, FaultyCall::Submit, FaultyCall::Wait];
    for (call, kind) in calls.into_iter().zip([OutOfMemory, Lost, Lost, Hung]) {
        let what = format!("{kind:?} at {call:?}");
        let (_bad, mut balancer) = beside_a_good_one(Fault::new(call, 0, Failure::Error(kind)));
        let told = until_it_fails(&what, &mut balancer, &mut sampling(QueueKind::Hybrid, patient()));
        assert!(told.contains("injected fault"), "{what}: the report tells {told}");
    }
    assert!(FOR_EVER > Limits::default().lost);
}
