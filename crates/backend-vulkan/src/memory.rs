//! The device's memory: which kinds there are, and how much of it buffers may still take.

use crate::instance::Instance;
use ash::vk;
use rt_core::{DeviceError, DeviceErrorKind};
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

/// Kinds of memory, and an account of what our buffers take of the device's own.
pub(crate) struct Memory {
    instance: Arc<Instance>,
    physical: vk::PhysicalDevice,
    kinds: vk::PhysicalDeviceMemoryProperties,
    /// Whether the driver says what other programs leave (`VK_EXT_memory_budget`).
    knows_budget: bool,
    /// Most bytes of the device's own memory that buffers may take together, by the caller's wish.
    limit: Option<u64>,
    /// Bytes that buffers take of the device's own memory. A lock, so that two threads cannot both take the last byte.
    taken: Mutex<u64>,
}

impl fmt::Debug for Memory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Memory").field("limit", &self.limit).field("taken", &self.taken).finish_non_exhaustive()
    }
}

/// A buffer's part of the account, given back when it is dropped.
#[derive(Debug)]
pub(crate) struct Claim {
    memory: Arc<Memory>,
    bytes: u64,
}

impl Memory {
    pub(crate) fn new(
        instance: Arc<Instance>,
        physical: vk::PhysicalDevice,
        limit: Option<u64>,
        knows_budget: bool,
    ) -> Self {
        // SAFETY: `physical` is of this instance.
        let kinds = unsafe { instance.raw().get_physical_device_memory_properties(physical) };
        Self { instance, physical, kinds, knows_budget, limit, taken: Mutex::default() }
    }

    /// The first kind of memory among `allowed` (a bit each) with all of the first properties that some kind has all
    /// of.
    pub(crate) fn kind(&self, allowed: u32, wishes: &[vk::MemoryPropertyFlags]) -> Option<u32> {
        let kinds = self.kinds.memory_types_as_slice();
        let fits = |wish: vk::MemoryPropertyFlags| {
            (0..kinds.len())
                .find(|&i| allowed >> i & 1 == 1 && kinds[i].property_flags.contains(wish))
                .and_then(|i| u32::try_from(i).ok())
        };
        wishes.iter().find_map(|&wish| fits(wish))
    }

    /// Bytes of the device's own memory that buffers may take, where it has such.
    pub(crate) fn size(&self) -> Option<u64> {
        let (_, heap) = self.own()?;
        Some(self.limit.map_or(heap.size, |limit| limit.min(heap.size)))
    }

    /// An error if `bytes` more do not fit into the device's own memory; `what` names them.
    pub(crate) fn check(&self, what: &str, bytes: u64) -> Result<(), DeviceError> {
        let Some((heap, _)) = self.own() else { return Ok(()) };
        self.fits(what, bytes, heap, *self.taken.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Takes `bytes` of a kind of memory for the buffer called `what`.
    pub(crate) fn claim(self: &Arc<Self>, what: &str, bytes: u64, kind: u32) -> Result<Claim, DeviceError> {
        let heap = self.kinds.memory_types_as_slice().get(kind as usize).map_or(0, |kind| kind.heap_index as usize);
        let mut taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
        self.fits(what, bytes, heap, *taken)?;
        // The host's memory is not on this account.
        let bytes = if self.is_own(heap) { bytes } else { 0 };
        *taken += bytes;
        drop(taken);
        Ok(Claim { memory: Arc::clone(self), bytes })
    }

    /// Bytes of a heap that buffers may still take.
    pub(crate) fn left(&self, kind: u32) -> u64 {
        let heap = self.kinds.memory_types_as_slice().get(kind as usize).map_or(0, |kind| kind.heap_index as usize);
        self.left_of(heap, *self.taken.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn fits(&self, what: &str, bytes: u64, heap: usize, taken: u64) -> Result<(), DeviceError> {
        let left = self.left_of(heap, taken);
        if bytes <= left { Ok(()) } else { Err(does_not_fit(what, bytes, left)) }
    }

    fn left_of(&self, heap: usize, taken: u64) -> u64 {
        let size = self.kinds.memory_heaps_as_slice().get(heap).map_or(0, |heap| heap.size);
        let left = match self.budget(heap) {
            Some((budget, usage)) => budget.saturating_sub(usage),
            None if self.is_own(heap) => size.saturating_sub(taken),
            None => size,
        };
        match self.limit {
            Some(limit) if self.is_own(heap) => left.min(limit.saturating_sub(taken)),
            _ => left,
        }
    }

    /// What the driver grants this process of a heap, and what the process uses of it already, in bytes.
    fn budget(&self, heap: usize) -> Option<(u64, u64)> {
        if !self.knows_budget {
            return None;
        }
        let mut budget = vk::PhysicalDeviceMemoryBudgetPropertiesEXT::default();
        let mut properties = vk::PhysicalDeviceMemoryProperties2::default().push_next(&mut budget);
        // SAFETY: `physical` is of this instance and knows the extension, whose structure the call fills.
        unsafe { self.instance.raw().get_physical_device_memory_properties2(self.physical, &mut properties) };
        // A driver that says 0 does not know.
        let granted = *budget.heap_budget.get(heap)?;
        (granted > 0).then_some((granted, *budget.heap_usage.get(heap)?))
    }

    /// The largest heap of the device's own memory.
    fn own(&self) -> Option<(usize, vk::MemoryHeap)> {
        let heaps = self.kinds.memory_heaps_as_slice().iter().copied().enumerate();
        heaps.filter(|(heap, _)| self.is_own(*heap)).max_by_key(|(_, heap)| heap.size)
    }

    fn is_own(&self, heap: usize) -> bool {
        let heap = self.kinds.memory_heaps_as_slice().get(heap);
        heap.is_some_and(|heap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL))
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        *self.memory.taken.lock().unwrap_or_else(PoisonError::into_inner) -= self.bytes;
    }
}

/// What is too large, and for what.
pub(crate) fn does_not_fit(what: &str, needed: u64, available: u64) -> DeviceError {
    DeviceError::new(
        DeviceErrorKind::OutOfMemory,
        format!("{what} of {needed} bytes does not fit into {available} bytes of device memory"),
    )
}
