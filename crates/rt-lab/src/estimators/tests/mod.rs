//! Estimators that are only tried, against counts that are known.

mod learned;
mod worth;

use super::*;
use proptest::prelude::*;
use rt_core::{
    CostEstimator, CostModel, Observation, RayStream, Step, StreamKind, StreamRecord, Task, TestCounts, Work, random,
    tasks_of,
};
use rt_sched::test_support::{diffuse, estimate, stream, truth};

/// The estimator that the tried ones are to be better than.
fn exact(fraction: Fraction) -> Box<dyn CostEstimator> {
    let entry = catalogue::find(catalogue::ESTIMATORS, "exact").expect("the catalogue has it");
    entry.sampling(fraction).expect("it takes a share").make()
}

#[test]
fn names_are_those_that_reports_have() {
    for entry in all() {
        assert_eq!(entry.usual().make().name(), entry.name);
    }
    assert_eq!(all()[0].name, catalogue::ESTIMATORS[0].name, "the default comes first");
}
