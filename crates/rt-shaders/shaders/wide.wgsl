// The traversal loop over the eight-wide compressed layout: step for step that of rt_bvh (see its module `trace::wide`,
// which also derives why the box test is conservative), so that counts are the same. What it is for is chosen by the
// constants of traverse.wgsl.

// rt_bvh::WideNode, 80 bytes: the grid's origin; three biased exponents and, in the uppermost byte, which slots are
// nodes; the first node and the first triangle of the children; what is in each slot; the lower planes by axis and
// slot, a byte each, and the upper ones.
struct WideNode {
    words: array<vec4<u32>, 5>,
}

@group(0) @binding(0) var<storage, read> nodes: array<WideNode>;

// Bits of a word of hits that stand for nodes; the others stand for triangles.
const NODE_BITS: u32 = 0xff000000u;

const FARTHEST: f32 = 3.40282346638528859812e+38;

struct WideSlabs {
    // The origin, moved away from the planes through which the ray enters, and from those through which it leaves.
    near: vec3<f32>,
    far: vec3<f32>,
    reciprocal: vec3<f32>,
    up: vec3<bool>,
    // A slot's number with these bits flipped is greater the earlier it is to be visited.
    flip: u32,
    tmin: f32,
}

// Which children the ray enters, as bits, and the least distance at which it enters a leaf of them.
struct Entered {
    hits: u32,
    entry: f32,
}

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
    let padding = padding_of(ray);
    let slabs = wide_slabs_of(ray, padding.xyz * 2.0);
    let origin = in_order(ray.origin, ray.kind & KIND_AXIS);

    var nearest = Nearest(MISS, ray.tmax);
    var boxes = 0u;
    var tests = 0u;
    // Nodes to be visited: the first node of their parent; and in one word, in the order of visits from the uppermost
    // bit down, which of its slots, and below those, which of its slots are nodes.
    var behind: array<vec2<u32>, STACK>;
    var used = 0u;
    // The root, as the only child of nobody.
    var next = vec2<u32>(0u, 1u << (24u + slabs.flip));

    loop {
        let bit = firstLeadingBit(next.y);
        next.y &= ~(1u << bit);
        let slot = (bit - 24u) ^ slabs.flip;
        let index = next.x + countOneBits(next.y & ((1u << slot) - 1u));
        if (next.y & NODE_BITS) != 0u {
            behind[used] = next;
            used += 1u;
        }
        let node = nodes[index];
        boxes += 8u;
        let entered = enter_wide(slabs, node, nearest.limit);
        next = vec2<u32>(node.words[1].x, (entered.hits & NODE_BITS) | (node.words[0].w >> 24u));

        var left = entered.hits & ~NODE_BITS;
        if REDUCED {
            tests += countOneBits(left);
            if CUT && left != 0u {
                nearest.limit = entered.entry;
            }
        } else {
            while left != 0u {
                let place = node.words[1].y + countTrailingZeros(left);
                left &= left - 1u;
                tests += 1u;
                nearest = nearest_with(ray, padding.w, origin, place, nearest);
                if is_settled(nearest) {
                    break;
                }
            }
            if is_settled(nearest) {
                break;
            }
        }
        if (next.y & NODE_BITS) == 0u {
            if used == 0u {
                break;
            }
            used -= 1u;
            next = behind[used];
        }
    }

    found[item] = nearest.slot;
    if COUNT {
        counts[item] = vec2<u32>(boxes, tests);
    }
}

fn wide_slabs_of(ray: Ray, padding: vec3<f32>) -> WideSlabs {
    let up = ray.reciprocal >= vec3<f32>(0.0);
    let lower = keep3(ray.origin + padding);
    let upper = keep3(ray.origin - padding);
    let bits = select(vec3<u32>(0u), vec3<u32>(1u, 2u, 4u), up);
    return WideSlabs(
        select(upper, lower, up),
        select(lower, upper, up),
        ray.reciprocal,
        up,
        bits.x | bits.y | bits.z,
        ray.tmin,
    );
}

