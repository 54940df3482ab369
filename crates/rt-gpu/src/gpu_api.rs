//! The seam between the host's side of a launch and the API by which a card is reached.

use crate::{Change, RayList, RayRecipe};
use rt_bvh::kernel_io::KernelRay;
use rt_core::{DeviceError, DeviceErrorKind, TestCounts};
use rt_shaders::Purpose;
use std::fmt::Debug;
use std::time::Duration;

/// A kernel that was started.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Flight(pub u64);

/// What a kernel wrote, in the order of its items.
#[derive(Clone, Copy, Debug)]
pub struct Answer<'a> {
    /// For each item the slot of the triangle it hits, or [`rt_shaders::MISS`] or [`rt_shaders::DOUBTFUL`].
    pub found: &'a [u32],
    /// For each item its counts; empty for kernels that do not count.
    pub counts: &'a [TestCounts],
    /// Time in the kernel, where the device knows it.
    pub in_kernel: Option<Duration>,
}

/// One scene on one graphics card, and a stream's rays beside it.
///
/// Rays that exceed what a kernel can bind lie in windows: the first `window()` rays in window 0, and so on. A kernel
/// reads one window, and a launch is one kernel for each window that it has rays in.
///
/// Kernels run in the order in which they were started. At most [`crate::IN_FLIGHT`] + 1 are in flight for each window:
/// launches and a walk. Dropping it with kernels in flight waits for them a while, or leaves behind what they use.
pub trait GpuApi: Send + Debug {
    /// The API's name in errors, such as `"Vulkan"`.
    fn name(&self) -> &'static str;

    /// Rays in a window, at least one; all of them where nothing limits a buffer. Always the same.
    fn window(&self) -> u32 {
        u32::MAX
    }

    /// Lanes of kernels whose lanes take one ray after the other until none is left, as many as the device keeps busy;
    /// `None`: a lane for each ray.
    fn persistent_lanes(&self) -> Option<u32> {
        None
    }

    /// Whether the kernel for `purpose` makes rays, the very bits that the host makes: see [`crate::Trials`]. It is
    /// compiled to find out. Nothing is in flight.
    fn makes(&mut self, purpose: Purpose) -> bool {
        let _ = purpose;
        false
    }

    /// Compiles the kernel for `purpose`, which traces, and runs it over [`RayList::nothing`], since some drivers
    /// compile when a kernel first runs, so that its first launch does not wait for it. Nothing is in flight.
    ///
    /// # Errors
    /// Those of [`GpuApi::start`].
    fn warm_up(&mut self, purpose: Purpose) -> Result<(), DeviceError> {
        let _ = purpose;
        Ok(())
    }

    /// Writes what has changed of the scene, whose triangles have moved. Nothing is in flight.
    ///
    /// # Errors
    /// [`DeviceErrorKind::Unsupported`], with nothing written, when it cannot; when the device is lost.
    fn write_scene(&mut self, changes: &[Change<'_>]) -> Result<(), DeviceError> {
        let _ = changes;
        let what = format!("{} cannot write to a scene: make another tracer", self.name());
        Err(DeviceError::new(DeviceErrorKind::Unsupported, what))
    }

    /// Makes room for `count` rays in place of those that were there. Nothing is in flight.
    ///
    /// # Errors
    /// When they do not fit: [`rt_core::DeviceErrorKind::OutOfMemory`] with the bytes needed and available.
    fn reserve_rays(&mut self, count: u32) -> Result<(), DeviceError>;

    /// Writes rays from number `first` of the stream on, within what was reserved and all of one window. Nothing is in
    /// flight.
    ///
    /// # Errors
    /// When the device is lost.
    fn write_rays(&mut self, first: u32, rays: &[KernelRay]) -> Result<(), DeviceError>;

    /// Starts the kernel for `purpose` over rays of a window, after the one that makes those of `recipe`: a purpose of
    /// which [`GpuApi::makes`] says that it does.
    ///
    /// # Errors
    /// When the kernel does not compile, its buffers do not fit, or the device is lost.
    fn start(
        &mut self,
        purpose: Purpose,
        window: u32,
        list: &RayList,
        recipe: Option<&RayRecipe>,
    ) -> Result<Flight, DeviceError>;

    /// Waits at most `limit` until a kernel is done, and shows `read` what it wrote.
    ///
    /// # Errors
    /// [`rt_core::DeviceErrorKind::Hung`] when the limit passed, otherwise when the device is lost. Then `read` was not
    /// called, and it is of no more use.
    fn wait(&mut self, flight: Flight, limit: Duration, read: &mut dyn FnMut(Answer<'_>)) -> Result<(), DeviceError>;
}
