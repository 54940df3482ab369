//! Mistakes of the caller: they are told, and cost no device.

use crate::fixture::{
    balancer, beside_a_good_one, cpus, faulty, fixture, patient, sampling, trace, trace_well, uniform,
};
use rt_balance::middleware::{Failure, Fault, FaultyCall, Record, Recorded};
use rt_balance::policies::{Lpt, Policy};
use rt_balance::{
    BalanceError, Balancer, Control, CostEstimator, Device, Hit, QueueKind, RaySource, Scheduling, Stream, TestCounts,
    Walk, Work,
};
use rt_core::{CostModel, DeviceErrorKind, Observation, RayStream, Step, Task};
use rt_sched::Schedule;
use std::sync::Arc;

/// A mistake: how it is made, what error it is, and what that has to name.
struct Mistake {
    names: &'static str,
    is: fn(&BalanceError) -> bool,
    /// Whether it can only be seen when the devices have the rays.
    is_seen_late: bool,
    stream: Stream,
    scheduling: Scheduling,
    /// Room for hits and counts beyond the rays.
    more: [isize; 2],
}

fn mistake(names: &'static str, is: fn(&BalanceError) -> bool) -> Mistake {
    let (stream, scheduling) = (fixture().stream.clone(), uniform(QueueKind::Hybrid, patient()));
    Mistake { names, is, is_seen_late: false, stream, scheduling, more: [0; 2] }
}

/// An estimator that answers at once, or asks for something first.
#[derive(Debug)]
struct Wrong {
    asks: Vec<u32>,
    more_tasks: isize,
}

impl CostEstimator for Wrong {
    fn name(&self) -> &'static str {
        "wrong"
    }

    fn next(&mut self, stream: RayStream<'_>, seen: Observation<'_>) -> Step {
        if seen.rays.is_empty() && !self.asks.is_empty() {
            return Step::Sample { rays: self.asks.clone(), walk: Walk::Full };
        }
        let tasks = stream.tasks.len().saturating_add_signed(self.more_tasks);
        Step::Done(vec![Work::new(f32::NAN, f32::NAN, f32::INFINITY); tasks])
    }
}

/// A policy that leaves the last task out, or the last device.
#[derive(Debug)]
struct Careless {
    tasks: usize,
    devices: usize,
}

impl Policy for Careless {
    fn name(&self) -> &'static str {
        "careless"
    }

    fn schedule(&self, work: &[Work], devices: &[CostModel]) -> Schedule {
        Lpt.schedule(&work[self.tasks..], &devices[self.devices..])
    }
}

fn mistakes() -> Vec<Mistake> {
    let rays = fixture().hits.len() as u32;
    let estimating = |names, asks: &[u32], more_tasks| {
        let mut wrong = mistake(names, |error| matches!(error, BalanceError::Estimator { estimator: "wrong", .. }));
        wrong.scheduling.estimator = Box::new(Wrong { asks: asks.to_vec(), more_tasks });
        Mistake { is_seen_late: true, ..wrong }
    };
    let dealing = |names, tasks, devices| {
        let policy: Option<Box<dyn Policy>> = Some(Box::new(Careless { tasks, devices }));
        let scheduling = Scheduling { policy, ..uniform(QueueKind::Static, patient()) };
        let wrong = mistake(names, |error| matches!(error, BalanceError::Policy { policy: "careless", .. }));
        Mistake { is_seen_late: true, scheduling, ..wrong }
    };
    let length = |names| mistake(names, |error| matches!(error, BalanceError::Length { .. }));
    let cut = |names, change: fn(&mut Vec<Task>)| {
        let mut wrong = mistake(names, |error| matches!(error, BalanceError::Tasks { .. }));
        change(&mut wrong.stream.tasks);
        wrong
    };
    let starting = |number: usize| {
        let mut wrong = length("`origins`");
        if let RaySource::Explicit { origins, .. } = &mut wrong.stream.source {
            *origins = Some(vec![u32::MAX; number].into());
        }
        wrong
    };
    let losing = |excess| {
        let mut wrong = mistake("uninformed_excess", |error| matches!(error, BalanceError::UninformedExcess(_)));
        wrong.scheduling.uninformed_excess = Some(excess);
        wrong
    };
    vec![
        Mistake { more: [-1, 0], ..length("`hits`") },
        Mistake { more: [1, 0], ..length("`hits`") },
        Mistake { more: [0, -1], ..length("`counts`") },
        starting(0),
        starting(rays as usize - 1),
        starting(rays as usize + 1),
        cut("`tasks`", |tasks| _ = tasks.remove(3)),
        cut("`tasks`", |tasks| _ = tasks.pop()),
        cut("`tasks`", |tasks| tasks.push(Task { first: u32::MAX, rays: u32::MAX })),
        cut("`tasks`", |tasks| tasks[1].rays += 1),
        estimating("ray 3001", &[0, rays], 0),
        estimating("ray 4294967295", &[u32::MAX], 0),
        estimating("49 tasks", &[], -1),
        estimating("51 tasks", &[7, 8], 1),
        dealing("other tasks", 1, 0),
        dealing("other devices", 0, 1),
        losing(f64::NAN),
        losing(-0.5),
    ]
}

