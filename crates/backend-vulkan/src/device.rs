//! Finding and opening devices.

use crate::api::VulkanApi;
use crate::error::OpenError;
use crate::instance::{Description, Instance};
use crate::logical::Logical;
use crate::options::Options;
use crate::pipeline::{BUFFERS, Layout};
use crate::probe;
use crate::shared::Shared;
use ash::vk;
use rt_core::{Clock, Device, DeviceError, DeviceInfo, Scene, Tracer};
use rt_gpu::{Card, GpuDevice, Profile, Tuning, fault_of_llvmpipe};
use rt_shaders::{FloatControls, Purpose};
use std::sync::Arc;

/// A graphics card or software rasteriser.
#[derive(Debug)]
pub struct VulkanDevice {
    profile: Profile,
    pub(crate) shared: Arc<Shared>,
}

/// A device that is not open yet. Those that were listed together share Vulkan's instance.
#[derive(Clone, Debug)]
pub struct ListedDevice {
    instance: Arc<Instance>,
    physical: vk::PhysicalDevice,
    options: Options,
}

impl ListedDevice {
    /// Opens the device, and no other.
    ///
    /// # Errors
    /// When it cannot be used, with the reason.
    pub fn open(&self) -> Result<VulkanDevice, OpenError> {
        VulkanDevice::open(&self.instance, self.physical, self.options)
    }
}

impl VulkanDevice {
    /// Every device of the system, none of which is open yet, in the order in which Vulkan lists them. Several may have
    /// the same name.
    ///
    /// # Errors
    /// When there is no Vulkan, or no device at all.
    pub fn list(options: Options) -> Result<Vec<ListedDevice>, OpenError> {
        let instance = Arc::new(Instance::new(options.validation)?);
        let found = instance.physical_devices()?;
        if found.is_empty() {
            return Err(OpenError::NoDevice);
        }
        let listed = |physical| ListedDevice { instance: Arc::clone(&instance), physical, options };
        Ok(found.into_iter().map(listed).collect())
    }

    /// Opens every device of [`VulkanDevice::list`]; in place of one that cannot be used stands the reason.
    ///
    /// # Errors
    /// When there is no Vulkan, or no device at all.
    pub fn enumerate(options: Options) -> Result<Vec<Result<Self, OpenError>>, OpenError> {
        Ok(Self::list(options)?.iter().map(ListedDevice::open).collect())
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
        let layout = Layout::new(&logical).map_err(|e| refuse(e.to_string()))?;
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
        let shared = Shared::new(&options, layout, logical);
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
        self.profile.tracer(scene, clock, |held| VulkanApi::new(Arc::clone(&self.shared), self.profile.tuning, held))
    }
}

impl GpuDevice for VulkanDevice {
    fn profile(&self) -> &Profile {
        &self.profile
    }

    fn makes_rays(&self) -> bool {
        probe::makes(&self.shared, Purpose::Camera)
    }

    #[cfg(feature = "test-support")]
    fn fault_of_bounces(&self, trials: &[rt_gpu::bounce::Trial]) -> Result<Option<String>, DeviceError> {
        probe::check_bounces(&self.shared, trials)
    }
}
