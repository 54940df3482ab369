//! raybalance for C, and for whatever can call it: the header `include/raybalance.h` is made from this crate, comments
//! and all, and a test compares the two.
//!
//! What crosses the border is in [`border`], with all `unsafe` code: pointers that are checked for null and taken at
//! their word otherwise, and handles. Behind it there is safe Rust. No panic crosses.

#![expect(non_camel_case_types, reason = "C programs name them so")]

mod border;
mod failure;
mod tracer;
mod types;

pub use border::*;
pub use types::*;
