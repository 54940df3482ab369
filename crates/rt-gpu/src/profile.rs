//! What backends keep of an opened card, and how they make a tracer of a scene.

use crate::{Card, GpuApi, GpuScene, GpuTracer, IN_FLIGHT, Layouts, RayCounters, Tuning};
use rt_core::{Capabilities, Clock, Counted, DeviceError, DeviceErrorKind, DeviceInfo, ReducedWalk, Scene, Tracer};
use std::sync::Arc;

/// What a backend keeps of an opened card, beside what its API needs.
#[derive(Debug)]
pub struct Profile {
    /// What the driver says of it, for people.
    pub card: Card,
    /// What it is, for the driver of a run.
    pub info: DeviceInfo,
    /// The layouts in which it is to hold scenes.
    pub layouts: Layouts,
    /// How its tracers make their launches.
    pub tuning: Tuning,
    /// What they did.
    pub counters: Arc<RayCounters>,
}

/// What every card can do.
pub(crate) fn capabilities() -> Capabilities {
    Capabilities::UNKNOWN
        .with_reduced_walks(&[ReducedWalk::LeafAsHit, ReducedWalk::Unshortened])
        .with_counts(Counted::SceneTree)
        .with_defined_bits()
        .making_rays()
}

impl Profile {
    /// A card that `backend` reached, with `memory` bytes for scenes where that is known; without `layouts`,
    /// [`Layouts::USUAL`].
    #[must_use]
    pub fn new(backend: &'static str, memory: Option<u64>, card: Card, layouts: Option<Layouts>) -> Self {
        // Neither API tells the number of units.
        let info = DeviceInfo::new(card.name.clone(), backend)
            .with_in_flight(IN_FLIGHT)
            .with_memory(memory)
            .with_capabilities(capabilities());
        let layouts = layouts.unwrap_or(Layouts::USUAL);
        Self { card, info, layouts, tuning: Tuning::default(), counters: Arc::default() }
    }

    /// A tracer of `scene`, which `api` brings to the card. Where it does not fit with both trees, and only hits were
    /// to be found over the wide one, the two-wide tree alone is tried, and the tracer notes it.
    ///
    /// # Errors
    /// Those of `api`.
    pub fn tracer<A: GpuApi + 'static>(
        &self,
        scene: Arc<Scene>,
        clock: Clock,
        api: impl Fn(&GpuScene) -> Result<A, DeviceError>,
    ) -> Result<Box<dyn Tracer>, DeviceError> {
        let mut held = GpuScene::new(Arc::clone(&scene), self.layouts);
        let (mut made, mut note) = (api(&held), None);
        if let Err(error) = &made
            && error.kind() == DeviceErrorKind::OutOfMemory
            && held.can_do_without_wide()
        {
            note = Some(format!("walks the two-wide tree alone: {error}"));
            held = GpuScene::from(scene);
            made = api(&held);
        }
        Ok(Box::new(GpuTracer::new(made?, held, clock, Arc::clone(&self.counters)).with_note(note)))
    }
}
