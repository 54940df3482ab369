//! Where a model's substance is: its bounds, or those of all but a few outliers.

use crate::Model;
use glam::DVec3;
use rt_core::Aabb;

/// Share of the triangles that may be outliers on each side of each axis: few large triangles (a ground, a sky) stay
/// below it, while no part worth looking at does.
pub(crate) const OUTLIERS: f64 = 0.01;

/// How many times longer than the frame without outliers the whole model must be for outliers to be left out. Below it
/// the whole model still fills a good part of a picture.
const FAR_LARGER: f64 = 4.0;

/// Smallest and largest corner of all finite triangles, or of the triangles between the outliers where these make the
/// model many times larger. `None` without finite triangles. Takes linear time.
pub(crate) fn frame(model: &Model) -> Option<(DVec3, DVec3)> {
    let triangles = (0..model.indices.len()).filter_map(|i| model.triangle(u32::try_from(i).ok()?));
    let bounds: Vec<Aabb> = triangles.filter(|t| t.is_finite()).map(|t| t.bounds()).collect();
    let whole = bounds.iter().fold(Aabb::EMPTY, |all, &b| all.union(b));
    if whole.is_empty() {
        return None;
    }
    let (low, high) = (whole.min.as_dvec3(), whole.max.as_dvec3());
    let outliers = (OUTLIERS * bounds.len() as f64) as usize;
    // Percentiles of both ends of the triangles, not of their centroids: a huge triangle may be centred on the subject.
    let (mut inner_low, mut inner_high) = (low, high);
    let mut ends = Vec::with_capacity(bounds.len());
    for axis in 0..3 {
        ends.extend(bounds.iter().map(|b| b.min[axis]));
        inner_low[axis] = f64::from(*ends.select_nth_unstable_by(outliers, f32::total_cmp).1);
        ends.clear();
        ends.extend(bounds.iter().map(|b| b.max[axis]));
        inner_high[axis] = f64::from(*ends.select_nth_unstable_by(bounds.len() - 1 - outliers, f32::total_cmp).1);
        ends.clear();
    }
    let inner = inner_high - inner_low;
    let is_box = inner.min_element() >= 0.0 && inner.length() > 0.0;
    let leave_out = is_box && (high - low).length() > FAR_LARGER * inner.length();
    Some(if leave_out { (inner_low, inner_high) } else { (low, high) })
}
