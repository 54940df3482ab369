//! What tests of estimators have in common: streams, counts that are known, and a driver that walks.

use alloc::vec::Vec;
use rt_core::{CostEstimator, Observation, RayStream, Step, StreamKind, Task, TestCounts, Work, random};

/// A stream on two devices.
#[must_use]
pub const fn stream(kind: StreamKind, tasks: &[Task], seed: u32) -> RayStream<'_> {
    RayStream { seed, devices: 2, ..RayStream::new(kind, tasks) }
}

/// Does what a driver does: walks what is asked for until the estimate is there. Returns it and the number of rays
/// walked.
///
/// # Panics
/// When the estimator asks ten times.
pub fn estimate(
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
#[must_use]
pub fn diffuse(ray: u32) -> TestCounts {
    let [a, b] = random::pair(3, ray, 0);
    let [c, _] = random::pair(3, ray, 1);
    TestCounts { boxes: (10.0 + 60.0 * a + 30.0 * a * b) as u32, triangles: (8.0 * c) as u32 }
}

/// Tests of all rays of a task.
pub fn truth(task: Task, counts: &dyn Fn(u32) -> TestCounts) -> f64 {
    task.range().map(|ray| f64::from(counts(ray).boxes + counts(ray).triangles)).sum()
}
