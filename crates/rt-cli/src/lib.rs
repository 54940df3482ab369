//! The parts of the command `raybalance` that can be tested without running it: files in and out, pictures, charts.
#![forbid(unsafe_code)]

pub mod chart;
pub mod image;
pub mod npy;
pub mod output;
