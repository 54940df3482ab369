//! Whether a device rounds sums and products as the kernels rely on: to nearest, and one by one.

use crate::device::Shared;
use rt_core::{DeviceError, DeviceErrorKind};
use rt_gpu::PATIENCE;
use rt_gpu::arithmetic::{Answer, PAIRS, first_fault, questions};
use rt_shaders::{Layout, Purpose};
use std::sync::mpsc::sync_channel;
use wgpu::{BufferUsages, ComputePassDescriptor, MapMode};

/// In words, the first numbers with which the device does not compute as it must; `None` if it always does.
pub(crate) fn check(shared: &Shared) -> Result<Option<String>, DeviceError> {
    let opened = &shared.opened;
    let questions = questions();
    let (given, wanted) = (size_of_val(&questions[..]) as u64, u64::from(PAIRS) * size_of::<Answer>() as u64);
    let numbers = opened.buffer("numbers", given, BufferUsages::STORAGE | BufferUsages::COPY_DST)?;
    let answers = opened.buffer("numbers", wanted, BufferUsages::STORAGE | BufferUsages::COPY_SRC)?;
    let back = opened.buffer("numbers", wanted, BufferUsages::MAP_READ | BufferUsages::COPY_DST)?;
    let pipeline = shared.pipeline(Layout::Two, Purpose::Arithmetic, 0)?;
    let (tell, mapped) = sync_channel(1);
    let done = opened.scoped("add and multiply", DeviceErrorKind::Lost, || {
        opened.queue.write_buffer(&numbers, 0, bytemuck::cast_slice(&questions));
        let buffers = [&numbers, &numbers, &numbers, &numbers, &numbers, &numbers, &answers, &answers];
        let bindings = pipeline.bind(&opened.device, buffers);
        let mut encoder = opened.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor::default());
        pipeline.run(opened, &mut pass, &bindings, PAIRS);
        drop(pass);
        encoder.copy_buffer_to_buffer(&answers, 0, &back, 0, wanted);
        let done = opened.queue.submit([encoder.finish()]);
        back.map_async(MapMode::Read, .., move |result| {
            // Nobody listens any more when the check was given up.
            let _ = tell.send(result);
        });
        done
    })?;
    opened.wait(done, PATIENCE)?;
    // Nobody else waits for this device yet, so the callback has run.
    match mapped.try_recv() {
        Ok(Ok(())) => {}
        other => return Err(opened.lose(&format!("its numbers cannot be read: {other:?}"))),
    }
    let view = back.get_mapped_range(..).map_err(|e| opened.lose(&e.to_string()))?;
    Ok(first_fault(bytemuck::cast_slice(&view)))
}
