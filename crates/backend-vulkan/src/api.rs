//! One scene on one Vulkan device.

use crate::buffer::{Buffer, Use};
use crate::gpu::Gpu;
use crate::launch::Job;
use crate::probe;
use crate::shared::Shared;
use crate::timeline::Timeline;
use crate::upload::{Resident, Uploader};
use rt_bvh::kernel_io::KernelRay;
use rt_core::arguments::invalid;
use rt_core::{DeviceError, DeviceErrorKind};
use rt_gpu::{
    Answer, Change, Flight, GpuApi, GpuScene, Layout, PATIENCE, RAY_BYTES, RayList, RayRecipe, Trees, Tuning,
};
use rt_shaders::Purpose;
use std::sync::Arc;
use std::time::Duration;

/// How long dropping it waits for launches in flight. What is not done then is freed later, see
/// [`Abandoned`](crate::gpu::Abandoned).
const DROP_LIMIT: Duration = Duration::from_secs(10);

fn unreserved() -> DeviceError {
    invalid("no room for these rays was reserved")
}

/// A scene resident on a Vulkan device.
#[derive(Debug)]
pub(crate) struct VulkanApi {
    shared: Arc<Shared>,
    trees: Trees,
    tuning: Tuning,
    /// Taken only when it is dropped.
    gpu: Option<Gpu>,
}

impl VulkanApi {
    pub(crate) fn new(shared: Arc<Shared>, tuning: Tuning, scene: &GpuScene) -> Result<Self, DeviceError> {
        shared.abandoned.sweep();
        let logical = &shared.logical;
        let image = scene.image();
        let gpu = Gpu {
            // First, so that a scene that does not fit is what is named.
            resident: Resident::new(logical, &image)?,
            timeline: Timeline::new(logical)?,
            uploader: Uploader::new(logical)?,
            rays: Vec::new(),
            slots: Vec::new(),
            busy: Vec::new(),
        };
        // From here on dropping it waits for the device.
        let mut api = Self { trees: scene.trees(), tuning, shared, gpu: Some(gpu) };
        api.on_gpu(|_, Gpu { timeline, uploader, resident, .. }| resident.fill(uploader, timeline, &image))?;
        api.shared.logical.check_validation()?;
        Ok(api)
    }

    /// Does something on the device; once that is lost or hangs, nothing any more.
    fn on_gpu<T>(&mut self, act: impl FnOnce(&Shared, &mut Gpu) -> Result<T, DeviceError>) -> Result<T, DeviceError> {
        let lost = || DeviceError::new(DeviceErrorKind::Lost, "the Vulkan device was lost in an earlier call");
        let result = act(&self.shared, self.gpu.as_mut().ok_or_else(lost)?);
        match result.as_ref().map_err(DeviceError::kind) {
            // There is no point in waiting longer.
            Err(DeviceErrorKind::Hung) => self.leave(Duration::ZERO),
            Err(DeviceErrorKind::Lost) => self.leave(DROP_LIMIT),
            _ => {}
        }
        result
    }

    /// Frees what the device holds when it is done with it, or leaves it behind after `limit`.
    fn leave(&mut self, limit: Duration) {
        if let Some(gpu) = self.gpu.take()
            && !gpu.timeline.idle(limit)
        {
            self.shared.abandoned.add(gpu);
        }
    }
}

