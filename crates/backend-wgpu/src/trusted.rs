//! Kernels without wgpu's checks.

use wgpu::{Device, ShaderModule, ShaderModuleDescriptor, ShaderRuntimeChecks};

/// Compiles one of the kernels of `rt_shaders` without checks of its accesses and without bounds on its loops.
pub(crate) fn module(device: &Device, kernel: ShaderModuleDescriptor<'_>) -> ShaderModule {
    // SAFETY: the kernels index buffers only by what `rt_core::Scene` was checked for when it was made, by rays that
    // `GpuTracer` checked, and by their own item below the number of items; the stack is as deep as the scene asks.
    // Loops end: every step visits another node of a finite tree.
    unsafe { device.create_shader_module_trusted(kernel, ShaderRuntimeChecks::unchecked()) }
}
