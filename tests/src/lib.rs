//! Test equipment for raybalance and its backends.
//!
//! * [`conformance`]: what every device must do, as cases that any backend can run.
//! * [`mod@reference`]: the exact answer for a ray, or the reason why there is more than one; [`brute`]: the defined bits.
//! * [`shapes`], [`rays`], [`scenes`]: triangles and rays that make trouble, and real scenes.
//! * [`strategy`]: the same for proptest.
//! * [`parity`]: trees compared with the exact reference on whole scenes.
//! * [`fake`]: a correct device without hardware, and flawed ones that the suite must find out.
#![forbid(unsafe_code)]

pub mod brute;
pub mod conformance;
pub mod exact;
pub mod fake;
pub mod parity;
pub mod rays;
pub mod reference;
pub mod scenes;
pub mod shapes;
pub mod strategy;
pub mod tree;
