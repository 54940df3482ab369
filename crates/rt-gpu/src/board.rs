//! The seam between the host's side of a launch and the API by which a card is reached.

use rt_bvh::offload::KernelRay;
use rt_core::{DeviceError, TestCounts};
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
/// Kernels run in the order in which they were started. At most [`crate::IN_FLIGHT`] + 1 are in flight: launches and a
/// walk. Dropping a board with kernels in flight waits for them a while, or leaves behind what they use.
pub trait Board: Send + Debug {
    /// The API's name in errors, such as `"Vulkan"`.
    fn api(&self) -> &'static str;

    /// Makes room for `count` rays in place of those that were there. Nothing is in flight.
    ///
    /// # Errors
    /// When they do not fit: [`rt_core::DeviceErrorKind::OutOfMemory`] with the bytes needed and available.
    fn reserve_rays(&mut self, count: u32) -> Result<(), DeviceError>;

    /// Writes rays from number `first` on, within what was reserved. Nothing is in flight.
    ///
    /// # Errors
    /// When the device is lost.
    fn write_rays(&mut self, first: u32, rays: &[KernelRay]) -> Result<(), DeviceError>;

    /// Starts the kernel for `purpose` over `items`, numbers of reserved rays; there is at least one.
    ///
    /// # Errors
    /// When the kernel does not compile, its buffers do not fit, or the device is lost.
    fn start(&mut self, purpose: Purpose, items: &[u32]) -> Result<Flight, DeviceError>;

    /// Waits at most `limit` until a kernel is done, and shows `read` what it wrote.
    ///
    /// # Errors
    /// [`rt_core::DeviceErrorKind::Hung`] when the limit passed, otherwise when the device is lost. Then `read` was not
    /// called, and the board is of no more use.
    fn wait(&mut self, flight: Flight, limit: Duration, read: &mut dyn FnMut(Answer<'_>)) -> Result<(), DeviceError>;
}
