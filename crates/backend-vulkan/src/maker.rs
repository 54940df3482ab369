//! Camera rays made on the device.

use crate::buffer::{Buffer, Use};
use crate::commands::{Commands, Stage};
use crate::device::Shared;
use crate::pipeline::Bindings;
use crate::timeline::Timeline;
use crate::upload::Uploader;
use rt_bvh::offload::KernelCamera;
use rt_core::DeviceError;
use rt_gpu::PATIENCE;
use rt_shaders::{Layout, Purpose};

/// What making rays needs beside the rays' own buffer.
#[derive(Debug)]
pub(crate) struct Maker {
    commands: Commands,
    bindings: Bindings,
    camera: Buffer,
    pixels: Buffer,
}

impl Maker {
    pub(crate) fn new(shared: &Shared) -> Result<Self, DeviceError> {
        let logical = &shared.logical;
        Ok(Self {
            commands: Commands::new(logical)?,
            bindings: Bindings::new(shared.layout())?,
            camera: Buffer::new(logical, "the camera", size_of::<KernelCamera>() as u64, Use::Kernel)?,
            pixels: Buffer::new(logical, "the pixels", 0, Use::Kernel)?,
        })
    }

    /// Makes `camera.count` rays at the start of `rays`, and waits for them. Nothing is in flight.
    pub(crate) fn make(
        &mut self,
        shared: &Shared,
        uploader: &mut Uploader,
        timeline: &mut Timeline,
        rays: &Buffer,
        (camera, pixels): (&KernelCamera, &[u32]),
    ) -> Result<(), DeviceError> {
        let size = size_of_val(pixels) as u64;
        if self.pixels.size() < size {
            self.pixels = Buffer::new(&shared.logical, &format!("{} pixels", pixels.len()), size, Use::Kernel)?;
        }
        uploader.send(timeline, &self.camera, 0, &[*camera])?;
        uploader.send(timeline, &self.pixels, 0, pixels)?;
        let pipeline = shared.pipeline(Layout::Two, Purpose::Camera, 0)?;
        let Self { commands, bindings, camera: block, pixels } = self;
        bindings.choose([pixels, pixels, pixels, pixels, pixels, block, rays, pixels]);
        commands.record(|to| {
            to.barrier(Stage::Copy, Stage::Kernel);
            to.run(&pipeline, bindings, camera.count);
            // For the launches that come after.
            to.barrier(Stage::Kernel, Stage::Kernel);
        })?;
        // The device's table keeps the pipeline as long as the device is open, and a tracer keeps that.
        let value = timeline.submit(commands.raw())?;
        timeline.wait(value, PATIENCE)
    }
}
