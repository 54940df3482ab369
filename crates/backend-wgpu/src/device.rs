//! Finding and opening devices.

use crate::api::WgpuApi;
use crate::error::OpenError;
use crate::opened::Opened;
use crate::options::Options;
use crate::pipeline::BUFFERS;
use crate::probe;
use crate::shared::Shared;
use rt_core::{Clock, Device, DeviceError, DeviceInfo, Scene, Tracer};
use rt_gpu::{Card, GpuDevice, Profile, Tuning, fault_of_llvmpipe};
use rt_shaders::Purpose;
use std::sync::Arc;
use wgpu::{Adapter, AdapterInfo, Backends, DeviceType, Instance, InstanceDescriptor, InstanceFlags};

/// A graphics card or software rasteriser.
#[derive(Debug)]
pub struct WgpuDevice {
    profile: Profile,
    shared: Arc<Shared>,
}

impl WgpuDevice {
    /// Opens every device of [`WgpuDevice::adapters`]; in place of one that cannot be used stands the reason.
    ///
    /// # Errors
    /// When there is no device at all.
    pub fn enumerate(options: Options) -> Result<Vec<Result<Self, OpenError>>, OpenError> {
        Ok(Self::adapters()?.iter().map(|adapter| Self::open(adapter, options)).collect())
    }

    /// Every device of the system, none of which is open yet, in the order in which wgpu lists them. Several may have
    /// the same name.
    ///
    /// # Errors
    /// When there is no device at all.
    pub fn adapters() -> Result<Vec<Adapter>, OpenError> {
        let instance = Instance::new(InstanceDescriptor {
            backends: Backends::VULKAN,
            // As in any program with wgpu: WGPU_VALIDATION and WGPU_DEBUG decide, else the build's profile. But objects
            // get no names unless asked for: while other instances come and go, Vulkan's loader (1.3.239) crashes now
            // and then in naming one.
            flags: (InstanceFlags::default() - InstanceFlags::DEBUG).with_env(),
            ..InstanceDescriptor::new_without_display_handle()
        });
        let found = pollster::block_on(instance.enumerate_adapters(Backends::VULKAN));
        if found.is_empty() {
            return Err(OpenError::NoDevice);
        }
        Ok(found)
    }

    /// Opens one device, and no other: of [`WgpuDevice::adapters`], or of an instance of the caller's.
    ///
    /// # Errors
    /// When it cannot be used, with the reason.
    pub fn open(adapter: &Adapter, options: Options) -> Result<Self, OpenError> {
        let said = adapter.get_info();
        Self::check(&said, adapter.limits().max_storage_buffers_per_shader_stage)?;
        let opened = Opened::new(adapter, &said.name)?;
        Self::with(opened, &said, options)
    }

    /// A device that the caller has opened, which draws with it, say. It is shared: launches wait for what was
    /// submitted before them. Whoever asks for it should ask for its adapter's limits, above all for storage buffers
    /// (how many a kernel uses, and how large), and for `TIMESTAMP_QUERY`, without which times are those of the host.
    /// What it calls when it is lost, and on errors that nobody waits for, stays the caller's.
    ///
    /// # Errors
    /// When it cannot be used, with the reason.
    pub fn of(device: wgpu::Device, queue: wgpu::Queue, options: Options) -> Result<Self, OpenError> {
        let said = device.adapter_info();
        Self::check(&said, device.limits().max_storage_buffers_per_shader_stage)?;
        Self::with(Opened::of(device, queue), &said, options)
    }

    /// That kernels can run there.
    fn check(said: &AdapterInfo, buffers: u32) -> Result<(), OpenError> {
        let refuse = |reason: String| Err(OpenError::Refused { name: said.name.clone(), reason });
        if said.driver == "llvmpipe"
            && let Some(fault) = fault_of_llvmpipe(&said.driver_info)
        {
            return refuse(fault);
        }
        if (buffers as usize) < BUFFERS {
            return refuse(format!("its kernels may use {buffers} buffers, and ours need {BUFFERS}"));
        }
        Ok(())
    }

    fn with(opened: Opened, said: &AdapterInfo, options: Options) -> Result<Self, OpenError> {
        let refuse = |reason: String| OpenError::Refused { name: said.name.clone(), reason };
        let card = Card {
            name: said.name.clone(),
            driver: format!("{} {}", said.driver, said.driver_info),
            software: said.device_type == DeviceType::Cpu,
            model: [said.vendor, said.device],
            slot: (!said.device_pci_bus_id.is_empty()).then(|| said.device_pci_bus_id.clone()),
            binding: opened.binding,
            kernels: if options.trusted { "WGSL, trusted" } else { "WGSL, checked" },
        };
        // wgpu does not tell how much memory there is.
        let profile = Profile::new("wgpu", None, card, options.layouts);
        let shared = Shared::new(options, opened);
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

    /// Closes the device under the feet of its tracers: for tests of what they do when a device is lost.
    #[cfg(feature = "test-support")]
    pub fn provoke_loss(&self) {
        self.shared.opened.device.destroy();
    }
}

impl Device for WgpuDevice {
    fn info(&self) -> &DeviceInfo {
        &self.profile.info
    }

    fn tracer(&self, scene: Arc<Scene>, clock: Clock) -> Result<Box<dyn Tracer>, DeviceError> {
        self.profile.tracer(scene, clock, |held| WgpuApi::new(Arc::clone(&self.shared), self.profile.tuning, held))
    }
}

impl GpuDevice for WgpuDevice {
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