impl GpuApi for VulkanApi {
    fn name(&self) -> &'static str {
        "Vulkan"
    }

    fn window(&self) -> u32 {
        self.tuning.window(self.shared.logical.limits.binding)
    }

    fn persistent_lanes(&self) -> Option<u32> {
        self.tuning.persistent_lanes
    }

    fn makes(&mut self, purpose: Purpose) -> bool {
        !self.tuning.host_rays && probe::makes(&self.shared, purpose)
    }

    fn warm_up(&mut self, purpose: Purpose) -> Result<(), DeviceError> {
        let (layout, depth) = self.trees.of(purpose);
        let tracing = self.shared.pipeline(layout, purpose, depth)?;
        if !tracing.is_to_warm_up() {
            return Ok(());
        }
        self.on_gpu(|shared, gpu| {
            let index = gpu.free_slot(&shared.logical, shared.layout())?;
            let Gpu { timeline, resident, slots, .. } = gpu;
            // No ray is read: any buffer will do.
            let [.., frame] = resident.bindings(layout);
            let job = Job { making: None, tracing, list: &RayList::nothing(), counted: false };
            let value = slots[index].start(resident, frame, job, timeline)?;
            timeline.wait(value, PATIENCE)
        })
    }

    fn write_scene(&mut self, changes: &[Change<'_>]) -> Result<(), DeviceError> {
        self.on_gpu(|shared, Gpu { timeline, uploader, resident, .. }| {
            for Change { buffer, offset, bytes } in changes {
                uploader.send(timeline, resident.buffer(*buffer), *offset, bytes)?;
            }
            shared.logical.check_validation()
        })
    }

    fn reserve_rays(&mut self, count: u32) -> Result<(), DeviceError> {
        let window = self.window();
        self.on_gpu(|shared, gpu| {
            // First, so that there need not be room for both.
            gpu.rays.clear();
            let bytes = u64::from(count) * RAY_BYTES;
            let bound = shared.logical.limits.binding;
            shared.logical.memory.check(&format!("{count} rays, of which {bound} bytes are bound at once,"), bytes)?;
            let what = format!("a part of {count} rays");
            for first in (0..count).step_by(window as usize) {
                let bytes = u64::from(window.min(count - first)) * RAY_BYTES;
                gpu.rays.push(Buffer::new(&shared.logical, &what, bytes, Use::Kernel)?);
            }
            shared.logical.check_validation()
        })
    }

    fn write_rays(&mut self, first: u32, rays: &[KernelRay]) -> Result<(), DeviceError> {
        let window = self.window();
        self.on_gpu(|_, Gpu { timeline, uploader, rays: windows, .. }| {
            let buffer = windows.get((first / window) as usize).ok_or_else(unreserved)?;
            uploader.send(timeline, buffer, u64::from(first % window) * RAY_BYTES, rays)
        })
    }

    fn start(
        &mut self,
        purpose: Purpose,
        window: u32,
        list: &RayList,
        recipe: Option<&RayRecipe>,
    ) -> Result<Flight, DeviceError> {
        let (layout, depth) = self.trees.of(purpose);
        let tracing = self.shared.pipeline(layout, purpose, depth)?;
        let making =
            recipe.map(|recipe| Ok((self.shared.pipeline(Layout::Two, recipe.purpose(), 0)?, recipe))).transpose()?;
        self.on_gpu(|shared, gpu| {
            let index = gpu.free_slot(&shared.logical, shared.layout())?;
            let Gpu { timeline, resident, rays, slots, busy, .. } = gpu;
            let rays = rays.get(window as usize).ok_or_else(unreserved)?;
            if shared.faults.lose_launch() {
                shared.logical.lose();
            }
            let value = slots[index].start(
                resident,
                rays,
                Job { making, tracing, list, counted: purpose.counts() },
                timeline,
            )?;
            busy.push((Flight(value), index, list.items()));
            Ok(Flight(value))
        })
    }

    fn wait(&mut self, flight: Flight, limit: Duration, read: &mut dyn FnMut(Answer<'_>)) -> Result<(), DeviceError> {
        self.on_gpu(|shared, gpu| {
            gpu.timeline.wait(flight.0, limit)?;
            shared.logical.check_validation()?;
            let known = gpu.busy.iter().position(|(busy, ..)| *busy == flight);
            let (_, index, items) = gpu.busy.swap_remove(known.ok_or_else(|| invalid("no such kernel is in flight"))?);
            let slot = &gpu.slots[index];
            read(Answer { found: slot.found(items as usize), counts: slot.counts(), in_kernel: slot.in_kernel() });
            Ok(())
        })
    }
}

impl Drop for VulkanApi {
    fn drop(&mut self) {
        self.leave(DROP_LIMIT);
    }
}
