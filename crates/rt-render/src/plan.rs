//! What is known of an animation before any of its frames is rendered.

use crate::light::exposure;
use crate::tiles::{fingerprint_of_picture, fingerprint_of_scene};
use crate::{Part, RenderError, Renderer};
use glam::Vec3;
use rt_core::{Camera, morton};
use rt_scene::camera::CameraMotion;
use rt_scene::streams::{Paths, Samples, Wave};
use std::ops::Range;

/// Pixels of the longer side: a percentile of some thousand pixels is as good as one of a million.
const LONGER_SIDE: u32 = 64;

/// Samples of each of them.
const SAMPLES: u32 = 4;

/// An animation before it is rendered.
#[derive(Clone, Debug, PartialEq)]
pub struct AnimationPlan {
    /// The exposure of all its frames.
    pub exposure: f32,
    /// For each frame, of everything that decides what its picture is, however it is cut and whoever renders it. Like
    /// [`crate::tiles::fingerprint`] they are the same only for programs of one compiler.
    pub fingerprints: Vec<u64>,
}

impl Renderer<'_> {
    /// Plans frames of an animation; which ones changes nothing of any of them.
    ///
    /// # Errors
    /// When a frame has no camera, or there is no memory.
    pub fn plan(&self, motion: &CameraMotion, frames: Range<u32>) -> Result<AnimationPlan, RenderError> {
        let exposure = self.exposure(motion.camera(0)?)?;
        let scene = fingerprint_of_scene(self);
        let paths = |frame| -> Result<Paths, RenderError> { Ok(self.paths(motion.camera(frame)?, frame)) };
        let fingerprint = |frame| Ok(fingerprint_of_picture(scene, self, &paths(frame)?, exposure));
        Ok(AnimationPlan { exposure, fingerprints: frames.map(fingerprint).collect::<Result<_, RenderError>>()? })
    }

    /// The exposure of an animation that begins with this camera: that of a small picture, which is rendered on this
    /// thread and without devices. So processes that render different frames, one after the other or at the same time,
    /// give them the same exposure without a word between them.
    ///
    /// # Errors
    /// When there is no memory.
    fn exposure(&self, first: Camera) -> Result<f32, RenderError> {
        let _environment = rt_fenv::Environment::enter();
        let longer = self.size[0].max(self.size[1]).max(1);
        let small = |side: u32| (u64::from(side) * u64::from(LONGER_SIDE)).div_ceil(u64::from(longer)).max(1) as u32;
        let size = self.size.map(|side| small(side).min(side));
        let wave = Wave { first: 0, pixels: morton::pixel_order(size[0], size[1]).into() };
        let paths = Paths { size, samples: SAMPLES, ..self.paths(first, 0) };
        let part = Part { paths: &paths, frame: 0, number: 0, wave: &wave, samples: Samples::all(SAMPLES) };
        let mut sums = vec![Vec3::ZERO; wave.pixels.len()];
        self.shade(part, &mut sums, &mut |stream| Ok(self.walk(stream, |_| ())))?;
        Ok(exposure(|| sums.iter().map(|&sum| sum / SAMPLES as f32)))
    }
}
