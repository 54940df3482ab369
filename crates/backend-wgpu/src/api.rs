//! One scene on one wgpu device.

use crate::launch::{Job, Slot};
use crate::opened::Opened;
use crate::probe;
use crate::shared::Shared;
use rt_bvh::kernel_io::KernelRay;
use rt_core::arguments::invalid;
use rt_core::{DeviceError, DeviceErrorKind};
use rt_gpu::{
    Answer, Change, Flight, GpuApi, GpuScene, PATIENCE, RAY_BYTES, RayList, RayRecipe, SceneBuffer, Trees, Tuning,
};
use rt_shaders::{Layout, Purpose};
use std::sync::Arc;
use std::time::Duration;
use wgpu::{Buffer, BufferUsages, SubmissionIndex};

/// How long dropping it waits for launches in flight. What is not done then is never freed.
const DROP_LIMIT: Duration = Duration::from_secs(10);

/// Bytes sent to the device at once: large enough for the bus, little beside any scene that is worth a GPU.
const SENDING: usize = 4 << 20;

/// The most buffers for a stream's rays, each as large as the device binds at once. wgpu does not tell how much memory
/// there is, and systems promise more than they have: where the least is bound, 128 MiB, these are 2 GiB.
const WINDOWS: u64 = 16;

fn unreserved() -> DeviceError {
    invalid("no room for these rays was reserved")
}

/// A scene resident on a wgpu device.
#[derive(Debug)]
pub(crate) struct WgpuApi {
    shared: Arc<Shared>,
    trees: Trees,
    tuning: Tuning,
    /// Those of [`rt_gpu::SceneImage::buffers`], in their order.
    scene: [Buffer; 4],
    /// The wide tree; without one a word.
    wide: Buffer,
    sender: Sender,
    /// The windows: as many rays in each but the last.
    rays: Vec<Buffer>,
    /// As many as kernels were in flight at once.
    slots: Vec<Slot>,
    /// Kernels in flight with the slot of each.
    busy: Vec<(Flight, usize)>,
    started: u64,
}

impl WgpuApi {
    pub(crate) fn new(shared: Arc<Shared>, tuning: Tuning, scene: &GpuScene) -> Result<Self, DeviceError> {
        let opened = &shared.opened;
        let mut sender = Sender { opened: Arc::clone(opened), last: None };
        let image = scene.image();
        let mut upload = |(what, bytes): (&str, &[u8])| -> Result<Buffer, DeviceError> {
            let buffer = opened.buffer(what, bytes.len() as u64, BufferUsages::STORAGE | BufferUsages::COPY_DST)?;
            sender.send(&buffer, 0, bytes)?;
            Ok(buffer)
        };
        let [nodes, triangles, primitives, frame] = image.buffers();
        let resident = [upload(nodes)?, upload(triangles)?, upload(primitives)?, upload(frame)?];
        let (what, bytes) = image.wide();
        let wide = upload((&what, bytes))?;
        sender.finish()?;
        let (trees, rays, slots, busy) = (scene.trees(), Vec::new(), Vec::new(), Vec::new());
        Ok(Self { shared, trees, tuning, scene: resident, wide, sender, rays, slots, busy, started: 0 })
    }

    /// A slot without a launch in flight.
    fn free_slot(&mut self) -> Result<usize, DeviceError> {
        let free = (0..self.slots.len()).find(|index| self.busy.iter().all(|(_, slot)| slot != index));
        if free.is_none() {
            self.slots.push(Slot::new(&self.shared.opened)?);
        }
        Ok(free.unwrap_or(self.slots.len() - 1))
    }
}

/// What kernels over a layout find at bindings 0 to 3.
const fn bindings<'a>(scene: &'a [Buffer; 4], wide: &'a Buffer, layout: Layout) -> [&'a Buffer; 4] {
    let [two, triangles, primitives, frame] = scene;
    let tree = match layout {
        Layout::Two => two,
        Layout::Wide => wide,
    };
    [tree, triangles, primitives, frame]
}

