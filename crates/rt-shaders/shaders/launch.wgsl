// Which lane of a launch traces which of its rays.

// Lanes in a workgroup: two waves of the widest hardware, and eight of the narrowest.
const GROUP: u32 = 64u;

@compute @workgroup_size(GROUP)
fn trace(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) index: u32,
) {
    let lane = (group.y * groups.x + group.x) * GROUP + index;
    if lane >= list.lanes {
        return;
    }
    hide(frame.zero);
    var item = lane;
    while item < list.count {
        solve(item);
        if list.lanes >= list.count {
            break;
        }
        item = atomicAdd(&list.next, 1u);
    }
}
