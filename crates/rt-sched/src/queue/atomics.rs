//! The atomic types of the queues: those of `core`, or of `loom`, which tries every interleaving of a few threads.
//!
//! `RUSTFLAGS="--cfg loom" cargo test -p rt-sched --lib loom`, or `cargo xtask loom`.

#[cfg(not(loom))]
pub(crate) use core::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, AtomicUsize, Ordering};
#[cfg(loom)]
pub(crate) use loom::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, AtomicUsize, Ordering};
