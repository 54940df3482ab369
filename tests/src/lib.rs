//! Test equipment for raybalance and its backends: an exact reference for ray–triangle hits.
#![forbid(unsafe_code)]

pub mod exact;
pub mod reference;
