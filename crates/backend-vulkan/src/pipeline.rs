//! Kernels on the device, and the buffers they are given.

use crate::buffer::Buffer;
use crate::error::failed;
use crate::logical::Logical;
use ash::vk;
use rt_core::{DeviceError, DeviceErrorKind};
use rt_shaders::Kernel;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Number of buffers of every kernel, bound in their order.
pub(crate) const BUFFERS: usize = 8;

/// What all kernels have in common: eight storage buffers in set 0.
pub(crate) struct Layout {
    logical: Arc<Logical>,
    set: vk::DescriptorSetLayout,
    pipeline: vk::PipelineLayout,
}

impl fmt::Debug for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Layout").finish_non_exhaustive()
    }
}

impl Layout {
    pub(crate) fn new(logical: &Arc<Logical>) -> Result<Self, DeviceError> {
        let device = logical.raw();
        let bindings: [_; BUFFERS] = std::array::from_fn(|i| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(i as u32)
                .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                .descriptor_count(1)
                .stage_flags(vk::ShaderStageFlags::COMPUTE)
        });
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: the device is alive and `info` complete.
        let set = unsafe { device.create_descriptor_set_layout(&info, None) };
        let set = set.map_err(failed("lay out the buffers of kernels"))?;
        // From here on dropping it cleans up; a null layout may be destroyed.
        let mut layout = Self { logical: Arc::clone(logical), set, pipeline: vk::PipelineLayout::null() };
        let sets = [set];
        let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets);
        // SAFETY: the device is alive, `set` is of it, and `info` is complete.
        layout.pipeline = unsafe { device.create_pipeline_layout(&info, None) }.map_err(failed("lay out kernels"))?;
        Ok(layout)
    }
}

impl Drop for Layout {
    fn drop(&mut self) {
        // SAFETY: pipelines and sets made from it hold it and are gone.
        unsafe { self.logical.raw().destroy_pipeline_layout(self.pipeline, None) };
        // SAFETY: the sets of this layout and the pipeline layout made from it are gone.
        unsafe { self.logical.raw().destroy_descriptor_set_layout(self.set, None) };
    }
}

/// A kernel compiled for the device.
pub(crate) struct Pipeline {
    layout: Arc<Layout>,
    raw: vk::Pipeline,
    workgroup: u32,
    tree: rt_shaders::Layout,
    /// Whether it ran, or is one that tests want to meet unprepared.
    ran: AtomicBool,
}

impl fmt::Debug for Pipeline {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Pipeline").field("workgroup", &self.workgroup).finish_non_exhaustive()
    }
}

