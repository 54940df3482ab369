//! How a device's launches are made, where it does not matter to the results.

use rt_bvh::kernel_io::KernelRay;

/// Bytes of a ray on a device.
pub const RAY_BYTES: u64 = size_of::<KernelRay>() as u64;

/// Choices that change no result. The default is what was measured to be best, or what the device asks for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tuning {
    /// Lanes of each launch, which take one ray after the other until none is left: persistent threads (T. Aila and S.
    /// Laine, *Understanding the Efficiency of Ray Traversal on GPUs*, HPG 2009). Best a multiple of 64, and as many as
    /// the device runs at once. `None`, the default: a lane for each ray.
    pub persistent_lanes: Option<u32>,
    /// The most rays in one buffer, fewer than the device would bind at once; for tests. `None`: as many as it binds.
    pub window: Option<u32>,
    /// Whether the host prepares rays even where the device makes them.
    pub host_rays: bool,
}

impl Tuning {
    /// Rays in a window of a device that binds so many bytes at once.
    #[must_use]
    pub fn window(&self, bound: u64) -> u32 {
        let rays = u32::try_from(bound / RAY_BYTES).unwrap_or(u32::MAX);
        rays.min(self.window.unwrap_or(u32::MAX)).max(1)
    }
}
