//! A command buffer with a pool of its own, and two timestamps.

use crate::buffer::Buffer;
use crate::error::failed;
use crate::logical::Logical;
use crate::pipeline::{Bindings, Pipeline};
use ash::vk;
use rt_core::DeviceError;
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

/// One command buffer, recorded anew for each launch.
pub(crate) struct Commands {
    logical: Arc<Logical>,
    pool: vk::CommandPool,
    buffer: vk::CommandBuffer,
    /// Null where the device has no timestamps.
    queries: vk::QueryPool,
}

impl fmt::Debug for Commands {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Commands").finish_non_exhaustive()
    }
}

impl Commands {
    pub(crate) fn new(logical: &Arc<Logical>) -> Result<Self, DeviceError> {
        let device = logical.raw();
        let info = vk::CommandPoolCreateInfo::default().queue_family_index(logical.family());
        // SAFETY: the device is alive and has that family.
        let pool = unsafe { device.create_command_pool(&info, None) }.map_err(failed("create a command pool"))?;
        // From here on dropping it cleans up; a null query pool may be destroyed.
        let mut commands = Self {
            logical: Arc::clone(logical),
            pool,
            buffer: vk::CommandBuffer::null(),
            queries: vk::QueryPool::null(),
        };
        let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        // SAFETY: the pool is of this device and used by nobody else.
        let buffers = unsafe { device.allocate_command_buffers(&info) }.map_err(failed("create a command buffer"))?;
        commands.buffer = buffers[0];
        if logical.limits.timestamp_bits > 0 {
            let info = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(2);
            // SAFETY: the device is alive.
            commands.queries = unsafe { device.create_query_pool(&info, None) }.map_err(failed("create timestamps"))?;
        }
        Ok(commands)
    }

    pub(crate) const fn raw(&self) -> vk::CommandBuffer {
        self.buffer
    }

    /// Records what `steps` says, in place of what was there. The caller has waited for the last launch, and keeps all
    /// that the steps name until the next is done.
    pub(crate) fn record(&mut self, steps: impl FnOnce(&Recorder<'_>)) -> Result<(), DeviceError> {
        let device = self.logical.raw();
        // SAFETY: the last launch is done, so nothing of the pool is in use.
        unsafe { device.reset_command_pool(self.pool, vk::CommandPoolResetFlags::empty()) }
            .map_err(failed("reset commands"))?;
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the buffer was reset with its pool.
        unsafe { device.begin_command_buffer(self.buffer, &info) }.map_err(failed("begin commands"))?;
        if self.queries != vk::QueryPool::null() {
            // SAFETY: two queries of a pool of this device, not in use.
            unsafe { device.cmd_reset_query_pool(self.buffer, self.queries, 0, 2) };
        }
        steps(&Recorder(self));
        // SAFETY: it was begun above.
        unsafe { device.end_command_buffer(self.buffer) }.map_err(failed("end commands"))
    }

    /// Time between the two timestamps of the last launch, which must be done; `None` where the device has none.
    pub(crate) fn elapsed(&self) -> Option<Duration> {
        if self.queries == vk::QueryPool::null() {
            return None;
        }
        let mut ticks = [0_u64; 2];
        // SAFETY: both queries were written by the launch, which is done.
        let got = unsafe {
            self.logical.raw().get_query_pool_results(self.queries, 0, &mut ticks, vk::QueryResultFlags::TYPE_64)
        };
        got.ok()?;
        let limits = &self.logical.limits;
        // Counters wrap around at their number of bits.
        let mask = u64::MAX >> (64 - limits.timestamp_bits.clamp(1, 64));
        let passed = ticks[1].wrapping_sub(ticks[0]) & mask;
        Some(Duration::from_nanos((passed as f64 * limits.tick) as u64))
    }
}

impl Drop for Commands {
    fn drop(&mut self) {
        let device = self.logical.raw();
        // SAFETY: callers wait for their launches; not used after.
        unsafe { device.destroy_query_pool(self.queries, None) };
        // SAFETY: no launch is under way (above), so the command buffer, which goes with its pool, is not in use.
        unsafe { device.destroy_command_pool(self.pool, None) };
    }
}

/// Commands being recorded.
#[derive(Debug)]
pub(crate) struct Recorder<'a>(&'a Commands);

