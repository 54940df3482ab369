//! Prices of many tasks or many devices at once.

use rt_core::{CostModel, Work};

/// Seconds per ray, box test and triangle test, averaged over `devices`.
pub(crate) fn mean_model(devices: &[CostModel]) -> [f64; 3] {
    let share = 1.0 / devices.len().max(1) as f64;
    let mut mean = [0.0; 3];
    for d in devices {
        for (sum, part) in mean.iter_mut().zip([d.per_ray(), d.per_box(), d.per_triangle()]) {
            *sum += part * share;
        }
    }
    mean
}

/// All rays, box tests and triangle tests of `work`.
pub(crate) fn total(work: &[Work]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for w in work {
        for (sum, part) in sum.iter_mut().zip([w.rays(), w.boxes(), w.triangles()]) {
            *sum += f64::from(part);
        }
    }
    sum
}

/// Expected seconds of `work` for [`mean_model`].
pub(crate) fn seconds(model: &[f64; 3], work: &Work) -> f64 {
    model[0] * f64::from(work.rays()) + model[1] * f64::from(work.boxes()) + model[2] * f64::from(work.triangles())
}
