//! Estimators that are only tried, against counts that are known.

mod learned;
mod worth;

use super::*;
use proptest::prelude::*;
use rt_core::{
    CostEstimator, CostModel, Observation, RayStream, Step, StreamKind, StreamRecord, Task, TestCounts, Work, random,
    tasks_of,
};

fn stream(kind: StreamKind, tasks: &[Task], seed: u32) -> RayStream<'_> {
    RayStream { seed, devices: 2, ..RayStream::new(kind, tasks) }
}

/// The estimator that the tried ones are to be better than.
fn exact(fraction: Fraction) -> Box<dyn CostEstimator> {
    let entry = catalogue::find(catalogue::ESTIMATORS, "exact").expect("the catalogue has it");
    entry.sampling(fraction).expect("it takes a share").make()
}

/// Does what a driver does: walks what is asked for until the estimate is there. Returns it and the rays walked.
fn estimate(
    estimator: &mut dyn CostEstimator,
    stream: RayStream<'_>,
    counts: &dyn Fn(u32) -> TestCounts,
) -> (Vec<Work>, usize) {
    let mut walked = 0;
    let mut rays = Vec::new();
    let mut seen = Vec::new();
    for _ in 0..10 {
        match estimator.next(stream, Observation { rays: &rays, counts: &seen }) {
            Step::Done(work) => return (work, walked),
            Step::Sample { rays: asked, .. } => {
                walked += asked.len();
                seen = asked.iter().map(|&ray| counts(ray)).collect();
                rays = asked;
            }
        }
    }
    panic!("the estimator asks for ever");
}

/// Skewed counts without order, as diffuse rays have.
fn diffuse(ray: u32) -> TestCounts {
    let [a, b] = random::pair(3, ray, 0);
    let [c, _] = random::pair(3, ray, 1);
    TestCounts { boxes: (10.0 + 60.0 * a + 30.0 * a * b) as u32, triangles: (8.0 * c) as u32 }
}

fn truth(task: Task, counts: &dyn Fn(u32) -> TestCounts) -> f64 {
    task.range().map(|ray| f64::from(counts(ray).boxes + counts(ray).triangles)).sum()
}

#[test]
fn names_are_those_that_reports_have() {
    for entry in all() {
        assert_eq!(entry.usual().make().name(), entry.name);
    }
    assert_eq!(all()[0].name, catalogue::ESTIMATORS[0].name, "the default comes first");
}