impl Recorder<'_> {
    /// Copies the first `size` bytes of `from` to `to` from byte `offset` on.
    pub(crate) fn copy(&self, from: &Buffer, to: &Buffer, offset: u64, size: u64) {
        debug_assert!(size <= from.size() && offset + size <= to.size());
        let region = vk::BufferCopy::default().dst_offset(offset).size(size);
        // SAFETY: being recorded; both buffers are of this device, made for this, and as large.
        unsafe { self.0.logical.raw().cmd_copy_buffer(self.0.buffer, from.raw(), to.raw(), &[region]) };
    }

    /// What `before` wrote or read is done and seen when `after` begins.
    pub(crate) fn barrier(&self, before: Stage, after: Stage) {
        let barrier = vk::MemoryBarrier::default().src_access_mask(before.access()).dst_access_mask(after.access());
        // SAFETY: being recorded, outside any render pass.
        unsafe {
            self.0.logical.raw().cmd_pipeline_barrier(
                self.0.buffer,
                before.stage(),
                after.stage(),
                vk::DependencyFlags::empty(),
                &[barrier],
                &[],
                &[],
            );
        };
    }

    /// Writes timestamp 0 or 1 when all kernels so far are done.
    pub(crate) fn stamp(&self, index: u32) {
        if self.0.queries != vk::QueryPool::null() {
            // SAFETY: being recorded; the pool has two queries, both reset.
            unsafe {
                self.0.logical.raw().cmd_write_timestamp(
                    self.0.buffer,
                    vk::PipelineStageFlags::COMPUTE_SHADER,
                    self.0.queries,
                    index,
                );
            };
        }
    }

    /// Runs a kernel for at least `items` invocations.
    pub(crate) fn run(&self, pipeline: &Pipeline, bindings: &Bindings, items: u32) {
        let device = self.0.logical.raw();
        let compute = vk::PipelineBindPoint::COMPUTE;
        let groups = items.div_ceil(pipeline.workgroup());
        let x = groups.min(self.0.logical.limits.groups[0]).max(1);
        // SAFETY: being recorded; the pipeline is of this device.
        unsafe { device.cmd_bind_pipeline(self.0.buffer, compute, pipeline.raw()) };
        // SAFETY: being recorded; the set is of this device and of the layout of the pipeline.
        unsafe {
            device.cmd_bind_descriptor_sets(self.0.buffer, compute, pipeline.layout(), 0, &[bindings.raw()], &[]);
        };
        // SAFETY: being recorded, all that the pipeline needs is bound; within limits: 2³² rays make fewer groups than
        // the least that a device must allow on two axes.
        unsafe { device.cmd_dispatch(self.0.buffer, x, groups.div_ceil(x), 1) };
    }
}

/// Who reads or writes memory.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Stage {
    Copy,
    Kernel,
    Host,
}

impl Stage {
    const fn stage(self) -> vk::PipelineStageFlags {
        match self {
            Self::Copy => vk::PipelineStageFlags::TRANSFER,
            Self::Kernel => vk::PipelineStageFlags::COMPUTE_SHADER,
            Self::Host => vk::PipelineStageFlags::HOST,
        }
    }

    fn access(self) -> vk::AccessFlags {
        match self {
            Self::Copy => vk::AccessFlags::TRANSFER_READ | vk::AccessFlags::TRANSFER_WRITE,
            Self::Kernel => vk::AccessFlags::SHADER_READ | vk::AccessFlags::SHADER_WRITE,
            Self::Host => vk::AccessFlags::HOST_READ,
        }
    }
}
