//! A stream's rays that the host prepares, on all of its threads, and sends.

use crate::GpuApi;
use rayon::prelude::*;
use rt_bvh::kernel_io::{KernelIo, KernelRay};
use rt_core::{DeviceError, DeviceErrorKind, RaySource};
use rt_fenv::Environment;

/// Rays prepared at once: 4 MiB of them, enough for every thread and the bus, little beside any scene.
const BATCH: u32 = 1 << 16;

/// First ray and number of rays of each window.
fn windows(window: u32, count: u32) -> impl Iterator<Item = (u32, u32)> {
    let window = window.max(1);
    (0..count.div_ceil(window)).map(move |number| (number * window, window.min(count - number * window)))
}

/// Prepares the rays and writes them to the card; returns the bytes sent.
pub(crate) fn prepare(api: &mut impl GpuApi, io: &KernelIo<'_>, source: &RaySource) -> Result<u64, DeviceError> {
    let mut batch: Vec<KernelRay> = Vec::new();
    batch.try_reserve_exact(BATCH.min(source.len()) as usize).map_err(|source| {
        DeviceError::new(DeviceErrorKind::OutOfMemory, "the host has no memory to prepare rays").with_source(source)
    })?;
    let mut sent = 0;
    for (first, count) in windows(api.window(), source.len()) {
        for skip in (0..count).step_by(BATCH as usize) {
            let prepare = |_: &mut Environment, index| {
                let (ray, excluded) = source.ray(index);
                io.prepare(&ray, excluded)
            };
            let begin = first + skip;
            (begin..begin + BATCH.min(count - skip))
                .into_par_iter()
                .map_init(Environment::enter, prepare)
                .collect_into_vec(&mut batch);
            api.write_rays(begin, &batch)?;
            sent += size_of_val(&batch[..]) as u64;
        }
    }
    Ok(sent)
}
