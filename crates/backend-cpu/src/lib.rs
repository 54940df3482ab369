//! CPU devices for raybalance: each is a set of cores with threads of its own.
//!
//! [`CpuDevice::open_all`] splits the machine: `[1, 1]` makes two devices of one thread each, pinned to cores of their
//! own where the system allows, which is how one machine plays several devices in experiments. CPU devices share the
//! scene with the host and copy nothing. All CPU devices run the same kernels in the same order per ray, so any split
//! of a stream over any of them gives the same bits.
//!
//! Launches and walks take the kernels of `rt-simd`, over its eight-wide tree, which devices opened together share: it
//! is held beside the scene. The environment variable `RAYBALANCE_ISA` chooses their instructions (`avx512`,
//! `avx2`, `portable`). Which candidate an any-hit ray reports then depends on the other rays.
//!
//! What is counted, in samples, reduced walks and launches alike, are the tests of a ray that walks that tree alone,
//! whatever its company ([`rt_simd::Kernel::count`]): so prices fit. Samples of a task come in the stream's order,
//! along the Z-curve: so sparse ones are compacted into packets of near neighbours. Where a stream asks for counts of
//! the scene's own tree, which other devices count too, where it asks for several hits of a ray, and where it asks for
//! the precision `fast`, single rays walk that. A stream whose mask hides primitives has a tree without those, which is
//! made when its rays are loaded and kept for the next, with three others; or, of few rays, walks alone too.
//!
//! Current state and limits: single rays, and those of scenes of more than 5 · 10⁸ leaves, take several times as long;
//! cores are taken in the order the system lists them, without regard to hyper-threads or NUMA nodes.
#![forbid(unsafe_code)]

mod device;
mod executor;
mod instructions;
mod launches;
mod masked;
mod stopwatch;
mod tracer;

pub use device::{CpuDevice, OpenError};
pub use instructions::InstructionsError;
pub use rt_simd::Isa;
