//! From a file's coordinates to single precision: vertices that no face uses are left out, and where single precision
//! would move the others noticeably, an offset is subtracted first.

use super::geometry::{Geometry, NOWHERE};
use super::{Defect, Fault, LoadOptions};
use crate::frame::OUTLIERS;
use crate::memory::{self, NoMemory};
use crate::progress::{LoadStage, Meter, Watch};
use glam::{DVec3, Vec3};

/// Share of a model's extent by which rounding to single precision may move a vertex: 2⁻²⁰.
///
/// In a model of ten million triangles an edge is some three-thousandth of the extent, and is moved by less than a
/// three-hundredth of itself. Coordinates reach 16 times the extent before any is moved so far; in the middle of the
/// coordinates' range, where most models are, it is 2⁻²⁵ at most.
const MOVED_AT_MOST: f64 = 1.0 / 1_048_576.0;

/// Vertices that are looked at for where the model is: enough for percentiles of it.
const SAMPLE: usize = 1 << 16;

/// Largest offset: what is within a quarter of single precision's range stays within half of it.
const LARGEST_OFFSET: f64 = f32::MAX as f64 / 4.0;

/// Vertices in single precision.
#[derive(Debug, Default)]
pub(super) struct Placed {
    pub(super) positions: Vec<Vec3>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// What was subtracted from the file's coordinates.
    pub(super) offset: DVec3,
    /// How far single precision would have moved vertices without it.
    pub(super) moved: f64,
    /// Vertices that the offset puts so far away that they are moved noticeably, and how far at most.
    pub(super) far: (u64, f64),
    /// Triangles with a vertex that is not finite, other than those that were left out before.
    pub(super) invalid: u64,
}

/// Places the vertices of a text.
pub(super) fn place(
    geometry: &mut Geometry<'_>,
    options: &LoadOptions,
    watch: &mut Watch<'_>,
) -> Result<Placed, Fault> {
    let mut triangles = std::mem::take(&mut geometry.triangles);
    let mut vertices = std::mem::take(&mut geometry.vertices);
    let work = 2 * triangles.len() + vertices.len();
    let mut meter = Meter::begin(LoadStage::Placing, work as u64, watch)?;

    // The vertices' new numbers.
    let mut numbers = memory::list(vertices.len())?;
    numbers.resize(vertices.len(), NOWHERE);
    for (done, triangle) in (0..).zip(&triangles) {
        for &corner in triangle.iter().filter(|&&corner| corner != NOWHERE) {
            numbers[corner as usize] = 0;
        }
        meter.at(done)?;
    }
    let mut used = 0;
    for old in 0..vertices.len() {
        if numbers[old] != NOWHERE {
            numbers[old] = used;
            vertices[used as usize] = vertices[old];
            used += 1;
        }
    }
    vertices.truncate(used as usize);
    geometry.doubtful.retain_mut(|doubtful| {
        doubtful.vertex = numbers[doubtful.vertex as usize];
        doubtful.vertex != NOWHERE
    });
    // Triangles that were left out get a vertex that is not finite, the last.
    for (done, triangle) in (triangles.len() as u64..).zip(&mut triangles) {
        *triangle = triangle.map(|corner| if corner == NOWHERE { used } else { numbers[corner as usize] });
        meter.at(done)?;
    }
    drop(numbers);

    let Offset { offset, moved, extent } = Offset::of(&vertices)?;
    let mut positions = memory::list(vertices.len() + 1)?;
    let mut far = (0, 0.0);
    for (done, &vertex) in (2 * triangles.len() as u64..).zip(&vertices) {
        let position = (vertex - offset).as_vec3();
        if offset != DVec3::ZERO {
            let by = rounding(vertex - offset).max_element();
            if by > MOVED_AT_MOST * extent && by > rounding(vertex).max_element() {
                far = (far.0 + 1, by.max(far.1));
            }
        }
        positions.push(position);
        meter.at(done)?;
    }
    let invalid = invalid_triangles(geometry, &positions, &triangles, options)?;
    if geometry.left_out.faces > 0 {
        positions.push(Vec3::NAN);
    }
    Ok(Placed { positions, triangles, offset, moved, far, invalid })
}

/// How far single precision moves a vertex.
fn rounding(vertex: DVec3) -> DVec3 {
    (vertex.as_vec3().as_dvec3() - vertex).abs()
}

/// Counts the triangles with a vertex that is not finite, or refuses the file for the first such vertex.
fn invalid_triangles(
    geometry: &Geometry<'_>,
    positions: &[Vec3],
    triangles: &[[u32; 3]],
    options: &LoadOptions,
) -> Result<u64, Fault> {
    let is_invalid = |vertex: u32| positions.get(vertex as usize).is_some_and(|position| !position.is_finite());
    let mut invalid = geometry.doubtful.iter().filter(|doubtful| is_invalid(doubtful.vertex));
    let Some(first) = invalid.next() else { return Ok(0) };
    let defect = Defect::NotFinite { vertices: 1 + invalid.count() as u64 };
    if !options.drop_invalid {
        return Err(Fault::Defect { line: first.line, defect });
    }
    Ok(triangles.iter().filter(|triangle| triangle.iter().any(|&vertex| is_invalid(vertex))).count() as u64)
}

/// What is subtracted from coordinates, and why.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Offset {
    /// 0 on each axis where nothing is gained.
    offset: DVec3,
    /// How far single precision would move a vertex without it, outliers left out.
    moved: f64,
    /// Longest side of the model, outliers left out.
    extent: f64,
}

impl Offset {
    /// The offset for vertices in a file's coordinates.
    ///
    /// It is a multiple of the largest power of two within the extent. So it has a finite number of decimal digits, and
    /// the differences from it are exact: in double precision those of the file's coordinates, and in single precision
    /// those of single-precision numbers (of rays, say) up to 2²³ extents away and no nearer to 0 than to the offset.
    fn of(vertices: &[DVec3]) -> Result<Self, NoMemory> {
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
