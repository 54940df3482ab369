//! One scene on one Vulkan device.

use crate::buffer::{Buffer, Use};
use crate::device::Shared;
use crate::launch::Slot;
use crate::timeline::Timeline;
use crate::upload::{Resident, Uploader};
use rt_bvh::offload::KernelRay;
use rt_core::arguments::invalid;
use rt_core::{DeviceError, DeviceErrorKind};
use rt_gpu::{Answer, Board, Flight, GpuScene, IN_FLIGHT, Trees};
use rt_shaders::Purpose;
use std::sync::Arc;
use std::time::Duration;

/// How long dropping a board waits for launches in flight. What is not done then is never freed.
const DROP_LIMIT: Duration = Duration::from_secs(10);

/// A scene resident on a Vulkan device.
#[derive(Debug)]
pub(crate) struct VulkanBoard {
    shared: Arc<Shared>,
    trees: Trees,
    /// Taken only when the board is dropped.
    gpu: Option<Gpu>,
}

/// What the device holds.
#[derive(Debug)]
struct Gpu {
    timeline: Timeline,
    uploader: Uploader,
    resident: Resident,
    rays: Option<Buffer>,
    /// One for each launch that may be in flight, and one for walks.
    slots: Vec<Slot>,
    /// Kernels in flight with the slot and the number of items of each.
    busy: Vec<(Flight, usize, usize)>,
}

impl VulkanBoard {
    pub(crate) fn new(shared: Arc<Shared>, scene: &GpuScene) -> Result<Self, DeviceError> {
        let logical = &shared.logical;
        let mut timeline = Timeline::new(logical)?;
        let mut uploader = Uploader::new(logical)?;
        let resident = Resident::new(logical, &mut uploader, &mut timeline, &scene.image())?;
        let slots = (0..=IN_FLIGHT).map(|_| Slot::new(logical, shared.layout())).collect::<Result<Vec<_>, _>>()?;
        logical.check_validation()?;
        let gpu = Gpu { timeline, uploader, resident, rays: None, slots, busy: Vec::new() };
        Ok(Self { trees: scene.trees(), shared, gpu: Some(gpu) })
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

    fn reserve_rays(&mut self, count: u32) -> Result<(), DeviceError> {
        let shared = Arc::clone(&self.shared);
        let gpu = self.gpu()?;
        // First, so that there need not be room for both.
        gpu.rays = None;
        let bytes = u64::from(count) * size_of::<KernelRay>() as u64;
        gpu.rays = Some(Buffer::new(&shared.logical, &format!("{count} rays"), bytes, Use::Kernel)?);
        shared.logical.check_validation()
    }

    fn write_rays(&mut self, first: u32, rays: &[KernelRay]) -> Result<(), DeviceError> {
        let Gpu { timeline, uploader, rays: buffer, .. } = self.gpu()?;
        let buffer = buffer.as_ref().ok_or_else(|| invalid("no room for rays was reserved"))?;
        uploader.send(timeline, buffer, u64::from(first) * size_of::<KernelRay>() as u64, rays)
    }

    fn start(&mut self, purpose: Purpose, items: &[u32]) -> Result<Flight, DeviceError> {
        let (layout, depth) = self.trees.of(purpose);
        let pipeline = self.shared.pipeline(layout, purpose, depth)?;
        let Gpu { timeline, resident, rays, slots, busy, .. } = self.gpu()?;
        let rays = rays.as_ref().ok_or_else(|| invalid("no rays are loaded"))?;
        let free = (0..slots.len()).find(|index| busy.iter().all(|(_, slot, _)| slot != index));
        let index = free.ok_or_else(|| invalid("every slot for launches is in use"))?;
        let value = slots[index].start(resident, rays, pipeline, items, purpose.counts(), timeline)?;
        busy.push((Flight(value), index, items.len()));
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
        read(Answer { found: slot.found(items), counts: slot.counts(), in_kernel: slot.in_kernel() });
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
