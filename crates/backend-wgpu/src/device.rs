//! Finding and opening devices.

use crate::board::WgpuBoard;
use crate::error::OpenError;
use crate::opened::Opened;
use crate::pipeline::{BUFFERS, Pipeline};
use crate::probe;
use rt_core::{Clock, Device, DeviceError, DeviceInfo, Scene, Tracer};
use rt_gpu::{BadVariable, Card, Faults, GpuDevice, Layouts, Profile, Trials, Tuning, fault_of_llvmpipe};
use rt_shaders::{Kernel, Layout, Purpose};
use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use wgpu::{Adapter, Backends, DeviceType, Instance, InstanceDescriptor, InstanceFlags};

/// How to open devices.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options {
    /// Whether kernels run without wgpu's checks of every access and its bounds on loops. They need none; wgpu does not
    /// know that.
    pub trusted: bool,
    /// The layouts of scenes' trees; `None`: [`Layouts::USUAL`]. Where a scene with both trees does not fit, the two-wide
    /// one alone does all, and [`Tracer::note`] says so, unless tests are to be counted over the wide one.
    pub layouts: Option<Layouts>,
    /// WGSL in place of a kernel's own, for tests that want kernels to fail. Not with `trusted`.
    #[cfg(feature = "test-support")]
    pub kernels: Option<fn(&'static Kernel) -> String>,
    /// What goes wrong on purpose, for tests of this crate and of programs that use it.
    #[cfg(feature = "test-support")]
    pub fault: Option<rt_gpu::FaultInjection>,
}

impl Options {
    /// Trusted kernels if the environment variable `RAYBALANCE_WGPU_TRUSTED` is `1`.
    ///
    /// # Errors
    /// When the variable is neither `1` nor `0` nor empty.
    pub fn from_env() -> Result<Self, BadVariable> {
        Ok(Self { trusted: rt_gpu::switch("RAYBALANCE_WGPU_TRUSTED")?, ..Self::default() })
    }

    fn faults(&self) -> Faults {
        #[cfg(feature = "test-support")]
        return Faults::of(self.fault);
        #[cfg(not(feature = "test-support"))]
        return Faults::default();
    }
}

/// A graphics card or software rasteriser.
#[derive(Debug)]
pub struct WgpuDevice {
    profile: Profile,
    shared: Arc<Shared>,
}

/// What a device's tracers have in common.
#[derive(Debug)]
pub(crate) struct Shared {
    pipelines: Mutex<HashMap<(Layout, Purpose, u32), Arc<Pipeline>>>,
    options: Options,
    /// Whether it makes the host's camera rays, and those that leave surfaces; asked when the first are wanted.
    trials: Trials,
    faults: Faults,
    pub opened: Arc<Opened>,
}

impl WgpuDevice {
    /// Opens every device, in the order in which wgpu lists them; in place of one that cannot be used stands the reason.
    /// Several devices may have the same name.
    ///
    /// # Errors
    /// When there is no device at all.
    pub fn enumerate(options: Options) -> Result<Vec<Result<Self, OpenError>>, OpenError> {
        let instance = Instance::new(InstanceDescriptor {
            backends: Backends::VULKAN,
            // As in any program with wgpu: WGPU_VALIDATION and WGPU_DEBUG decide, else the build's profile. But objects get no
            // names unless asked for: while other instances come and go, Vulkan's loader (1.3.239) crashes now and then in
            // naming one.
            flags: (InstanceFlags::default() - InstanceFlags::DEBUG).with_env(),
            ..InstanceDescriptor::new_without_display_handle()
        });
        let found = pollster::block_on(instance.enumerate_adapters(Backends::VULKAN));
        if found.is_empty() {
            return Err(OpenError::NoDevice);
        }
        Ok(found.iter().map(|adapter| Self::open(adapter, options)).collect())
    }

    fn open(adapter: &Adapter, options: Options) -> Result<Self, OpenError> {
        let said = adapter.get_info();
        let refuse = |reason: String| OpenError::Refused { name: said.name.clone(), reason };
        if said.driver == "llvmpipe"
            && let Some(fault) = fault_of_llvmpipe(&said.driver_info)
        {
            return Err(refuse(fault));
        }
        let buffers = adapter.limits().max_storage_buffers_per_shader_stage;
        if (buffers as usize) < BUFFERS {
            return Err(refuse(format!("its kernels may use {buffers} buffers, and ours need {BUFFERS}")));
        }
        let opened = Opened::new(adapter, &said.name)?;
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
        let shared = Shared {
            pipelines: Mutex::default(),
            options,
            trials: Trials::default(),
            faults: options.faults(),
            opened: Arc::new(opened),
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
        self.profile.tracer(scene, clock, |held| WgpuBoard::new(Arc::clone(&self.shared), self.profile.tuning, held))
    }
}

impl GpuDevice for WgpuDevice {
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

    /// To be called before each launch: at the one that a test has chosen the device is closed under its feet.
    pub(crate) fn count_launch(&self) {
        if self.faults.lose_launch() {
            self.opened.device.destroy();
            // wgpu says so too, but after it has objected to the next call.
            let _ = self.opened.lose("a test closed it");
        }
    }

    /// The kernel for a layout, a purpose and a tree's depth; compiled once.
    pub(crate) fn pipeline(&self, layout: Layout, purpose: Purpose, depth: u32) -> Result<Arc<Pipeline>, DeviceError> {
        let kernel = self.faults.kernel(layout, purpose, depth)?;
        let mut pipelines = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        let key = (kernel.layout, kernel.purpose, kernel.stack);
        if let Some(pipeline) = pipelines.get(&key) {
            return Ok(Arc::clone(pipeline));
        }
        let (source, trusted) = self.source(kernel);
        let pipeline = Arc::new(Pipeline::new(&self.opened, kernel, &source, trusted)?);
        pipelines.insert(key, Arc::clone(&pipeline));
        Ok(pipeline)
    }

    /// A kernel's WGSL, and whether wgpu is to trust it.
    fn source(&self, kernel: &'static Kernel) -> (Cow<'static, str>, bool) {
        #[cfg(feature = "test-support")]
        if let Some(replace) = self.options.kernels {
            return (replace(kernel).into(), false);
        }
        (kernel.wgsl.into(), self.options.trusted)
    }
}
