//! What moves from frame to frame, and what bringing the scene up to date took.

use crate::{RenderError, Renderer, Session};
use rt_balance::clock;
use rt_balance::report::UpdateReport;
use rt_scene::wind::{FRAMES_PER_SECOND, Wind};
use std::sync::Arc;

/// The scene of each frame: the first is the one that was prepared.
#[derive(Debug, Default)]
pub struct Animation {
    wind: Option<Wind>,
    updates: Vec<UpdateReport>,
}

impl Animation {
    /// Of a scene in which all that `wind` bends moves; without any nothing does.
    #[must_use]
    pub const fn new(wind: Option<Wind>) -> Self {
        Self { wind, updates: Vec::new() }
    }

    /// Brings what a session traces and a renderer shades up to date with a frame. Whether that changed anything.
    ///
    /// # Errors
    /// When no device can take the scene: then none is left.
    pub fn show(
        &mut self,
        frame: u32,
        renderer: &mut Renderer<'_>,
        session: &mut Session<'_>,
    ) -> Result<bool, RenderError> {
        let Some(wind) = self.wind.as_mut().filter(|_| frame > 0) else { return Ok(false) };
        let begin = clock();
        let mesh = wind.after(frame as f32 / FRAMES_PER_SECOND);
        let move_s = clock().saturating_sub(begin).as_secs_f64();
        let update = session.balancer.update(bytemuck::cast_slice(mesh.positions), mesh.indices)?;
        renderer.surfaces = Arc::new(renderer.surfaces.moved(Arc::clone(session.balancer.scene())));
        self.updates.push(UpdateReport::new(frame, move_s, &update));
        Ok(true)
    }

    /// What was done so far, one entry for each frame before which the scene moved.
    #[must_use]
    pub fn updates(&self) -> &[UpdateReport] {
        &self.updates
    }
}
