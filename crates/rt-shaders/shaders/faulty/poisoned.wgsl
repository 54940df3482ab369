// Wrong on purpose: every ray misses, whatever there is to hit, and nothing is counted.

@compute @workgroup_size(64)
fn poisoned(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    // However many invocations the backend starts, every item is answered once.
    let stride = groups.x * groups.y * 64u;
    for (var item = id.y * groups.x * 64u + id.x; item < list.count; item += stride) {
        found[item] = MISS;
        if item < arrayLength(&counts) {
            counts[item] = vec2<u32>(0u);
        }
    }
}
