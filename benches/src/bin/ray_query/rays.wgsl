// A lane for each ray asks the driver's acceleration structure for the nearest hit, or any.
enable wgpu_ray_query;

struct Ray {
    origin: vec3<f32>,
    tmin: f32,
    direction: vec3<f32>,
    tmax: f32,
}

@group(0) @binding(0) var scene: acceleration_structure;
@group(0) @binding(1) var<storage, read> rays: array<Ray>;
@group(0) @binding(2) var<storage, read_write> found: array<u32>;

/// Of a ray query.
override flags: u32;
/// Lanes along the first axis: a dispatch has more workgroups than one axis may count.
override row: u32;

const MISS: u32 = 0xffffffffu;

@compute @workgroup_size(64)
fn trace(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.y * row + id.x;
    if index >= arrayLength(&rays) {
        return;
    }
    let ray = rays[index];
    var query: ray_query;
    rayQueryInitialize(&query, scene, RayDesc(flags, 0xffu, ray.tmin, ray.tmax, ray.origin, ray.direction));
    while rayQueryProceed(&query) {}
    let hit = rayQueryGetCommittedIntersection(&query);
    found[index] = select(hit.primitive_index, MISS, hit.kind == RAY_QUERY_INTERSECTION_NONE);
}
