//! Cost-based balancing of ray tracing over several devices.
#![forbid(unsafe_code)]

pub mod report;
