//! Triangles as a file gives them, before they become a model.

use crate::memory::{grow, push, spare};
use crate::model::{Geometry, UNCOLOURED};
use crate::obj::polygon::{self, Shape};
use crate::obj::{Defect, Fault, LoadOptions, LoadStage, Loaded, MOST_VERTICES, Watch, offset_note};
use crate::offset::Offset;
use crate::progress::Meter;
use crate::{Model, memory};
use glam::{DVec3, Vec3};
use std::path::PathBuf;

/// What a file says.
#[derive(Debug, Default)]
pub(super) struct Soup {
    pub(super) vertices: Vec<DVec3>,
    /// Vertices of each triangle, counted from 0; those beyond the last are found later.
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) palette: Vec<Vec3>,
    /// For each triangle, or empty.
    pub(super) colour_of: Vec<u16>,
    pub(super) warnings: Vec<String>,
    pub(super) notes: Vec<String>,
    /// Parts that have names; none where the file is one.
    pub(super) geometries: Vec<Geometry>,
    /// Other files that were read.
    pub(super) files: Vec<PathBuf>,
    /// Points and lines that were skipped.
    pub(super) points: u64,
    pub(super) lines: u64,
    /// Polygons that cross themselves, or do not lie in a plane.
    pub(super) crossing: u64,
    pub(super) warped: u64,
}

impl Soup {
    pub(super) fn vertex(&mut self, vertex: DVec3) -> Result<u32, Fault> {
        let number = u32::try_from(self.vertices.len()).unwrap_or(u32::MAX);
        if number >= MOST_VERTICES {
            return Err(Fault::TooMany { what: "vertices", limit: MOST_VERTICES });
        }
        push(&mut self.vertices, vertex)?;
        Ok(number)
    }

    pub(super) fn triangle(&mut self, triangle: [u32; 3], options: &LoadOptions) -> Result<(), Fault> {
        if self.triangles.len() >= options.max_triangles as usize {
            return Err(Fault::TooMany { what: "triangles", limit: options.max_triangles });
        }
        Ok(push(&mut self.triangles, triangle)?)
    }

    /// Adds a polygon of three corners or more as triangles, whose ids follow each other, as of OBJ files.
    pub(super) fn polygon(&mut self, corners: &[u32], options: &LoadOptions) -> Result<(), Fault> {
        let first = self.triangles.len();
        for triangle in polygon::fan(corners) {
            self.triangle(triangle, options)?;
        }
        let are_there = corners.iter().all(|&corner| (corner as usize) < self.vertices.len());
        if corners.len() > 3 && are_there {
            match polygon::cover(corners, &mut self.triangles[first..], &self.vertices) {
                Shape::Plain | Shape::NotFinite => {}
                Shape::Crossing => self.crossing += 1,
                Shape::Warped => self.warped += 1,
            }
        }
        Ok(())
    }

    /// Places the vertices in single precision. Triangles with a vertex that is not there or not finite are an error,
    /// or are left out with their numbers kept.
    pub(super) fn into_model(self, name: &str, options: &LoadOptions, watch: &mut Watch<'_>) -> Result<Loaded, Fault> {
        let Self {
            vertices, mut triangles, mut palette, colour_of, mut warnings, mut notes, files, geometries, ..
        } = self;
        if triangles.is_empty() {
            return Err(Fault::NoTriangles { vertices: vertices.len() as u64 });
        }
        let mut meter = Meter::begin(LoadStage::Placing, (vertices.len() + triangles.len()) as u64, watch)?;
        let Offset { offset, moved, .. } = Offset::of(&vertices)?;
        let mut positions = memory::list(vertices.len() + 1)?;
        for (done, &vertex) in (0..).zip(&vertices) {
            positions.push((vertex - offset).as_vec3());
            meter.at(done)?;
        }
        let nowhere = positions.len() as u32;
        let mut left_out = 0;
        for (number, triangle) in (0..).zip(&mut triangles) {
            let beyond = triangle.iter().find(|&&corner| corner >= nowhere);
            let defect = match beyond {
                Some(&index) => Some(Defect::Vertex { triangle: number, index, vertices: vertices.len() as u64 }),
                None if triangle.iter().all(|&corner| positions[corner as usize].is_finite()) => None,
                None => Some(Defect::NotFiniteTriangle { triangle: number }),
            };
            if let Some(defect) = defect {
                if !options.drop_invalid {
                    return Err(Fault::Geometry(defect));
                }
                if left_out == 0 {
                    warnings.push(format!("{name}: {defect}, and is left out"));
                }
                left_out += 1;
                *triangle = [nowhere; 3];
            }
            meter.at(u64::from(nowhere) + number)?;
        }
        spare()?;
        if left_out > 0 {
            positions.push(Vec3::NAN);
            warnings.push(format!("{name}: {left_out} triangles are left out in all"));
        }
        for (count, what) in [
            (self.crossing, "cross themselves: what their triangles cover is arbitrary"),
            (self.warped, "are not plane: other triangles would fit them as well"),
        ] {
            if count > 0 {
                warnings.push(format!("{name}: {count} polygons {what}"));
            }
        }
        notes.extend(offset_note(name, offset, moved));
        if palette.is_empty() {
            grow(&mut palette, 1)?;
            palette.push(UNCOLOURED);
        }
        Ok(Loaded {
            skipped_points: self.points,
            skipped_lines: self.lines,
            left_out,
            moved,
            warnings,
            notes,
            libraries: files,
            model: Model {
                source: name.to_owned(),
                positions,
                indices: triangles,
                palette,
                colour_of,
                offset,
                geometries,
                ..Model::default()
            },
        })
    }
}
