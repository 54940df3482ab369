//! The driver's own ray tracing: its acceleration structure, asked by `VK_KHR_ray_query` from a compute kernel.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use rt_core::{Query, RaySource};
use rt_scene::Model;
use std::error::Error;
use std::time::{Duration, Instant};
use wgpu::util::{BufferInitDescriptor, DeviceExt};
use wgpu::{
    AccelerationStructureFlags, AccelerationStructureGeometryFlags, AccelerationStructureUpdateMode as Update,
    Backends, BindGroup, BlasBuildEntry, BlasGeometries, BlasGeometrySizeDescriptors, BlasTriangleGeometry,
    BlasTriangleGeometrySizeDescriptor, Buffer, BufferUsages, CommandEncoderDescriptor, ComputePassTimestampWrites,
    ComputePipeline, ExperimentalFeatures, Features, PollType, QueryType, Tlas, TlasInstance,
};

/// The longest a launch may take; a software rasteriser on a loaded machine is slow.
const LIMIT: Duration = Duration::from_secs(300);

/// Bits of a ray query: no kernel decides on hits; the first hit ends the ray.
const OPAQUE: u32 = 1;
const FIRST: u32 = 4;

/// Where rays of bounces begin, as a share of the scene's largest coordinate: what renderers do, for nothing else keeps
/// the driver from hitting the triangle that a ray leaves.
const LEAST_T: f32 = 1.0 / (1 << 16) as f32;

/// Distance of rays without end: that of ray queries must be finite.
const MOST_T: f32 = 1e30;

/// Lanes of a workgroup, as the kernel says.
const LANES: u32 = 64;

/// A ray as the kernel reads it.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct PeerRay {
    origin: Vec3,
    tmin: f32,
    direction: Vec3,
    tmax: f32,
}

/// A device opened for ray queries.
pub(crate) struct Peer {
    pub(crate) name: String,
    /// PCI's numbers of its maker and its model.
    pub(crate) model: [u32; 2],
    device: wgpu::Device,
    queue: wgpu::Queue,
    /// The kernel for the nearest hit, and for any.
    kernels: [ComputePipeline; 2],
    /// Lanes along the first axis of a dispatch.
    row: u32,
}

/// A scene as the driver holds it.
pub(crate) struct Tree {
    scene: Tlas,
    least_t: f32,
    /// Seconds from the upload to the end of the build.
    pub(crate) built_s: f64,
}

/// Rays on the device, and room for what they hit.
pub(crate) struct Loaded {
    bindings: BindGroup,
    found: Buffer,
    count: u32,
    query: Query,
}

/// What a launch found.
pub(crate) struct Answer {
    /// Seconds in the kernel by the device's clock.
    pub(crate) seconds: f64,
    /// For each ray the primitive that it hits, or [`u32::MAX`].
    pub(crate) found: Vec<u32>,
}

