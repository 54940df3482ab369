//! The host's side of the GPU backends: everything that does not depend on the API by which a card is reached.
//!
//! A backend implements [`GpuApi`]: buffers, kernels of `rt_shaders` started and waited for. [`GpuTracer`] makes a
//! [`rt_core::Tracer`] of it: it prepares rays or has them made there, deals rays to kernels, computes t, u and v of
//! the hits that come back from ray and triangle, and traces the rays that rounding leaves in doubt. [`GpuScene`]
//! chooses between layouts, [`SceneImage`] is what a scene looks like to the kernels; [`arithmetic`], [`camera`] and
//! [`bounce`] find out whether a card computes as the host relies on.
//!
//! # What crosses the bus
//!
//! | | up | down |
//! |---|---|---|
//! | moving the scene | what of nodes and triangles has changed | |
//! | loading a ray of the host's | 64 bytes | |
//! | the first time a camera ray is asked for | 4 bytes a pixel, and 16 for all in a row | |
//! | the first time a ray is asked for that leaves a surface | 12 bytes, and its path's number: 4, or 8 for all in a row | |
//! | tracing a ray of a whole task | 8 bytes a task or less: neighbours are one range | 4 bytes, 12 with counts |
//! | tracing a ray of a task with rays left out | 4 bytes at most | 4 bytes, 12 with counts; none for rays left out |
//! | walking a ray | 4 bytes | 12 bytes: hit and counts |
//!
//! The host's share runs on rayon's threads.
//!
//! The feature `test-support` adds [`FaultInjection`] and what else tests want of a device; it changes nothing else.
#![forbid(unsafe_code)]

pub mod arithmetic;
pub mod bounce;
pub mod camera;
mod card;
mod changes;
mod environment;
mod faults;
mod gpu_api;
mod image;
mod pending;
mod profile;
mod ray_counters;
mod ray_generation;
mod ray_list;
mod ray_recipe;
mod rays;
mod scene;
mod tracer;
mod trials;
mod tuning;

pub use card::{Card, GpuDevice, fault_of_llvmpipe};
pub use changes::{Change, SceneBuffer};
pub use environment::{BadVariable, switch};
#[cfg(feature = "test-support")]
pub use faults::FaultInjection;
pub use faults::Faults;
pub use gpu_api::{Answer, Flight, GpuApi};
pub use image::{Frame, SceneImage};
pub use profile::Profile;
pub use ray_counters::RayCounters;
pub use ray_list::RayList;
pub use ray_recipe::RayRecipe;
pub use rt_shaders::Layout;
pub use scene::{GpuScene, Layouts, Trees};
pub use tracer::GpuTracer;
pub use trials::Trials;
pub use tuning::{RAY_BYTES, Tuning};

/// Launches a device keeps in flight. Two hide the host's hand-over between launches.
pub const IN_FLIGHT: u32 = 2;

/// The longest that a device may take for what it does in microseconds, at the first time compiling included.
pub const PATIENCE: std::time::Duration = std::time::Duration::from_secs(60);
