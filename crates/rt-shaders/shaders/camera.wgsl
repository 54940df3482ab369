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
    // Where the table of numbers begins: those of the rays, counted from the first sample of the first pixel below.
    numbers: u32,
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
    // Where the pixels begin, each x | y << 16.
    pixels: u32,
    // At word 0 the table of places in the window.
    words: array<u32>,
}

@group(0) @binding(5) var<storage, read> order: Camera;
@group(0) @binding(6) var<storage, read_write> made: array<Ray>;

const GROUP: u32 = 64u;

@compute @workgroup_size(GROUP)
fn make_rays(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = (group.y * groups.x + group.x) * GROUP + lane;
    if index >= order.count {
        return;
    }
    hide(order.zero);
    let number = named(order.numbers, index);
    let pixel = order.words[order.pixels + number / order.samples];
    var inside = vec2<f32>(0.5);
    if order.samples > 1u {
        inside = spread_pair(order.seed, pixel, 0u, number % order.samples);
    }
    // rt_core::CameraRays::ray and Camera::ray. Products with 2 are exact.
    let x = keep(keep(f32(pixel & 0xffffu) + inside.x) * order.pixel.x);
    let y = keep(keep(f32(pixel >> 16u) + inside.y) * order.pixel.y);
    let across = keep(keep(2.0 * x - 1.0) * order.aspect);
    let upward = keep(1.0 - 2.0 * y);
    let direction = vec3<f32>(
        component(order.forward.x, order.right.x, across, order.up.x, upward),
        component(order.forward.y, order.right.y, across, order.up.y, upward),
        component(order.forward.z, order.right.z, across, order.up.z, upward),
    );
    made[named(0u, index)] = prepared(order.origin, direction, order.tmax, NO_PRIMITIVE, order.exponents, false);
}

fn component(forward: f32, right: f32, across: f32, up: f32, upward: f32) -> f32 {
    return keep(keep(forward + keep(right * across)) + keep(up * upward));
}