impl Peer {
    /// Opens number `index` of the system's Vulkan devices.
    pub(crate) fn open(index: usize) -> Result<Self, Box<dyn Error>> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends: Backends::VULKAN,
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        });
        let adapters = pollster::block_on(instance.enumerate_adapters(Backends::VULKAN));
        let adapter = adapters.into_iter().nth(index).ok_or_else(|| format!("there is no Vulkan device {index}"))?;
        let info = adapter.get_info();
        let needed = Features::EXPERIMENTAL_RAY_QUERY | Features::TIMESTAMP_QUERY;
        let missing = needed - adapter.features();
        if !missing.is_empty() {
            return Err(format!("{} has no {missing}: choose another --device", info.name).into());
        }
        let limits = adapter.limits();
        let row = limits.max_compute_workgroups_per_dimension.min(1 << 14) * LANES;
        let request = adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("ray queries"),
            required_features: needed,
            required_limits: limits,
            experimental_features: experimental(),
            ..Default::default()
        });
        let (device, queue) = pollster::block_on(request)?;
        let module = device.create_shader_module(wgpu::include_wgsl!("rays.wgsl"));
        let kernels = [OPAQUE, OPAQUE | FIRST].map(|flags| {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some("ray queries"),
                layout: None,
                module: &module,
                entry_point: Some("trace"),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: &[("flags", f64::from(flags)), ("row", f64::from(row))],
                    ..Default::default()
                },
                cache: None,
            })
        });
        let name = format!("{} ({} {})", info.name, info.driver, info.driver_info);
        Ok(Self { name, model: [info.vendor, info.device], device, queue, kernels, row })
    }

    /// Has the driver build its tree, for fast tracing.
    pub(crate) fn build(&self, model: &Model) -> Result<Tree, Box<dyn Error>> {
        let begin = Instant::now();
        let buffer = |contents: &[u8]| {
            let usage = BufferUsages::BLAS_INPUT;
            self.device.create_buffer_init(&BufferInitDescriptor { label: None, contents, usage })
        };
        let positions: Vec<[f32; 3]> = model.positions.iter().map(|position| position.to_array()).collect();
        let vertex_buffer = buffer(bytemuck::cast_slice(&positions));
        let index_buffer = buffer(bytemuck::cast_slice(&model.indices));
        let size = BlasTriangleGeometrySizeDescriptor {
            vertex_format: wgpu::VertexFormat::Float32x3,
            vertex_count: u32::try_from(positions.len())?,
            index_format: Some(wgpu::IndexFormat::Uint32),
            index_count: Some(u32::try_from(3 * model.indices.len())?),
            flags: AccelerationStructureGeometryFlags::OPAQUE,
        };
        let flags = AccelerationStructureFlags::PREFER_FAST_TRACE;
        let triangles = self.device.create_blas(
            &wgpu::CreateBlasDescriptor { label: None, flags, update_mode: Update::Build },
            BlasGeometrySizeDescriptors::Triangles { descriptors: vec![size.clone()] },
        );
        let mut scene = self.device.create_tlas(&wgpu::CreateTlasDescriptor {
            label: None,
            max_instances: 1,
            flags,
            update_mode: Update::Build,
        });
        let as_it_is = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        if let Some(instance) = scene.get_mut_single(0) {
            *instance = Some(TlasInstance::new(&triangles, as_it_is, 0, 0xff));
        }
        let geometry = BlasTriangleGeometry {
            size: &size,
            vertex_buffer: &vertex_buffer,
            first_vertex: 0,
            vertex_stride: 12,
            index_buffer: Some(&index_buffer),
            first_index: Some(0),
            transform_buffer: None,
            transform_buffer_offset: None,
        };
        let entry = BlasBuildEntry { blas: &triangles, geometry: BlasGeometries::TriangleGeometries(vec![geometry]) };
        let mut encoder = self.device.create_command_encoder(&CommandEncoderDescriptor::default());
        encoder.build_acceleration_structures([&entry], [&scene]);
        self.finish(encoder)?;
        let bounds = model.bounds();
        let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
        Ok(Tree { scene, least_t: largest * LEAST_T, built_s: begin.elapsed().as_secs_f64() })
    }

    /// Sends a stream's rays.
    pub(crate) fn load(&self, tree: &Tree, source: &RaySource, query: Query) -> Loaded {
        // Camera rays leave no surface.
        let least_t = if matches!(source, RaySource::Camera(_)) { 0.0 } else { tree.least_t };
        let ray = |index| {
            let (ray, _) = source.ray(index);
            let (tmin, tmax) = (ray.tmin.max(least_t), ray.tmax.min(MOST_T));
            PeerRay { origin: ray.origin, tmin, direction: ray.direction, tmax }
        };
        let rays: Vec<PeerRay> = (0..source.len()).map(ray).collect();
        let contents = bytemuck::cast_slice(&rays);
        let rays = self.device.create_buffer_init(&BufferInitDescriptor {
            label: None,
            contents,
            usage: BufferUsages::STORAGE,
        });
        let found = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: 4 * u64::from(source.len()),
            usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let resources = [tree.scene.as_binding(), rays.as_entire_binding(), found.as_entire_binding()];
        let entries: Vec<wgpu::BindGroupEntry<'_>> =
            (0..).zip(resources).map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
        let layout = self.kernels[usize::from(query == Query::Any)].get_bind_group_layout(0);
        let bindings = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &layout,
            entries: &entries,
        });
        Loaded { bindings, found, count: source.len(), query }
    }

    /// Traces the rays once.
    pub(crate) fn trace(&self, rays: &Loaded) -> Result<Answer, Box<dyn Error>> {
        let buffer = |size, usage| {
            self.device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
        };
        let queries =
            self.device.create_query_set(&wgpu::QuerySetDescriptor { label: None, ty: QueryType::Timestamp, count: 2 });
        let resolved = buffer(16, BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC);
        let stamps = buffer(16, BufferUsages::COPY_DST | BufferUsages::MAP_READ);
        let bytes = rays.found.size();
        let answers = buffer(bytes, BufferUsages::COPY_DST | BufferUsages::MAP_READ);
        let mut encoder = self.device.create_command_encoder(&CommandEncoderDescriptor::default());
        let timestamp_writes = Some(ComputePassTimestampWrites {
            query_set: &queries,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: Some(1),
        });
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes });
        pass.set_pipeline(&self.kernels[usize::from(rays.query == Query::Any)]);
        pass.set_bind_group(0, &rays.bindings, &[]);
        pass.dispatch_workgroups(rays.count.min(self.row).div_ceil(LANES), rays.count.div_ceil(self.row), 1);
        drop(pass);
        encoder.resolve_query_set(&queries, 0..2, &resolved, 0);
        encoder.copy_buffer_to_buffer(&resolved, 0, &stamps, 0, 16);
        encoder.copy_buffer_to_buffer(&rays.found, 0, &answers, 0, bytes);
        for buffer in [&stamps, &answers] {
            encoder.map_buffer_on_submit(buffer, wgpu::MapMode::Read, .., |_| ());
        }
        self.finish(encoder)?;
        let read = |buffer: &Buffer| -> Result<Vec<u8>, Box<dyn Error>> { Ok(buffer.get_mapped_range(..)?.to_vec()) };
        let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(&read(&stamps)?);
        let ns = ticks[1].wrapping_sub(ticks[0]) as f64 * f64::from(self.queue.get_timestamp_period());
        Ok(Answer { seconds: ns * 1e-9, found: bytemuck::pod_collect_to_vec(&read(&answers)?) })
    }

    fn finish(&self, encoder: wgpu::CommandEncoder) -> Result<(), Box<dyn Error>> {
        let done = self.queue.submit([encoder.finish()]);
        self.device.poll(PollType::Wait { submission_index: Some(done), timeout: Some(LIMIT) })?;
        Ok(())
    }
}

#[expect(unsafe_code, reason = "wgpu wants to hear that its ray queries are known to be young")]
fn experimental() -> ExperimentalFeatures {
    // SAFETY: nothing is asked but to take note that wgpu's ray queries are young and may have faults. Only this
    // benchmark uses them.
    unsafe { ExperimentalFeatures::enabled() }
}
