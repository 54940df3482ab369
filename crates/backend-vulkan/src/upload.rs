//! Copies to buffers that the host does not see.

use crate::buffer::{Buffer, Use};
use crate::commands::Commands;
use crate::logical::Logical;
use crate::timeline::Timeline;
use bytemuck::NoUninit;
use rt_core::DeviceError;
use rt_gpu::{Layout, PATIENCE, SceneBuffer, SceneImage};
use std::sync::Arc;

/// Bytes copied to the device at once: large enough for the bus, small beside any scene that is worth a GPU.
const STAGING: u64 = 4 << 20;

/// Copies through a buffer that both see.
#[derive(Debug)]
pub(crate) struct Uploader {
    staging: Buffer,
    commands: Commands,
}

impl Uploader {
    pub(crate) fn new(logical: &Arc<Logical>) -> Result<Self, DeviceError> {
        let staging = Buffer::new(logical, "the buffer for uploads", STAGING, Use::Upload)?;
        Ok(Self { staging, commands: Commands::new(logical)? })
    }

    /// Copies `values` to `target` from byte `offset` on, and waits for it.
    pub(crate) fn send<T: NoUninit>(
        &mut self,
        timeline: &mut Timeline,
        target: &Buffer,
        offset: u64,
        values: &[T],
    ) -> Result<(), DeviceError> {
        let mut offset = offset;
        let at_once = (STAGING as usize / size_of::<T>().max(1)).max(1);
        for part in values.chunks(at_once) {
            let size = size_of_val(part) as u64;
            self.staging.write(0, part);
            let Self { staging, commands } = self;
            commands.record(|to| to.copy(staging, target, offset, size))?;
            let value = timeline.submit(commands.raw())?;
            timeline.wait(value, PATIENCE)?;
            offset += size;
        }
        Ok(())
    }
}

/// A scene on the device.
#[derive(Debug)]
pub(crate) struct Resident {
    /// Those of [`SceneImage::buffers`], in their order.
    buffers: [Buffer; 4],
    /// The wide tree; without one a word.
    wide: Buffer,
}

impl Resident {
    /// Room for a scene.
    pub(crate) fn new(logical: &Arc<Logical>, image: &SceneImage<'_>) -> Result<Self, DeviceError> {
        logical.memory.check("the scene", image.bytes())?;
        let room = |(what, bytes): (&str, &[u8])| Buffer::new(logical, what, bytes.len() as u64, Use::Kernel);
        let [nodes, triangles, primitives, frame] = image.buffers();
        let buffers = [room(nodes)?, room(triangles)?, room(primitives)?, room(frame)?];
        let (what, bytes) = image.wide();
        Ok(Self { buffers, wide: room((&what, bytes))? })
    }

    /// Copies the scene that there is room for.
    pub(crate) fn fill(
        &self,
        uploader: &mut Uploader,
        timeline: &mut Timeline,
        image: &SceneImage<'_>,
    ) -> Result<(), DeviceError> {
        let mut pairs = self.buffers.iter().zip(image.buffers());
        pairs.try_for_each(|(buffer, (_, bytes))| uploader.send(timeline, buffer, 0, bytes))?;
        let (_, bytes) = image.wide();
        uploader.send(timeline, &self.wide, 0, bytes)
    }

    /// A buffer that changes when triangles move.
    pub(crate) const fn buffer(&self, buffer: SceneBuffer) -> &Buffer {
        let [tree, triangles, _, frame] = &self.buffers;
        match buffer {
            SceneBuffer::Tree => tree,
            SceneBuffer::Triangles => triangles,
            SceneBuffer::Box => frame,
            SceneBuffer::Wide => &self.wide,
        }
    }

    /// What kernels over a layout find at bindings 0 to 3.
    pub(crate) const fn bindings(&self, layout: Layout) -> [&Buffer; 4] {
        let [two, triangles, primitives, frame] = &self.buffers;
        let tree = match layout {
            Layout::Two => two,
            Layout::Wide => &self.wide,
        };
        [tree, triangles, primitives, frame]
    }
}
