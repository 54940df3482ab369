//! Finding and opening devices.

use crate::board::{Abandoned, VulkanBoard};
use crate::error::OpenError;
use crate::instance::{Description, Instance};
use crate::logical::Logical;
use crate::pipeline::{self, BUFFERS, Pipeline};
use crate::probe;
use ash::vk;
use rt_core::{Clock, Device, DeviceError, DeviceInfo, Scene, Tracer};
use rt_gpu::{BadVariable, Card, Faults, GpuDevice, Layouts, Profile, Trials, Tuning, fault_of_llvmpipe};
use rt_shaders::{FloatControls, Kernel, Layout, Purpose};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// How to open devices.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options {
    /// Whether the validation layer checks every call, synchronisation included. What it objects to becomes an error of
    /// kind [`rt_core::DeviceErrorKind::Lost`] of the next launch that is waited for.
    pub validation: bool,
    /// The layouts of scenes' trees; `None`: [`Layouts::USUAL`]. Where a scene with both trees does not fit, the two-wide
    /// one alone does all, and [`Tracer::note`] says so, unless tests are to be counted over the wide one.
    pub layouts: Option<Layouts>,
    /// Most bytes of the device's own memory that scenes and streams may take together; `None`: all that there is.
    /// Whatever does not fit is refused with [`rt_core::DeviceErrorKind::OutOfMemory`], as on a card that is too small.
    pub memory: Option<u64>,
    /// What goes wrong on purpose, for tests of this crate and of programs that use it.
    #[cfg(feature = "test-support")]
    pub fault: Option<rt_gpu::FaultInjection>,
    /// SPIR-V in place of kernels' own, for tests that want kernels to fail.
    #[cfg(feature = "test-support")]
    pub kernels: Option<Replacement>,
}

impl Options {
    /// Validation if the environment variable `RAYBALANCE_VULKAN_VALIDATION` is `1`.
    ///
    /// # Errors
    /// When the variable is neither `1` nor `0` nor empty.
    pub fn from_env() -> Result<Self, BadVariable> {
        Ok(Self { validation: rt_gpu::switch("RAYBALANCE_VULKAN_VALIDATION")?, ..Self::default() })
    }

    fn faults(&self) -> Faults {
        #[cfg(feature = "test-support")]
        return Faults::of(self.fault);
        #[cfg(not(feature = "test-support"))]
        return Faults::default();
    }
}

/// SPIR-V that runs in place of kernels' own. Drivers trust it, so to make one is unsafe.
#[cfg(feature = "test-support")]
#[derive(Clone, Copy, Debug)]
pub struct Replacement(fn(&'static Kernel) -> Vec<u32>);

#[cfg(feature = "test-support")]
impl Replacement {
    /// What runs in place of each kernel.
    ///
    /// # Safety
    /// For every kernel of `rt_shaders`, `words` must return valid SPIR-V that Vulkan 1.2 takes without features or extensions
    /// beyond those of [`Kernel::spirv_with`] for the device; with the kernel's entry point, workgroup and buffers; that
    /// accesses nothing that the kernel would not access; and that ends.
    #[must_use]
    pub const unsafe fn new(words: fn(&'static Kernel) -> Vec<u32>) -> Self {
        Self(words)
    }
}

/// A graphics card or software rasteriser.
#[derive(Debug)]
pub struct VulkanDevice {
    profile: Profile,
    pub(crate) shared: Arc<Shared>,
}

/// What a device's tracers have in common.
#[derive(Debug)]
pub(crate) struct Shared {
    pipelines: Mutex<HashMap<(Layout, Purpose, u32), Arc<Pipeline>>>,
    layout: Arc<pipeline::Layout>,
    pub faults: Faults,
    #[cfg(feature = "test-support")]
    kernels: Option<Replacement>,
    /// Whether it makes the host's camera rays, and those that leave surfaces; asked when the first are wanted.
    trials: Trials,
    pub abandoned: Abandoned,
    pub logical: Arc<Logical>,
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
        let logical = Arc::new(Logical::new(Arc::clone(instance), physical, options)?);
        let layout = pipeline::Layout::new(&logical).map_err(|e| refuse(e.to_string()))?;
        let card = Card {
            name: name.clone(),
            driver: format!("{driver} {version}"),
            software: is_software,
            model,
            slot,
            binding: logical.limits.binding,
            kernels: "SPIR-V, unchecked",
        };
        let profile = Profile::new("vulkan", logical.memory.size(), card, options.layouts);
        let shared = Shared {
            pipelines: Mutex::default(),
            layout: Arc::new(layout),
            faults: options.faults(),
            #[cfg(feature = "test-support")]
            kernels: options.kernels,
            trials: Trials::default(),
            abandoned: Abandoned::default(),
            logical,
        };
        match probe::check_arithmetic(&shared) {
            Ok(None) => {}
            Ok(Some(fault)) => return Err(refuse(format!("it does not round as IEEE 754 says: {fault}"))),
            Err(error) => return Err(refuse(error.to_string())),
        }
        Ok(Self { profile, shared: Arc::new(shared) })
    }

    /// The device with other choices for the tracers that it will open.
    #[must_use]
    pub fn tuned(mut self, tuning: Tuning) -> Self {
        self.profile.tuning = tuning;
        self
    }

    /// What the device promises of the kernels' arithmetic, and they ask it for.
    #[must_use]
    pub fn float_controls(&self) -> FloatControls {
        self.shared.logical.limits.float_controls
    }
}

impl Device for VulkanDevice {
    fn info(&self) -> &DeviceInfo {
        &self.profile.info
    }

    fn tracer(&self, scene: Arc<Scene>, clock: Clock) -> Result<Box<dyn Tracer>, DeviceError> {
        self.profile.tracer(scene, clock, |held| VulkanBoard::new(Arc::clone(&self.shared), self.profile.tuning, held))
    }
}

impl GpuDevice for VulkanDevice {
    fn profile(&self) -> &Profile {
        &self.profile
    }

    fn makes_rays(&self) -> bool {
        self.shared.makes(Purpose::Camera)
    }

    #[cfg(feature = "test-support")]
    fn fault_of_bounces(&self, trials: &[rt_gpu::bounce::Trial]) -> Result<Option<String>, DeviceError> {
        probe::check_bounces(&self.shared, trials)
    }
}

impl Shared {
    /// Whether a kernel that makes rays makes those of the host.
    pub(crate) fn makes(&self, purpose: Purpose) -> bool {
        self.trials.passed(purpose, || probe::check_camera(self), |trials| probe::check_bounces(self, trials))
    }

    /// The kernel for a layout, a purpose and a tree's depth; compiled once.
    pub(crate) fn pipeline(&self, layout: Layout, purpose: Purpose, depth: u32) -> Result<Arc<Pipeline>, DeviceError> {
        let kernel = self.faults.kernel(layout, purpose, depth)?;
        let mut pipelines = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        let key = (kernel.layout, kernel.purpose, kernel.stack);
        if let Some(pipeline) = pipelines.get(&key) {
            return Ok(Arc::clone(pipeline));
        }
        let pipeline = Arc::new(Pipeline::new(&self.layout, kernel, &self.words(kernel))?);
        pipelines.insert(key, Arc::clone(&pipeline));
        Ok(pipeline)
    }

    fn words(&self, kernel: &'static Kernel) -> Vec<u32> {
        #[cfg(feature = "test-support")]
        if let Some(Replacement(words)) = self.kernels {
            return words(kernel);
        }
        kernel.spirv_with(self.logical.limits.float_controls)
    }

    pub(crate) const fn layout(&self) -> &Arc<pipeline::Layout> {
        &self.layout
    }
}
