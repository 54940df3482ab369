//! Finding and opening devices.

use crate::arithmetic;
use crate::board::{Abandoned, VulkanBoard};
use crate::buffer::{Buffer, Use};
use crate::commands::{Commands, Recorder};
use crate::error::OpenError;
use crate::instance::{Description, Instance};
use crate::logical::Logical;
use crate::pipeline::{BUFFERS, Layout, Pipeline};
use ash::vk;
use rt_core::{Clock, Device, DeviceError, DeviceErrorKind, DeviceInfo, Scene, Tracer};
use rt_gpu::{GpuTracer, IN_FLIGHT, Tally, Trouble};
use rt_shaders::{FloatControls, Purpose};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Mesa's first release whose software rasteriser runs loops to their end: 22.3 stops silently after 65,535 rounds.
const LEAST_LLVMPIPE: u32 = 25;

/// How to open devices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// Whether the validation layer checks every call, synchronisation included. What it objects to becomes an error of
    /// kind [`DeviceErrorKind::Lost`] of the next launch that is waited for.
    pub validation: bool,
    /// Most bytes of the device's own memory that scenes and streams may take together; `None`: all that there is.
    /// Whatever does not fit is refused with [`DeviceErrorKind::OutOfMemory`], as it is on a card that is too small.
    pub memory: Option<u64>,
    /// What goes wrong on purpose, for tests of this crate and of programs that use it.
    pub trouble: Option<Trouble>,
}

impl Options {
    /// Validation if the environment variable `RAYBALANCE_VULKAN_VALIDATION` is `1`.
    #[must_use]
    pub fn from_env() -> Self {
        let validation = std::env::var_os("RAYBALANCE_VULKAN_VALIDATION").is_some_and(|value| value == "1");
        Self { validation, ..Self::default() }
    }
}

/// A graphics card or software rasteriser.
#[derive(Debug)]
pub struct VulkanDevice {
    info: DeviceInfo,
    driver: String,
    software: bool,
    shared: Arc<Shared>,
}

/// What a device's tracers have in common.
#[derive(Debug)]
pub(crate) struct Shared {
    pipelines: Mutex<HashMap<(Purpose, u32), Arc<Pipeline>>>,
    layout: Arc<Layout>,
    /// Runs in place of every kernel that traces, where a test wants it to.
    instead: Option<Purpose>,
    pub abandoned: Abandoned,
    pub logical: Arc<Logical>,
    pub tally: Arc<Tally>,
}

impl VulkanDevice {
    /// Opens every device, in the order in which Vulkan lists them; in place of one that cannot be used stands the
    /// reason. Several devices may have the same name.
    ///
    /// # Errors
    /// When there is no Vulkan, or no device at all.
    pub fn enumerate(options: Options) -> Result<Vec<Result<Self, OpenError>>, OpenError> {
        let instance = Arc::new(Instance::new(options.validation)?);
        let found = instance.physical_devices()?;
        if found.is_empty() {
            return Err(OpenError::NoDevice);
        }
        Ok(found.into_iter().map(|physical| Self::open(&instance, physical, options)).collect())
    }

    fn open(instance: &Arc<Instance>, physical: vk::PhysicalDevice, options: Options) -> Result<Self, OpenError> {
        let Description { name, driver, version, is_llvmpipe, is_software, has_api, has_timelines, buffers } =
            instance.describe(physical);
        let refuse = |reason: String| OpenError::Refused { name: name.clone(), reason };
        if !has_api {
            return Err(refuse("its driver is older than Vulkan 1.2".to_owned()));
        }
        if is_llvmpipe && mesa_version(&version) < Some(LEAST_LLVMPIPE) {
            return Err(refuse(format!(
                "its driver, {version:?}, ends long loops early and gives wrong hits: install Mesa {LEAST_LLVMPIPE} or \
                 later"
            )));
        }
        if !has_timelines {
            return Err(refuse("it has no timeline semaphores".to_owned()));
        }
        if (buffers as usize) < BUFFERS {
            return Err(refuse(format!("its kernels may use {buffers} buffers, and ours need {BUFFERS}")));
        }
        let logical = Arc::new(Logical::new(Arc::clone(instance), physical, options)?);
        let layout = Layout::new(&logical).map_err(|e| refuse(e.to_string()))?;
        let info = DeviceInfo {
            name: name.clone(),
            backend: "vulkan",
            // Vulkan does not tell.
            units: 1,
            in_flight: IN_FLIGHT,
            memory: logical.memory.size(),
        };
        let instead = match options.trouble {
            Some(Trouble::Kernel(purpose)) => Some(purpose),
            _ => None,
        };
        let shared = Shared {
            pipelines: Mutex::default(),
            layout: Arc::new(layout),
            instead,
            abandoned: Abandoned::default(),
            logical,
            tally: Arc::default(),
        };
        match arithmetic::check(&shared) {
            Ok(None) => {}
            Ok(Some(fault)) => return Err(refuse(format!("it does not round as IEEE 754 says: {fault}"))),
            Err(error) => return Err(refuse(error.to_string())),
        }
        Ok(Self { info, driver: format!("{driver} {version}"), software: is_software, shared: Arc::new(shared) })
    }

