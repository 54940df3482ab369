// Rays that leave surfaces, made where they are traced: the bits of `rt_core::BounceRays::ray`, prepared as
// `rt_bvh::kernel_io` does. Function for function those of rt_core's module `bounce`, which says why no number here is
// denormal that matters; triangles for which one could be are left to the host.

// rt_bvh::kernel_io::KernelBounce; a test compares the offsets.
struct Bounce {
    // Unit vector to the middle of the disc that rays go to.
    middle: vec3<f32>,
    // Whether they go there; otherwise about the normal.
    disc: u32,
    // Two radii of the disc.
    tangent: vec3<f32>,
    seed: u32,
    bitangent: vec3<f32>,
    samples: u32,
    dimension: u32,
    // Where the table of the rays' paths begins, their numbers in the wave.
    paths: u32,
    // How many rays to make.
    count: u32,
    tmax: f32,
    // Range of the exponent, as it is stored, of a triangle's largest coordinate.
    coordinates: vec2<u32>,
    // The same of a direction's largest component.
    exponents: vec2<u32>,
    // Always 0, which compilers do not know.
    zero: u32,
    // Where the departures begin: for each ray the weights of the second and the third vertex in units of 2^-24, BEHIND
    // in the first, and the triangle.
    departures: u32,
    // Number of the group of `samples` paths that the wave's first one belongs to.
    first_group: u32,
    // As much as the camera's needs.
    unused: array<u32, 5>,
    // At word 0 the table of places in the window.
    words: array<u32>,
}

struct Triangle {
    vertices: array<f32, 9>,
}

@group(0) @binding(1) var<storage, read> triangles: array<Triangle>;
@group(0) @binding(2) var<storage, read> primitives: array<u32>;
@group(0) @binding(5) var<storage, read> recipe: Bounce;
@group(0) @binding(6) var<storage, read_write> made: array<Ray>;

const GROUP: u32 = 64u;

const BEHIND: u32 = 0x80000000u;
const NO_TRIANGLE: u32 = 0xffffffffu;
const ONE: u32 = 16777216u;

// The constants of rt_core::bounce::Surface.
const COARSE: f32 = 3.637978807091713e-12; // 2^-38
const GRID: f32 = 1.0913936421275139e-11; // 1.5 * 2^-37
const LEAST_NORMAL: f32 = 9.313225746154785e-10; // 2^-30
const CLEARANCE: f32 = 9.094947017729282e-13; // 2^-40
const HALF_STEP: f32 = 1.001 / 16777216.0;
const LEAST_COORDINATE: f32 = 8.673617379884035e-19; // 2^-60

fn rsqrt(x: f32) -> f32 {
    let h = 0.5 * x;
    var y = bitcast<f32>(0x5f3759dfu - (bitcast<u32>(x) >> 1u));
    for (var i = 0; i < 3; i += 1) {
        y = keep(y * keep(1.5 - keep(keep(h * y) * y)));
    }
    return y;
}

fn squared_length(v: vec3<f32>) -> f32 {
    return keep(keep(keep(v.x * v.x) + keep(v.y * v.y)) + keep(v.z * v.z));
}

fn kept(v: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(keep(v.x), keep(v.y), keep(v.z));
}

fn on_grid(c: f32) -> f32 {
    return select(c, keep(keep(c + GRID) - GRID), abs(c) < COARSE);
}

fn grid_vertex(slot: u32, corner: u32, factor: f32) -> vec3<f32> {
    let v = triangles[slot].vertices[3u * corner];
    let w = triangles[slot].vertices[3u * corner + 1u];
    let x = triangles[slot].vertices[3u * corner + 2u];
    return vec3<f32>(on_grid(v * factor), on_grid(w * factor), on_grid(x * factor));
}

fn cross_of(a: vec2<f32>, d: vec2<f32>, b: vec2<f32>, c: vec2<f32>) -> f32 {
    let p = two_product(a.x, d.x);
    let q = two_product(b.x, c.x);
    let s = two_sum(p.x, -q.x);
    let small = keep(keep(keep(a.x * d.y) + keep(a.y * d.x)) - keep(keep(b.x * c.y) + keep(b.y * c.x)));
    return keep(s.x + keep(s.y + keep(keep(p.y - q.y) + small)));
}

