//! Asking a device a question by a kernel of its own: whether it rounds as the others rely on, and makes rays.

use crate::shared::Shared;
use bytemuck::Pod;
use rt_bvh::kernel_io::KernelRay;
use rt_core::{DeviceError, DeviceErrorKind};
use rt_gpu::{PATIENCE, RayRecipe, SceneImage, arithmetic, bounce, camera};
use rt_shaders::{Layout, Purpose};
use std::sync::mpsc::sync_channel;
use wgpu::{BufferUsages, ComputePassDescriptor, MapMode};

/// In words, the first numbers with which the device does not compute as it must; `None` if it always does.
pub(crate) fn check_arithmetic(shared: &Shared) -> Result<Option<String>, DeviceError> {
    let questions = arithmetic::questions();
    let inputs = [&[], &[], bytemuck::cast_slice(&questions), &[]];
    let answers = ask(shared, Purpose::Arithmetic, inputs, arithmetic::PAIRS)?;
    Ok(arithmetic::first_fault(&answers))
}

/// Whether a kernel that makes rays makes those of the host; found out when it is first asked.
pub(crate) fn makes(shared: &Shared, purpose: Purpose) -> bool {
    shared.trials.passed(purpose, || check_camera(shared), |trials| check_bounces(shared, trials))
}

/// In words, the first camera ray that the device makes otherwise than the host; `None` if there is none.
fn check_camera(shared: &Shared) -> Result<Option<String>, DeviceError> {
    camera::fault(|recipe| make(shared, None, recipe))
}

/// The same of rays that leave surfaces.
pub(crate) fn check_bounces(shared: &Shared, trials: &[bounce::Trial]) -> Result<Option<String>, DeviceError> {
    bounce::fault(trials, |scene, recipe| make(shared, Some(scene), recipe))
}

/// The rays that a kernel makes.
fn make(shared: &Shared, scene: Option<&SceneImage<'_>>, recipe: &RayRecipe) -> Result<Vec<KernelRay>, DeviceError> {
    let [_, triangles, primitives, _] = scene.map_or([&[][..]; 4], |scene| scene.buffers().map(|(_, bytes)| bytes));
    let inputs = [triangles, primitives, &[], bytemuck::cast_slice(recipe.words())];
    ask(shared, recipe.purpose(), inputs, recipe.count())
}

/// Runs a kernel that reads bindings 1, 2, 4 and 5 and writes `count` answers, each by an invocation, to binding 6.
fn ask<T: Pod>(shared: &Shared, purpose: Purpose, inputs: [&[u8]; 4], count: u32) -> Result<Vec<T>, DeviceError> {
    let opened = &shared.opened;
    let wanted = u64::from(count) * size_of::<T>() as u64;
    let mut given = Vec::new();
    for bytes in inputs {
        given.push(opened.buffer("numbers", bytes.len() as u64, BufferUsages::STORAGE | BufferUsages::COPY_DST)?);
    }
    let [triangles, primitives, list, recipe] = std::array::from_fn(|i| &given[i]);
    let answers = opened.buffer("numbers", wanted, BufferUsages::STORAGE | BufferUsages::COPY_SRC)?;
    let back = opened.buffer("numbers", wanted, BufferUsages::MAP_READ | BufferUsages::COPY_DST)?;
    let pipeline = shared.pipeline(Layout::Two, purpose, 0)?;
    let (tell, mapped) = sync_channel(1);
    let done = opened.scoped("add and multiply", DeviceErrorKind::Lost, || {
        for (buffer, bytes) in given.iter().zip(inputs).filter(|(_, bytes)| !bytes.is_empty()) {
            opened.queue.write_buffer(buffer, 0, bytes);
        }
        let buffers = [triangles, triangles, primitives, triangles, list, recipe, &answers, list];
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
