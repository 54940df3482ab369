//! A stream's rays: made on the device, or prepared on all of the host's threads and sent.

use crate::Board;
use rayon::prelude::*;
use rt_bvh::offload::{KernelRay, Offload};
use rt_core::{CameraRays, DeviceError, DeviceErrorKind, RaySource, Scene};

/// Rays prepared at once: 4 MiB of them, enough for every thread and the bus, little beside any scene.
const BATCH: u32 = 1 << 16;

/// What went to the board of a stream's rays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sent {
    pub bytes: u64,
    /// Rays that the board made itself.
    pub made: u32,
}

/// Puts a stream's rays on the board.
pub(crate) fn send(board: &mut impl Board, scene: &Scene, source: &RaySource) -> Result<Sent, DeviceError> {
    board.reserve_rays(source.len())?;
    let offload = Offload::new(scene);
    if let RaySource::Camera(rays) = source
        && let Some(bytes) = make(board, &offload, rays)?
    {
        return Ok(Sent { bytes, made: source.len() });
    }
    Ok(Sent { bytes: prepare(board, &offload, source)?, made: 0 })
}

/// First ray and number of rays of each window.
fn windows(window: u32, count: u32) -> impl Iterator<Item = (u32, u32)> {
    let window = window.max(1);
    (0..count.div_ceil(window)).map(move |number| (number * window, window.min(count - number * window)))
}

/// Has the board make the rays; returns the bytes sent, or `None` if it does not.
fn make(board: &mut impl Board, offload: &Offload<'_>, rays: &CameraRays) -> Result<Option<u64>, DeviceError> {
    let Some(camera) = offload.camera(rays) else {
        return Ok(None);
    };
    let mut sent = 0;
    for (number, (first, count)) in (0..).zip(windows(board.window(), rays.len())) {
        let (camera, pixels) = camera.part(rays, first, count);
        if !board.make_rays(number, &camera, pixels)? {
            return Ok(None);
        }
        sent += (size_of_val(&camera) + size_of_val(pixels)) as u64;
    }
    Ok(Some(sent))
}

/// Prepares the rays and writes them to the board; returns the bytes sent.
fn prepare(board: &mut impl Board, offload: &Offload<'_>, source: &RaySource) -> Result<u64, DeviceError> {
    let mut batch: Vec<KernelRay> = Vec::new();
    batch.try_reserve_exact(BATCH.min(source.len()) as usize).map_err(|source| {
        DeviceError::new(DeviceErrorKind::OutOfMemory, "the host has no memory to prepare rays").with_source(source)
    })?;
    let mut sent = 0;
    for (first, count) in windows(board.window(), source.len()) {
        for skip in (0..count).step_by(BATCH as usize) {
            let prepare = |index| {
                let (ray, excluded) = source.ray(index);
                offload.prepare(&ray, excluded)
            };
            let begin = first + skip;
            (begin..begin + BATCH.min(count - skip)).into_par_iter().map(prepare).collect_into_vec(&mut batch);
            board.write_rays(begin, &batch)?;
            sent += size_of_val(&batch[..]) as u64;
        }
    }
    Ok(sent)
}
