//! CPU devices for raybalance: each is a set of cores with threads of its own.
//!
//! [`CpuDevice::open_all`] splits the machine: `[1, 1]` makes two devices of one thread each, pinned to cores of their
//! own where the system allows, which is how one machine plays several devices in experiments. CPU devices share the
//! scene with the host and copy nothing. All CPU devices run the same kernels in the same order per ray, so any split
//! of a stream over any of them gives the same bits.
//!
//! Rays that follow each other in a task, or in a list of samples, walk the tree in packets of sixteen. Samples of a
//! task come in the stream's order, along the Z-curve: so sparse ones are compacted into packets of near neighbours. Where
//! the processor has AVX2, packets take its words; the one `unsafe` call is that.
//!
//! Current state and limits: no wide nodes; packets in words of AVX2 or SSE2 on x86-64, elsewhere what the compiler makes of
//! the portable code, which was not measured; cores are taken in the order the system lists them, without regard to
//! hyper-threads or NUMA nodes.
#![deny(unsafe_code)]

mod device;
mod executor;
mod packets;
mod stopwatch;
mod tracer;

pub use device::{CpuDevice, OpenError};
