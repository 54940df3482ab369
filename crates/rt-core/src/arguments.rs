//! What every [`Tracer`](crate::Tracer) refuses before it does anything, and what of a device's answers is refused: one
//! place, so that all refuse alike.

use crate::{Capabilities, DeviceError, DeviceErrorKind, Hit, Query, RaySource, Scene, StreamSpec, Task, TestCounts};
use alloc::format;
use alloc::string::String;

/// An error that left the device as it was.
#[must_use]
pub fn invalid(message: impl Into<String>) -> DeviceError {
    DeviceError::new(DeviceErrorKind::InvalidArgument, message)
}

/// Refuses a scene that has moved while `open` launches are in flight.
///
/// # Errors
/// In that case.
pub fn check_move(open: usize) -> Result<(), DeviceError> {
    if open > 0 {
        return Err(invalid(format!("move_scene: {open} launches are in flight: wait for them")));
    }
    Ok(())
}

/// Refuses rays while `open` launches are in flight, and rays whose origins are not as many.
///
/// # Errors
/// In those cases.
pub fn check_load(source: &RaySource, open: usize) -> Result<(), DeviceError> {
    if open > 0 {
        return Err(invalid(format!("load_rays: {open} launches are in flight: wait for them")));
    }
    match source {
        RaySource::Explicit { rays, origins: Some(origins) } if rays.len() != origins.len() => {
            Err(invalid(format!("load_rays: {} rays but {} origins", rays.len(), origins.len())))
        }
        _ => Ok(()),
    }
}

/// Refuses a stream that a device of these capabilities cannot trace in this scene.
///
/// # Errors
/// [`DeviceErrorKind::Unsupported`] in that case; the message says what to do.
pub fn check_spec(capabilities: &Capabilities, scene: &Scene, spec: StreamSpec) -> Result<(), DeviceError> {
    let what = if scene.hides(spec.mask) && !capabilities.has_masks() {
        "it knows no masks, and the mask of these rays hides primitives: choose a CPU device, or trace a scene without \
         those"
            .into()
    } else if matches!(spec.query, Query::All { .. }) && !capabilities.has_all_hits() {
        "it finds one hit of each ray: choose a CPU device, or ask for the nearest hit".into()
    } else if !capabilities.can_trace(spec) {
        let (precision, counts) = (spec.precision.name(), spec.counts);
        format!("it cannot trace with precision {precision}, counts {counts}: choose another device")
    } else {
        return Ok(());
    };
    Err(DeviceError::new(DeviceErrorKind::Unsupported, what))
}

/// Refuses a walk of rays that are not among the `loaded` ones, or with room for another number of answers.
///
/// # Errors
/// In those cases.
pub fn check_walk(rays: &[u32], counts: &[TestCounts], hits: Option<&[Hit]>, loaded: u32) -> Result<(), DeviceError> {
    if counts.len() != rays.len() || hits.is_some_and(|hits| hits.len() != rays.len()) {
        return Err(invalid(format!("walk: {} rays need as many counts and hits", rays.len())));
    }
    match rays.iter().find(|&&ray| ray >= loaded) {
        Some(bad) => Err(invalid(format!("walk: ray {bad} of {loaded}"))),
        None => Ok(()),
    }
}

/// Refuses a launch beyond the `capacity` that may be in flight, and tasks of rays that are not among the `loaded`
/// ones.
///
/// # Errors
/// In those cases.
pub fn check_submit(tasks: &[Task], loaded: u32, open: usize, capacity: u32) -> Result<(), DeviceError> {
    if open >= capacity as usize {
        return Err(invalid(format!("submit: {capacity} launches are in flight already: wait for one")));
    }
    let outside = |task: &&Task| u64::from(task.first) + u64::from(task.rays) > u64::from(loaded);
    match tasks.iter().find(outside) {
        Some(task) => Err(invalid(format!(
            "submit: a task of {} rays from ray {} does not fit into {loaded} loaded rays",
            task.rays, task.first
        ))),
        None => Ok(()),
    }
}

/// The share of the answers of a launch, beyond a single one, that may be refused before the device is not believed.
///
/// A single answer may differ by a rounding that a driver makes otherwise than it says. Embree in its robust mode,
/// which decides edges its own way, lets up to 0.31% of rays out of closed meshes that are aimed at vertices
/// (`docs/results/robustness.md`), and a picture's rays meet few of those. Where launches are mixed up, or kernels do
/// nothing, about every second answer is wrong.
pub const MOST_REFUSED: f64 = 1.0 / 32.0;

/// Whether a device is not believed of which `refused` answers out of `all` that were looked at are wrong.
#[must_use]
pub const fn is_disbelieved(all: u64, refused: u64) -> bool {
    refused as f64 > 1.0 + MOST_REFUSED * all as f64
}

#[cfg(test)]
mod tests {
    use super::is_disbelieved;

    /// Mutants: `>=` for `>`; the single one not let through; the share of it all instead of what was looked at.
    #[test]
    fn single_answers_may_be_refused_and_many_may_not() {
        let refused = [(0, 0), (1, 1), (31, 1), (61, 2), (1024, 33), (100_000, 3126)];
        assert!(refused.iter().all(|&(all, refused)| !is_disbelieved(all, refused)));
        let too_many = [(1, 2), (31, 2), (61, 3), (1024, 34), (100_000, 3127)];
        assert!(too_many.iter().all(|&(all, refused)| is_disbelieved(all, refused)));
    }
}
