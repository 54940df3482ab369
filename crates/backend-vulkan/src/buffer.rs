//! Buffers, each with memory of its own.

use crate::error::failed;
use crate::logical::Logical;
use crate::memory::{Claim, does_not_fit};
use ash::vk;
use bytemuck::{AnyBitPattern, NoUninit};
use rt_core::{DeviceError, DeviceErrorKind};
use std::fmt;
use std::ptr::NonNull;
use std::sync::Arc;

/// What a buffer is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Use {
    /// Kernels read and write it.
    Kernel,
    /// The host writes it and the device copies from it.
    Upload,
    /// The device copies to it and the host reads it.
    Download,
}

impl Use {
    const fn usage(self) -> vk::BufferUsageFlags {
        match self {
            Self::Kernel => vk::BufferUsageFlags::from_raw(
                vk::BufferUsageFlags::STORAGE_BUFFER.as_raw()
                    | vk::BufferUsageFlags::TRANSFER_SRC.as_raw()
                    | vk::BufferUsageFlags::TRANSFER_DST.as_raw(),
            ),
            Self::Upload => vk::BufferUsageFlags::TRANSFER_SRC,
            Self::Download => vk::BufferUsageFlags::TRANSFER_DST,
        }
    }

    /// Memory, the best first. Coherent, so that nothing need be flushed; cached where the host reads.
    fn wishes(self) -> Vec<vk::MemoryPropertyFlags> {
        let shared = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        match self {
            Self::Kernel => vec![vk::MemoryPropertyFlags::DEVICE_LOCAL, vk::MemoryPropertyFlags::empty()],
            Self::Upload => vec![shared],
            Self::Download => vec![shared | vk::MemoryPropertyFlags::HOST_CACHED, shared],
        }
    }
}

/// A buffer.
pub(crate) struct Buffer {
    logical: Arc<Logical>,
    raw: vk::Buffer,
    memory: vk::DeviceMemory,
    size: u64,
    /// Where the host sees it.
    mapped: Option<NonNull<u8>>,
    /// Given back after the memory itself, which `Drop` frees.
    claim: Option<Claim>,
}

// SAFETY: `mapped` points to memory that this buffer alone owns, whichever thread that is on.
unsafe impl Send for Buffer {}
// SAFETY: through `&self` the memory at `mapped` is only read; writing takes `&mut self`.
unsafe impl Sync for Buffer {}

impl fmt::Debug for Buffer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Buffer").field("size", &self.size).finish_non_exhaustive()
    }
}

impl Buffer {
    /// A buffer of `size` bytes, or of one word if that is 0; `what` names it in errors.
    pub(crate) fn new(logical: &Arc<Logical>, what: &str, size: u64, purpose: Use) -> Result<Self, DeviceError> {
        let size = size.max(4);
        if purpose == Use::Kernel && size > logical.limits.binding {
            return Err(DeviceError::new(
                DeviceErrorKind::OutOfMemory,
                format!("{what} of {size} bytes: the device binds at most {} at once", logical.limits.binding),
            ));
        }
        let info = vk::BufferCreateInfo::default().size(size).usage(purpose.usage());
        // SAFETY: the device is alive and `info` is complete.
        let raw = unsafe { logical.raw().create_buffer(&info, None) }.map_err(failed("create a buffer"))?;
        // From here on dropping it cleans up; null memory may be freed.
        let mut buffer = Self {
            logical: Arc::clone(logical),
            raw,
            memory: vk::DeviceMemory::null(),
            size,
            mapped: None,
            claim: None,
        };
        // SAFETY: the buffer is of this device.
        let needs = unsafe { logical.raw().get_buffer_memory_requirements(raw) };
        let memory_type = logical.memory.kind(needs.memory_type_bits, &purpose.wishes()).ok_or_else(|| {
            DeviceError::new(DeviceErrorKind::Unsupported, format!("the device has no memory for {what}"))
        })?;
        buffer.claim = Some(logical.memory.claim(what, needs.size, memory_type)?);
        let info = vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(memory_type);
        // SAFETY: the memory type is one that the device named.
        buffer.memory = unsafe { logical.raw().allocate_memory(&info, None) }
            .map_err(|source| does_not_fit(what, needs.size, logical.memory.left(memory_type)).with_source(source))?;
        // SAFETY: both are of this device, new, and the memory is as large as was asked for.
        unsafe { logical.raw().bind_buffer_memory(raw, buffer.memory, 0) }.map_err(failed("bind memory"))?;
        if purpose != Use::Kernel {
            let (device, memory, all) = (logical.raw(), buffer.memory, vk::WHOLE_SIZE);
            // SAFETY: the memory is visible to the host and not mapped yet.
            let pointer = unsafe { device.map_memory(memory, 0, all, vk::MemoryMapFlags::empty()) };
            buffer.mapped = NonNull::new(pointer.map_err(failed("map memory"))?.cast());
        }
        Ok(buffer)
    }

    pub(crate) const fn raw(&self) -> vk::Buffer {
        self.raw
    }

    /// Bytes.
    pub(crate) const fn size(&self) -> u64 {
        self.size
    }

    /// Writes `values` at the start of an upload buffer, after `skip` bytes.
    ///
    /// # Panics
    /// When they do not fit, or the buffer is no upload buffer.
    pub(crate) fn write<T: NoUninit>(&mut self, skip: usize, values: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        let end = skip.saturating_add(bytes.len());
        assert!(end as u64 <= self.size, "{end} bytes into a buffer of {}", self.size);
        let mapped = self.mapped.expect("upload buffers are mapped");
        // SAFETY: within the mapped memory, checked above.
        let target = unsafe { mapped.as_ptr().add(skip) };
        // SAFETY: `end − skip` bytes at both places, which cannot overlap: mapped memory is reached through this buffer
        // alone. The device does not read it: callers write between launches.
        unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), target, bytes.len()) };
    }

    /// The first `count` values of a download buffer.
    ///
    /// # Panics
    /// When there are fewer, or the buffer is no download buffer.
    pub(crate) fn read<T: AnyBitPattern>(&self, count: usize) -> &[T] {
        let bytes = count.saturating_mul(size_of::<T>());
        assert!(bytes as u64 <= self.size, "{bytes} bytes of a buffer of {}", self.size);
        let mapped = self.mapped.expect("download buffers are mapped");
        assert!(mapped.cast::<T>().is_aligned(), "memory is mapped at multiples of 64 bytes");
        // SAFETY: mapped, long enough and aligned, checked above; any bits are a `T`. The device does not write it:
        // callers read after they waited for the launch.
        unsafe { std::slice::from_raw_parts(mapped.as_ptr().cast::<T>(), count) }
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        let device = self.logical.raw();
        // SAFETY: callers wait for launches that use it, so the device does not; it is not used after.
        unsafe { device.destroy_buffer(self.raw, None) };
        // SAFETY: the buffer bound to it is gone, and `mapped`, which this unmaps, is not used after.
        unsafe { device.free_memory(self.memory, None) };
    }
}