/// Mutants: any of the checks left out, or made after the devices were asked; a device dropped for what the caller did.
#[test]
fn a_mistake_is_told_and_costs_nothing() {
    let recorded: Vec<Arc<Recorded>> = cpus(2).into_iter().map(|device| Arc::new(Recorded::new(device))).collect();
    let devices: Vec<Arc<dyn Device>> = recorded.iter().map(|device| Arc::clone(device) as _).collect();
    let mut balancer = balancer(&devices);
    let seen = |late: bool| {
        let records = recorded.iter().flat_map(|device| device.records());
        records.filter(|record| !late || matches!(record, Record::Submit { .. })).count()
    };
    for mut wrong in mistakes() {
        let before = seen(wrong.is_seen_late);
        let room = |more: isize| fixture().hits.len().saturating_add_signed(more);
        let mut hits = vec![Hit::MISS; room(wrong.more[0])];
        let mut counts = vec![TestCounts::default(); room(wrong.more[1])];
        let counts = Some(&mut counts[..]);
        let answer = balancer.trace(&wrong.stream, &mut wrong.scheduling, &mut hits, counts, Control::default());
        let Err(error) = answer else { panic!("{}: {answer:?}", wrong.names) };
        assert!(error.to_string().contains(wrong.names), "no {:?} in {error}", wrong.names);
        assert!((wrong.is)(&error), "{}: {error:?}", wrong.names);
        assert_eq!(seen(wrong.is_seen_late), before, "{}: the devices saw it", wrong.names);
        is_well(wrong.names, &mut balancer);
    }
}

fn is_well(what: &str, balancer: &mut Balancer) {
    let run = trace_well(what, balancer, &mut uniform(QueueKind::Static, patient()));
    assert!(run.report.devices.iter().all(|device| device.error.is_none() && device.tasks > 0), "{what}");
}

/// Work that is no number cannot be made: [`Work::new`] takes it for none, and infinity for the most there is. So there
/// is nothing to refuse, and what such work stands for is traced.
#[test]
fn work_that_is_no_number_is_traced() {
    let estimator = Box::new(Wrong { asks: vec![5, 5, 6], more_tasks: 0 });
    let mut scheduling = Scheduling { estimator, ..uniform(QueueKind::Hybrid, patient()) };
    trace_well("work that is no number", &mut balancer(&cpus(2)), &mut scheduling);
}

/// A device that refuses a stream is left out of it, and has its part in the next; where all refuse, the caller is
/// told.
///
/// Mutants: a device is dropped that refuses rays; its refusal of a walk ends the stream.
#[test]
fn what_a_device_refuses_costs_it_nothing() {
    let refusals = [DeviceErrorKind::InvalidArgument, DeviceErrorKind::Unsupported];
    for (kind, call) in refusals.into_iter().flat_map(|kind| [(kind, FaultyCall::Load), (kind, FaultyCall::Walk)]) {
        let what = format!("{kind:?} at {call:?}");
        let fault = Fault::new(call, 0, Failure::Error(kind));
        let (_bad, mut balancer) = beside_a_good_one(fault);
        let run = trace_well(&what, &mut balancer, &mut sampling(QueueKind::Static, patient()));
        let [bad, good] = &run.report.devices[..] else { panic!("two devices") };
        assert!(bad.error.is_none() && good.error.is_none(), "{what}: {:?}", run.report.devices);
        if call == FaultyCall::Load {
            let note = bad.note.as_deref().unwrap_or_default();
            assert!(bad.tasks == 0 && note.contains("refused this stream"), "{what}: {bad:?}");
        }
        is_well(&what, &mut balancer);

        let all = [0, 1].map(|_| faulty(fault) as Arc<dyn Device>);
        let mut balancer = crate::fixture::balancer(&all);
        let answer = trace(&what, &mut balancer, &mut sampling(QueueKind::Static, patient()), Control::default());
        assert!(matches!(answer, Err(BalanceError::Refused { .. })), "{what}: {answer:?}");
        is_well(&what, &mut balancer);
    }
}
