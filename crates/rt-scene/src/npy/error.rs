//! Why rays could not be read.

use std::error::Error;
use std::fmt;
use std::io;
use std::ops::Range;

/// Why rays could not be read. The message names the file, what it holds and what to do.
#[derive(Debug)]
pub struct RayFileError {
    /// The file, or what stands for it.
    pub file: String,
    /// What is wrong with it.
    pub fault: Fault,
}

/// What is wrong with a file of rays.
#[derive(Debug)]
#[non_exhaustive]
pub enum Fault {
    /// It cannot be opened.
    Open(io::Error),
    /// It cannot be read.
    Read(io::Error),
    /// It is no `.npy` file.
    NotNpy,
    /// It is an archive of arrays.
    Archive,
    /// Its header claims to be longer than NumPy reads.
    LongHeader {
        /// Bytes that it claims.
        bytes: usize,
        /// Bytes that are read.
        most: usize,
    },
    /// Its header is none: what is wrong with it.
    Damaged(&'static str),
    /// It holds something else than rays.
    NoRays {
        /// The type of its elements, as the file names it.
        found: String,
        /// Its shape.
        shape: Vec<u64>,
        /// What to save instead.
        advice: String,
    },
    /// It holds more rays than ids can number.
    TooMany(u64),
    /// The system refuses the memory for its rays.
    Memory {
        /// Bytes that were asked for.
        bytes: u64,
    },
    /// The data end before the last ray.
    Ended {
        /// Rays that the header promises.
        rays: u64,
        /// The numbers among which it ends.
        numbers: Range<usize>,
        /// What the system says.
        source: io::Error,
    },
}

impl fmt::Display for RayFileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let file = &self.file;
        match &self.fault {
            Fault::Open(_) => write!(f, "cannot open `{file}`"),
            Fault::Read(_) => write!(f, "cannot read rays from `{file}`"),
            fault => write!(f, "cannot read rays from `{file}`: {fault}"),
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Open(_) => write!(f, "it cannot be opened"),
            Self::Read(_) => write!(f, "it cannot be read"),
            Self::NotNpy => write!(f, "this is no .npy file: write it with `np.save`"),
            Self::Archive => write!(f, "this is an archive (.npz): save the one array with `np.save`"),
            Self::LongHeader { bytes, most } => {
                write!(f, "its header claims {bytes} bytes, more than {most}: the file is damaged")
            }
            Self::Damaged(what) => write!(f, "{what}: the file is damaged"),
            Self::NoRays { found, shape, advice } => write!(
                f,
                "found {found} of shape {shape:?}, wanted float32 or float64 ('<f4', '<f8') of shape [N, 8]: {advice}"
            ),
            Self::TooMany(rays) => write!(f, "{rays} rays are more than {}: split the file", u32::MAX),
            Self::Memory { bytes } => {
                write!(f, "there is no memory for the {bytes} bytes that the rays take: split the file")
            }
            Self::Ended { rays, numbers, .. } => {
                write!(f, "its header promises {rays} rays, but the data end among numbers {numbers:?}")
            }
        }
    }
}

impl Error for RayFileError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match &self.fault {
            Fault::Open(source) | Fault::Read(source) | Fault::Ended { source, .. } => Some(source),
            _ => None,
        }
    }
}
