//! The opened (Vulkan: logical) device, its queue and its limits.

use crate::error::{OpenError, failed, opening};
use crate::instance::Instance;
use ash::vk;
use rt_core::{DeviceError, DeviceErrorKind};
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

/// What the driver says of a device, as far as we ask.
#[derive(Clone, Debug)]
pub(crate) struct Limits {
    /// Greatest size of a storage buffer as a kernel sees it, in bytes.
    pub binding: u64,
    /// Greatest number of workgroups along each of the first two axes of a dispatch.
    pub groups: [u32; 2],
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
    memory: vk::PhysicalDeviceMemoryProperties,
    /// Vulkan wants calls on a queue one at a time.
    queue: Mutex<vk::Queue>,
    family: u32,
    pub limits: Limits,
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
    pub(crate) fn new(instance: Arc<Instance>, physical: vk::PhysicalDevice) -> Result<Self, OpenError> {
        let functions = instance.raw();
        // SAFETY: `physical` is of this instance.
        let limits = unsafe { functions.get_physical_device_properties(physical) }.limits;
        // SAFETY: likewise.
        let memory = unsafe { functions.get_physical_device_memory_properties(physical) };
        // SAFETY: likewise.
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
        };
        Ok(Self { instance, raw, physical, memory, queue: Mutex::new(queue), family, limits })
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
        let queue = self.queue.lock().unwrap_or_else(PoisonError::into_inner);
        // SAFETY: the queue is of this device and locked; callers pass handles of this device that live until the work
        // is done.
        unsafe { self.raw.queue_submit(*queue, std::slice::from_ref(info), vk::Fence::null()) }
            .map_err(failed("take work"))
    }

    /// The first memory type among `allowed` (a bit each) with all of the first properties that some type has all of.
    pub(crate) fn memory_type(&self, allowed: u32, wishes: &[vk::MemoryPropertyFlags]) -> Option<u32> {
        let types = self.memory.memory_types_as_slice();
        let fits = |wish: vk::MemoryPropertyFlags| {
            (0..types.len())
                .find(|&i| allowed >> i & 1 == 1 && types[i].property_flags.contains(wish))
                .and_then(|i| u32::try_from(i).ok())
        };
        wishes.iter().find_map(|&wish| fits(wish))
    }

    /// Bytes of the heap of a memory type.
    pub(crate) fn heap_size(&self, memory_type: u32) -> u64 {
        let heap = self.memory.memory_types_as_slice().get(memory_type as usize).map_or(0, |t| t.heap_index);
        self.memory.memory_heaps_as_slice().get(heap as usize).map_or(0, |heap| heap.size)
    }

    /// Bytes of the largest heap of the device's own memory.
    pub(crate) fn memory(&self) -> Option<u64> {
        let heaps = self.memory.memory_heaps_as_slice().iter();
        heaps.filter(|h| h.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL)).map(|h| h.size).max()
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