// The unit normal; 0 where there is none.
fn normal_of(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> vec3<f32> {
    let abx = two_sum(b.x, -a.x);
    let aby = two_sum(b.y, -a.y);
    let abz = two_sum(b.z, -a.z);
    let acx = two_sum(c.x, -a.x);
    let acy = two_sum(c.y, -a.y);
    let acz = two_sum(c.z, -a.z);
    let area =
        vec3<f32>(cross_of(aby, acz, abz, acy), cross_of(abz, acx, abx, acz), cross_of(abx, acy, aby, acx));
    let size = abs(area);
    let greatest = max(max(size.x, size.y), size.z);
    if greatest == 0.0 {
        return vec3<f32>(0.0);
    }
    let n = area * bitcast<f32>((254u - (bitcast<u32>(greatest) >> 23u)) << 23u);
    let normal = kept(n * rsqrt(squared_length(n)));
    return select(normal, vec3<f32>(0.0), abs(normal) < vec3<f32>(LEAST_NORMAL));
}

// A coordinate of where a ray starts, in the triangle's unit.
fn start_of(weights: vec3<f32>, coordinates: vec3<f32>, side: f32) -> f32 {
    let a = two_product(weights.x, coordinates.x);
    let b = two_product(weights.y, coordinates.y);
    let c = two_product(weights.z, coordinates.z);
    let ab = two_sum(a.x, b.x);
    let abc = two_sum(ab.x, c.x);
    let sum = two_sum(abc.x, keep(keep(abc.y + ab.y) + keep(keep(a.y + b.y) + c.y)));
    let away = keep(abs(sum.x) * HALF_STEP);
    let step = keep(side * CLEARANCE + select(select(-away, away, side > 0.0), 0.0, side == 0.0));
    let rounded = keep(sum.x + keep(sum.y + step));
    return select(rounded, 0.0, abs(rounded) < LEAST_COORDINATE);
}

// A point of the unit disc, and its squared distance from the middle.
fn disc_of(uniform_pair: vec2<f32>) -> vec3<f32> {
    // All exact.
    let a = keep(keep(2.0 * uniform_pair.x - 1.0) + 5.9604644775390625e-8);
    let b = keep(keep(2.0 * uniform_pair.y - 1.0) + 5.9604644775390625e-8);
    let steep = abs(b) > abs(a);
    let radius = select(a, b, steep);
    let other = select(b, a, steep);
    let squared = keep(radius * radius);
    let inverse = rsqrt(squared);
    let x = keep(0.78539816339744830962 * keep(keep(other * inverse) * keep(radius * inverse)));
    let q = keep(x * x);
    var sine = keep(-1.0 / 5040.0 + keep(q * (1.0 / 362880.0)));
    sine = keep(1.0 / 120.0 + keep(q * sine));
    sine = keep(-1.0 / 6.0 + keep(q * sine));
    sine = keep(x * keep(1.0 + keep(q * sine)));
    var cosine = keep(1.0 / 40320.0 + keep(q * (-1.0 / 3628800.0)));
    cosine = keep(-1.0 / 720.0 + keep(q * cosine));
    cosine = keep(1.0 / 24.0 + keep(q * cosine));
    cosine = keep(-1.0 / 2.0 + keep(q * cosine));
    cosine = keep(1.0 + keep(q * cosine));
    let along = keep(radius * cosine);
    let across = keep(radius * sine);
    return vec3<f32>(select(along, across, steep), select(across, along, steep), squared);
}

fn about(n: vec3<f32>, at: vec3<f32>) -> vec3<f32> {
    let rest = keep(1.0 - at.z);
    let height = keep(rest * rsqrt(rest));
    let sign = select(1.0, -1.0, n.z < 0.0);
    let root = rsqrt(keep(1.0 + abs(n.z)));
    let a = -sign * keep(root * root);
    let b = keep(keep(n.x * n.y) * a);
    let tangent = vec3<f32>(keep(1.0 + sign * keep(keep(n.x * n.x) * a)), sign * b, -sign * n.x);
    let bitangent = vec3<f32>(b, keep(sign + keep(keep(n.y * n.y) * a)), -n.y);
    return kept(kept(kept(tangent * at.x) + kept(bitangent * at.y)) + kept(n * height));
}

fn towards(at: vec3<f32>) -> vec3<f32> {
    let to = kept(kept(recipe.middle + kept(recipe.tangent * at.x)) + kept(recipe.bitangent * at.y));
    return kept(to * rsqrt(squared_length(to)));
}

fn ray_from(index: u32) -> Ray {
    let departure = recipe.departures + 3u * index;
    let slot = recipe.words[departure + 2u];
    if slot == NO_TRIANGLE {
        return for_the_host();
    }
    var greatest = 0.0;
    for (var i = 0u; i < 9u; i += 1u) {
        greatest = max(greatest, abs(triangles[slot].vertices[i]));
    }
    let exponent = bitcast<u32>(greatest) >> 23u;
    if exponent < recipe.coordinates.x || exponent > recipe.coordinates.y {
        return for_the_host();
    }
    // To [1/2, 1), and back.
    let factor = bitcast<f32>((253u - exponent) << 23u);
    let back = bitcast<f32>((exponent + 1u) << 23u);
    let a = grid_vertex(slot, 0u, factor);
    let b = grid_vertex(slot, 1u, factor);
    let c = grid_vertex(slot, 2u, factor);
    let front = normal_of(a, b, c);
    if all(front == vec3<f32>(0.0)) {
        return for_the_host();
    }
    let n = select(front, -front, (recipe.words[departure] & BEHIND) != 0u);
    let u = min(recipe.words[departure] & ~BEHIND, ONE);
    let v = min(recipe.words[departure + 1u] & ~BEHIND, ONE);
    // Exact.
    let weights = vec3<f32>(f32(max(ONE, u + v) - (u + v)), f32(u), f32(v)) * 5.9604644775390625e-8;
    let origin = vec3<f32>(
        start_of(weights, vec3<f32>(a.x, b.x, c.x), n.x),
        start_of(weights, vec3<f32>(a.y, b.y, c.y), n.y),
        start_of(weights, vec3<f32>(a.z, b.z, c.z), n.z),
    ) * back;
    let path = named(recipe.paths, index);
    let group = recipe.first_group + path / recipe.samples;
    let at = disc_of(spread_pair(recipe.seed, group, recipe.dimension, path % recipe.samples));
    var direction = about(n, at);
    if recipe.disc != 0u {
        direction = towards(at);
    }
    return prepared(origin, direction, recipe.tmax, primitives[slot], recipe.exponents, true);
}

@compute @workgroup_size(GROUP)
fn make_bounces(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = (group.y * groups.x + group.x) * GROUP + lane;
    if index >= recipe.count {
        return;
    }
    hide(recipe.zero);
    made[named(0u, index)] = ray_from(index);
}
