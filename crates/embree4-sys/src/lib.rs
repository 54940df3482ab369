//! Embree 4, loaded at run time: the reference that raybalance's tracers are compared with.
//!
//! `embree4-rs` 0.0.16 needs a crate `embree4-sys` 0.0.10. The published one is generated from Embree 4.2's headers,
//! and has a defect that corrupts memory: since 4.3 every hit writes four more bytes (`instPrimID`), which lie past the
//! end of its `RTCRayHit`. It also needs libclang to be built and Embree to be linked. This crate takes its place
//! through `[patch.crates-io]`. It is written by hand for what `embree4-rs` calls, and leaves room behind each hit, so
//! that Embree 4.0 to 4.4 and later write into their own. It builds anywhere; a missing library is found out at run
//! time.
//!
//! * [`version`] says whether there is a library, or where it was looked for: first in the environment variable
//!   [`VARIABLE`], then where `cargo xtask setup` puts it, then where the system has its own.
//! * The functions carry Embree's names. Without a library they do nothing and return null, and
//!   [`rtcGetDeviceError`] an error.
//! * [`Mesh`] is a safe scene of triangles, for what `embree4-rs` has no calls for: occlusion and packets.
//! * [`without`] leaves a primitive out of a query, for callers of `embree4-rs` too.
//!
//! # Current state and limits
//!
//! One level of instances, as Embree is configured unless someone changes it: a library built with more levels writes
//! longer hits and cannot be told from others.
#![allow(non_camel_case_types, non_snake_case, reason = "types, fields and functions carry Embree's names")]

mod arguments;
mod enums;
mod filter;
mod functions;
mod library;
mod mesh;
mod rays;

pub use arguments::*;
pub use enums::*;
pub use filter::{Occluder, without};
pub use functions::*;
pub use library::{LoadError, VARIABLE, version};
pub use mesh::{Mesh, MeshError};
pub use rays::*;
