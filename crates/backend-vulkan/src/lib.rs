//! Vulkan devices for raybalance: graphics cards, and Mesa's software rasteriser lavapipe.
//!
//! [`VulkanDevice::enumerate`] opens every device of the system, [`VulkanDevice::list`] leaves the choice. A device
//! decides which triangle each ray hits and counts tests, by the kernels of `rt_shaders`; the host computes t, u and v
//! of the hits it reads back from ray and triangle. Rays that rounding leaves in doubt are traced on the host when
//! their launch is waited for ([`GpuDevice::counters`] says how many). A device that does not round as the kernels rely
//! on is refused when it is opened. So hits and counts are, bit for bit, those of the CPU devices.
//!
//! # Current state and limits
//!
//! * Two layouts, of which [`Options`] choose, with one kernel each: single rays, for [`rt_core::Precision::Robust`].
//!   The other precisions are answered by it too: `Double` promises the same bits, `Fast` promises less.
//! * Camera rays and rays of bounces are made on the device, where a trial of it shows the host's bits
//!   ([`GpuDevice::makes_rays`]). A caller's own rays are prepared on the host and uploaded.
//! * A launch has a lane for each ray. Persistent threads are there on request ([`Tuning`]): on lavapipe they gain
//!   nothing (`cargo run --release -p rt-benches --bin launches`), and hardware was not measured.
//! * Rays that start so close to a second triangle in the plane of their own that its side is lost in rounding, about
//!   2⁻⁴⁰ of that triangle's size, go to the host: a quarter of the bounces off the doubled 2 km ground plane of one
//!   scene.
//! * A scene with a buffer that exceeds the device's limit for one binding is refused, with the sizes. Rays beyond it
//!   lie in several buffers, and a launch becomes a kernel for each.
//! * One queue per device, which its tracers share.
//!
//! The raw handles of Vulkan are each owned by a type of a module of its own, which destroys them; `unsafe` is found
//! there only.

mod api;
mod buffer;
mod commands;
mod device;
mod error;
mod gpu;
mod instance;
mod launch;
mod logical;
mod memory;
mod options;
mod pipeline;
mod probe;
#[cfg(feature = "test-support")]
mod provoke;
mod shared;
mod timeline;
mod upload;

pub use device::{ListedDevice, VulkanDevice};
pub use error::OpenError;
pub use options::Options;
#[cfg(feature = "test-support")]
pub use options::Replacement;
#[cfg(feature = "test-support")]
pub use rt_gpu::FaultInjection;
pub use rt_gpu::{BadVariable, Card, GpuDevice, Layout, Layouts, Profile, RayCounters, Tuning};
pub use rt_shaders::{FloatControls, Purpose};
