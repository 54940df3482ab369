//! Ray streams: camera rays in waves that fit the memory, and the shadow and diffuse rays that follow from their hits.
//!
//! [`Paths`] makes them all. Whoever renders, measures or checks takes its rays from there, so that what is measured is
//! what is rendered; [`Spawner`] is for rays that follow from others than a camera's.

mod path;
mod spawn;
mod sun;
mod wave;

pub use path::{PathStream, Paths, Samples};
pub use spawn::Spawner;
pub use sun::Sun;
pub use wave::{ImageSizeError, Wave, Waves};

use rayon::prelude::*;
use rt_bvh::Stack;
use rt_core::{Hit, RaySource, Scene, StreamSpec};

/// The hits of a stream, found on all of the host's cores: for those who need hits to go on from, not devices to
/// measure.
#[must_use]
pub fn trace(scene: &Scene, source: &RaySource, spec: StreamSpec) -> Vec<Hit> {
    /// Rays that one core traces at a time.
    const CHUNK: u32 = 1 << 12;
    let chunk = |chunk: u32| {
        // Threads of the pool may have inherited another.
        let _environment = rt_fenv::Environment::enter();
        let rays = (chunk * CHUNK..source.len().min((chunk + 1).saturating_mul(CHUNK))).map(|i| source.ray(i));
        let mut hits = Vec::with_capacity(CHUNK as usize);
        rt_bvh::trace(scene, &mut Stack::for_scene(scene), spec, rays, |hit, _| hits.push(hit));
        hits
    };
    (0..source.len().div_ceil(CHUNK)).into_par_iter().flat_map_iter(chunk).collect()
}

/// Largest width and height of an image in pixels: a pixel's position is packed into two times 16 bits.
pub const MAX_SIDE: u32 = 1 << 16;
