// The traversal loop over the two-wide layout: step for step that of rt_bvh, so that counts are the same. What it is for
// is chosen by constants that the build prepends:
//   STACK    entries of the stack, at least the depth of the scene
//   ANY      whether the first hit ends the ray
//   COUNT    whether tests are counted
//   REDUCED  whether leaves are counted and not opened
//   CUT      whether, then, a leaf counts as a hit where it is entered

// Two boxes, each lower corner before upper corner, as twelve planes in a row; then where the children are:
// index 0 and 1, number of triangles 0 and 1.
struct Node {
    planes: array<vec4<f32>, 3>,
    links: vec4<u32>,
}

@group(0) @binding(0) var<storage, read> nodes: array<Node>;

// Finds out what is asked of item `item`.
fn solve(item: u32) {
    let ray = rays[ray_of(item)];
    if (ray.kind & (KIND_MISS | KIND_HOST)) != 0u {
        found[item] = select(DOUBTFUL, MISS, (ray.kind & KIND_MISS) != 0u);
        if COUNT {
            counts[item] = vec2<u32>(0u);
        }
        return;
    }
    let slabs = slabs_of(ray);
    let dominant = ray.kind & KIND_AXIS;
    let origin = in_order(ray.origin, dominant);

    var best = MISS;
    var limit = ray.tmax;
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
            var range = enter_first(slabs, node, limit);
            if frame.root == 1u {
                range = enter_second(slabs, node, limit);
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
            let first = enter_first(slabs, node, limit);
            let second = enter_second(slabs, node, limit);
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
                limit = entry;
            }
        } else {
            for (var slot = next.x; slot < next.x + next.y; slot += 1u) {
                tests += 1u;
                let triangle = triangles[slot];
                let a = vec3<f32>(triangle.vertices[0], triangle.vertices[1], triangle.vertices[2]);
                let b = vec3<f32>(triangle.vertices[3], triangle.vertices[4], triangle.vertices[5]);
                let c = vec3<f32>(triangle.vertices[6], triangle.vertices[7], triangle.vertices[8]);
                let p = in_order(a, dominant);
                let q = in_order(b, dominant);
                let r = in_order(c, dominant);
                if clearly_misses(ray, slabs.reach, origin, p, q, r) {
                    continue;
                }
                if ray.excluded != MISS && primitives[slot] == ray.excluded {
                    continue;
                }
                let meeting = meet(ray, limit, origin, p, q, r);
                if meeting.verdict == MISSES {
                    continue;
                }
                if meeting.verdict == HITS && meeting.t == limit && best != MISS && primitives[slot] >= primitives[best] {
                    continue;
                }
                if meeting.verdict == IN_DOUBT {
                    // A hit counts only where the ray enters the triangle's own box. One that is certain exists, so the
                    // padded box test cannot refuse it; for a doubtful one it often settles the matter.
                    let range = enter(slabs, min(min(a, b), c), max(max(a, b), c), limit);
                    if range.x > range.y {
                        continue;
                    }
                    best = DOUBTFUL;
                    break;
                }
                best = slot;
                limit = meeting.t;
                if ANY {
                    break;
                }
            }
            if best == DOUBTFUL || (ANY && best != MISS) {
                break;
            }
        }
        // The limit may have come down since a child was left behind.
        going = down;
        while !going && used > 0u {
            used -= 1u;
            next = behind[used];
            entry = entries[used];
            going = entry <= limit;
        }
    }

    found[item] = best;
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
