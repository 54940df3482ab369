//! Asking a device a question by a kernel of its own: whether it rounds as the others rely on, and makes rays.

use crate::device::Shared;
use bytemuck::{NoUninit, Pod};
use rt_core::{DeviceError, DeviceErrorKind};
use rt_gpu::{PATIENCE, arithmetic, camera};
use rt_shaders::{Layout, Purpose};
use std::sync::mpsc::sync_channel;
use wgpu::{BufferUsages, ComputePassDescriptor, MapMode};

/// In words, the first numbers with which the device does not compute as it must; `None` if it always does.
pub(crate) fn check_arithmetic(shared: &Shared) -> Result<Option<String>, DeviceError> {
    let answers = ask(shared, Purpose::Arithmetic, &arithmetic::questions(), &[0_u32], arithmetic::PAIRS)?;
    Ok(arithmetic::first_fault(&answers))
}

/// In words, the first camera ray that the device makes otherwise than the host; `None` if there is none.
pub(crate) fn check_camera(shared: &Shared) -> Result<Option<String>, DeviceError> {
    for trial in camera::trials() {
        let (camera, pixels) = trial.input();
        let made = ask(shared, Purpose::Camera, pixels, &[camera], camera.count)?;
        if let Some(fault) = trial.first_fault(&made) {
            return Ok(Some(fault));
        }
    }
    Ok(None)
}

/// Runs a kernel that reads bindings 4 and 5 and writes `count` answers, each by an invocation, to binding 6.
fn ask<A: NoUninit, B: NoUninit, T: Pod>(
    shared: &Shared,
    purpose: Purpose,
    fourth: &[A],
    fifth: &[B],
    count: u32,
) -> Result<Vec<T>, DeviceError> {
    let opened = &shared.opened;
    let wanted = u64::from(count) * size_of::<T>() as u64;
    let given = |size: usize| opened.buffer("numbers", size as u64, BufferUsages::STORAGE | BufferUsages::COPY_DST);
    let (numbers, more) = (given(size_of_val(fourth))?, given(size_of_val(fifth))?);
    let answers = opened.buffer("numbers", wanted, BufferUsages::STORAGE | BufferUsages::COPY_SRC)?;
    let back = opened.buffer("numbers", wanted, BufferUsages::MAP_READ | BufferUsages::COPY_DST)?;
    let pipeline = shared.pipeline(Layout::Two, purpose, 0)?;
    let (tell, mapped) = sync_channel(1);
    let done = opened.scoped("add and multiply", DeviceErrorKind::Lost, || {
        opened.queue.write_buffer(&numbers, 0, bytemuck::cast_slice(fourth));
        opened.queue.write_buffer(&more, 0, bytemuck::cast_slice(fifth));
        let buffers = [&numbers, &numbers, &numbers, &numbers, &numbers, &more, &answers, &answers];
        let bindings = pipeline.bind(&opened.device, buffers);
        let mut encoder = opened.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor::default());
        pipeline.run(opened, &mut pass, &bindings, count);
        drop(pass);
        encoder.copy_buffer_to_buffer(&answers, 0, &back, 0, wanted);
        let done = opened.queue.submit([encoder.finish()]);
        back.map_async(MapMode::Read, 0..wanted, move |result| {
            // Nobody listens any more when the question was given up.
            let _ = tell.send(result);
        });
        done
    })?;
    opened.wait(done, PATIENCE)?;
    // Another thread that waits for the device may be the one that runs the callback.
    match mapped.recv_timeout(PATIENCE) {
        Ok(Ok(())) => {}
        other => return Err(opened.lose(&format!("its numbers cannot be read: {other:?}"))),
    }
    let view = back.get_mapped_range(0..wanted).map_err(|e| opened.lose(&e.to_string()))?;
    Ok(bytemuck::pod_collect_to_vec(&view))
}
