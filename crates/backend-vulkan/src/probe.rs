//! Asking a device a question by a kernel of its own: whether it rounds as the others rely on, and makes rays.

use crate::buffer::{Buffer, Use};
use crate::commands::{Commands, Stage};
use crate::device::Shared;
use crate::pipeline::Bindings;
use crate::timeline::Timeline;
use bytemuck::{AnyBitPattern, NoUninit};
use rt_core::DeviceError;
use rt_gpu::{PATIENCE, arithmetic, camera};
use rt_shaders::{Layout, Purpose};

/// In words, the first numbers with which the device does not compute as it must; `None` if it always does.
pub(crate) fn check_arithmetic(shared: &Shared) -> Result<Option<String>, DeviceError> {
    let answers = ask(shared, Purpose::Arithmetic, &arithmetic::questions(), &[0_u32], arithmetic::PAIRS as usize)?;
    Ok(arithmetic::first_fault(&answers))
}

/// In words, the first camera ray that the device makes otherwise than the host; `None` if there is none.
pub(crate) fn check_camera(shared: &Shared) -> Result<Option<String>, DeviceError> {
    for trial in camera::trials() {
        let (camera, pixels) = trial.input();
        let made = ask(shared, Purpose::Camera, pixels, &[camera], camera.count as usize)?;
        if let Some(fault) = trial.first_fault(&made) {
            return Ok(Some(fault));
        }
    }
    Ok(None)
}

/// Runs a kernel that reads bindings 4 and 5 and writes `count` answers, each by an invocation, to binding 6.
fn ask<A: NoUninit, B: NoUninit, T: AnyBitPattern>(
    shared: &Shared,
    purpose: Purpose,
    fourth: &[A],
    fifth: &[B],
    count: usize,
) -> Result<Vec<T>, DeviceError> {
    let logical = &shared.logical;
    let sizes = [size_of_val(fourth), size_of_val(fifth), count * size_of::<T>()].map(|size| size as u64);
    let buffer = |size, purpose| Buffer::new(logical, "numbers", size, purpose);
    let mut uploads = [buffer(sizes[0], Use::Upload)?, buffer(sizes[1], Use::Upload)?];
    let [given, more, answers] = sizes.map(|size| buffer(size, Use::Kernel));
    let (given, more, answers) = (given?, more?, answers?);
    let download = buffer(sizes[2], Use::Download)?;
    uploads[0].write(0, fourth);
    uploads[1].write(0, fifth);
    let pipeline = shared.pipeline(Layout::Two, purpose, 0)?;
    let mut bindings = Bindings::new(shared.layout())?;
    bindings.choose([&given, &given, &given, &given, &given, &more, &answers, &given]);
    let (mut commands, mut timeline) = (Commands::new(logical)?, Timeline::new(logical)?);
    commands.record(|to| {
        to.copy(&uploads[0], &given, 0, sizes[0]);
        to.copy(&uploads[1], &more, 0, sizes[1]);
        to.barrier(Stage::Copy, Stage::Kernel);
        to.run(&pipeline, &bindings, count as u32);
        to.barrier(Stage::Kernel, Stage::Copy);
        to.copy(&answers, &download, 0, sizes[2]);
        to.barrier(Stage::Copy, Stage::Host);
    })?;
    let value = timeline.submit(commands.raw())?;
    if let Err(error) = timeline.wait(value, PATIENCE) {
        // The device may still use all of them: better lost than freed.
        std::mem::forget((uploads, given, more, answers, download, pipeline, bindings, commands, timeline));
        return Err(error);
    }
    Ok(download.read(count).to_vec())
}
