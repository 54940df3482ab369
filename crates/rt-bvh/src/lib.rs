//! Bounding volume hierarchies: building them, and tracing rays through them.
//!
//! [`build`] turns a mesh into an [`rt_core::Scene`], [`build_meshes`] several; [`trace()`] finds a hit of each ray,
//! [`trace_several`] several; [`count`] finds what rays cost, with hits ([`rt_core::Walk::Full`]) or without touching a
//! triangle ([`rt_core::Walk::Reduced`]); [`TreeStats`] describes a tree.
//!
//! It traces two layouts, the scene's own two-wide tree and an eight-wide compressed one made from it ([`WideTree`],
//! [`trace_wide`], [`count_wide`]), with one traversal loop each, generic over a visitor. Hits are a function of ray
//! and triangles alone: they do not depend on the builder, its options, the layout or the order of traversal (the
//! module `trace` says why).
//!
//! [`BlockTree`] is a third layout, for kernels that use the SIMD words of processors: eight-wide too, with boxes in
//! single precision and leaves of four triangles. This crate makes and checks it, and does not trace it.
//!
//! # Current state and limits
//!
//! * Portable code without `unsafe`, one ray at a time: the crate `rt-simd` is what is fast on processors.
//! * Where a mesh has coordinates 2⁶⁰ times as large as its details, or a ray starts as far away, boxes hardly help:
//!   every ray is tested against much of the mesh, and graphics cards leave it to the host. Hits are right all the
//!   same.
//! * Spatial splits are not made: a triangle is in exactly one leaf.
#![no_std]
#![forbid(unsafe_code)]
#![warn(clippy::std_instead_of_core, clippy::std_instead_of_alloc)]

extern crate alloc;

mod blocks;
mod build;
mod collapse;
mod options;
mod parallel;
mod stats;
mod trace;
mod wide;

use rt_core::scale;

pub use blocks::{Block, BlockAxis, BlockChild, BlockNode, BlockTree, BlockTreeError};
pub use build::{BuildError, BuildReport, Built, Fallback, MOST_STEPS, build, build_meshes, build_with, refit};
pub use options::{BuildOptions, Builder, InvalidTriangles, Mesh, PlocQuality, UnknownBuilder};
pub use stats::TreeStats;
pub use trace::{Stack, count, count_wide, kernel_io, trace, trace_several, trace_wide};
pub use wide::{WideError, WideNode, WideShape, WideTree};
