// Rays as kernels trace them, made on the device: the bits that `rt_bvh::kernel_io` prepares on the host.
//
// What is a sum, a product or a whole number is the host's operation for operation. Quotients are not: devices may be
// off by 2.5 units in the last place. So each is tested: q is a / b rounded to nearest if and only if |a - b q| is less
// than half a unit in q's last place times |b|.
// * Both sides are exact: the left one is a number of single precision where it is at most the right one, because it is
//   a multiple of the product of the units of b and q; and where it is greater, rounding does not make it less.
// * A quotient of two numbers of single precision is never halfway between two others.
// * Just below a power of two 2^k numbers lie twice as close. But a quotient less than 2^k is at most 2^k (1 - 2^-24),
//   a and b 2^k being different numbers, and for it the test refuses 2^k. A ray with a quotient that fails is left to
//   the host, as are rays with a component so small that the products below would become denormal. Nothing rests on how
//   well a device divides but how many rays those are.

const NO_PRIMITIVE: u32 = 0xffffffffu;

// Smallest component of a direction whose largest is in [1, 2). A quotient of two components is then at least 2^-25;
// what it leaves over is 0 or at least 2^-71, the quotient of that 2^-72, and all of what that leaves over are
// multiples of 2^-118.
const LEAST_COMPONENT: f32 = 5.9604644775390625e-8; // 2^-24

// One over a component that is 0: the host raises it to 2^-60.
const STEEPEST: f32 = 1152921504606846976.0; // 2^60

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

// The ray from `origin`, in local coordinates, along `given`, in given ones. `exponents` is the range of the exponent,
// as it is stored, of the largest component of a direction. A component of 0 is left to the host unless `zeros` says
// that it is +0 there: devices need not keep its sign.
fn prepared(origin: vec3<f32>, given: vec3<f32>, tmax: f32, excluded: u32, exponents: vec2<u32>, zeros: bool) -> Ray {
    let size = abs(given);
    let greatest = max(max(size.x, size.y), size.z);
    let exponent = bitcast<u32>(greatest) >> 23u;
    if exponent < exponents.x || exponent > exponents.y {
        return for_the_host();
    }
    // Exact: times a power of two.
    let direction = given * bitcast<f32>((254u - exponent) << 23u);
    let zero = (direction == vec3<f32>(0.0)) & vec3<bool>(zeros);
    if any((abs(direction) < vec3<f32>(LEAST_COMPONENT)) & !zero) {
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
    var none = zero;
    if axis == 0u {
        ordered = direction.yzx;
        none = zero.yzx;
    } else if axis == 1u {
        ordered = direction.zxy;
        none = zero.zxy;
    }
    let x = quotient(1.0, select(ordered.x, 1.0, none.x));
    let y = quotient(1.0, select(ordered.y, 1.0, none.y));
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
    // +0 over the dominant component has its sign.
    let signed = bitcast<f32>(bitcast<u32>(ordered.z) & 0x80000000u);
    var reciprocal = vec3<f32>(select(x.value, STEEPEST, none.x), select(y.value, STEEPEST, none.y), z.value);
    if axis == 0u {
        reciprocal = reciprocal.zxy;
    } else if axis == 1u {
        reciprocal = reciprocal.yzx;
    }
    return Ray(
        origin,
        0.0,
        reciprocal,
        tmax,
        vec4<f32>(
            select(shear_x.value, signed, none.x),
            shear_x_low.value,
            select(shear_y.value, signed, none.y),
            shear_y_low.value,
        ),
        vec2<f32>(z.value, z_low.value),
        excluded,
        axis,
    );
}
