//! Test equipment for raybalance and its backends.
//!
//! * [`conformance`]: what every device must do, as cases that any backend can run.
//! * [`mod@reference`]: the exact answer for a ray, or the reason why there is more than one; [`brute`]: the defined bits.
//! * [`shapes`], [`rays`], [`scenes`]: triangles and rays that make trouble, and real scenes.
//! * [`strategy`]: the same for proptest.
//! * [`parity`]: trees compared with the exact reference on whole scenes.
//! * [`peers`]: Embree and obvhs behind our traits; [`judge`]: who is right where they differ from us.
//! * [`fake`]: a correct device without hardware, and flawed ones that the suite must find out.
//!
//! # Current state and limits
//!
//! * The cases about counts demand `rt_bvh`'s own counts, so a backend with another layout fails them.
//! * `reports_the_defined_bits` demands double precision; a device without it may still pass every case about which
//!   triangle is hit.
//! * The reference tests every ray with every triangle: about 10⁸ tests a second on one core.
#![forbid(unsafe_code)]

pub mod brute;
pub mod conformance;
pub mod exact;
pub mod fake;
pub mod judge;
pub mod parity;
pub mod peers;
pub mod rays;
pub mod reference;
pub mod scenes;
pub mod shapes;
pub mod strategy;
pub mod tree;

/// Whether a list separated by commas, the environment variable `RT_REQUIRE`, names what must not be missing.
#[must_use]
pub fn is_required(name: &str) -> bool {
    std::env::var("RT_REQUIRE").is_ok_and(|list| is_listed(name, &list))
}

/// Whether `name` is in a list separated by commas.
fn is_listed(name: &str, list: &str) -> bool {
    list.split(',').any(|entry| entry.trim() == name)
}
