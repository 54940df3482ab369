//! What is uploaded: a scene, and a stream's rays.

use crate::buffer::{Buffer, Use};
use crate::commands::Commands;
use crate::logical::Logical;
use crate::timeline::Timeline;
use bytemuck::{NoUninit, Pod, Zeroable};
use rt_bvh::offload::{KernelRay, Offload};
use rt_core::{Child, DeviceError, DeviceErrorKind, RaySource, Scene};
use std::sync::Arc;
use std::time::Duration;

/// Bytes copied to the device at once: large enough for the bus, small beside any scene that is worth a GPU.
const STAGING: u64 = 4 << 20;

/// The longest that copying [`STAGING`] bytes may take. It takes milliseconds.
const COPY_LIMIT: Duration = Duration::from_secs(60);

/// Copies to buffers that the host does not see.
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
            timeline.wait(value, COPY_LIMIT)?;
            offset += size;
        }
        Ok(())
    }
}

/// A scene on the device.
#[derive(Debug)]
pub(crate) struct Resident {
    pub nodes: Buffer,
    pub triangles: Buffer,
    pub primitives: Buffer,
    pub frame: Buffer,
}

/// The shader's structure `Frame`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Frame {
    low: [f32; 3],
    root: u32,
    high: [f32; 3],
    unused: u32,
}

impl Resident {
    pub(crate) fn new(
        logical: &Arc<Logical>,
        uploader: &mut Uploader,
        timeline: &mut Timeline,
        scene: &Scene,
    ) -> Result<Self, DeviceError> {
        // With two children 2, with one its side, with none 3.
        let root = &scene.nodes()[0];
        let there: Vec<u32> = (0..2).filter(|&side| root.child(side as usize) != Child::Absent).collect();
        let bounds = Offload::new(scene).bounds();
        let frame = Frame {
            low: bounds.min.to_array(),
            root: match there[..] {
                [] => 3,
                [side] => side,
                _ => 2,
            },
            high: bounds.max.to_array(),
            unused: 0,
        };
        let ids: Vec<u32> = (0..scene.primitives().len()).map(|slot| scene.primitives().get(slot)).collect();
        let mut upload = |what: &str, bytes: &[u8]| -> Result<Buffer, DeviceError> {
            let buffer = Buffer::new(logical, what, bytes.len() as u64, Use::Kernel)?;
            uploader.send(timeline, &buffer, 0, bytes)?;
            Ok(buffer)
        };
        Ok(Self {
            nodes: upload("the scene's tree", bytemuck::cast_slice(scene.nodes()))?,
            triangles: upload("the scene's triangles", bytemuck::cast_slice(scene.triangles()))?,
            primitives: upload("the scene's primitive ids", bytemuck::cast_slice(&ids))?,
            frame: upload("the scene's box", bytemuck::bytes_of(&frame))?,
        })
    }
}

/// Uploads a stream's rays.
pub(crate) fn upload_rays(
    logical: &Arc<Logical>,
    uploader: &mut Uploader,
    timeline: &mut Timeline,
    scene: &Scene,
    source: &RaySource,
) -> Result<Buffer, DeviceError> {
    const SIZE: u64 = size_of::<KernelRay>() as u64;
    let count = source.len();
    let bytes = u64::from(count) * SIZE;
    let buffer = Buffer::new(logical, &format!("{count} rays"), bytes, Use::Kernel)?;
    let offload = Offload::new(scene);
    let at_once = (STAGING / SIZE) as usize;
    let mut part = Vec::new();
    part.try_reserve_exact(at_once.min(count as usize)).map_err(|source| {
        DeviceError::new(DeviceErrorKind::OutOfMemory, "the host has no memory to prepare rays").with_source(source)
    })?;
    let mut sent = 0;
    for index in 0..count {
        let (ray, excluded) = source.ray(index);
        part.push(offload.prepare(&ray, excluded));
        if part.len() == at_once || index + 1 == count {
            uploader.send(timeline, &buffer, sent, &part)?;
            sent += part.len() as u64 * SIZE;
            part.clear();
        }
    }
    Ok(buffer)
}
