//! Queues of the caller's own that break their promises, and estimators that share a name.

use crate::fixture::{balancer, cpus, fixture, patient, trace, trace_well, uniform};
use rt_balance::policies::{Block, RoundRobin};
use rt_balance::queues::{Dealt, Needs, Pop, QueueMaker, TaskQueue};
use rt_balance::{
    BalanceError, Control, CostEstimator, Observation, QueueKind, RayStream, Scheduling, Step, TaskId, Work,
};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// What a queue does wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wrong {
    DoneAtOnce,
    WaitForEver,
    Unknown,
    EmptyLaunch,
    SameForEver,
    Twice,
    Panic,
}

#[derive(Clone, Copy, Debug)]
struct Own(Wrong);

impl QueueMaker for Own {
    fn name(&self) -> &'static str {
        "own"
    }

    fn needs(&self) -> Needs {
        Needs::Nothing
    }

    fn make(&self, dealt: Dealt<'_>) -> Box<dyn TaskQueue> {
        assert!(dealt.schedule.lists().is_empty());
        Box::new(OwnQueue(self.0, dealt.work.len() as TaskId))
    }
}

#[derive(Debug)]
struct OwnQueue(Wrong, TaskId);

impl TaskQueue for OwnQueue {
    fn pop(&self, _: usize, out: &mut Vec<TaskId>) -> Pop {
        out.clear();
        let all = self.1;
        match self.0 {
            Wrong::DoneAtOnce => return Pop::Done,
            Wrong::WaitForEver => return Pop::Wait,
            Wrong::Unknown => out.push(all),
            Wrong::EmptyLaunch => {}
            Wrong::SameForEver => out.push(0),
            Wrong::Twice => out.extend((0..all).chain(0..all)),
            Wrong::Panic => panic!("the caller's queue"),
        }
        Pop::Launch
    }

    fn finish(&self, _: usize, _: &[TaskId]) {}

    fn retire(&self, _: usize, _: &[TaskId]) {}

    fn unfinished_tasks(&self) -> Vec<TaskId> {
        Vec::new()
    }
}

fn own(wrong: Wrong) -> Scheduling {
    Scheduling { queue: Box::new(Own(wrong)), ..uniform(QueueKind::Hybrid, patient()) }
}

/// Mutants: any of the checks of what a queue hands out; the stream ends well though tasks are open; it waits for ever.
#[test]
fn a_queue_that_breaks_its_promises_is_named() {
    let mut balancer = balancer(&cpus(2));
    let mistakes = [
        (Wrong::DoneAtOnce, "50 of 50 tasks are open"),
        (Wrong::WaitForEver, "50 of 50 tasks are open"),
        (Wrong::Unknown, "task 50, but there are only 50"),
        (Wrong::EmptyLaunch, "a launch without tasks"),
        (Wrong::SameForEver, "for ever"),
    ];
    for (wrong, told) in mistakes {
        let what = format!("{wrong:?}");
        match trace(&what, &mut balancer, &mut own(wrong), Control::default()) {
            Err(error @ BalanceError::Queue { queue: "own", .. }) => {
                assert!(error.to_string().contains(told), "{what}: {error}");
            }
            other => panic!("{what}: {other:?}"),
        }
        // In turn, so that every device has tasks whatever speeds were measured in streams of 50.
        let mut after = Scheduling { policy: Some(Box::new(RoundRobin)), ..uniform(QueueKind::Static, patient()) };
        let run = trace_well(&what, &mut balancer, &mut after);
        assert!(run.report.devices.iter().all(|device| device.error.is_none() && device.tasks > 0), "{what}");
    }
    // Handed out twice, done once.
    trace_well("twice", &mut balancer, &mut own(Wrong::Twice));
    let panic = catch_unwind(AssertUnwindSafe(|| {
        trace("a queue that panics", &mut balancer, &mut own(Wrong::Panic), Control::default())
    }));
    let said = panic.expect_err("passed on");
    assert_eq!(said.downcast_ref::<&str>().copied(), Some("the caller's queue"));
    trace_well("after the queue", &mut balancer, &mut uniform(QueueKind::Static, patient()));
}

/// Mutant: what a queue needs is not asked.
#[test]
fn a_policy_without_effect_is_refused() {
    let mut scheduling = Scheduling { policy: Some(Box::new(Block)), ..own(Wrong::Twice) };
    let answer = trace("a policy", &mut balancer(&cpus(2)), &mut scheduling, Control::default());
    assert!(matches!(answer, Err(BalanceError::PolicyUnused { policy: "block", queue: "own" })), "{answer:?}");
    // Every queue of ours takes every policy.
    for kind in crate::fixture::QUEUES {
        let mut scheduling = Scheduling { policy: Some(Box::new(Block)), ..uniform(kind, patient()) };
        trace_well("block", &mut balancer(&cpus(2)), &mut scheduling);
    }
}

/// One test a ray, or a thousand: counts of two types, under one name.
#[derive(Debug)]
struct Few;

#[derive(Debug)]
struct Many;

fn counting(stream: RayStream<'_>, tests: f32) -> Step {
    Step::Done(stream.tasks.iter().map(|task| Work::new(task.rays as f32, task.rays as f32 * tests, 0.0)).collect())
}

impl CostEstimator for Few {
    fn name(&self) -> &'static str {
        "mine"
    }

    fn next(&mut self, stream: RayStream<'_>, _: Observation<'_>) -> Step {
        counting(stream, 1.0)
    }
}

impl CostEstimator for Many {
    fn name(&self) -> &'static str {
        "mine"
    }

    fn next(&mut self, stream: RayStream<'_>, _: Observation<'_>) -> Step {
        counting(stream, 1000.0)
    }
}

/// Mutant: prices are kept by the names that people read. Then the second estimator finds those of the first.
#[test]
fn estimators_of_one_name_do_not_share_prices() {
    let mut balancer = balancer(&cpus(1));
    let mut predicted = |estimator: Box<dyn CostEstimator>| -> f64 {
        let mut scheduling = Scheduling { estimator, ..uniform(QueueKind::Static, patient()) };
        let run = trace_well("one name", &mut balancer, &mut scheduling);
        run.predicted_s.iter().sum()
    };
    // A nanosecond for each ray and test, before anything is known of them.
    let tests = |each: f64| fixture().hits.len() as f64 * (1.0 + each) * 1e-9;
    let near = |found: f64, wanted: f64| (found / wanted - 1.0).abs() < 1e-3;
    assert!(near(predicted(Box::new(Few)), tests(1.0)));
    assert!(!near(predicted(Box::new(Few)), tests(1.0)), "nothing was learned");
    assert!(near(predicted(Box::new(Many)), tests(1000.0)), "the prices of another estimator");
}
