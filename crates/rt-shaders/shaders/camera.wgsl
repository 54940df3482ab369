// Camera rays, made where they are traced: the bits of `rt_core::CameraRays::ray`, prepared as `rt_bvh::offload` does.
//
// What is a sum, a product or a whole number is the host's operation for operation. Quotients are not: devices may be off
// by 2.5 units in the last place. So each is tested: q is a / b rounded to nearest if and only if |a - b q| is less than
// half a unit in q's last place times |b|.
// * Both sides are exact: the left one is a number of single precision where it is at most the right one, because it is a
//   multiple of the product of the units of b and q; and where it is greater, rounding does not make it less.
// * A quotient of two numbers of single precision is never halfway between two others.
// * Just below a power of two 2^k numbers lie twice as close. But a quotient less than 2^k is at most 2^k (1 - 2^-24), a and
//   b 2^k being different numbers, and for it the test refuses 2^k.
// A ray with a quotient that fails is left to the host, as are rays with a component so small that the products below would
// become denormal, 0 included, whose sign devices need not keep. Nothing rests on how well a device divides but how many
// rays those are.

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

const NO_PRIMITIVE: u32 = 0xffffffffu;

// Smallest component of a direction whose largest is in [1, 2). A quotient of two components is then at least 2^-25; what it
// leaves over is 0 or at least 2^-71, the quotient of that 2^-72, and all of what that leaves over are multiples of 2^-118.
const LEAST_COMPONENT: f32 = 5.9604644775390625e-8; // 2^-24

// rt_core::random, function for function.

fn pcg3d(words: vec3<u32>) -> vec3<u32> {
    var v = words * 1664525u + vec3<u32>(1013904223u);
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v ^= v >> vec3<u32>(16u);
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    return v;
}

// In [0, 1).
fn unit(word: u32) -> f32 {
    return f32(word >> 8u) * 5.9604644775390625e-8;
}

fn spread_pair(seed: u32, index: u32, sample: u32) -> vec2<f32> {
    let hash = pcg3d(vec3<u32>(seed, index, 0u));
    return vec2<f32>(unit(hash.x + sample * 0xc13fa9a9u), unit(hash.y + sample * 0x91e10da5u));
}

struct Quotient {
    value: f32,
    // What the value leaves over: a - b value, exact.
    rest: f32,
    // Whether the value is the quotient rounded to nearest.
    certain: bool,
}

fn rest_of(a: f32, b: f32, q: f32) -> f32 {
    let p = two_product(b, q);
    return keep(keep(a - p.x) - p.y);
}

fn quotient(a: f32, b: f32) -> Quotient {
    let near = keep(a / b);
    let value = keep(near + keep(rest_of(a, b, near) / b));
    let rest = rest_of(a, b, value);
    let half_unit = bitcast<f32>((bitcast<u32>(value) & 0x7f800000u) - 0x0c000000u);
    if a == 0.0 {
        return Quotient(0.0, 0.0, true);
    }
    return Quotient(value, rest, rest == 0.0 || abs(rest) < abs(b) * half_unit);
}

fn for_the_host() -> Ray {
    return Ray(vec3<f32>(0.0), 0.0, vec3<f32>(1.0), 0.0, vec4<f32>(0.0), vec2<f32>(0.0), NO_PRIMITIVE, KIND_HOST);
}

fn prepared(given: vec3<f32>) -> Ray {
    let size = abs(given);
    let greatest = max(max(size.x, size.y), size.z);
    let exponent = bitcast<u32>(greatest) >> 23u;
    if exponent < camera.exponents.x || exponent > camera.exponents.y {
        return for_the_host();
    }
    // Exact: times a power of two.
    let direction = given * bitcast<f32>((254u - exponent) << 23u);
    if any(abs(direction) < vec3<f32>(LEAST_COMPONENT)) {
        return for_the_host();
    }
    var axis = 2u;
    if size.x >= size.y && size.x >= size.z {
        axis = 0u;
    } else if size.y >= size.z {
        axis = 1u;
    }
    // As rt_core::intersect::shear_axes: the two sheared axes, then the dominant one.
    var ordered = direction;
    if axis == 0u {
        ordered = direction.yzx;
    } else if axis == 1u {
        ordered = direction.zxy;
    }
    let x = quotient(1.0, ordered.x);
    let y = quotient(1.0, ordered.y);
    let z = quotient(1.0, ordered.z);
    let z_low = quotient(z.rest, ordered.z);
    let shear_x = quotient(ordered.x, ordered.z);
    let shear_x_low = quotient(shear_x.rest, ordered.z);
    let shear_y = quotient(ordered.y, ordered.z);
    let shear_y_low = quotient(shear_y.rest, ordered.z);
    let certain = x.certain && y.certain && z.certain && z_low.certain && shear_x.certain && shear_x_low.certain
        && shear_y.certain && shear_y_low.certain;
    if !certain {
        return for_the_host();
    }
    var reciprocal = vec3<f32>(x.value, y.value, z.value);
    if axis == 0u {
        reciprocal = reciprocal.zxy;
    } else if axis == 1u {
        reciprocal = reciprocal.yzx;
    }
    return Ray(
        camera.origin,
        0.0,
        reciprocal,
        camera.tmax,
        vec4<f32>(shear_x.value, shear_x_low.value, shear_y.value, shear_y_low.value),
        vec2<f32>(z.value, z_low.value),
        NO_PRIMITIVE,
        axis,
    );
}

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
        inside = spread_pair(camera.seed, pixel, number % camera.samples);
    }
    // rt_core::CameraRays::ray and Camera::ray. Products with 2 are exact.
    let x = keep(keep(f32(pixel & 0xffffu) + inside.x) * camera.pixel.x);
    let y = keep(keep(f32(pixel >> 16u) + inside.y) * camera.pixel.y);
    let across = keep(keep(2.0 * x - 1.0) * camera.aspect);
    let upward = keep(1.0 - 2.0 * y);
    made[index] = prepared(vec3<f32>(
        component(camera.forward.x, camera.right.x, across, camera.up.x, upward),
        component(camera.forward.y, camera.right.y, across, camera.up.y, upward),
        component(camera.forward.z, camera.right.z, across, camera.up.z, upward),
    ));
}

fn component(forward: f32, right: f32, across: f32, up: f32, upward: f32) -> f32 {
    return keep(keep(forward + keep(right * across)) + keep(up * upward));
}
