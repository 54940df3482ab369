//! Embree 4, loaded at run time: the tracer that raybalance's are compared with.
//!
//! It is written by hand for what is called here. The published crate of this name needs libclang to be built and
//! Embree to be linked, and is generated from Embree 4.2's headers: since 4.3 every hit writes four more bytes
//! (`instPrimID`), which lie past the end of its `RTCRayHit`. Here hits have that field, so that Embree 4.0 to 4.4 and
//! later write into their own. This one builds anywhere; a missing library is found out at run time.
//!
//! * [`version`] says whether there is a library, or where it was looked for: first in the environment variable
//!   [`VARIABLE`], then where `cargo xtask setup` puts it, then where the system has its own.
//! * The functions carry Embree's names. Without a library they do nothing and return null, and
//!   [`rtcGetDeviceError`] an error.
//! * [`Mesh`] is a safe scene of triangles: nearest and any hits of single rays and packets, also leaving out the
//!   primitive that a ray starts on ([`RTCRay::leaving_out`]).
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
pub use filter::Occluder;
pub use functions::*;
pub use library::{LoadError, VARIABLE, version};
pub use mesh::{Mesh, MeshError};
pub use rays::*;
