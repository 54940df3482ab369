//! A stream's rays: made on the device, or prepared on all of the host's threads and sent.

use crate::{Board, Recipe, bounce};
use rayon::prelude::*;
use rt_bvh::offload::{KernelRay, Offload};
use rt_core::{BounceRays, CameraRays, DeviceError, DeviceErrorKind, RaySource, Scene};
use rt_shaders::Purpose;

/// Rays prepared at once: 4 MiB of them, enough for every thread and the bus, little beside any scene.
const BATCH: u32 = 1 << 16;

/// Departures sent at once: 12 MiB of them, so many that a device hardly waits in between.
const DEPARTURES: u32 = 1 << 20;

/// What went to the board of a stream's rays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sent {
    pub bytes: u64,
    /// Rays that the board made itself.
    pub made: u32,
}

/// Puts a stream's rays on the board. `places` are those of the scene's triangles there, see
/// [`crate::GpuScene`].
pub(crate) fn send<'a>(
    board: &mut impl Board,
    scene: &Scene,
    places: impl FnOnce() -> &'a [u32],
    source: &RaySource,
) -> Result<Sent, DeviceError> {
    board.reserve_rays(source.len())?;
    let offload = Offload::new(scene);
    let made = match source {
        RaySource::Camera(rays) if board.makes(Purpose::Camera) => make_camera(board, &offload, rays)?,
        RaySource::Bounce(rays) if board.makes(Purpose::Bounce) => make_bounces(board, &offload, places(), rays)?,
        _ => None,
    };
    match made {
        Some(bytes) => Ok(Sent { bytes, made: source.len() }),
        None => Ok(Sent { bytes: prepare(board, &offload, source)?, made: 0 }),
    }
}

/// First ray and number of rays of each window.
fn windows(window: u32, count: u32) -> impl Iterator<Item = (u32, u32)> {
    let window = window.max(1);
    (0..count.div_ceil(window)).map(move |number| (number * window, window.min(count - number * window)))
}

/// Has the board make the rays; returns the bytes sent, or `None` where kernels cannot be told of such rays.
fn make_camera(board: &mut impl Board, offload: &Offload<'_>, rays: &CameraRays) -> Result<Option<u64>, DeviceError> {
    let Some(camera) = offload.camera(rays) else {
        return Ok(None);
    };
    let mut sent = 0;
    for (number, (first, count)) in (0..).zip(windows(board.window(), rays.len())) {
        let (camera, list) = camera.part(rays, first, count);
        let block = bytemuck::bytes_of(&camera);
        let recipe = Recipe { purpose: Purpose::Camera, block, list, parents: &[], count };
        board.make_rays(number, recipe)?;
        sent += recipe.bytes();
    }
    Ok(Some(sent))
}

/// Likewise.
fn make_bounces(
    board: &mut impl Board,
    offload: &Offload<'_>,
    places: &[u32],
    rays: &BounceRays,
) -> Result<Option<u64>, DeviceError> {
    let Some(block) = offload.bounce(rays) else {
        return Ok(None);
    };
    let mut sent = 0;
    for (number, (first, count)) in (0..).zip(windows(board.window(), rays.len())) {
        for skip in (0..count).step_by(DEPARTURES as usize) {
            let count = DEPARTURES.min(count - skip);
            let part = bounce::Part::new(&block, rays, [first + skip, count], skip, places);
            board.make_rays(number, part.recipe())?;
            sent += part.recipe().bytes();
        }
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
