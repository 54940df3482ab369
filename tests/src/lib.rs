//! Test equipment for raybalance and its backends.
//!
//! * [`scenes`]: real scenes; [`strategy`]: the shapes and rays of `rt_verify` for proptest.
//! * [`parity`]: trees compared with the exact reference on whole scenes.
//! * [`judge`]: who is right where Embree and obvhs differ from us.
//! * [`cards`]: which graphics cards are worth a test of their own.
//! * [`fake`]: a correct device without hardware, and flawed ones that the suites must find out.
//!
//! The exact reference, brute force, shapes and rays are in `rt_verify`, whose suite users run.
//!
//! # Current state and limits
//!
//! * The reference tests every ray with every triangle: about 10⁸ tests a second on one core.
#![forbid(unsafe_code)]

pub mod cards;
pub mod fake;
pub mod judge;
pub mod parity;
pub mod scenes;
pub mod strategy;
