//! Loading Wavefront OBJ files.
//!
//! The parser is the crate `tobj`. Between the file and the parser stands a pre-pass (`clean`), because `tobj` 4.0.5
//! has no line numbers in its errors, refuses Latin-1 comments and `\` continuations, makes triangles of points and
//! lines, and panics on some broken input. The pre-pass hands it only what this project uses: positions, faces without
//! texture and normal indices, and materials.
//!
//! Polygons become triangle fans, and all groups and objects of a file become one model, in file order. A triangle's
//! primitive id is its position in that order. Vertices that no face uses are not kept, and a vertex shared by faces
//! of different materials is kept once for each.

mod clean;
mod diagnose;
mod error;
mod material;
mod progress;
mod statement;

pub use error::LoadError;
pub use progress::{LoadProgress, LoadStage};

use crate::Model;
use glam::Vec3;
use material::Materials;
use progress::Counted;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// What a loader accepts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadOptions {
    /// Accept vertices that are NaN, infinite or beyond single precision. Their triangles stay in [`Model::indices`],
    /// so that every other triangle keeps its number; the builder of the tree leaves them out. Otherwise such a file
    /// is an error.
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
    /// Number of `v` statements that are not finite in single precision; above 0 only with
    /// [`LoadOptions::drop_invalid`] and when a face uses one of them.
    pub invalid_vertices: u64,
    /// Number of triangles that use such a vertex.
    pub invalid_triangles: u64,
    /// What else the user should know, one sentence each: materials that could not be read.
    pub warnings: Vec<String>,
}

/// Loads the OBJ file at `path`, with the material files that it names where they can be read.
///
/// Needs about nine times the file's size in memory while it runs, the parser's lists included. `progress` is called every few megabytes.
///
/// # Errors
/// When the file cannot be read, is not an OBJ file, or has defects; the error names the file and the line.
pub fn load_obj(
    path: &Path,
    options: &LoadOptions,
    progress: &mut dyn FnMut(LoadProgress),
) -> Result<Loaded, LoadError> {
    let name = path.display().to_string();
    let bytes = read_file(path, progress).map_err(|source| LoadError::Read { file: name.clone(), source })?;
    let folder = path.parent().unwrap_or(Path::new(""));
    load_obj_from(&bytes, &name, options, &|file| material::read_beside(folder, file), progress)
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
    progress: &mut dyn FnMut(LoadProgress),
) -> Result<Loaded, LoadError> {
    let clean = clean::clean(bytes, name, options, progress)?;
    let library = Materials::new(materials);
    // Only the fan triangulation is wanted of the parser; points and lines no longer occur in the clean text.
    let parser = tobj::LoadOptions { triangulate: true, ..tobj::LoadOptions::default() };
    let (meshes, colours) = {
        let text = clean.vertices.as_slice().chain(clean.faces.as_slice());
        let mut reader = Counted::new(text, clean.bytes(), progress);
        tobj::load_obj_buf(&mut reader, &parser, |file| library.load(file))
            .map_err(|error| diagnose::parser_error(bytes, name, error))?
    };
    let mut loaded = join(name, &meshes)?;
    loaded.model.palette = library.palette(&colours.unwrap_or_default());
    loaded.skipped_points = clean.points;
    loaded.skipped_lines = clean.lines;
    loaded.warnings = library.into_warnings();
    check_vertices(bytes, name, options, &mut loaded)?;
    Ok(loaded)
}

/// Puts the parser's meshes, one for each run of faces with one material, behind each other.
fn join(name: &str, meshes: &[tobj::Model]) -> Result<Loaded, LoadError> {
    let mut model = Model { source: name.to_owned(), ..Model::default() };
    let coloured = meshes.iter().any(|part| part.mesh.material_id.is_some());
    for mesh in meshes.iter().map(|part| &part.mesh) {
        let too_large = || LoadError::TooLarge { file: name.to_owned(), what: "vertices", limit: u32::MAX };
        let base = u32::try_from(model.positions.len()).map_err(|_| too_large())?;
        base.checked_add(u32::try_from(mesh.positions.len() / 3).map_err(|_| too_large())?).ok_or_else(too_large)?;
        model.positions.extend(mesh.positions.chunks_exact(3).map(Vec3::from_slice));
        model.indices.extend(mesh.indices.chunks_exact(3).map(|i| [base + i[0], base + i[1], base + i[2]]));
        if coloured {
            model.colour_of.resize(model.indices.len(), material::colour_index(mesh.material_id));
        }
    }
    Ok(Loaded { model, ..Loaded::default() })
}

/// Finds vertices that are not finite; only then is the text looked at again.
fn check_vertices(bytes: &[u8], name: &str, options: &LoadOptions, loaded: &mut Loaded) -> Result<(), LoadError> {
    if loaded.model.positions.iter().all(|p| p.is_finite()) {
        return Ok(());
    }
    let (line, count) = diagnose::invalid_vertices(bytes);
    if !options.drop_invalid {
        return Err(LoadError::NotFinite { file: name.to_owned(), line, count });
    }
    let positions = &loaded.model.positions;
    let is_invalid = |triangle: &&[u32; 3]| triangle.iter().any(|&i| !positions[i as usize].is_finite());
    loaded.invalid_vertices = count;
    loaded.invalid_triangles = loaded.model.indices.iter().filter(is_invalid).count() as u64;
    Ok(())
}

/// Reads a whole file and reports how far it got.
fn read_file(path: &Path, progress: &mut dyn FnMut(LoadProgress)) -> io::Result<Vec<u8>> {
    let mut file = File::open(path)?;
    let about = file.metadata()?;
    if about.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    let total_bytes = about.len();
    let mut bytes = Vec::new();
    // A refused allocation must be an error here, not an abort; files without a size (pipes) just grow the buffer.
    bytes.try_reserve_exact(usize::try_from(total_bytes).unwrap_or(usize::MAX)).map_err(io::Error::from)?;
    while file.by_ref().take(progress::STEP).read_to_end(&mut bytes)? > 0 {
        progress(LoadProgress { stage: LoadStage::Reading, done_bytes: bytes.len() as u64, total_bytes });
    }
    Ok(bytes)
}