impl GpuApi for WgpuApi {
    fn name(&self) -> &'static str {
        "wgpu"
    }

    fn window(&self) -> u32 {
        self.tuning.window(self.shared.opened.binding)
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
        let index = self.free_slot()?;
        let none = self.shared.opened.buffer("no rays", RAY_BYTES, BufferUsages::STORAGE)?;
        let scene = bindings(&self.scene, &self.wide, layout);
        let job = Job { making: None, tracing: &tracing, list: &RayList::nothing(), counted: false };
        self.slots[index].start(scene, &none, job)?;
        self.slots[index].wait(PATIENCE, &mut |_| ())
    }

    fn write_scene(&mut self, changes: &[Change<'_>]) -> Result<(), DeviceError> {
        let [tree, triangles, _, frame] = &self.scene;
        for Change { buffer, offset, bytes } in changes {
            let to = match buffer {
                SceneBuffer::Tree => tree,
                SceneBuffer::Triangles => triangles,
                SceneBuffer::Box => frame,
                SceneBuffer::Wide => &self.wide,
            };
            self.sender.send(to, *offset, bytes)?;
        }
        self.sender.finish()
    }

    fn reserve_rays(&mut self, count: u32) -> Result<(), DeviceError> {
        // First, so that there need not be room for both.
        self.rays.clear();
        let (opened, window, bytes) = (&self.shared.opened, self.window(), u64::from(count) * RAY_BYTES);
        let most = opened.binding.saturating_mul(WINDOWS);
        if bytes > most {
            let what = format!(
                "{count} rays of {bytes} bytes: at most {most} are taken, {WINDOWS} times the {} that the device binds at once",
                opened.binding
            );
            return Err(DeviceError::new(DeviceErrorKind::OutOfMemory, what));
        }
        let what = format!("a part of {count} rays");
        for first in (0..count).step_by(window as usize) {
            let bytes = u64::from(window.min(count - first)) * RAY_BYTES;
            self.rays.push(opened.buffer(&what, bytes, BufferUsages::STORAGE | BufferUsages::COPY_DST)?);
        }
        Ok(())
    }

    fn write_rays(&mut self, first: u32, rays: &[KernelRay]) -> Result<(), DeviceError> {
        let window = self.window();
        let buffer = self.rays.get((first / window) as usize).ok_or_else(unreserved)?;
        self.sender.send(buffer, u64::from(first % window) * RAY_BYTES, bytemuck::cast_slice(rays))
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
        let index = self.free_slot()?;
        let rays = self.rays.get(window as usize).ok_or_else(unreserved)?;
        self.shared.count_launch();
        let scene = bindings(&self.scene, &self.wide, layout);
        let making = making.as_ref().map(|(kernel, recipe)| (&**kernel, *recipe));
        let job = Job { making, tracing: &tracing, list, counted: purpose.counts() };
        self.slots[index].start(scene, rays, job)?;
        self.started += 1;
        let flight = Flight(self.started);
        self.busy.push((flight, index));
        Ok(flight)
    }

    fn wait(&mut self, flight: Flight, limit: Duration, read: &mut dyn FnMut(Answer<'_>)) -> Result<(), DeviceError> {
        let known = self.busy.iter().position(|(busy, _)| *busy == flight);
        let (_, index) = self.busy.swap_remove(known.ok_or_else(|| invalid("no such kernel is in flight"))?);
        self.slots[index].wait(limit, read)
    }
}

impl Drop for WgpuApi {
    fn drop(&mut self) {
        // wgpu keeps buffers until the device is done with them, but closing a device waits without end.
        for slot in &mut self.slots {
            // Not again for the others: a device that did not end in time is lost, which `wait` says at once.
            if !slot.is_idle(DROP_LIMIT) {
                break;
            }
        }
    }
}

/// Copies to buffers on the device, at most two batches at a time.
#[derive(Debug)]
struct Sender {
    opened: Arc<Opened>,
    /// The last batch, which may still be on its way.
    last: Option<SubmissionIndex>,
}

impl Sender {
    /// Copies `bytes`, a multiple of 4, to `target` from byte `offset` on.
    fn send(&mut self, target: &Buffer, offset: u64, bytes: &[u8]) -> Result<(), DeviceError> {
        let mut offset = offset;
        for part in bytes.chunks(SENDING) {
            let opened = &self.opened;
            let sent = opened.scoped("write a buffer", DeviceErrorKind::Lost, || {
                opened.queue.write_buffer(target, offset, part);
                opened.queue.submit([])
            })?;
            if let Some(before) = self.last.replace(sent) {
                self.opened.wait(before, PATIENCE)?;
            }
            offset += part.len() as u64;
        }
        Ok(())
    }

    /// Waits until all that was sent is there.
    fn finish(&mut self) -> Result<(), DeviceError> {
        self.last.take().map_or(Ok(()), |last| self.opened.wait(last, PATIENCE))
    }
}
