// In place of rays.wgsl, for tests: each ray counts how often a kernel takes it, in bits of `Ray::kind` that mean
// nothing.

// The structure `Ray`, but for `kind`.
struct VisitedRay {
    origin: vec3<f32>,
    tmin: f32,
    reciprocal: vec3<f32>,
    tmax: f32,
    shear: vec4<f32>,
    depth: vec2<f32>,
    excluded: u32,
    kind: atomic<u32>,
}

@group(0) @binding(4) var<storage, read_write> rays: array<VisitedRay>;

// One visit. The lower half is left to what a ray's kind says; 65,535 visits are more than any test makes.
const VISIT: u32 = 0x10000u;

fn ray_at(index: u32) -> Ray {
    let kind = atomicAdd(&rays[index].kind, VISIT) % VISIT;
    return Ray(
        rays[index].origin,
        rays[index].tmin,
        rays[index].reciprocal,
        rays[index].tmax,
        rays[index].shear,
        rays[index].depth,
        rays[index].excluded,
        kind,
    );
}
