// Camera rays, made where they are traced: the bits of `rt_core::CameraRays::ray`, prepared as `rt_bvh::kernel_io`
// does.
//
// A ray with a component of 0 is left to the host.

// rt_bvh::kernel_io::KernelCamera; a test compares the offsets.
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
    // Number of the first of a pixel's rays among its samples.
    first_sample: u32,
    // Not 0 if rays go through the centres of their pixels.
    is_centred: u32,
    unused: vec2<u32>,
    // At word 0 the table of places in the window.
    words: array<u32>,
}

@group(0) @binding(5) var<storage, read> recipe: Camera;
@group(0) @binding(6) var<storage, read_write> made: array<Ray>;

const GROUP: u32 = 64u;

@compute @workgroup_size(GROUP)
fn make_rays(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = (group.y * groups.x + group.x) * GROUP + lane;
    if index >= recipe.count {
        return;
    }
    hide(recipe.zero);
    let number = named(recipe.numbers, index);
    let pixel = recipe.words[recipe.pixels + number / recipe.samples];
    var inside = vec2<f32>(0.5);
    if recipe.is_centred == 0u {
        inside = spread_pair(recipe.seed, pixel, 0u, recipe.first_sample + number % recipe.samples);
    }
    // rt_core::CameraRays::ray and Camera::ray. Products with 2 are exact.
    let x = keep(keep(f32(pixel & 0xffffu) + inside.x) * recipe.pixel.x);
    let y = keep(keep(f32(pixel >> 16u) + inside.y) * recipe.pixel.y);
    let across = keep(keep(2.0 * x - 1.0) * recipe.aspect);
    let upward = keep(1.0 - 2.0 * y);
    let direction = vec3<f32>(
        component(recipe.forward.x, recipe.right.x, across, recipe.up.x, upward),
        component(recipe.forward.y, recipe.right.y, across, recipe.up.y, upward),
        component(recipe.forward.z, recipe.right.z, across, recipe.up.z, upward),
    );
    made[named(0u, index)] = prepared(recipe.origin, direction, recipe.tmax, NO_PRIMITIVE, recipe.exponents, false);
}

fn component(forward: f32, right: f32, across: f32, up: f32, upward: f32) -> f32 {
    return keep(keep(forward + keep(right * across)) + keep(up * upward));
}
