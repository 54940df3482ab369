//! Why something could not be shown or written.

use std::error::Error;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// Why something could not be shown or written.
#[derive(Debug)]
#[non_exhaustive]
pub enum ReportError {
    /// There is nothing to show in such a thing.
    Nothing(&'static str),
    /// A picture is given another number of pixels than it has.
    Pixels {
        /// Width and height.
        size: [u32; 2],
        /// Pixels that were given.
        found: usize,
    },
    /// The font that comes with the program is broken.
    Font,
    /// This build writes no OpenEXR files.
    NoExr,
    /// A file that was read is not what it should be.
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, and where.
        what: String,
    },
    /// A file cannot be read.
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file cannot be written.
    Write {
        /// The file.
        path: PathBuf,
        /// Why, and what to do.
        source: io::Error,
    },
}

impl ReportError {
    pub(crate) fn read(path: &Path, source: io::Error) -> Self {
        Self::Read { path: path.to_owned(), source }
    }

    pub(crate) fn content(path: &Path, what: String) -> Self {
        Self::Content { path: path.to_owned(), what }
    }

    pub(crate) fn write(path: &Path, source: io::Error) -> Self {
        Self::Write { path: path.to_owned(), source }
    }
}

impl fmt::Display for ReportError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Nothing(what) => write!(f, "{what} has nothing to show"),
            Self::Pixels { size: [width, height], found } => {
                write!(f, "{found} radiances for a picture of {width} × {height}")
            }
            Self::Font => write!(f, "the embedded font is broken"),
            Self::NoExr => write!(f, "this build writes no OpenEXR files: build it with the feature `exr`"),
            Self::Content { path, what } => write!(f, "`{}`: {what}", path.display()),
            Self::Read { path, .. } => write!(f, "cannot read `{}`", path.display()),
            Self::Write { path, .. } => write!(f, "cannot write `{}`", path.display()),
        }
    }
}

impl Error for ReportError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::Read { source, .. } | Self::Write { source, .. } => Some(source),
            _ => None,
        }
    }
}
