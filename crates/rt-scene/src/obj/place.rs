//! From a file's coordinates to single precision: vertices that no face uses are left out, and where single precision
//! would move the others noticeably, an offset is subtracted first.

use super::geometry::{Geometry, NOWHERE};
use super::{Defect, Fault, LoadOptions};
use crate::memory;
use crate::offset::{MOVED_AT_MOST, Offset};
use crate::progress::{LoadStage, Meter, Watch};
use glam::{DVec3, Vec3};

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
