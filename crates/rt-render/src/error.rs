//! What can go wrong while a picture is rendered.

use crate::memory::NoMemory;
use rt_balance::BalanceError;
use rt_scene::camera::NoCamera;
use std::error::Error;
use std::fmt;

/// Why a part of a picture could not be rendered.
#[derive(Debug)]
#[non_exhaustive]
pub enum RenderError {
    /// There is no memory for it.
    NoMemory(NoMemory),
    /// Its rays could not be traced.
    Trace(BalanceError),
    /// A frame has no camera.
    Camera(NoCamera),
    /// A tile that came from another process does not have the bytes of its pixels.
    Tile {
        /// Number of the tile.
        tile: u32,
        /// The bytes it has.
        found: usize,
        /// The bytes it should have.
        expected: usize,
    },
}

impl fmt::Display for RenderError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoMemory(source) => source.fmt(f),
            Self::Trace(source) => source.fmt(f),
            Self::Camera(source) => source.fmt(f),
            Self::Tile { tile, found, expected } => {
                write!(f, "tile {tile} came with {found} bytes instead of {expected}")
            }
        }
    }
}

impl Error for RenderError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            // What they say is said above.
            Self::Trace(source) => source.source(),
            Self::Camera(source) => source.source(),
            Self::NoMemory(_) | Self::Tile { .. } => None,
        }
    }
}

impl From<NoMemory> for RenderError {
    fn from(source: NoMemory) -> Self {
        Self::NoMemory(source)
    }
}

impl From<NoCamera> for RenderError {
    fn from(source: NoCamera) -> Self {
        Self::Camera(source)
    }
}

impl From<BalanceError> for RenderError {
    fn from(source: BalanceError) -> Self {
        Self::Trace(source)
    }
}
