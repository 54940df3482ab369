//! Kernels on the device, and the buffers they are given.

use crate::opened::Opened;
use crate::trusted;
use rt_core::{DeviceError, DeviceErrorKind};
use rt_shaders::Kernel;
use std::sync::atomic::{AtomicBool, Ordering};
use wgpu::{
    BindGroup, BindGroupDescriptor, BindGroupEntry, BindGroupLayout, BindGroupLayoutDescriptor, BindGroupLayoutEntry,
    BindingType, Buffer, BufferBindingType, ComputePass, ComputePipeline, ComputePipelineDescriptor, Device,
    PipelineLayoutDescriptor, ShaderModuleDescriptor, ShaderSource, ShaderStages,
};

/// The greatest number of buffers of a kernel.
pub(crate) const BUFFERS: usize = 8;

/// A kernel compiled for the device.
#[derive(Debug)]
pub(crate) struct Pipeline {
    raw: ComputePipeline,
    layout: BindGroupLayout,
    kernel: &'static Kernel,
    /// Whether it ran, or is one that tests want to meet unprepared.
    ran: AtomicBool,
}

impl Pipeline {
    /// Compiles `source`, the kernel's or one in its place.
    pub(crate) fn new(
        opened: &Opened,
        kernel: &'static Kernel,
        source: &str,
        trusted: bool,
    ) -> Result<Self, DeviceError> {
        let task = format!("compile the kernel {:?}", kernel.purpose);
        opened.scoped(&task, DeviceErrorKind::Unsupported, || {
            let device = &opened.device;
            let descriptor =
                ShaderModuleDescriptor { label: kernel.entry.to_str().ok(), source: ShaderSource::Wgsl(source.into()) };
            let module =
                if trusted { trusted::module(device, descriptor) } else { device.create_shader_module(descriptor) };
            let layout = layout(device, kernel);
            let whole = device.create_pipeline_layout(&PipelineLayoutDescriptor {
                label: None,
                bind_group_layouts: &[Some(&layout)],
                immediate_size: 0,
            });
            let raw = device.create_compute_pipeline(&ComputePipelineDescriptor {
                label: kernel.entry.to_str().ok(),
                layout: Some(&whole),
                module: &module,
                // The only one of the module.
                entry_point: None,
                compilation_options: wgpu::PipelineCompilationOptions {
                    zero_initialize_workgroup_memory: false,
                    ..Default::default()
                },
                cache: None,
            });
            Self { raw, layout, kernel, ran: AtomicBool::new(kernel.purpose.is_faulty()) }
        })
    }

    /// Whether it never ran, which it is to do now: asked again, no.
    pub(crate) fn is_to_warm_up(&self) -> bool {
        !self.ran.swap(true, Ordering::Relaxed)
    }

    /// A choice of buffers, by number of their binding; those that the kernel does not use are ignored.
    pub(crate) fn bind(&self, device: &Device, buffers: [&Buffer; BUFFERS]) -> BindGroup {
        let numbers = self.kernel.bindings.iter().map(|binding| binding.binding);
        let entries: Vec<_> = numbers
            .filter_map(|binding| {
                Some(BindGroupEntry { binding, resource: buffers.get(binding as usize)?.as_entire_binding() })
            })
            .collect();
        device.create_bind_group(&BindGroupDescriptor { label: None, layout: &self.layout, entries: &entries })
    }

    /// Runs the kernel for at least `items` invocations.
    pub(crate) fn run(&self, opened: &Opened, pass: &mut ComputePass<'_>, bindings: &BindGroup, items: u32) {
        let groups = items.div_ceil(self.kernel.workgroup.iter().product());
        let x = groups.min(opened.groups).max(1);
        pass.set_pipeline(&self.raw);
        pass.set_bind_group(0, bindings, &[]);
        pass.dispatch_workgroups(x, groups.div_ceil(x), 1);
    }
}

fn layout(device: &Device, kernel: &Kernel) -> BindGroupLayout {
    let entry = |binding: &rt_shaders::Binding| BindGroupLayoutEntry {
        binding: binding.binding,
        visibility: ShaderStages::COMPUTE,
        ty: BindingType::Buffer {
            ty: BufferBindingType::Storage { read_only: !binding.written },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    };
    let entries: Vec<_> = kernel.bindings.iter().map(entry).collect();
    device.create_bind_group_layout(&BindGroupLayoutDescriptor { label: None, entries: &entries })
}
