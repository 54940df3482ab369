//! Scenes, cameras and ray streams.
#![forbid(unsafe_code)]

pub mod builtin;
mod model;

pub use model::{Model, View};
