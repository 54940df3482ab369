//! Whether a device rounds sums and products as the kernels rely on: to nearest, and one by one.

use crate::buffer::{Buffer, Use};
use crate::commands::{Commands, Stage};
use crate::device::Shared;
use crate::pipeline::Bindings;
use crate::timeline::Timeline;
use rt_core::DeviceError;
use rt_gpu::PATIENCE;
use rt_gpu::arithmetic::{Answer, PAIRS, first_fault, questions};
use rt_shaders::{Layout, Purpose};

/// In words, the first numbers with which the device does not compute as it must; `None` if it always does.
pub(crate) fn check(shared: &Shared) -> Result<Option<String>, DeviceError> {
    let logical = &shared.logical;
    let questions = questions();
    let (given, wanted) = (size_of_val(&questions[..]) as u64, u64::from(PAIRS) * size_of::<Answer>() as u64);
    let mut upload = Buffer::new(logical, "numbers", given, Use::Upload)?;
    let [numbers, answers] = [given, wanted].map(|size| Buffer::new(logical, "numbers", size, Use::Kernel));
    let (numbers, answers) = (numbers?, answers?);
    let download = Buffer::new(logical, "numbers", wanted, Use::Download)?;
    upload.write(0, &questions);
    let pipeline = shared.pipeline(Layout::Two, Purpose::Arithmetic, 0)?;
    let mut bindings = Bindings::new(shared.layout())?;
    bindings.choose([&numbers, &numbers, &numbers, &numbers, &numbers, &numbers, &answers, &numbers]);
    let (mut commands, mut timeline) = (Commands::new(logical)?, Timeline::new(logical)?);
    commands.record(|to| {
        to.copy(&upload, &numbers, 0, given);
        to.barrier(Stage::Copy, Stage::Kernel);
        to.run(&pipeline, &bindings, PAIRS);
        to.barrier(Stage::Kernel, Stage::Copy);
        to.copy(&answers, &download, 0, wanted);
        to.barrier(Stage::Copy, Stage::Host);
    })?;
    let value = timeline.submit(commands.raw())?;
    if let Err(error) = timeline.wait(value, PATIENCE) {
        // The device may still use all of them: better lost than freed.
        std::mem::forget((upload, numbers, answers, download, pipeline, bindings, commands, timeline));
        return Err(error);
    }
    Ok(first_fault(download.read(PAIRS as usize)))
}
