// A ray as the host or the kernel `make_rays` prepares it: `rt_bvh::kernel_io::KernelRay`; a test compares the offsets.

struct Ray {
    origin: vec3<f32>,
    tmin: f32,
    reciprocal: vec3<f32>,
    tmax: f32,
    shear: vec4<f32>,
    depth: vec2<f32>,
    excluded: u32,
    kind: u32,
}

// Bits of Ray::kind: the dominant axis, that the ray misses, that only the host may trace it.
const KIND_AXIS: u32 = 3u;
const KIND_MISS: u32 = 4u;
const KIND_HOST: u32 = 8u;