impl Pipeline {
    /// Compiles `code`, the kernel's or one in its place.
    pub(crate) fn new(layout: &Arc<Layout>, kernel: &Kernel, code: &[u32]) -> Result<Self, DeviceError> {
        let device = layout.logical.raw();
        let refused = |source: vk::Result| {
            let kind = match source {
                vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY => {
                    DeviceErrorKind::OutOfMemory
                }
                vk::Result::ERROR_DEVICE_LOST => DeviceErrorKind::Lost,
                _ => DeviceErrorKind::Unsupported,
            };
            let what = format!("the Vulkan driver cannot compile the kernel {:?}: {source}", kernel.purpose);
            DeviceError::new(kind, what).with_source(source)
        };
        let (workgroup, most) = (kernel.workgroup.iter().product(), layout.logical.limits.workgroup);
        if workgroup > most {
            // Drivers need not notice.
            let what =
                format!("the kernel {:?} has workgroups of {workgroup}, and the device takes {most}", kernel.purpose);
            return Err(DeviceError::new(DeviceErrorKind::Unsupported, what));
        }
        let info = vk::ShaderModuleCreateInfo::default().code(code);
        // SAFETY: the code is valid SPIR-V and asks for nothing that the device lacks: it is what naga made of the
        // kernel, or the maker of a `Replacement` vouched for it.
        let module = unsafe { device.create_shader_module(&info, None) }.map_err(refused)?;
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module)
            .name(kernel.entry);
        let info = vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout.pipeline);
        // SAFETY: module, entry point and layout fit each other.
        let made = unsafe { device.create_compute_pipelines(vk::PipelineCache::null(), &[info], None) };
        // SAFETY: a pipeline does not need its module once it is made.
        unsafe { device.destroy_shader_module(module, None) };
        let raw = match made {
            Ok(pipelines) => pipelines[0],
            Err((_, source)) => return Err(refused(source)),
        };
        let ran = AtomicBool::new(kernel.purpose.is_faulty());
        Ok(Self { layout: Arc::clone(layout), raw, workgroup, tree: kernel.layout, ran })
    }

    pub(crate) const fn raw(&self) -> vk::Pipeline {
        self.raw
    }

    pub(crate) fn layout(&self) -> vk::PipelineLayout {
        self.layout.pipeline
    }

    /// The layout of the tree it walks.
    pub(crate) const fn tree(&self) -> rt_shaders::Layout {
        self.tree
    }

    /// Whether it never ran, which it is to do now: asked again, no.
    pub(crate) fn is_to_warm_up(&self) -> bool {
        !self.ran.swap(true, Ordering::Relaxed)
    }

    /// Invocations in a workgroup.
    pub(crate) const fn workgroup(&self) -> u32 {
        self.workgroup
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        // SAFETY: tracers that run it hold it until their launches are done.
        unsafe { self.layout.logical.raw().destroy_pipeline(self.raw, None) };
    }
}

/// A choice of buffers for a kernel (Vulkan: a descriptor set with a pool of its own).
pub(crate) struct Bindings {
    layout: Arc<Layout>,
    pool: vk::DescriptorPool,
    set: vk::DescriptorSet,
}

impl fmt::Debug for Bindings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Bindings").finish_non_exhaustive()
    }
}

impl Bindings {
    pub(crate) fn new(layout: &Arc<Layout>) -> Result<Self, DeviceError> {
        let device = layout.logical.raw();
        let sizes =
            [vk::DescriptorPoolSize::default().ty(vk::DescriptorType::STORAGE_BUFFER).descriptor_count(BUFFERS as u32)];
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        // SAFETY: the device is alive and `info` complete.
        let pool = unsafe { device.create_descriptor_pool(&info, None) }.map_err(failed("create a descriptor pool"))?;
        // From here on dropping it cleans up.
        let mut bindings = Self { layout: Arc::clone(layout), pool, set: vk::DescriptorSet::null() };
        let layouts = [layout.set];
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        // SAFETY: the pool has room for one set and nobody else uses it.
        let sets = unsafe { device.allocate_descriptor_sets(&info) }.map_err(failed("create a descriptor set"))?;
        bindings.set = sets[0];
        Ok(bindings)
    }

    /// Chooses the buffers. No launch that uses the bindings may be in flight.
    pub(crate) fn choose(&mut self, buffers: [&Buffer; BUFFERS]) {
        let infos = buffers
            .map(|buffer| [vk::DescriptorBufferInfo::default().buffer(buffer.raw()).offset(0).range(vk::WHOLE_SIZE)]);
        let writes: [_; BUFFERS] = std::array::from_fn(|i| {
            vk::WriteDescriptorSet::default()
                .dst_set(self.set)
                .dst_binding(i as u32)
                .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                .buffer_info(&infos[i])
        });
        // SAFETY: set and buffers are of this device, the set is not in use (the caller waited).
        unsafe { self.layout.logical.raw().update_descriptor_sets(&writes, &[]) };
    }

    pub(crate) const fn raw(&self) -> vk::DescriptorSet {
        self.set
    }
}

impl Drop for Bindings {
    fn drop(&mut self) {
        // SAFETY: the tracer waited for its launches; frees the set as well.
        unsafe { self.layout.logical.raw().destroy_descriptor_pool(self.pool, None) };
    }
}
