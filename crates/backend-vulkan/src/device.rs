//! Finding and opening devices.

use crate::board::VulkanBoard;
use crate::buffer::{Buffer, Use};
use crate::commands::Commands;
use crate::error::OpenError;
use crate::instance::{Description, Instance};
use crate::logical::Logical;
use crate::pipeline::{BUFFERS, Layout, Pipeline};
use crate::probe;
use ash::vk;
use rt_core::{Clock, Device, DeviceError, DeviceErrorKind, DeviceInfo, Scene, Tracer};
use rt_gpu::{Card, GpuDevice, GpuTracer, IN_FLIGHT, Tally, Tuning, fault_of_llvmpipe};
use rt_shaders::{Kernel, Purpose};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// How to open devices.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options {
    /// Whether the validation layer checks every call. What it objects to becomes an error of kind
    /// [`DeviceErrorKind::Lost`] of the next launch that is waited for.
    pub validation: bool,
    /// SPIR-V in place of a kernel's own, for tests that want kernels to fail; it must be valid.
    pub kernels: Option<fn(&'static Kernel) -> Vec<u32>>,
}

impl Options {
    /// Validation if the environment variable `RAYBALANCE_VULKAN_VALIDATION` is `1`.
    #[must_use]
    pub fn from_env() -> Self {
        let validation = std::env::var_os("RAYBALANCE_VULKAN_VALIDATION").is_some_and(|value| value == "1");
        Self { validation, kernels: None }
    }
}

/// A graphics card or software rasteriser.
#[derive(Debug)]
pub struct VulkanDevice {
    info: DeviceInfo,
    card: Card,
    tuning: Tuning,
    shared: Arc<Shared>,
}

/// What a device's tracers have in common.
#[derive(Debug)]
pub(crate) struct Shared {
    pipelines: Mutex<HashMap<(Purpose, u32), Arc<Pipeline>>>,
    layout: Arc<Layout>,
    kernels: Option<fn(&'static Kernel) -> Vec<u32>>,
    /// Whether it makes the host's camera rays; asked when the first are wanted.
    makes_rays: OnceLock<bool>,
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
        let Description {
            name,
            driver,
            version,
            is_llvmpipe,
            is_software,
            model,
            slot,
            has_api,
            has_timelines,
            buffers,
        } = instance.describe(physical);
        let refuse = |reason: String| OpenError::Refused { name: name.clone(), reason };
        if !has_api {
            return Err(refuse("its driver is older than Vulkan 1.2".to_owned()));
        }
        if is_llvmpipe && let Some(fault) = fault_of_llvmpipe(&version) {
            return Err(refuse(fault));
        }
        if !has_timelines {
            return Err(refuse("it has no timeline semaphores".to_owned()));
        }
        if (buffers as usize) < BUFFERS {
            return Err(refuse(format!("its kernels may use {buffers} buffers, and ours need {BUFFERS}")));
        }
        let logical = Arc::new(Logical::new(Arc::clone(instance), physical)?);
        let layout = Layout::new(&logical).map_err(|e| refuse(e.to_string()))?;
        let info = DeviceInfo {
            name: name.clone(),
            backend: "vulkan",
            // Vulkan does not tell.
            units: 1,
            in_flight: IN_FLIGHT,
            memory: logical.memory(),
        };
        let card = Card {
            name: name.clone(),
            driver: format!("{driver} {version}"),
            software: is_software,
            model,
            slot,
            binding: logical.limits.binding,
            kernels: "SPIR-V, unchecked",
        };
        let shared = Shared {
            pipelines: Mutex::default(),
            layout: Arc::new(layout),
            kernels: options.kernels,
            makes_rays: OnceLock::new(),
            logical,
            tally: Arc::default(),
        };
        match probe::check_arithmetic(&shared) {
            Ok(None) => {}
            Ok(Some(fault)) => return Err(refuse(format!("it does not round as IEEE 754 says: {fault}"))),
            Err(error) => return Err(refuse(error.to_string())),
        }
        Ok(Self { info, card, tuning: Tuning::default(), shared: Arc::new(shared) })
    }

    /// The device with other choices for the tracers that it will open.
    #[must_use]
    pub fn tuned(mut self, tuning: Tuning) -> Self {
        self.tuning = tuning;
        self
    }

    /// Whether the device makes camera rays itself: where it does not make the host's bits, the host prepares them.
    #[must_use]
    pub fn makes_rays(&self) -> bool {
        self.shared.makes_rays()
    }

    /// Records a wrong call, which is never run: an error where the validation layer is at work, so that tests can tell
    /// that it is.
    ///
    /// # Errors
    /// What the layer said. Devices that were enumerated together share its messages.
    pub fn provoke_validation(&self) -> Result<(), DeviceError> {
        let logical = &self.shared.logical;
        let [from, to] = [Use::Download, Use::Upload].map(|purpose| Buffer::new(logical, "a word", 4, purpose));
        let (from, to) = (from?, to?);
        // The wrong way round: neither buffer was made for it.
        Commands::new(logical)?.record(|record| record.copy(&from, &to, 0, 4))?;
        logical.check_validation()
    }
}

impl Device for VulkanDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn tracer(&self, scene: Arc<Scene>, clock: Clock) -> Result<Box<dyn Tracer>, DeviceError> {
        let board = VulkanBoard::new(Arc::clone(&self.shared), self.tuning, &scene)?;
        Ok(Box::new(GpuTracer::new(board, scene, clock, Arc::clone(&self.shared.tally))))
    }
}

impl GpuDevice for VulkanDevice {
    fn card(&self) -> &Card {
        &self.card
    }

    fn tally(&self) -> &Tally {
        &self.shared.tally
    }
}

impl Shared {
    pub(crate) fn makes_rays(&self) -> bool {
        // A device that is lost will say so when it is used.
        *self.makes_rays.get_or_init(|| matches!(probe::check_camera(self), Ok(None)))
    }

    /// The kernel for a purpose and a scene's depth; compiled once.
    pub(crate) fn pipeline(&self, purpose: Purpose, depth: u32) -> Result<Arc<Pipeline>, DeviceError> {
        let kernel = rt_shaders::kernel(purpose, depth).ok_or_else(|| {
            DeviceError::new(DeviceErrorKind::Unsupported, format!("no kernel traces a tree of depth {depth}"))
        })?;
        let mut pipelines = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        let key = (kernel.purpose, kernel.stack);
        if let Some(pipeline) = pipelines.get(&key) {
            return Ok(Arc::clone(pipeline));
        }
        let pipeline = Arc::new(Pipeline::new(
            &self.layout,
            kernel,
            &self.kernels.map_or_else(|| kernel.spirv(), |replace| replace(kernel)),
        )?);
        pipelines.insert(key, Arc::clone(&pipeline));
        Ok(pipeline)
    }

    pub(crate) const fn layout(&self) -> &Arc<Layout> {
        &self.layout
    }
}