    /// The driver's name and version.
    #[must_use]
    pub fn driver(&self) -> &str {
        &self.driver
    }

    /// Whether it is a processor in the guise of a graphics card.
    #[must_use]
    pub const fn is_software(&self) -> bool {
        self.software
    }

    /// What the device promises of the kernels' arithmetic, and they ask it for.
    #[must_use]
    pub fn float_controls(&self) -> FloatControls {
        self.shared.logical.limits.float_controls
    }

    /// Records a wrong call, which is never run: an error where the validation layer is at work, so that tests can tell
    /// that it is.
    ///
    /// # Errors
    /// What the layer said. Devices that were enumerated together share its messages.
    pub fn provoke_validation(&self) -> Result<(), DeviceError> {
        // The wrong way round: neither buffer was made for it.
        self.provoke([Use::Download, Use::Upload], |record, from, to| record.copy(from, to, 0, 4))
    }

    /// Records two copies to one place, the second of which does not wait for the first, and never runs them: an error
    /// where the validation layer looks at synchronisation too.
    ///
    /// # Errors
    /// As for [`VulkanDevice::provoke_validation`].
    pub fn provoke_race(&self) -> Result<(), DeviceError> {
        self.provoke([Use::Kernel, Use::Kernel], |record, from, to| {
            record.copy(from, to, 0, 4);
            record.copy(from, to, 0, 4);
        })
    }

    fn provoke(
        &self,
        purposes: [Use; 2],
        steps: impl FnOnce(&Recorder<'_>, &Buffer, &Buffer),
    ) -> Result<(), DeviceError> {
        let logical = &self.shared.logical;
        let [from, to] = purposes.map(|purpose| Buffer::new(logical, "a word", 4, purpose));
        let (from, to) = (from?, to?);
        Commands::new(logical)?.record(|record| steps(record, &from, &to))?;
        logical.check_validation()
    }

    /// What the device's tracers have done so far.
    #[must_use]
    pub fn tally(&self) -> &Tally {
        &self.shared.tally
    }
}

/// The first number in Mesa's version, such as `Mesa 25.0.7-2 (LLVM 15.0.6)`.
fn mesa_version(info: &str) -> Option<u32> {
    let digits = info.split(|c: char| !c.is_ascii_digit()).find(|part| !part.is_empty())?;
    digits.parse().ok()
}

impl Device for VulkanDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn tracer(&self, scene: Arc<Scene>, clock: Clock) -> Result<Box<dyn Tracer>, DeviceError> {
        let board = VulkanBoard::new(Arc::clone(&self.shared), &scene)?;
        Ok(Box::new(GpuTracer::new(board, scene, clock, Arc::clone(&self.shared.tally))))
    }
}

impl Shared {
    /// The kernel for a purpose and a scene's depth; compiled once.
    pub(crate) fn pipeline(&self, purpose: Purpose, depth: u32) -> Result<Arc<Pipeline>, DeviceError> {
        let purpose = if purpose == Purpose::Arithmetic { purpose } else { self.instead.unwrap_or(purpose) };
        let kernel = rt_shaders::kernel(purpose, depth).ok_or_else(|| {
            DeviceError::new(DeviceErrorKind::Unsupported, format!("no kernel traces a tree of depth {depth}"))
        })?;
        let mut pipelines = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        let key = (kernel.purpose, kernel.stack);
        if let Some(pipeline) = pipelines.get(&key) {
            return Ok(Arc::clone(pipeline));
        }
        let pipeline = Arc::new(Pipeline::new(&self.layout, kernel)?);
        pipelines.insert(key, Arc::clone(&pipeline));
        Ok(pipeline)
    }

    pub(crate) const fn layout(&self) -> &Arc<Layout> {
        &self.layout
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn old_software_rasterisers_are_known_by_their_driver_info() {
        assert_eq!(mesa_version("Mesa 22.3.6 (LLVM 15.0.6)"), Some(22));
        assert_eq!(mesa_version("Mesa 25.0.7-2~bpo12+1 (LLVM 15.0.6)"), Some(25));
        assert!(mesa_version("") < Some(LEAST_LLVMPIPE) && mesa_version("Mesa 22.3.6") < Some(LEAST_LLVMPIPE));
    }
}
