// Camera rays, made where they are traced: the bits of `rt_core::CameraRays::ray`, prepared as `rt_bvh::offload` does.
//
// A ray with a component of 0 is left to the host.

// rt_bvh::offload::KernelCamera; a test compares the offsets.
struct Camera {
    // In local coordinates.
    origin: vec3<f32>,
    // Rays per pixel.
    samples: u32,
    forward: vec3<f32>,
    seed: u32,
    right: vec3<f32>,
    // Number of the first ray, counted from the first sample of the first pixel.
    first: u32,
    up: vec3<f32>,
    count: u32,
    // Width and height of a pixel in image positions.
    pixel: vec2<f32>,
    aspect: f32,
    tmax: f32,
    // Range of the exponent, as it is stored, of a direction's largest component.
    exponents: vec2<u32>,
    // Always 0, which compilers do not know.
    zero: u32,
}

// Each x | y << 16.
@group(0) @binding(4) var<storage, read> pixels: array<u32>;
@group(0) @binding(5) var<storage, read> camera: Camera;
@group(0) @binding(6) var<storage, read_write> made: array<Ray>;

const GROUP: u32 = 64u;

@compute @workgroup_size(GROUP)
fn make_rays(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = (group.y * groups.x + group.x) * GROUP + lane;
    if index >= camera.count {
        return;
    }
    hide(camera.zero);
    let number = camera.first + index;
    let pixel = pixels[number / camera.samples];
    var inside = vec2<f32>(0.5);
    if camera.samples > 1u {
        inside = spread_pair(camera.seed, pixel, 0u, number % camera.samples);
    }
    // rt_core::CameraRays::ray and Camera::ray. Products with 2 are exact.
    let x = keep(keep(f32(pixel & 0xffffu) + inside.x) * camera.pixel.x);
    let y = keep(keep(f32(pixel >> 16u) + inside.y) * camera.pixel.y);
    let across = keep(keep(2.0 * x - 1.0) * camera.aspect);
    let upward = keep(1.0 - 2.0 * y);
    let direction = vec3<f32>(
        component(camera.forward.x, camera.right.x, across, camera.up.x, upward),
        component(camera.forward.y, camera.right.y, across, camera.up.y, upward),
        component(camera.forward.z, camera.right.z, across, camera.up.z, upward),
    );
    made[index] = prepared(camera.origin, direction, camera.tmax, NO_PRIMITIVE, camera.exponents, false);
}

fn component(forward: f32, right: f32, across: f32, up: f32, upward: f32) -> f32 {
    return keep(keep(forward + keep(right * across)) + keep(up * upward));
}
