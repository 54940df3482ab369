//! Preparing rays on all of the host's threads.

use crate::Board;
use rayon::prelude::*;
use rt_bvh::offload::{KernelRay, Offload};
use rt_core::{DeviceError, DeviceErrorKind, RaySource, Scene};

/// Rays prepared at once: 4 MiB of them, enough for every thread and the bus, little beside any scene.
const BATCH: u32 = 1 << 16;

/// Prepares a stream's rays and writes them to the board; returns the number of bytes.
pub(crate) fn send(board: &mut impl Board, scene: &Scene, source: &RaySource) -> Result<u64, DeviceError> {
    let count = source.len();
    board.reserve_rays(count)?;
    let offload = Offload::new(scene);
    let mut batch: Vec<KernelRay> = Vec::new();
    batch.try_reserve_exact(BATCH.min(count) as usize).map_err(|source| {
        DeviceError::new(DeviceErrorKind::OutOfMemory, "the host has no memory to prepare rays").with_source(source)
    })?;
    let (mut first, mut sent) = (0, 0);
    while first < count {
        let here = BATCH.min(count - first);
        let prepare = |index| {
            let (ray, excluded) = source.ray(index);
            offload.prepare(&ray, excluded)
        };
        (first..first + here).into_par_iter().map(prepare).collect_into_vec(&mut batch);
        board.write_rays(first, &batch)?;
        first += here;
        sent += size_of_val(&batch[..]) as u64;
    }
    Ok(sent)
}
