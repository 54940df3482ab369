// The ray-triangle test: certain, or openly in doubt.
//
// A hit is defined by rt_core::intersect, in exact arithmetic. Here its edge functions are computed twice. Single
// precision rejects most triangles, by the bound that rt_bvh's module `triangle` derives. What it leaves is computed in
// double floats, with a bound on the error; where that does not settle an edge function's sign, or the exact distance
// rounded to single precision, the triangle is doubtful and the host traces the ray. So what a device decides, it
// decides as exact arithmetic does. The bound is relative to the triangle's own numbers: of a triangle far smaller than
// its distance no sign is certain, and it is doubtful.
//
// The bound. Let u = 2^-24, Z the greatest |z| and X, Y the greatest sheared |x| and |y| of the vertices, S = X + Y.
// * Coordinates relative to the origin are exact: two_sum.
// * A sheared coordinate x - s z, with |s| <= 1, is off by D = 7.7 u² Z + 3.1 u² X: 7 u² from the product, 0.5 u² from
//   s, 3 u² from the difference, the rest to round up.
// * An edge function, c.x b.y - c.y b.x, changes by at most 2 (Dx Y + Dy X) = 15.4 u² Z S + 12.4 u² X Y from that, and
//   by 14 u² X Y + 6 u² X Y from its own two products and difference. With X Y <= S²/4: 15.4 u² Z S + 8.2 u² S². EDGE_Z
//   and EDGE_XY are 32 u² and 16 u².
// * Where all edge functions have one sign, the mean of the z that they weigh lies among the z. So moving each by at
//   most E moves the mean by at most 3 E / |determinant| times the spread of the z. Rounding adds, in units of u² Z: 7
//   for the products, 6 for their sum, 6 for the determinant, 6 for the quotient, and 7.5 for the product with
//   1/d, |1/d| <= 1: 33. T_Z is 64 u². Numbers below 2^-126 may be flushed to zero.
// * A coordinate is so changed by less than 2^-122, hence an edge function by 2^-121 S, and by 2^-121 in its own
//   products. E is at least EDGE_XY S²: 2^-116 where S is above SMALLEST.
// * The sum of the weighted z is changed by less than 2^-120, which must be small beside 8 u² |determinant| Z: that is
//   2^-117 where LEAST_SUM holds. Triangles that are smaller, and distances below NEAREST, are left in doubt. Overflow:
//   coordinates are below 2^61, for REACH of rt_bvh's `kernel_io`, so that edge functions are below 2^124. Where they
//   are certain and of one sign, the line meets the triangle, which is in the scene's box, of size 2 (the host keeps
//   the rays of larger ones): then S <= 8, and as edge functions are at most S²/2 and above E, Z <= 2^45: nothing that
//   follows overflows.

const EDGE_Z: f32 = 1.1368683772161603e-13; // 2^-43
const EDGE_XY: f32 = 5.684341886080802e-14; // 2^-44
const T_Z: f32 = 2.2737367544323206e-13; // 2^-42
const SMALLEST: f32 = 1.4551915228366852e-11; // 2^-36
const LEAST_SUM: f32 = 2.117582368135751e-22; // 2^-72
const NEAREST: f32 = 5.9604644775390625e-8; // 2^-24

const MISSES: u32 = 0u;
const HITS: u32 = 1u;
const IN_DOUBT: u32 = 2u;

struct Meeting {
    verdict: u32,
    // The exact distance of a hit, rounded once, in local units.
    t: f32,
}

// Coordinates in the order of the ray: the two sheared axes, the dominant axis.
fn in_order(v: vec3<f32>, dominant: u32) -> vec3<f32> {
    if dominant == 0u {
        return v.yzx;
    }
    if dominant == 1u {
        return v.zxy;
    }
    return v;
}

fn largest(v: vec3<f32>) -> f32 {
    return max(max(abs(v.x), abs(v.y)), abs(v.z));
}

// Whether the line certainly misses the triangle, in single precision. Vertices are in the ray's order.
fn clearly_misses(ray: Ray, reach: f32, o: vec3<f32>, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> bool {
    let z = vec3<f32>(a.z, b.z, c.z) - vec3<f32>(o.z);
    let x = (vec3<f32>(a.x, b.x, c.x) - vec3<f32>(o.x)) - z * ray.shear.x;
    let y = (vec3<f32>(a.y, b.y, c.y) - vec3<f32>(o.y)) - z * ray.shear.z;
    let edges = x.zxy * y.yzx - y.zxy * x.yzx;
    let e = (largest(x) + largest(y) + 5.0 * UNIT_ROUNDOFF * reach) * (18.0 * UNIT_ROUNDOFF * reach);
    return any(edges < vec3<f32>(-e)) && any(edges > vec3<f32>(e));
}

fn edge(cx: vec2<f32>, cy: vec2<f32>, bx: vec2<f32>, by: vec2<f32>) -> vec2<f32> {
    return add(mul(cx, by), -mul(cy, bx));
}

fn meet(ray: Ray, limit: f32, o: vec3<f32>, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> Meeting {
    let az = two_sum(a.z, -o.z);
    let bz = two_sum(b.z, -o.z);
    let cz = two_sum(c.z, -o.z);
    let ax = add(two_sum(a.x, -o.x), -mul(ray.shear.xy, az));
    let bx = add(two_sum(b.x, -o.x), -mul(ray.shear.xy, bz));
    let cx = add(two_sum(c.x, -o.x), -mul(ray.shear.xy, cz));
    let ay = add(two_sum(a.y, -o.y), -mul(ray.shear.zw, az));
    let by = add(two_sum(b.y, -o.y), -mul(ray.shear.zw, bz));
    let cy = add(two_sum(c.y, -o.y), -mul(ray.shear.zw, cz));
    let u = edge(cx, cy, bx, by);
    let v = edge(ax, ay, cx, cy);
    let w = edge(bx, by, ax, ay);

    let z = vec3<f32>(az.x, bz.x, cz.x);
    let size = largest(vec3<f32>(ax.x, bx.x, cx.x)) + largest(vec3<f32>(ay.x, by.x, cy.x));
    let e = (EDGE_Z * largest(z) + EDGE_XY * size) * size;
    let edges = vec3<f32>(u.x, v.x, w.x);
    let negative = edges < vec3<f32>(-e);
    let positive = edges > vec3<f32>(e);
    if size < SMALLEST {
        return Meeting(IN_DOUBT, 0.0);
    }
    if any(negative) && any(positive) {
        return Meeting(MISSES, 0.0);
    }
    if !all(negative) && !all(positive) {
        return Meeting(IN_DOUBT, 0.0);
    }

    let determinant = add(add(u, v), w);
    if abs(determinant.x) * largest(z) < LEAST_SUM {
        return Meeting(IN_DOUBT, 0.0);
    }
    let mean = divide(add(add(mul(u, az), mul(v, bz)), mul(w, cz)), determinant);
    let t = mul(mean, ray.depth);
    let spread = max(max(z.x, z.y), z.z) - min(min(z.x, z.y), z.z);
    let error = 4.0 * (e / abs(determinant.x)) * spread + T_Z * largest(z);
    // Rounding is monotone: the exact distance is rounded to something between these two.
    let low = t.x + keep(t.y - error);
    let high = t.x + keep(t.y + error);
    if low > limit || high < ray.tmin {
        return Meeting(MISSES, 0.0);
    }
    // Written so that it holds for NaN, too.
    if !(low == high) || abs(low) < NEAREST {
        return Meeting(IN_DOUBT, 0.0);
    }
    return Meeting(HITS, low);
}
