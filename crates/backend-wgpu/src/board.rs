//! One scene on one wgpu device.

use crate::device::Shared;
use crate::launch::Slot;
use crate::opened::Opened;
use rt_bvh::offload::KernelRay;
use rt_core::arguments::invalid;
use rt_core::{DeviceError, DeviceErrorKind};
use rt_gpu::{Answer, Board, Flight, GpuScene, IN_FLIGHT, PATIENCE, Trees};
use rt_shaders::{Layout, Purpose};
use std::sync::Arc;
use std::time::Duration;
use wgpu::{Buffer, BufferUsages, SubmissionIndex};

/// How long dropping a board waits for launches in flight. What is not done then is never freed.
const DROP_LIMIT: Duration = Duration::from_secs(10);

/// Bytes sent to the device at once: large enough for the bus, little beside any scene that is worth a GPU.
const SENDING: usize = 4 << 20;

/// A scene resident on a wgpu device.
#[derive(Debug)]
pub(crate) struct WgpuBoard {
    shared: Arc<Shared>,
    trees: Trees,
    /// Those of [`rt_gpu::SceneImage::buffers`], in their order.
    scene: [Buffer; 4],
    /// The wide tree; without one a word.
    wide: Buffer,
    sender: Sender,
    rays: Option<Buffer>,
    /// One for each launch that may be in flight, and one for walks.
    slots: Vec<Slot>,
    /// Kernels in flight with the slot of each.
    busy: Vec<(Flight, usize)>,
    started: u64,
}

impl WgpuBoard {
    pub(crate) fn new(shared: Arc<Shared>, scene: &GpuScene) -> Result<Self, DeviceError> {
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
        let slots = (0..=IN_FLIGHT).map(|_| Slot::new(opened)).collect::<Result<Vec<_>, _>>()?;
        let trees = scene.trees();
        Ok(Self { shared, trees, scene: resident, wide, sender, rays: None, slots, busy: Vec::new(), started: 0 })
    }
}

impl Board for WgpuBoard {
    fn api(&self) -> &'static str {
        "wgpu"
    }

    fn reserve_rays(&mut self, count: u32) -> Result<(), DeviceError> {
        // First, so that there need not be room for both.
        self.rays = None;
        let bytes = u64::from(count) * size_of::<KernelRay>() as u64;
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
        self.rays = Some(self.shared.opened.buffer(&format!("{count} rays"), bytes, usage)?);
        Ok(())
    }

    fn write_rays(&mut self, first: u32, rays: &[KernelRay]) -> Result<(), DeviceError> {
        let buffer = self.rays.as_ref().ok_or_else(|| invalid("no room for rays was reserved"))?;
        self.sender.send(buffer, u64::from(first) * size_of::<KernelRay>() as u64, bytemuck::cast_slice(rays))
    }

    fn start(&mut self, purpose: Purpose, items: &[u32]) -> Result<Flight, DeviceError> {
        let (layout, depth) = self.trees.of(purpose);
        let pipeline = self.shared.pipeline(layout, purpose, depth)?;
        let rays = self.rays.as_ref().ok_or_else(|| invalid("no rays are loaded"))?;
        let free = (0..self.slots.len()).find(|index| self.busy.iter().all(|(_, slot)| slot != index));
        let index = free.ok_or_else(|| invalid("every slot for launches is in use"))?;
        self.shared.count_launch();
        let [two, triangles, primitives, frame] = &self.scene;
        let tree = match layout {
            Layout::Two => two,
            Layout::Wide => &self.wide,
        };
        let inputs = [tree, triangles, primitives, frame, rays];
        self.slots[index].start(inputs, &pipeline, items, purpose.counts())?;
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

impl Drop for WgpuBoard {
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
