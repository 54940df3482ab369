//! Test equipment for raybalance and its backends.
//!
//! * [`conformance`]: what every device must do, as cases that any backend can run.
//! * [`scenes`]: real scenes; [`strategy`]: the shapes and rays of `rt_verify` for proptest.
//! * [`parity`]: trees compared with the exact reference on whole scenes.
//! * [`peers`]: Embree and obvhs behind our traits; [`judge`]: who is right where they differ from us.
//! * [`fake`]: a correct device without hardware, and flawed ones that the suites must find out.
//!
//! The exact reference, brute force, shapes and rays are in `rt_verify`, whose suite users run.
//!
//! # Current state and limits
//!
//! * The cases about counts demand `rt_bvh`'s own counts, so a backend with another layout fails them.
//! * `reports_the_defined_bits` demands double precision; a device without it may still pass every case about which
//!   triangle is hit.
//! * The reference tests every ray with every triangle: about 10⁸ tests a second on one core.
#![forbid(unsafe_code)]

pub mod conformance;
pub mod fake;
pub mod judge;
pub mod parity;
pub mod peers;
pub mod scenes;
pub mod strategy;

/// Whether a list separated by commas, the environment variable `RT_REQUIRE`, names what must not be missing.
#[must_use]
pub fn is_required(name: &str) -> bool {
    std::env::var("RT_REQUIRE").is_ok_and(|list| is_listed(name, &list))
}

/// Whether `name` is in a list separated by commas.
fn is_listed(name: &str, list: &str) -> bool {
    list.split(',').any(|entry| entry.trim() == name)
}
