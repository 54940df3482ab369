//! Asking a device a question by a kernel of its own: whether it rounds as the others rely on, and makes rays.

use crate::buffer::{Buffer, Use};
use crate::commands::{Commands, Stage};
use crate::pipeline::Bindings;
use crate::shared::Shared;
use crate::timeline::Timeline;
use bytemuck::AnyBitPattern;
use rt_bvh::kernel_io::KernelRay;
use rt_core::DeviceError;
use rt_gpu::{PATIENCE, RayRecipe, SceneImage, arithmetic, bounce, camera};
use rt_shaders::{Layout, Purpose};

/// In words, the first numbers with which the device does not compute as it must; `None` if it always does.
pub(crate) fn check_arithmetic(shared: &Shared) -> Result<Option<String>, DeviceError> {
    let questions = arithmetic::questions();
    let inputs = [&[], &[], bytemuck::cast_slice(&questions), &[]];
    let answers = ask(shared, Purpose::Arithmetic, inputs, arithmetic::PAIRS as usize)?;
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
    ask(shared, recipe.purpose(), inputs, recipe.count() as usize)
}

/// Runs a kernel that reads bindings 1, 2, 4 and 5 and writes `count` answers, each by an invocation, to binding 6.
fn ask<T: AnyBitPattern>(
    shared: &Shared,
    purpose: Purpose,
    inputs: [&[u8]; 4],
    count: usize,
) -> Result<Vec<T>, DeviceError> {
    let logical = &shared.logical;
    let wanted = (count * size_of::<T>()) as u64;
    let buffer = |size, purpose| Buffer::new(logical, "numbers", size, purpose);
    let mut given = Vec::new();
    for bytes in inputs {
        let mut upload = buffer(bytes.len() as u64, Use::Upload)?;
        upload.write(0, bytes);
        given.push((upload, buffer(bytes.len() as u64, Use::Kernel)?, bytes.len() as u64));
    }
    let (answers, download) = (buffer(wanted, Use::Kernel)?, buffer(wanted, Use::Download)?);
    let pipeline = shared.pipeline(Layout::Two, purpose, 0)?;
    let mut bindings = Bindings::new(shared.layout())?;
    let [triangles, primitives, list, recipe] = std::array::from_fn(|i| &given[i].1);
    bindings.choose([triangles, triangles, primitives, triangles, list, recipe, &answers, list]);
    let (mut commands, mut timeline) = (Commands::new(logical)?, Timeline::new(logical)?);
    commands.record(|to| {
        for (upload, buffer, size) in given.iter().filter(|(_, _, size)| *size > 0) {
            to.copy(upload, buffer, 0, *size);
        }
        to.barrier(Stage::Copy, Stage::Kernel);
        to.run(&pipeline, &bindings, count as u32);
        to.barrier(Stage::Kernel, Stage::Copy);
        to.copy(&answers, &download, 0, wanted);
        to.barrier(Stage::Copy, Stage::Host);
    })?;
    let value = timeline.submit(commands.raw())?;
    if let Err(error) = timeline.wait(value, PATIENCE) {
        // The device may still use all of them: better lost than freed.
        std::mem::forget((given, answers, download, pipeline, bindings, commands, timeline));
        return Err(error);
    }
    Ok(download.read(count).to_vec())
}
