//! Where a model's substance is: its bounds, or those of all but a few outliers.

use crate::{Model, memory};
use glam::DVec3;
use rt_core::Aabb;

/// Share of the triangles that may be outliers on each side of each axis: few large triangles (a ground, a sky) stay
/// below it, while no part worth looking at does.
pub(crate) const OUTLIERS: f64 = 0.01;

/// How many times longer than the frame without outliers the whole model must be for outliers to be left out. Below it
/// the whole model still fills a good part of a picture.
const FAR_LARGER: f64 = 4.0;

/// Triangles that are looked at for where most of a model is: more are not needed for percentiles, and would need much
/// memory.
const SAMPLE: usize = 1 << 20;

/// Smallest and largest corner of all finite triangles but a floor's, or of the triangles between the outliers where
/// these make the model many times larger. `None` without finite triangles. Takes linear time.
pub(crate) fn frame(model: &Model) -> Option<(DVec3, DVec3)> {
    let count = u32::try_from(model.own().len()).unwrap_or(u32::MAX);
    let bounds_of = |i| model.triangle(i).filter(|triangle| triangle.is_finite()).map(|triangle| triangle.bounds());
    let whole = (0..count).filter_map(bounds_of).fold(Aabb::EMPTY, |all, b| all.union(b));
    if whole.is_empty() {
        return None;
    }
    let (low, high) = (whole.min.as_dvec3(), whole.max.as_dvec3());
    let stride = (count as usize).div_ceil(SAMPLE);
    let sample = || (0..count).step_by(stride).filter_map(bounds_of);
    // Percentiles of both ends of the triangles, not of their centroids: a huge triangle may be centred on the subject.
    let (mut inner_low, mut inner_high) = (low, high);
    let Ok(mut ends) = memory::list(SAMPLE.min(count as usize)) else { return Some((low, high)) };
    for axis in 0..3 {
        ends.clear();
        ends.extend(sample().map(|b| b.min[axis]));
        let outliers = (OUTLIERS * ends.len() as f64) as usize;
        let Some(last) = ends.len().checked_sub(1 + outliers) else { return Some((low, high)) };
        inner_low[axis] = f64::from(*ends.select_nth_unstable_by(outliers, f32::total_cmp).1);
        ends.clear();
        ends.extend(sample().map(|b| b.max[axis]));
        inner_high[axis] = f64::from(*ends.select_nth_unstable_by(last, f32::total_cmp).1);
    }
    let inner = inner_high - inner_low;
    let is_box = inner.min_element() >= 0.0 && inner.length() > 0.0;
    let leave_out = is_box && (high - low).length() > FAR_LARGER * inner.length();
    Some(if leave_out { (inner_low, inner_high) } else { (low, high) })
}
