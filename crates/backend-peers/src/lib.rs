//! Other tracers behind raybalance's traits, so that whatever runs on its devices runs on them: the command's `bench`,
//! parity, `raybalance verify`.
//!
//! * [`backends`]: all of them by name, for lists of devices: `embree:2`, `embree-fast`, `obvhs:1`, `obvhs-wide:1`.
//! * [`all`]: one of each that is here, on one thread.
//! * `EmbreeDevice`: Embree 4, with or without its robust flag, loaded at run time.
//! * `ObvhsDevice`: the crate `obvhs`, its two-wide tree or its compressed eight-wide one.
//!
//! A peer is given the triangles as their file has them, in the order of their ids, not our tree nor our scaling. It
//! keeps what its own manual promises and no more: ties go to any triangle, and `t` is as exact as its arithmetic. So
//! it does not pass the conformance suite, and is not meant to.
//!
//! # Current state and limits
//!
//! * Without the feature `peers` there are the names alone: asked for a device, they say what is to be built.
//! * Peers count no tests: streams that ask for counts are refused as unsupported, and there are no walks.
//! * The precision of a stream is ignored: it is a property of the peer.
//! * Threads are not pinned, and Embree builds its tree on all cores whatever the number of threads.
#![forbid(unsafe_code)]

#[cfg(feature = "peers")]
mod embree;
mod named;
#[cfg(feature = "peers")]
mod obvhs;
#[cfg(feature = "peers")]
mod soup;
#[cfg(feature = "peers")]
mod tracer;

#[cfg(feature = "peers")]
pub use embree::{EmbreeDevice, EmbreeOptions};
pub use named::{all, backends};
#[cfg(feature = "peers")]
pub use obvhs::{ObvhsDevice, ObvhsLayout};
