//! The host's side of the GPU backends: everything that does not depend on the API by which a card is reached.
//!
//! A backend implements [`Board`]: buffers, kernels of `rt_shaders` started and waited for. [`GpuTracer`] makes a
//! [`rt_core::Tracer`] of it: it prepares rays, deals items to kernels, computes t, u and v of the hits that come back from
//! ray and triangle, and traces the rays that rounding leaves in doubt. [`GpuScene`] chooses between layouts, [`SceneImage`] is what a scene looks like to the
//! kernels, [`arithmetic`] finds out whether a card rounds as they rely on.
//!
//! The host's share runs on rayon's threads.
#![forbid(unsafe_code)]

pub mod arithmetic;
mod board;
mod card;
mod image;
mod pending;
mod rays;
mod scene;
mod tally;
mod tracer;
mod trouble;

pub use board::{Answer, Board, Flight};
pub use card::{Card, GpuDevice, fault_of_llvmpipe};
pub use image::{Frame, SceneImage};
pub use rt_shaders::Layout;
pub use scene::{GpuScene, Layouts, Trees};
pub use tally::Tally;
pub use tracer::GpuTracer;
pub use trouble::Trouble;

/// Launches a device keeps in flight. Two hide the host's hand-over between launches.
pub const IN_FLIGHT: u32 = 2;

/// The longest that a device may take for what it does in microseconds, at the first time compiling included.
pub const PATIENCE: std::time::Duration = std::time::Duration::from_secs(60);
