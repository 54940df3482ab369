// The conservative ray-box test: operation for operation that of rt_bvh (see its module `slabs`), so that both enter
// the same boxes at the same distances, bit for bit.

const UNIT_ROUNDOFF: f32 = 5.9604644775390625e-8; // 2^-24
const REACH_SHARE: f32 = 7.62939453125e-6; // 2^-17

struct Slabs {
    // The origin, moved away from lower planes and from upper ones.
    lower: vec3<f32>,
    upper: vec3<f32>,
    reciprocal: vec3<f32>,
    // Where the ray goes up, it enters through the lower plane.
    up: vec3<bool>,
    tmin: f32,
    // Greatest distance along an axis from the origin to a plane of the scene's box.
    reach: f32,
}

// How far box planes are moved away from a ray's origin, by axis; and the ray's reach.
fn padding_of(ray: Ray) -> vec4<f32> {
    let reaches = max(abs(frame.low - ray.origin), abs(frame.high - ray.origin));
    let reach = max(max(reaches.x, reaches.y), reaches.z);
    // Every product is exact, so fusing one with a sum changes nothing; the order of the sums matters.
    let padding = keep3(keep3(reaches * 8.0 + abs(ray.origin) * 4.0) + vec3<f32>(reach * REACH_SHARE)) * UNIT_ROUNDOFF;
    return vec4<f32>(padding, reach);
}

fn slabs_of(ray: Ray) -> Slabs {
    let padding = padding_of(ray);
    return Slabs(
        keep3(ray.origin + padding.xyz),
        keep3(ray.origin - padding.xyz),
        ray.reciprocal,
        ray.reciprocal >= vec3<f32>(0.0),
        ray.tmin,
        padding.w,
    );
}

fn keep3(v: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(keep(v.x), keep(v.y), keep(v.z));
}

// Where the ray enters and leaves a box, if the first is not beyond the second. No product is added to anything, so
// there is nothing to fuse, and no sum to reorder: nothing need be kept.
fn enter(slabs: Slabs, low: vec3<f32>, high: vec3<f32>, limit: f32) -> vec2<f32> {
    let a = (low - slabs.lower) * slabs.reciprocal;
    let b = (high - slabs.upper) * slabs.reciprocal;
    let near = select(b, a, slabs.up);
    let far = select(a, b, slabs.up);
    return vec2<f32>(max(max(near.x, near.y), max(near.z, slabs.tmin)), min(min(far.x, far.y), min(far.z, limit)));
}