// The four bytes of a word, the lowest first.
fn bytes_of(word: u32) -> vec4<u32> {
    return (vec4<u32>(word) >> vec4<u32>(0u, 8u, 16u, 24u)) & vec4<u32>(0xffu);
}

// Distances between a grid's origin and four of its planes.
fn planes(word: u32, step: f32) -> vec4<f32> {
    let at = vec4<f32>(bytes_of(word)) * step;
    return vec4<f32>(keep(at.x), keep(at.y), keep(at.z), keep(at.w));
}

fn enter_wide(slabs: WideSlabs, node: WideNode, limit: f32) -> Entered {
    let exponents = bytes_of(node.words[0].w).xyz;
    let step = bitcast<vec3<f32>>(exponents << vec3<u32>(23u)) * slabs.reciprocal;
    let grid = bitcast<vec3<f32>>(node.words[0].xyz);
    let near = keep3((grid - slabs.near) * slabs.reciprocal);
    let far = keep3((grid - slabs.far) * slabs.reciprocal);
    // By axis: the planes through which the ray enters the eight boxes, then those through which it leaves.
    let x = select(vec4<u32>(node.words[3].zw, node.words[2].xy), vec4<u32>(node.words[2].xy, node.words[3].zw), slabs.up.x);
    let y = select(vec4<u32>(node.words[4].xy, node.words[2].zw), vec4<u32>(node.words[2].zw, node.words[4].xy), slabs.up.y);
    let z = select(vec4<u32>(node.words[4].zw, node.words[3].xy), vec4<u32>(node.words[3].xy, node.words[4].zw), slabs.up.z);
    let first = enter_four(slabs, step, near, far, vec3<u32>(x.x, y.x, z.x), vec3<u32>(x.z, y.z, z.z), node.words[1].z, limit);
    let second = enter_four(slabs, step, near, far, vec3<u32>(x.y, y.y, z.y), vec3<u32>(x.w, y.w, z.w), node.words[1].w, limit);
    return Entered(first.hits | second.hits, min(first.entry, second.entry));
}

// Half of the slots: a word of planes for each axis, and one of what is in the slots.
fn enter_four(
    slabs: WideSlabs,
    step: vec3<f32>,
    near: vec3<f32>,
    far: vec3<f32>,
    enters: vec3<u32>,
    leaves: vec3<u32>,
    kinds: u32,
    limit: f32,
) -> Entered {
    var enters_at = vec4<f32>(slabs.tmin);
    enters_at = max(enters_at, planes(enters.x, step.x) + vec4<f32>(near.x));
    enters_at = max(enters_at, planes(enters.y, step.y) + vec4<f32>(near.y));
    enters_at = max(enters_at, planes(enters.z, step.z) + vec4<f32>(near.z));
    var leaves_at = vec4<f32>(limit);
    leaves_at = min(leaves_at, planes(leaves.x, step.x) + vec4<f32>(far.x));
    leaves_at = min(leaves_at, planes(leaves.y, step.y) + vec4<f32>(far.y));
    leaves_at = min(leaves_at, planes(leaves.z, step.z) + vec4<f32>(far.z));
    let inside = enters_at <= leaves_at;

    let slot = bytes_of(kinds);
    // Five bits from 24 up mean a node: its place is turned into the order of visits.
    let is_node = (slot & vec4<u32>(24u)) == vec4<u32>(24u);
    let place = (slot & vec4<u32>(31u)) ^ select(vec4<u32>(0u), vec4<u32>(slabs.flip), is_node);
    let bits = select(vec4<u32>(0u), (slot >> vec4<u32>(5u)) << place, inside);
    var entry = FARTHEST;
    if CUT {
        let is_leaf = inside & !is_node & (slot != vec4<u32>(0u));
        let entries = select(vec4<f32>(FARTHEST), enters_at, is_leaf);
        entry = min(min(entries.x, entries.y), min(entries.z, entries.w));
    }
    return Entered(bits.x | bits.y | bits.z | bits.w, entry);
}
