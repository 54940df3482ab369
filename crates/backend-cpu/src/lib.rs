//! CPU devices for raybalance: each is a set of cores with threads of its own.
//!
//! [`CpuDevice::open_all`] splits the machine: `[1, 1]` makes two devices of one thread each, pinned to cores of their
//! own where the system allows, which is how one machine plays several devices in experiments. CPU devices share the
//! scene with the host and copy nothing. All CPU devices run the same kernels in the same order per ray, so any split
//! of a stream over any of them gives the same bits.
//!
//! Current state and limits: one scalar kernel over the two-wide layout (no packets, no wide nodes); cores are taken in
//! the order the system lists them, without regard to hyper-threads or NUMA nodes.
#![forbid(unsafe_code)]

mod device;
mod executor;
mod stopwatch;
mod tracer;

pub use device::{CpuDevice, OpenError};
