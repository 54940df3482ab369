//! Rays of measurements, until one maker makes all streams.

use glam::Vec3;
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use rt_core::RaySource;
use rt_scene::View;
use rt_scene::streams::{Spawned, Sun};
use std::ops::Range;

/// Hits that one core turns into rays at a time.
const SPAWN_CHUNK: u32 = 1 << 14;

/// Spawns from all hits on all cores; the rays are in the order of their parents, as if spawned on one.
pub(crate) fn spawn(hits: usize, from: impl Fn(Range<u32>) -> Spawned + Sync) -> (RaySource, Vec<u32>) {
    let hits = hits as u32;
    let chunk = |chunk| from(chunk * SPAWN_CHUNK..hits.min((chunk + 1) * SPAWN_CHUNK));
    let chunks: Vec<Spawned> = (0..hits.div_ceil(SPAWN_CHUNK)).into_par_iter().map(chunk).collect();
    let mut all = Spawned::default();
    chunks.into_iter().for_each(|chunk| all.append(chunk));
    all.into_source()
}

/// The sun of pictures.
pub(crate) fn sun(view: &View) -> Sun {
    let up = view.up.try_normalize().unwrap_or(Vec3::Y);
    let back = (view.eye - view.target).reject_from_normalized(up).try_normalize();
    let back = back.unwrap_or_else(|| up.any_orthonormal_vector());
    let ((sin_a, cos_a), (sin_e, cos_e)) = (50_f32.to_radians().sin_cos(), 48_f32.to_radians().sin_cos());
    let sun = (back * cos_a + back.cross(up) * sin_a) * cos_e + up * sin_e;
    Sun::new(sun, 0.045).expect("a unit direction and a small disc make a sun")
}
