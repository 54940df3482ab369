//! Why a file could not be loaded.

use std::error::Error;
use std::fmt;
use std::io;

/// Why an OBJ file could not be loaded. Every message names the file, the line where there is one, and the remedy.
#[derive(Debug)]
#[non_exhaustive]
pub enum LoadError {
    /// The file cannot be opened or read, or is a directory.
    Read {
        /// The file.
        file: String,
        /// What the system said.
        source: io::Error,
    },
    /// The file is binary, or holds neither vertices nor faces.
    NotObj {
        /// The file.
        file: String,
        /// What it looks like instead.
        looks_like: &'static str,
    },
    /// The file has no face, so there is nothing to trace.
    NoTriangles {
        /// The file.
        file: String,
        /// Number of vertices.
        vertices: u64,
    },
    /// A `v` statement with fewer than three coordinates.
    Vertex {
        /// The file.
        file: String,
        /// Line of the statement, from 1.
        line: u64,
        /// Number of coordinates found.
        found: usize,
    },
    /// Something else where a number belongs.
    Number {
        /// The file.
        file: String,
        /// Line of the statement, from 1.
        line: u64,
        /// What stands there, shortened.
        text: String,
    },
    /// An `f` statement with fewer than three corners.
    Face {
        /// The file.
        file: String,
        /// Line of the statement, from 1.
        line: u64,
        /// Number of corners found.
        corners: usize,
    },
    /// A face refers to a vertex that does not exist.
    Index {
        /// The file.
        file: String,
        /// Line of the statement, from 1.
        line: u64,
        /// The index as it stands in the file, shortened.
        index: String,
        /// Number of vertices it could refer to: all of the file, or for a negative index those above its line.
        vertices: u64,
    },
    /// Vertices are NaN, infinite or beyond single precision.
    NotFinite {
        /// The file.
        file: String,
        /// Line of the first such vertex, from 1.
        line: u64,
        /// Number of such vertices.
        count: u64,
    },
    /// There is more of something than ids can number.
    TooLarge {
        /// The file.
        file: String,
        /// Triangles or vertices.
        what: &'static str,
        /// How many are accepted.
        limit: u32,
    },
    /// The parser refused a text that passed every check: a defect of this loader.
    Parser {
        /// The file.
        file: String,
        /// What the parser said.
        message: String,
    },
}

impl fmt::Display for LoadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Read { file, .. } if file.is_empty() => write!(f, "no file name was given: name an OBJ file"),
            Self::Read { file, source } => match source.kind() {
                io::ErrorKind::NotFound => write!(f, "{file}: no such file: check the path"),
                io::ErrorKind::IsADirectory => write!(f, "{file}: is a directory: name an OBJ file in it"),
                _ => write!(f, "{file}: cannot be read ({source}): check the file and its permissions"),
            },
            Self::NotObj { file, looks_like } => {
                write!(f, "{file}: not an OBJ file, {looks_like}: export the model as Wavefront OBJ text")
            }
            Self::NoTriangles { file, vertices } => {
                write!(f, "{file}: no faces ({vertices} vertices): export the model with its surfaces, as polygons")
            }
            Self::Vertex { file, line, found } => {
                write!(f, "{file}:{line}: a vertex with {found} coordinates: write 'v x y z'")
            }
            Self::Number { file, line, text } => write!(f, "{file}:{line}: '{text}' is not a number: correct the line"),
            Self::Face { file, line, corners } => {
                write!(f, "{file}:{line}: a face with {corners} corners: a face needs 3 or more; correct or remove it")
            }
            Self::Index { file, line, index, vertices } => write!(
                f,
                "{file}:{line}: index {index} does not lead to one of the {vertices} vertices: indices count from 1, \
                 or from -1 backwards; correct the line or export again"
            ),
            Self::NotFinite { file, line, count } => write!(
                f,
                "{file}:{line}: a coordinate is not a finite single-precision number ({count} such vertices in all): \
                 repair the file, or load it without the triangles that use them"
            ),
            Self::TooLarge { file, what, limit } => {
                write!(f, "{file}: more than {limit} {what}: split the model or reduce it")
            }
            Self::Parser { file, message } => {
                write!(f, "{file}: the OBJ parser gave up ({message}): please report this file")
            }
        }
    }
}

impl Error for LoadError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::Read { source, .. } => Some(source),
            _ => None,
        }
    }
}
