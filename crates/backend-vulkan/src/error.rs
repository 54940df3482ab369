//! Errors: why a device could not be opened, and Vulkan's results as [`DeviceError`]s.

use ash::vk;
use rt_core::{DeviceError, DeviceErrorKind};
use std::fmt;

/// Why a Vulkan device, or Vulkan itself, cannot be used.
#[derive(Debug)]
#[non_exhaustive]
pub enum OpenError {
    /// There is no Vulkan loader, or it is broken.
    NoLoader(ash::LoadingError),
    /// The loader finds no driver, or none of its drivers a device.
    NoDevice,
    /// The validation layer was asked for and is not installed.
    NoValidation,
    /// The device lacks something that we need, or is known to give wrong results.
    Refused {
        /// Its name.
        name: String,
        /// Why.
        reason: String,
    },
    /// A call of the driver failed.
    Driver {
        /// What was to be done.
        task: &'static str,
        /// The driver's answer.
        source: vk::Result,
    },
}

impl fmt::Display for OpenError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoLoader(_) => write!(f, "no Vulkan loader: install libvulkan (Debian: libvulkan1)"),
            Self::NoDevice => write!(f, "no Vulkan device: install a driver, or name one in VK_DRIVER_FILES"),
            Self::NoValidation => {
                write!(f, "no layer {VALIDATION}: install it (Debian: vulkan-validationlayers)")
            }
            Self::Refused { name, reason } => write!(f, "the Vulkan device {name} is not used: {reason}"),
            Self::Driver { task, source } => write!(f, "the Vulkan driver failed to {task}: {source}"),
        }
    }
}

impl std::error::Error for OpenError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::NoLoader(source) => Some(source),
            Self::Driver { source, .. } => Some(source),
            _ => None,
        }
    }
}

/// The validation layer's name.
pub(crate) const VALIDATION: &str = "VK_LAYER_KHRONOS_validation";

/// For `map_err` when opening: what was to be done.
pub(crate) fn opening(task: &'static str) -> impl FnOnce(vk::Result) -> OpenError {
    move |source| OpenError::Driver { task, source }
}

/// For `map_err` on an open device: what was to be done.
pub(crate) fn failed(task: &'static str) -> impl FnOnce(vk::Result) -> DeviceError {
    move |source| {
        let kind = match source {
            vk::Result::ERROR_OUT_OF_DEVICE_MEMORY
            | vk::Result::ERROR_OUT_OF_HOST_MEMORY
            | vk::Result::ERROR_OUT_OF_POOL_MEMORY
            | vk::Result::ERROR_TOO_MANY_OBJECTS => DeviceErrorKind::OutOfMemory,
            vk::Result::ERROR_INVALID_SHADER_NV | vk::Result::ERROR_FEATURE_NOT_PRESENT => DeviceErrorKind::Unsupported,
            vk::Result::TIMEOUT => DeviceErrorKind::Hung,
            _ => DeviceErrorKind::Lost,
        };
        let advice = if kind == DeviceErrorKind::Lost { "; it may work again when it is opened anew" } else { "" };
        DeviceError::new(kind, format!("the Vulkan device failed to {task}{advice}")).with_source(source)
    }
}
