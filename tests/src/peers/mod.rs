//! Other tracers behind our traits, so that whatever runs on our devices runs on them: parity, `raybalance verify`,
//! benchmarks.
//!
//! * [`EmbreeDevice`]: Embree 4, with or without its robust flag.
//! * [`ObvhsDevice`]: the crate `obvhs`, its two-wide tree or its compressed eight-wide one.
//!
//! A peer is given the triangles as their file has them, in the order of their ids, not our tree nor our scaling. It
//! keeps what its own manual promises and no more: ties go to any triangle, and `t` is as exact as its arithmetic. So
//! it does not pass the conformance suite, and is not meant to.
//!
//! # Current state and limits
//!
//! * One thread for each tracer.
//! * Peers count no tests: streams that ask for counts and reduced walks are refused as unsupported, and full walks
//!   return counts of 0.
//! * The precision of a stream is ignored: it is a property of the peer.

mod embree;
mod obvhs;
mod soup;
mod tracer;

pub use embree::{EmbreeDevice, EmbreeOptions};
pub use obvhs::{ObvhsDevice, ObvhsLayout};

use rt_core::{Capabilities, Counted, Device, DeviceInfo};
use std::sync::Arc;

/// What all peers say of themselves.
fn info(name: String, backend: &'static str) -> DeviceInfo {
    let capabilities = Capabilities::UNKNOWN.with_counts(Counted::Nothing);
    DeviceInfo::new(name, backend).with_in_flight(tracer::IN_FLIGHT).with_capabilities(capabilities)
}

/// Every peer that is here, the most careful first; and why others are not.
#[must_use]
pub fn all() -> (Vec<Arc<dyn Device>>, Vec<String>) {
    let (mut found, mut missing) = (Vec::<Arc<dyn Device>>::new(), Vec::new());
    for robust in [true, false] {
        match EmbreeDevice::open(EmbreeOptions { robust }) {
            Ok(device) => found.push(Arc::new(device)),
            Err(e) => missing.push(e.to_string()),
        }
    }
    // Both are missing for one reason.
    missing.dedup();
    found.extend(ObvhsLayout::ALL.map(|layout| Arc::new(ObvhsDevice::new(layout)) as Arc<dyn Device>));
    (found, missing)
}
