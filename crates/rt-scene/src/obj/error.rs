//! Why a file could not be loaded.

use crate::memory::NoMemory;
use crate::progress::Stopped;
use std::error::Error;
use std::fmt;
use std::io;

/// Why a file could not be loaded. The message names the file, the line where there is one, and the remedy.
#[derive(Debug)]
pub struct LoadError {
    /// The file.
    pub file: String,
    /// What is wrong with it.
    pub fault: Fault,
}

/// What is wrong with a file.
#[derive(Debug)]
#[non_exhaustive]
pub enum Fault {
    /// It cannot be opened or read, or is a directory.
    Read(io::Error),
    /// It is no OBJ file: what it looks like instead.
    NotObj(&'static str),
    /// It is of a format, but not as that wants it.
    Malformed {
        /// The format.
        format: &'static str,
        /// What is wrong, and where.
        reason: String,
    },
    /// A triangle has no three corners, in a format without lines.
    Geometry(Defect),
    /// It has no face, so there is nothing to trace.
    NoTriangles {
        /// Number of vertices.
        vertices: u64,
    },
    /// A statement means nothing. [`super::LoadOptions::drop_invalid`] leaves out the faces concerned.
    Defect {
        /// Line of the statement, from 1.
        line: u64,
        /// What is wrong with it.
        defect: Defect,
    },
    /// There is more of something than ids can number.
    TooMany {
        /// Triangles or vertices.
        what: &'static str,
        /// How many are accepted.
        limit: u32,
    },
    /// The system refused the memory.
    Memory {
        /// Bytes of the list that could not be made or grown.
        bytes: u64,
    },
    /// The caller's watch said to stop.
    Stopped,
}

/// What is wrong with a statement.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Defect {
    /// A `v` statement with fewer than three coordinates: so many.
    Coordinates(usize),
    /// An `f` statement with fewer than three corners: so many.
    Corners(usize),
    /// Something else where a number belongs.
    Number {
        /// What stands there, shortened.
        text: String,
        /// What that may come from, in brackets; empty where nothing is known.
        hint: &'static str,
    },
    /// A face refers to a vertex that does not exist.
    Index {
        /// The index as it stands in the file, shortened.
        index: String,
        /// Number of vertices that it could refer to: all of the file, or for a negative index those above its line.
        vertices: u64,
    },
    /// A triangle refers to a vertex that does not exist.
    Vertex {
        /// The triangle, from 0.
        triangle: u64,
        /// The vertex, from 0.
        index: u32,
        /// Number of vertices.
        vertices: u64,
    },
    /// A vertex of this triangle, counted from 0, is not a number, infinite, or beyond single precision.
    NotFiniteTriangle {
        /// The triangle.
        triangle: u64,
    },
    /// A face uses a vertex that is not a number, infinite, or beyond single precision.
    NotFinite {
        /// Number of such vertices in the file.
        vertices: u64,
    },
}

impl fmt::Display for LoadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let file = &self.file;
        match &self.fault {
            Fault::Read(_) if file.is_empty() => write!(f, "no file name was given: name a file of triangles"),
            Fault::Read(error) => match error.kind() {
                io::ErrorKind::NotFound => write!(f, "{file}: no such file: check the path"),
                io::ErrorKind::IsADirectory => write!(f, "{file}: is a directory: name a file in it"),
                _ => write!(f, "{file}: cannot be read ({error}): check the file and its permissions"),
            },
            Fault::NotObj(looks_like) => {
                write!(f, "{file}: not an OBJ file, {looks_like}: export the model as OBJ, PLY, STL or glTF")
            }
            Fault::Malformed { format, reason } => {
                write!(f, "{file}: {format}, but malformed: {reason}: export the model again, or as OBJ")
            }
            Fault::Geometry(defect) => {
                write!(f, "{file}: {defect}: correct it, or load the file without the triangles concerned")
            }
            Fault::NoTriangles { vertices } => {
                write!(f, "{file}: no faces ({vertices} vertices): export the model with its surfaces, as polygons")
            }
            Fault::Defect { line, defect } => {
                write!(f, "{file}:{line}: {defect}: correct it, or load the file without the faces concerned")
            }
            Fault::TooMany { what, limit } => {
                write!(f, "{file}: more than {limit} {what}: split the model or reduce it")
            }
            Fault::Memory { bytes } => {
                write!(f, "{file}: the system refused {bytes} bytes of memory: free some, or reduce the model")
            }
            Fault::Stopped => write!(f, "{file}: loading was stopped"),
        }
    }
}

impl fmt::Display for Defect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Coordinates(found) => write!(f, "a vertex with {found} coordinates instead of 3"),
            Self::Corners(found) => write!(f, "a face with {found} corners, of 3 or more that it needs"),
            Self::Number { text, hint } => write!(f, "'{text}' is not a number{hint}"),
            Self::Index { index, vertices } => write!(
                f,
                "index {index} does not lead to one of the {vertices} vertices (indices count from 1, or from -1 backwards)"
            ),
            Self::Vertex { triangle, index, vertices } => {
                write!(f, "triangle {triangle} has the vertex {index}, of {vertices} from 0 on")
            }
            Self::NotFiniteTriangle { triangle } => {
                write!(f, "a vertex of triangle {triangle} is not three finite single-precision numbers")
            }
            Self::NotFinite { vertices } => {
                write!(f, "a vertex that faces use is not three finite single-precision numbers")?;
                if *vertices > 1 { write!(f, " ({vertices} such vertices in all)") } else { Ok(()) }
            }
        }
    }
}

impl Error for LoadError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match &self.fault {
            Fault::Read(error) => Some(error),
            _ => None,
        }
    }
}

impl Fault {
    /// The error for `file`.
    pub(crate) fn of(self, file: &str) -> LoadError {
        LoadError { file: file.to_owned(), fault: self }
    }
}

impl From<NoMemory> for Fault {
    fn from(refused: NoMemory) -> Self {
        Self::Memory { bytes: refused.bytes }
    }
}

impl From<Stopped> for Fault {
    fn from(_: Stopped) -> Self {
        Self::Stopped
    }
}
