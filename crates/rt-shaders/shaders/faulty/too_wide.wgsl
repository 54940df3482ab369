// Valid, but a workgroup is larger than any device takes: such a kernel cannot be compiled.

@compute @workgroup_size(16384)
fn too_wide(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < list.count {
        found[id.x] = MISS;
    }
}
