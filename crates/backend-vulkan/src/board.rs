//! One scene on one Vulkan device.

use crate::buffer::{Buffer, Use};
use crate::device::Shared;
use crate::launch::Slot;
use crate::maker::Maker;
use crate::timeline::Timeline;
use crate::upload::{Resident, Uploader};
use rt_bvh::offload::{KernelCamera, KernelRay};
use rt_core::arguments::invalid;
use rt_core::{DeviceError, DeviceErrorKind, Scene};
use rt_gpu::{Answer, Board, Flight, SceneImage, Tuning, Work};
use rt_shaders::Purpose;
use std::sync::Arc;
use std::time::Duration;

/// How long dropping a board waits for launches in flight. What is not done then is never freed.
const DROP_LIMIT: Duration = Duration::from_secs(10);

/// Bytes of a ray.
const RAY: u64 = size_of::<KernelRay>() as u64;

fn unreserved() -> DeviceError {
    invalid("no room for these rays was reserved")
}

/// A scene resident on a Vulkan device.
#[derive(Debug)]
pub(crate) struct VulkanBoard {
    shared: Arc<Shared>,
    /// Of the scene's tree.
    depth: u32,
    tuning: Tuning,
    /// Taken only when the board is dropped.
    gpu: Option<Gpu>,
}

/// What the device holds.
#[derive(Debug)]
struct Gpu {
    timeline: Timeline,
    uploader: Uploader,
    resident: Resident,
    /// The windows: as many rays in each but the last.
    rays: Vec<Buffer>,
    /// Made for the first camera.
    maker: Option<Maker>,
    /// As many as kernels were in flight at once.
    slots: Vec<Slot>,
    /// Kernels in flight with the slot and the number of items of each.
    busy: Vec<(Flight, usize, u32)>,
}

impl VulkanBoard {
    pub(crate) fn new(shared: Arc<Shared>, tuning: Tuning, scene: &Scene) -> Result<Self, DeviceError> {
        let logical = &shared.logical;
        let mut timeline = Timeline::new(logical)?;
        let mut uploader = Uploader::new(logical)?;
        let resident = Resident::new(logical, &mut uploader, &mut timeline, &SceneImage::new(scene))?;
        logical.check_validation()?;
        let (rays, slots, busy) = (Vec::new(), Vec::new(), Vec::new());
        let gpu = Gpu { timeline, uploader, resident, rays, maker: None, slots, busy };
        Ok(Self { depth: scene.depth(), tuning, shared, gpu: Some(gpu) })
    }

    fn gpu(&mut self) -> Result<&mut Gpu, DeviceError> {
        let lost = || DeviceError::new(DeviceErrorKind::Lost, "the Vulkan device was lost in an earlier call");
        self.gpu.as_mut().ok_or_else(lost)
    }
}

impl Board for VulkanBoard {
    fn api(&self) -> &'static str {
        "Vulkan"
    }

    fn window(&self) -> u32 {
        let bound = self.shared.logical.limits.binding / RAY;
        u32::try_from(bound).unwrap_or(u32::MAX).min(self.tuning.window.unwrap_or(u32::MAX)).max(1)
    }

    fn persistent_lanes(&self) -> Option<u32> {
        self.tuning.persistent_lanes
    }

    fn reserve_rays(&mut self, count: u32) -> Result<(), DeviceError> {
        let (shared, window) = (Arc::clone(&self.shared), self.window());
        let gpu = self.gpu()?;
        // First, so that there need not be room for both.
        gpu.rays.clear();
        let bytes = u64::from(count) * RAY;
        if let Some(available) = shared.logical.memory().filter(|&available| bytes > available) {
            let bound = shared.logical.limits.binding;
            let what = format!(
                "{count} rays of {bytes} bytes do not fit into device memory of {available} bytes, of which {bound} are \
                 bound at once"
            );
            return Err(DeviceError::new(DeviceErrorKind::OutOfMemory, what));
        }
        let what = format!("a part of {count} rays");
        for first in (0..count).step_by(window as usize) {
            let bytes = u64::from(window.min(count - first)) * RAY;
            gpu.rays.push(Buffer::new(&shared.logical, &what, bytes, Use::Kernel)?);
        }
        shared.logical.check_validation()
    }

    fn write_rays(&mut self, first: u32, rays: &[KernelRay]) -> Result<(), DeviceError> {
        let window = self.window();
        let Gpu { timeline, uploader, rays: windows, .. } = self.gpu()?;
        let buffer = windows.get((first / window) as usize).ok_or_else(unreserved)?;
        uploader.send(timeline, buffer, u64::from(first % window) * RAY, rays)
    }

    fn make_rays(&mut self, window: u32, camera: &KernelCamera, pixels: &[u32]) -> Result<bool, DeviceError> {
        let shared = Arc::clone(&self.shared);
        if self.tuning.host_rays || !shared.makes_rays() {
            return Ok(false);
        }
        let Gpu { timeline, uploader, rays, maker, .. } = self.gpu()?;
        let rays = rays.get(window as usize).ok_or_else(unreserved)?;
        let maker = match maker {
            Some(maker) => maker,
            None => maker.insert(Maker::new(&shared)?),
        };
        maker.make(&shared, uploader, timeline, rays, (camera, pixels))?;
        shared.logical.check_validation()?;
        Ok(true)
    }

    fn start(&mut self, purpose: Purpose, window: u32, work: &Work) -> Result<Flight, DeviceError> {
        let shared = Arc::clone(&self.shared);
        let pipeline = shared.pipeline(purpose, self.depth)?;
        let Gpu { timeline, resident, rays, slots, busy, .. } = self.gpu()?;
        let rays = rays.get(window as usize).ok_or_else(unreserved)?;
        let free = (0..slots.len()).find(|index| busy.iter().all(|(_, slot, _)| slot != index));
        let index = free.unwrap_or(slots.len());
        if free.is_none() {
            slots.push(Slot::new(&shared.logical, shared.layout())?);
        }
        let value = slots[index].start(resident, rays, pipeline, work, purpose.counts(), timeline)?;
        busy.push((Flight(value), index, work.items()));
        Ok(Flight(value))
    }

    fn wait(&mut self, flight: Flight, limit: Duration, read: &mut dyn FnMut(Answer<'_>)) -> Result<(), DeviceError> {
        let shared = Arc::clone(&self.shared);
        let gpu = self.gpu()?;
        gpu.timeline.wait(flight.0, limit)?;
        shared.logical.check_validation()?;
        let known = gpu.busy.iter().position(|(busy, ..)| *busy == flight);
        let (_, index, items) = gpu.busy.swap_remove(known.ok_or_else(|| invalid("no such kernel is in flight"))?);
        let slot = &gpu.slots[index];
        read(Answer { found: slot.found(items as usize), counts: slot.counts(), in_kernel: slot.in_kernel() });
        Ok(())
    }
}

impl Drop for VulkanBoard {
    fn drop(&mut self) {
        if let Some(gpu) = self.gpu.take()
            && !gpu.timeline.idle(DROP_LIMIT)
        {
            // The device may still write to the buffers: better lost than freed.
            std::mem::forget(gpu);
        }
    }
}
