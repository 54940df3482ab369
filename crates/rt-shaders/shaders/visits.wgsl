// For tests: tells how often each ray was visited since it was loaded, as if that were its number of box tests.

@compute @workgroup_size(64)
fn visits(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    // However many invocations the backend starts, every item is answered once.
    let stride = groups.x * groups.y * 64u;
    for (var item = id.y * groups.x * 64u + id.x; item < list.count; item += stride) {
        found[item] = MISS;
        counts[item] = vec2<u32>(atomicLoad(&rays[ray_of(item)].kind) / VISIT, 0u);
    }
}
