//! wgpu devices for raybalance: graphics cards, and Mesa's software rasteriser lavapipe.
//!
//! [`WgpuDevice::enumerate`] opens every device of the system, [`WgpuDevice::open`] one of them, and [`WgpuDevice::of`]
//! takes one that the program has already, from [`wgpu`]. It runs the kernels of `rt_shaders` and answers as the Vulkan
//! backend does: hits and counts are, bit for bit, those of the CPU devices, and rays that rounding leaves in doubt are
//! traced on the host. wgpu compiles WGSL itself and cannot forbid drivers to fuse a product and a sum, so these
//! kernels hide every result that matters from the compiler; a device that fuses all the same is refused when it is
//! opened.
//!
//! # Current state and limits
//!
//! * wgpu checks every access of the kernels and bounds their loops, unless [`Options::trusted`] says that it need not:
//!   [`Card::kernels`] says which.
//! * The adapters are those that wgpu finds through Vulkan. wgpu does not tell how much memory they have.
//! * A scene with a buffer that exceeds the device's limit for one binding, at most 2 GiB, is refused, with the sizes.
//!   Rays beyond it lie in several buffers, up to 16, and a launch becomes a kernel for each.
//! * Camera rays and rays of bounces are made on the device, where a trial of it shows the host's bits
//!   ([`GpuDevice::makes_rays`]). A caller's own rays are prepared on the host and uploaded.
//! * wgpu panics inside when a device is lost while it is waited for. The panic is caught, and its message goes to the
//!   standard error output; a program built with `panic = "abort"` ends.
//! * What a lost or hung device held is never freed: wgpu would wait for it without end.
#![deny(unsafe_code)]

mod api;
mod device;
mod error;
mod launch;
mod opened;
mod options;
mod pipeline;
mod probe;
mod shared;
#[expect(unsafe_code, reason = "wgpu's call for kernels that need no checks is unsafe")]
mod trusted;

pub use device::WgpuDevice;
pub use error::OpenError;
pub use options::Options;
#[cfg(feature = "test-support")]
pub use rt_gpu::FaultInjection;
/// The version of wgpu whose devices [`WgpuDevice::of`] takes.
pub use wgpu;

pub use rt_gpu::{BadVariable, Card, GpuDevice, Layout, Layouts, Profile, RayCounters, Tuning};
