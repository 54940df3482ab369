// The traversal loop over the two-wide layout: step for step that of rt_bvh, so that counts are the same. What it is
// for is chosen by constants that the build prepends: STACK entries of the stack, at least the depth of the scene ANY
// whether the first hit ends the ray COUNT whether tests are counted REDUCED whether leaves are counted and not opened
// CUT whether, then, a leaf counts as a hit where it is entered

// Two boxes, each lower corner before upper corner, as twelve planes in a row; then where the children are:
// index 0 and 1, number of triangles 0 and 1.
struct Node {
    planes: array<vec4<f32>, 3>,
    links: vec4<u32>,
}

@group(0) @binding(0) var<storage, read> nodes: array<Node>;

// Finds out what is asked of item `item`.
fn solve(item: u32) {
    let ray = ray_at(ray_of(item));
    if (ray.kind & (KIND_MISS | KIND_HOST)) != 0u {
        found[item] = select(DOUBTFUL, MISS, (ray.kind & KIND_MISS) != 0u);
        if COUNT {
            counts[item] = vec2<u32>(0u);
        }
        return;
    }
    let slabs = slabs_of(ray);
    let origin = in_order(ray.origin, ray.kind & KIND_AXIS);

    var nearest = Nearest(MISS, ray.tmax);
    var boxes = 0u;
    var tests = 0u;
    // Children left behind: index and number of triangles, and where they are entered.
    var behind: array<vec2<u32>, STACK>;
    var entries: array<f32, STACK>;
    var used = 0u;
    // The child to visit.
    var next = vec2<u32>(0u);
    var entry = 0.0;
    var going = true;
    if frame.root != ROOT_WHOLE {
        going = false;
        if frame.root != ROOT_EMPTY {
            // The loop trusts that every node has two children.
            let node = nodes[0];
            var range = enter_first(slabs, node, nearest.limit);
            if frame.root == 1u {
                range = enter_second(slabs, node, nearest.limit);
            }
            boxes = 1u;
            going = range.x <= range.y;
            next = select(node.links.yw, node.links.xz, frame.root == 0u);
            entry = range.x;
        }
    }

    while going {
        var down = false;
        if next.y == 0u {
            let node = nodes[next.x];
            boxes += 2u;
            let first = enter_first(slabs, node, nearest.limit);
            let second = enter_second(slabs, node, nearest.limit);
            let in_first = first.x <= first.y;
            let in_second = second.x <= second.y;
            let swap = !in_first || (in_second && first.x > second.x);
            if in_first && in_second {
                behind[used] = select(node.links.yw, node.links.xz, swap);
                entries[used] = select(second.x, first.x, swap);
                used += 1u;
            }
            next = select(node.links.xz, node.links.yw, swap);
            entry = select(first.x, second.x, swap);
            down = in_first || in_second;
        } else if REDUCED {
            tests += next.y;
            if CUT {
                nearest.limit = entry;
            }
        } else {
            for (var slot = next.x; slot < next.x + next.y; slot += 1u) {
                tests += 1u;
                nearest = nearest_with(ray, slabs.reach, origin, slot, nearest);
                if is_settled(nearest) {
                    break;
                }
            }
            if is_settled(nearest) {
                break;
            }
        }
        // The limit may have come down since a child was left behind.
        going = down;
        while !going && used > 0u {
            used -= 1u;
            next = behind[used];
            entry = entries[used];
            going = entry <= nearest.limit;
        }
    }

    found[item] = nearest.slot;
    if COUNT {
        counts[item] = vec2<u32>(boxes, tests);
    }
}

fn enter_first(slabs: Slabs, node: Node, limit: f32) -> vec2<f32> {
    let high = vec3<f32>(node.planes[0].w, node.planes[1].x, node.planes[1].y);
    return enter(slabs, node.planes[0].xyz, high, limit);
}

fn enter_second(slabs: Slabs, node: Node, limit: f32) -> vec2<f32> {
    let low = vec3<f32>(node.planes[1].z, node.planes[1].w, node.planes[2].x);
    return enter(slabs, low, node.planes[2].yzw, limit);
}
