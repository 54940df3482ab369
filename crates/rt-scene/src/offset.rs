//! Where single precision would move vertices noticeably: what is subtracted from their coordinates first.

use crate::frame::OUTLIERS;
use crate::memory::{self, NoMemory};
use glam::DVec3;

/// Share of a model's extent by which rounding to single precision may move a vertex: 2⁻²⁰.
///
/// In a model of ten million triangles an edge is some three-thousandth of the extent, and is moved by less than a
/// three-hundredth of itself. Coordinates reach 16 times the extent before any is moved so far; in the middle of the
/// coordinates' range, where most models are, it is 2⁻²⁵ at most.
pub(crate) const MOVED_AT_MOST: f64 = 1.0 / 1_048_576.0;

/// Vertices that are looked at for where the model is: enough for percentiles of it.
const SAMPLE: usize = 1 << 16;

/// Largest offset: what is within a quarter of single precision's range stays within half of it.
const LARGEST_OFFSET: f64 = f32::MAX as f64 / 4.0;

/// What is subtracted from coordinates, and why.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Offset {
    /// 0 on each axis where nothing is gained.
    pub(crate) offset: DVec3,
    /// How far single precision would move a vertex without it, outliers left out.
    pub(crate) moved: f64,
    /// Longest side of the model, outliers left out.
    pub(crate) extent: f64,
}

impl Offset {
    /// The offset for vertices in a file's coordinates.
    ///
    /// It is a multiple of the largest power of two within the extent. So it has a finite number of decimal digits, and
    /// the differences from it are exact: in double precision those of the file's coordinates, and in single precision
    /// those of single-precision numbers (of rays, say) up to 2²³ extents away and no nearer to 0 than to the offset.
    pub(crate) fn of(vertices: &[DVec3]) -> Result<Self, NoMemory> {
        let mut sample = memory::list(SAMPLE.min(vertices.len()))?;
        let mut range = |axis: usize| {
            sample.clear();
            let stride = vertices.len().div_ceil(SAMPLE).max(1);
            sample.extend(vertices.iter().step_by(stride).map(|vertex| vertex[axis]).filter(|x| x.is_finite()));
            let outliers = (OUTLIERS * sample.len() as f64) as usize;
            let last = sample.len().checked_sub(1 + outliers)?;
            let low = *sample.select_nth_unstable_by(outliers, f64::total_cmp).1;
            let high = *sample.select_nth_unstable_by(last, f64::total_cmp).1;
            Some((low, high))
        };
        let (Some(x), Some(y), Some(z)) = (range(0), range(1), range(2)) else { return Ok(Self::default()) };
        let (low, high) = (DVec3::new(x.0, y.0, z.0), DVec3::new(x.1, y.1, z.1));
        let extent = (high - low).max_element();
        if !(extent > 0.0 && extent.is_finite()) {
            return Ok(Self::default());
        }
        let mut all = Self { extent, ..Self::default() };
        let unit = libm::ldexp(1.0, libm::frexp(extent).1 - 1);
        for axis in 0..3 {
            let inner = vertices.iter().map(|vertex| vertex[axis]).filter(|x| (low[axis]..=high[axis]).contains(x));
            let moved = inner.map(|x| (f64::from(x as f32) - x).abs()).fold(0.0, f64::max);
            let middle = low[axis] + (high[axis] - low[axis]) / 2.0;
            // Where the model is near 0 nothing is gained, and what is beyond single precision anyway is refused.
            if moved > MOVED_AT_MOST * extent && (extent..LARGEST_OFFSET).contains(&middle.abs()) {
                all.offset[axis] = (middle / unit).round() * unit;
                all.moved = moved.max(all.moved);
            }
        }
        Ok(all)
    }
}
