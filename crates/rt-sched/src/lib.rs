//! Everything that decides who traces what: sampling, cost estimators, scheduling policies, task queues, calibration,
//! a simulator, lower bounds and metrics.
//!
//! The crate knows no device. It reads work and cost models, names rays and tasks, and leaves walking and tracing to
//! its caller, so all of it runs without hardware, on a virtual clock ([`simulate`]) as well as on a real one.
//!
//! The way of a stream through it: [`estimate`] names sample rays (chosen by [`sample`]) and turns their counts into
//! work per task; [`calibrate`] turns measured launches into each device's seconds for that work; a [`policy`] deals
//! the tasks; a [`queue`] hands them out launch by launch; [`bound`] and [`metrics`] say how good that was.
//!
//! The feature `test-support` adds what tests of estimators have in common; it changes nothing else.
//!
//! `no_std` with `alloc`. Current limits: a policy sees expected costs only, not their standard errors; queues know no
//! clock, so a device that is late is noticed by others only when they run dry.
#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;
#[cfg(test)]
extern crate std;

pub mod bound;
pub mod calibrate;
pub mod cut;
pub mod estimate;
pub mod metrics;
pub mod policy;
pub mod queue;
pub mod sample;
mod schedule;
pub mod simulate;
#[cfg(any(test, feature = "test-support"))]
pub mod test_support;
pub mod uninformed;

pub use schedule::{Schedule, ScheduleError};
