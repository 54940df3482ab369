//! Why a device could not be opened.

use std::fmt;

/// Why a device, or wgpu itself, cannot be used.
#[derive(Debug)]
#[non_exhaustive]
pub enum OpenError {
    /// wgpu finds no device: there is no Vulkan loader, no driver, or none of its drivers has one.
    NoDevice,
    /// The device lacks something that we need, or is known to give wrong results.
    Refused {
        /// Its name.
        name: String,
        /// Why.
        reason: String,
    },
}

impl fmt::Display for OpenError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoDevice => {
                write!(f, "wgpu finds no device: install a Vulkan loader and driver, or name one in VK_DRIVER_FILES")
            }
            Self::Refused { name, reason } => write!(f, "the wgpu device {name} is not used: {reason}"),
        }
    }
}

impl std::error::Error for OpenError {}
