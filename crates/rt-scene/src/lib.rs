//! Scenes, cameras and ray streams.
//!
//! [`obj`] loads a [`Model`] of a Wavefront file and, with the feature `formats` (default), `files` of any format,
//! [`builtin`] generates one, [`npy`] reads a caller's rays, [`view`] finds a camera for it, [`camera`] moves that from
//! frame to frame, [`scan`] looks at its numbers and plans how to trace it, and [`streams`] makes the rays: camera rays
//! in waves, then shadow and diffuse rays from the hits of a stream before. [`scenes`] lists what can be named without
//! a file, and [`prepare`] makes of a name or a file what can be traced. [`wind`] moves what bends in it.
#![forbid(unsafe_code)]

pub mod builtin;
pub mod camera;
#[cfg(feature = "formats")]
pub mod files;
mod frame;
mod memory;
mod model;
pub mod npy;
pub mod obj;
mod offset;
pub mod prepare;
pub mod progress;
mod reading;
pub mod scan;
pub mod scenes;
pub mod streams;
pub mod view;
pub mod wind;

pub use model::{Colours, Geometry, Model, Plant, View};
