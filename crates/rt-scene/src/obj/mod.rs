//! Loading Wavefront OBJ files.
//!
//! What is read of the format, and what becomes of the rest, is listed in `docs/obj.md`. In short: vertices, faces and
//! diffuse colours. All groups and objects of a file become one model, in file order, and are its geometries; vertices
//! that no face uses are not kept.
//!
//! **Ids.** A face of `n` corners has `n − 2` triangles, whose primitive ids follow each other, and those of the next
//! face follow on them: in a file of triangles the id is the number of the `f` statement, counted from 0, and in a file
//! of quadrilaterals its half. That holds whatever shape the polygons have, and with faces that are left out. Where the
//! fan from a polygon's first corner covers it, its triangles are that fan, in order (`polygon`).
//!
//! **Digits.** Coordinates are read in double precision. Where single precision would move vertices by more than a
//! millionth of the model's extent, an offset is subtracted first (`place`): [`Model::offset`].
//!
//! A file passes through `text` (its encoding), `statement` (its lines), `geometry` (vertices and faces), `material`
//! and `place` (single precision).

mod error;
mod geometry;
mod material;
mod number;
mod place;
pub(crate) mod polygon;
mod statement;
mod text;

pub use crate::progress::{LoadProgress, LoadStage, Watch, unwatched};
pub use error::{Defect, Fault, LoadError};

use crate::Model;
use crate::memory::spare;
use crate::reading::read_file;
#[cfg(feature = "formats")]
pub(crate) use geometry::MOST_VERTICES;
use geometry::{Geometry, Noticed};
use glam::DVec3;
use place::Placed;
use std::borrow::Cow;
use std::cell::RefCell;
use std::io;
use std::path::{Path, PathBuf};

/// What a loader accepts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadOptions {
    /// Leave out faces with a [`Defect`], or that use a vertex with one. Their triangles stay in [`Model::indices`]
    /// with a vertex that is not finite, so that every other triangle keeps its number; the builder of the tree leaves
    /// them out. Otherwise such a file is an error.
    pub drop_invalid: bool,
    /// Most triangles accepted. Ids have 32 bits and `u32::MAX` means "none", hence the default of `u32::MAX − 1`.
    pub max_triangles: u32,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self { drop_invalid: false, max_triangles: u32::MAX - 1 }
    }
}

/// A model and what was noticed while loading it.
#[derive(Clone, Debug, Default)]
pub struct Loaded {
    /// The triangles. It has no view; see [`crate::view::auto_view`].
    pub model: Model,
    /// Number of points (`p` statements) that were skipped.
    pub skipped_points: u64,
    /// Number of lines (`l` statements) that were skipped.
    pub skipped_lines: u64,
    /// Number of faces that are left out: above 0 only with [`LoadOptions::drop_invalid`].
    pub left_out: u64,
    /// How far single precision would have moved vertices of the model, in its units, but for [`Model::offset`]; 0
    /// where that is 0.
    pub moved: f64,
    /// What else the user should know, one sentence each, which begins with the name of a file.
    pub warnings: Vec<String>,
    /// What was done with the file's numbers, likewise.
    pub notes: Vec<String>,
    /// The material files that were read: of [`load_obj`] alone.
    pub libraries: Vec<PathBuf>,
}

/// Loads the OBJ file at `path`, with the material files that it names where they can be read.
///
/// Needs about twice the file's size in memory while it runs. `watch` is called every megabyte or 65,536 vertices.
///
/// # Errors
/// When the file cannot be read, is not an OBJ file, or has defects; when the system refuses memory; when `watch`
/// breaks.
pub fn load_obj(path: &Path, options: &LoadOptions, watch: &mut Watch<'_>) -> Result<Loaded, LoadError> {
    let name = path.display().to_string();
    let folder = path.parent().unwrap_or(Path::new(""));
    let bytes = read_file(path, watch).map_err(|fault| fault.of(&name))?;
    load_obj_bytes(bytes, &name, folder, options, watch).map_err(|fault| fault.of(&name))
}

/// Loads the contents of an OBJ file in `folder`.
pub(crate) fn load_obj_bytes(
    bytes: Vec<u8>,
    name: &str,
    folder: &Path,
    options: &LoadOptions,
    watch: &mut Watch<'_>,
) -> Result<Loaded, Fault> {
    let libraries = RefCell::new(Vec::new());
    let read = |file: &str| {
        let (path, bytes) = material::read_beside(folder, file)?;
        libraries.borrow_mut().push(path);
        Ok(bytes)
    };
    let loaded = load(bytes.into(), name, options, &read, watch)?;
    Ok(Loaded { libraries: libraries.into_inner(), ..loaded })
}

