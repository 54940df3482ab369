//! Panics: a backend's cost the device, the caller's are passed on.

use crate::fixture::{
    QUEUES, balancer, beside_a_good_one, cpu, cpus, fixture, patient, sampling, trace, trace_well, uniform,
    until_it_fails,
};
use rt_balance::middleware::{Failure, Fault, FaultyCall};
use rt_balance::policies::Policy;
use rt_balance::{BalanceError, Balancer, Control, CostEstimator, Device, QueueKind, Scene, Scheduling, Tracer, Work};
use rt_core::{Clock, CostModel, DeviceError, DeviceInfo, Observation, RayStream, Step};
use rt_sched::Schedule;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

/// Mutants: rays of a panicked walk stay marked as found; popped tasks are in flight only after `submit`; a call that
/// is not contained.
#[test]
fn a_panic_anywhere_in_a_device_costs_that_device_alone() {
    for queue in QUEUES {
        for call in FaultyCall::ALL.into_iter().filter(|call| *call != FaultyCall::Drop) {
            let what = format!("{queue:?}, a panic at {call:?}");
            let (_bad, mut balancer) = beside_a_good_one(Fault::new(call, 0, Failure::Panic));
            let mut scheduling = sampling(queue, patient());
            let told = until_it_fails(&what, &mut balancer, &mut scheduling);
            assert!(told.contains(&format!("a panic at {call:?}")), "{what}: the report tells {told}");
            // It does not come back.
            let run = trace_well(&what, &mut balancer, &mut scheduling);
            assert!(run.report.devices[0].error.is_some() && run.report.devices[1].error.is_none(), "{what}");
        }
    }
}

/// Mutant: the tracer is dropped outside of what contains panics.
#[test]
fn a_panic_in_a_destructor_costs_nothing() {
    let (_bad, mut balancer) = beside_a_good_one(Fault::new(FaultyCall::Drop, 0, Failure::Panic));
    let run = trace_well("a panic at Drop", &mut balancer, &mut sampling(QueueKind::Hybrid, patient()));
    assert!(run.report.devices.iter().all(|device| device.error.is_none()));
    drop(balancer);
}

/// A device that does not even say what it is.
#[derive(Debug)]
struct Nameless(Arc<dyn Device>);

impl Device for Nameless {
    fn info(&self) -> &DeviceInfo {
        panic!("it has forgotten its name")
    }

    fn tracer(&self, scene: Arc<Scene>, clock: Clock) -> Result<Box<dyn Tracer>, DeviceError> {
        self.0.tracer(scene, clock)
    }
}

#[test]
fn a_device_that_cannot_tell_what_it_is_is_left_out() {
    let nameless = || Arc::new(Nameless(cpu())) as Arc<dyn Device>;
    let mut balancer = balancer(&[nameless(), cpu()]);
    let run = trace_well("nameless", &mut balancer, &mut sampling(QueueKind::Hybrid, patient()));
    let told = run.report.devices[0].error.clone().expect("named");
    assert!(told.contains("forgotten its name") && run.report.devices[0].name == "device 0", "{told}");
    let error = Balancer::new(Arc::clone(&fixture().scene), &[nameless()]).expect_err("nobody is left");
    assert!(matches!(error, BalanceError::Open { .. }), "{error:?}");
}

/// What a panic of the caller's own says, when a stream is traced with it.
fn passed_on(balancer: &mut Balancer, scheduling: &mut Scheduling, control: Control<'_>) -> &'static str {
    let panic = catch_unwind(AssertUnwindSafe(|| trace("the caller panics", balancer, scheduling, control)));
    let panic = panic.expect_err("a panic that is passed on");
    panic.downcast_ref::<&'static str>().copied().expect("the caller's own words")
}

/// No device has failed, and the next stream is right.
fn is_well(what: &str, balancer: &mut Balancer) {
    let run = trace_well(what, balancer, &mut sampling(QueueKind::Hybrid, patient()));
    let told: Vec<_> = run.report.devices.iter().filter_map(|device| device.error.clone()).collect();
    assert!(told.is_empty(), "{what}: {told:?}");
    assert!(run.report.devices.iter().all(|device| device.note.is_none()), "{what}: a device was left out");
}

/// Mutant: a device is blamed for what the callback does.
#[test]
fn a_panic_of_the_progress_callback_is_passed_on() {
    for queue in QUEUES {
        let mut balancer = balancer(&cpus(2));
        let progress = |_, _| panic!("the caller's callback");
        let control = Control { progress: Some(&progress), ..Control::default() };
        assert_eq!(passed_on(&mut balancer, &mut uniform(queue, patient()), control), "the caller's callback");
        is_well("after a panic of the callback", &mut balancer);
    }
}

/// An estimator or policy that panics.
#[derive(Debug)]
struct Panicky;

impl CostEstimator for Panicky {
    fn name(&self) -> &'static str {
        "panicky"
    }

    fn next(&mut self, _: RayStream<'_>, _: Observation<'_>) -> Step {
        panic!("the caller's estimator")
    }
}

impl Policy for Panicky {
    fn name(&self) -> &'static str {
        "panicky"
    }

    fn schedule(&self, _: &[Work], _: &[CostModel]) -> Schedule {
        panic!("the caller's policy")
    }
}

#[test]
fn a_panic_of_an_estimator_or_policy_is_passed_on() {
    let mut balancer = balancer(&cpus(2));
    let mut scheduling = Scheduling { estimator: Box::new(Panicky), ..Scheduling::default() };
    assert_eq!(passed_on(&mut balancer, &mut scheduling, Control::default()), "the caller's estimator");
    is_well("after a panic of the estimator", &mut balancer);
    let mut scheduling = Scheduling { policy: Some(Box::new(Panicky)), ..uniform(QueueKind::Static, patient()) };
    assert_eq!(passed_on(&mut balancer, &mut scheduling, Control::default()), "the caller's policy");
    is_well("after a panic of the policy", &mut balancer);
}
