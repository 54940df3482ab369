//! The promises of raybalance as a suite that anybody can run on any device.
//!
//! [`Suite`] holds the cases; it traces each on a [`rt_core::Device`], judges every hit without looking at how the
//! device found it, and counts. What a count stands for is a [`Promise`]; how sure it is say Clopper–Pearson bounds
//! ([`stats`]).
//!
//! What the cases are made of is here as well, for other tests to use:
//!
//! * [`mod@reference`]: the one right answer for a ray, and what tracers of other definitions may say ([`exact`]
//!   decides one triangle); [`brute`]: the same by the kernels' own test.
//! * [`shapes`], [`rays`]: triangles and rays that make trouble; [`closed`]: surfaces that no ray may leave.
//! * [`accuracy`]: hits compared with double precision, and with the exact reference on a sample.
//! * [`tree`]: triangles turned into scenes, and `rt_bvh`'s own answers.
//! * [`stats`]: medians, order-statistic intervals, paired ratios, bounds of rates.
//!
//! # Current state and limits
//!
//! * The reference tests every ray with every triangle: about 10⁸ tests a second on one core.
//! * Promises about time (robust against fast, invalid rays, builds) are measured elsewhere: `raybalance tradeoff
//!   precision` and the benchmarks. Here counts stand for time where a device has them.
#![forbid(unsafe_code)]

pub mod accuracy;
pub mod brute;
mod cases;
pub mod closed;
pub mod exact;
mod promise;
pub mod rays;
pub mod reference;
mod report;
pub mod shapes;
pub mod stats;
mod suite;
mod tally;
pub mod tree;
mod trial;

pub use promise::Promise;
pub use report::{DeviceReport, Row, Verdict};
pub use rt_core::clock::now as clock;
pub use suite::{Extent, Options, Stopped, Subject, Suite, Watch};