/// Loads an OBJ file that is already in memory.
///
/// `name` stands for the file in messages and in [`Model::source`]; `materials` returns the bytes of a material file
/// that the text names.
///
/// # Errors
/// As [`load_obj`].
pub fn load_obj_from(
    bytes: &[u8],
    name: &str,
    options: &LoadOptions,
    materials: &dyn Fn(&str) -> io::Result<Vec<u8>>,
    watch: &mut Watch<'_>,
) -> Result<Loaded, LoadError> {
    load(bytes.into(), name, options, materials, watch).map_err(|fault| fault.of(name))
}

fn load(
    bytes: Cow<'_, [u8]>,
    name: &str,
    options: &LoadOptions,
    materials: &dyn Fn(&str) -> io::Result<Vec<u8>>,
    watch: &mut Watch<'_>,
) -> Result<Loaded, Fault> {
    let text = text::decode(bytes)?;
    let geometry = geometry::parse(&text, options, watch)?;
    if geometry.triangles.is_empty() {
        return Err(match geometry.vertices.len() {
            0 if geometry.left_out.faces == 0 => Fault::NotObj(text::looks_like(&text)),
            vertices => Fault::NoTriangles { vertices: vertices as u64 },
        });
    }
    let colours = material::colour(&geometry.uses, name, geometry.triangles.len(), materials)?;
    let geometries = geometry.parts();
    // The longest list of all is not needed any more.
    let mut geometry = geometry.without_text();
    drop(text);
    let placed = place::place(&mut geometry, options, watch)?;
    spare()?;
    let mut warnings = warnings(name, &geometry, &placed);
    warnings.extend(colours.warnings);
    let notes = offset_note(name, placed.offset, placed.moved).into_iter().collect();
    Ok(Loaded {
        skipped_points: geometry.points,
        skipped_lines: geometry.lines,
        left_out: geometry.left_out.faces + placed.invalid,
        moved: placed.moved,
        warnings,
        notes,
        libraries: Vec::new(),
        model: Model {
            source: name.to_owned(),
            positions: placed.positions,
            indices: placed.triangles,
            palette: colours.palette,
            colour_of: colours.colour_of,
            offset: placed.offset,
            geometries,
            ..Model::default()
        },
    })
}

/// That an offset is subtracted, and why.
pub(crate) fn offset_note(name: &str, DVec3 { x, y, z }: DVec3, moved: f64) -> Option<String> {
    (moved > 0.0).then(|| {
        format!(
            "{name}: coordinates are kept relative to ({x}, {y}, {z}), since single precision would move vertices by up to \
             {}; cameras and rays are given in the coordinates of the file",
            two_digits(moved)
        )
    })
}

/// A number without the digits that nobody needs.
fn two_digits(number: f64) -> f64 {
    format!("{number:.1e}").parse().unwrap_or(number)
}

/// What the user should know of the shapes.
fn warnings(name: &str, geometry: &Geometry<'_>, placed: &Placed) -> Vec<String> {
    let mut warnings = Vec::new();
    let left_out = geometry.left_out.faces + placed.invalid;
    if left_out > 0 {
        let (line, defect) = geometry.left_out.example.clone().unwrap_or_else(|| {
            let line = geometry.doubtful.first().map_or(0, |doubtful| doubtful.line);
            (line, Defect::NotFinite { vertices: 1 })
        });
        warnings.push(format!("{name}:{line}: {defect}: {} left out", faces(left_out)));
    }
    let mut polygons = |noticed: Noticed, what: &str| {
        if noticed.count > 0 {
            warnings.push(format!("{name}:{}: {} of this file {what}", noticed.line, faces(noticed.count)));
        }
    };
    polygons(geometry.crossing, "cross themselves, the first one here: what their triangles cover is arbitrary");
    polygons(geometry.warped, "are not plane, the first one here: other triangles would fit them as well");
    let (count, by) = placed.far;
    if count > 0 {
        warnings.push(format!(
            "{name}: {count} vertices are so far from the rest that single precision moves them by up to {}: put \
             what is there into a file of its own",
            two_digits(by)
        ));
    }
    warnings
}

fn faces(count: u64) -> String {
    if count == 1 { "1 face".to_owned() } else { format!("{count} faces") }
}
