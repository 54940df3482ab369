//! Rays made on the device.

use crate::buffer::{Buffer, Use};
use crate::commands::{Commands, Stage};
use crate::device::Shared;
use crate::pipeline::Bindings;
use crate::timeline::Timeline;
use crate::upload::{Resident, Uploader};
use rt_core::DeviceError;
use rt_gpu::{PATIENCE, Recipe};
use rt_shaders::Layout;

/// What making rays needs beside the scene and the rays' own buffer.
#[derive(Debug)]
pub(crate) struct Maker {
    commands: Commands,
    bindings: Bindings,
    /// Those of [`inputs`], as large as was needed so far.
    inputs: [Buffer; 3],
}

/// What the buffers of a recipe are called in errors, and their bytes.
fn inputs<'a>(recipe: &Recipe<'a>) -> [(&'static str, &'a [u8]); 3] {
    [
        ("how rays are made", recipe.block),
        ("pixels or departures", bytemuck::cast_slice(recipe.list)),
        ("numbers of rays", bytemuck::cast_slice(recipe.parents)),
    ]
}

impl Maker {
    pub(crate) fn new(shared: &Shared) -> Result<Self, DeviceError> {
        let logical = &shared.logical;
        let empty = || Buffer::new(logical, "nothing", 0, Use::Kernel);
        Ok(Self {
            commands: Commands::new(logical)?,
            bindings: Bindings::new(shared.layout())?,
            inputs: [empty()?, empty()?, empty()?],
        })
    }

    /// Makes rays in the window `rays`, and waits for them. Nothing is in flight.
    pub(crate) fn make(
        &mut self,
        shared: &Shared,
        (uploader, timeline): (&mut Uploader, &mut Timeline),
        scene: &Resident,
        rays: &Buffer,
        recipe: Recipe<'_>,
    ) -> Result<(), DeviceError> {
        for (buffer, (what, bytes)) in self.inputs.iter_mut().zip(inputs(&recipe)) {
            let size = bytes.len() as u64;
            if buffer.size() < size {
                *buffer = Buffer::new(&shared.logical, what, size, Use::Kernel)?;
            }
            uploader.send(timeline, buffer, 0, bytes)?;
        }
        let pipeline = shared.pipeline(Layout::Two, recipe.purpose, 0)?;
        let Self { commands, bindings, inputs: [block, list, parents] } = self;
        let [tree, triangles, primitives, frame] = scene.bindings(Layout::Two);
        bindings.choose([tree, triangles, primitives, frame, list, block, rays, parents]);
        commands.record(|to| {
            to.barrier(Stage::Copy, Stage::Kernel);
            to.run(&pipeline, bindings, recipe.count);
            // For the launches that come after.
            to.barrier(Stage::Kernel, Stage::Kernel);
        })?;
        // The device's table keeps the pipeline as long as the device is open, and a tracer keeps that.
        let value = timeline.submit(commands.raw())?;
        timeline.wait(value, PATIENCE)
    }
}
