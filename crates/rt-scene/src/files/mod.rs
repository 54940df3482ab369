//! Loading files of triangles, whatever their format: Wavefront OBJ, PLY, STL and glTF 2.0, also compressed by gzip or
//! xz.
//!
//! The content decides on the format, not the name. OBJ is read by [`crate::obj`]; the others become a `Soup`, of which
//! a [`Model`](crate::Model) is made as of an OBJ file: coordinates in double precision, less an offset where single
//! precision would move vertices. What is read of each format is listed in `docs/files.md`.

mod compressed;
mod gltf;
mod ply;
mod soup;
mod stl;

use crate::obj::{Fault, LoadError, LoadOptions, Loaded, Watch, load_obj_bytes};
use crate::reading::read_file;
use std::path::Path;

/// Loads the file at `path`, with the files that it names where they can be read.
///
/// Needs about twice the size of the unpacked file in memory while it runs. `watch` is called every megabyte or 65,536
/// vertices.
///
/// # Errors
/// When the file cannot be read, has none of the formats, or has defects; when the system refuses memory; when `watch`
/// breaks.
pub fn load_file(path: &Path, options: &LoadOptions, watch: &mut Watch<'_>) -> Result<Loaded, LoadError> {
    let name = path.display().to_string();
    let bytes = read_file(path, watch).map_err(|fault| fault.of(&name))?;
    load(bytes, &name, path.parent().unwrap_or(Path::new("")), options, watch).map_err(|fault| fault.of(&name))
}

/// Loads a file that is already in memory and stands alone: files that it names are not read.
///
/// # Errors
/// As [`load_file`].
pub fn load_bytes(
    bytes: Vec<u8>,
    name: &str,
    options: &LoadOptions,
    watch: &mut Watch<'_>,
) -> Result<Loaded, LoadError> {
    // No file lies in a folder whose name cannot be.
    load(bytes, name, Path::new("\0"), options, watch).map_err(|fault| fault.of(name))
}

fn load(
    bytes: Vec<u8>,
    name: &str,
    folder: &Path,
    options: &LoadOptions,
    watch: &mut Watch<'_>,
) -> Result<Loaded, Fault> {
    let bytes = compressed::unpack(bytes, watch)?;
    let soup = match Format::of(&bytes) {
        Format::Ply => ply::parse(&bytes, options, watch)?,
        Format::Stl => stl::parse(bytes, options, watch)?,
        Format::Gltf => gltf::parse(&bytes, name, folder, options, watch)?,
        Format::Obj => return load_obj_bytes(bytes, name, folder, options, watch),
    };
    soup.into_model(name, options, watch)
}

/// What a file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Obj,
    Ply,
    Stl,
    Gltf,
}

impl Format {
    /// The format of these bytes; OBJ where they look like none of the others.
    fn of(bytes: &[u8]) -> Self {
        let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        match text.trim_ascii_start() {
            _ if stl::is_binary(bytes) => Self::Stl,
            [b'p', b'l', b'y', b'\n' | b'\r' | b' ', ..] => Self::Ply,
            [b'g', b'l', b'T', b'F', ..] => Self::Gltf,
            [b'{', ..] if memchr::memmem::find(bytes, b"\"asset\"").is_some() => Self::Gltf,
            text if stl::is_text(text) => Self::Stl,
            _ => Self::Obj,
        }
    }
}

/// A fault of a file that is of a format, but not as that wants it.
fn malformed(format: &'static str, reason: impl Into<String>) -> Fault {
    Fault::Malformed { format, reason: reason.into() }
}
