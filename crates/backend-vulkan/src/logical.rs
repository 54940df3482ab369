//! The opened (Vulkan: logical) device, its queue and its limits.

use crate::error::{OpenError, failed, opening};
use crate::instance::{Abilities, Instance};
use crate::memory::Memory;
use crate::options::Options;
use ash::vk;
use rt_core::{DeviceError, DeviceErrorKind};
use rt_shaders::FloatControls;
use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// What the driver says of a device, as far as we ask.
#[derive(Clone, Debug)]
pub(crate) struct Limits {
    /// Greatest size of a storage buffer as a kernel sees it, in bytes.
    pub binding: u64,
    /// Greatest number of workgroups along each of the first two axes of a dispatch.
    pub groups: [u32; 2],
    /// Greatest number of invocations in a workgroup.
    pub workgroup: u32,
    /// What kernels may ask of arithmetic.
    pub float_controls: FloatControls,
    /// Nanoseconds of one tick of a timestamp.
    pub tick: f64,
    /// Bits of a timestamp that count; 0 where there are none.
    pub timestamp_bits: u32,
}

/// An opened device.
pub(crate) struct Logical {
    instance: Arc<Instance>,
    raw: ash::Device,
    physical: vk::PhysicalDevice,
    pub memory: Arc<Memory>,
    /// Vulkan wants calls on a queue one at a time.
    queue: Mutex<vk::Queue>,
    family: u32,
    pub limits: Limits,
    /// Whether the driver gave the device up, or a test did.
    lost: AtomicBool,
}

impl fmt::Debug for Logical {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Logical")
            .field("physical", &self.physical)
            .field("limits", &self.limits)
            .finish_non_exhaustive()
    }
}

impl Logical {
    /// Opens `physical` with one queue that can compute.
    pub(crate) fn new(
        instance: Arc<Instance>,
        physical: vk::PhysicalDevice,
        options: Options,
    ) -> Result<Self, OpenError> {
        let Abilities { float_controls, knows_budget } = instance.abilities(physical)?;
        let functions = instance.raw();
        // SAFETY: `physical` is of this instance.
        let limits = unsafe { functions.get_physical_device_properties(physical) }.limits;
        // SAFETY: `physical` is of this instance.
        let families = unsafe { functions.get_physical_device_queue_family_properties(physical) };
        let family = families.iter().position(|family| family.queue_flags.contains(vk::QueueFlags::COMPUTE));
        let family = family.ok_or_else(|| OpenError::Refused {
            name: "without a name".to_owned(),
            reason: "it has no queue for computations".to_owned(),
        })?;
        let timestamp_bits = families[family].timestamp_valid_bits;
        let family = family as u32;
        let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];
        let mut timeline = vk::PhysicalDeviceTimelineSemaphoreFeatures::default().timeline_semaphore(true);
        let info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).push_next(&mut timeline);
        // SAFETY: `info` and all it points to live until the call returns; `physical` is of this instance.
        let raw = unsafe { functions.create_device(physical, &info, None) }.map_err(opening("open the device"))?;
        // SAFETY: the family and its queue 0 were asked for above.
        let queue = unsafe { raw.get_device_queue(family, 0) };
        let limits = Limits {
            binding: u64::from(limits.max_storage_buffer_range),
            groups: [limits.max_compute_work_group_count[0], limits.max_compute_work_group_count[1]],
            tick: f64::from(limits.timestamp_period),
            timestamp_bits,
            workgroup: limits.max_compute_work_group_invocations.min(limits.max_compute_work_group_size[0]),
            float_controls,
        };
        let memory = Memory::new(Arc::clone(&instance), physical, options.memory, knows_budget);
        Ok(Self {
            instance,
            raw,
            physical,
            memory: Arc::new(memory),
            queue: Mutex::new(queue),
            family,
            limits,
            lost: AtomicBool::default(),
        })
    }

    pub(crate) const fn raw(&self) -> &ash::Device {
        &self.raw
    }

    /// The family of the queue.
    pub(crate) const fn family(&self) -> u32 {
        self.family
    }

    /// Hands work to the queue.
    pub(crate) fn submit(&self, info: &vk::SubmitInfo<'_>) -> Result<(), DeviceError> {
        self.check_lost("take work")?;
        let queue = self.queue.lock().unwrap_or_else(PoisonError::into_inner);
        // SAFETY: the queue is of this device and locked; callers pass handles of this device that live until the work
        // is done.
        let taken = unsafe { self.raw.queue_submit(*queue, std::slice::from_ref(info), vk::Fence::null()) };
        taken.map_err(|source| self.failed("take work", source))
    }

    /// The error for a call that failed; remembers when the device is lost.
    pub(crate) fn failed(&self, task: &'static str, source: vk::Result) -> DeviceError {
        if source == vk::Result::ERROR_DEVICE_LOST {
            self.lose();
        }
        failed(task)(source)
    }

    /// The error that every call gives once the device is lost.
    pub(crate) fn check_lost(&self, task: &'static str) -> Result<(), DeviceError> {
        let lost = self.lost.load(Ordering::Relaxed);
        if lost { Err(failed(task)(vk::Result::ERROR_DEVICE_LOST)) } else { Ok(()) }
    }

    /// From now on the device counts as lost.
    pub(crate) fn lose(&self) {
        self.lost.store(true, Ordering::Relaxed);
    }

    /// An error if the validation layer had something to say.
    pub(crate) fn check_validation(&self) -> Result<(), DeviceError> {
        let messages = self.instance.take_messages();
        if messages.is_empty() {
            return Ok(());
        }
        let message = format!("Vulkan's validation layer objects: {}", messages.join("; "));
        Err(DeviceError::new(DeviceErrorKind::Lost, message))
    }
}

impl Drop for Logical {
    fn drop(&mut self) {
        // SAFETY: everything made from the device held it and is gone.
        unsafe { self.raw.destroy_device(None) };
    }
}
