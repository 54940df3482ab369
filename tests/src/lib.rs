//! Test equipment for raybalance and its backends: an exact reference for ray–triangle hits, shapes and rays that make
//! trouble, and proptest strategies.
#![forbid(unsafe_code)]

pub mod brute;
pub mod exact;
pub mod rays;
pub mod reference;
pub mod shapes;
pub mod strategy;
