// Which rays a launch traces.

// rt_gpu's `RayList`; a test compares the offsets.
struct RayList {
    // The first item that no lane has taken: at the start, the number of lanes.
    next: atomic<u32>,
    // Lanes that work. As many as items, or fewer: then they are persistent threads (T. Aila and S. Laine,
    // "Understanding the Efficiency of Ray Traversal on GPUs", HPG 2009), which take items until none is left. Lanes
    // that run in step take consecutive items.
    lanes: u32,
    count: u32,
    // Number of ranges; 0 for a list.
    ranges: u32,
    // A list: for each item its ray. Ranges: for each one its first item, then its first ray, in the order of items.
    rays: array<u32>,
}

@group(0) @binding(5) var<storage, read_write> list: RayList;

fn ray_of(item: u32) -> u32 {
    if list.ranges == 0u {
        return list.rays[item];
    }
    // The last range that does not begin behind the item.
    var low = 0u;
    var high = list.ranges;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if list.rays[2u * middle] <= item {
            low = middle;
        } else {
            high = middle;
        }
    }
    return list.rays[2u * low + 1u] + (item - list.rays[2u * low]);
}
