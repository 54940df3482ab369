// What becomes of a ray at a triangle of a leaf, whatever the layout of the tree.

// The nearest hit so far: its slot (MISS: none; DOUBTFUL: the host must decide) and distance, or else the ray's own
// limit.
struct Nearest {
    slot: u32,
    limit: f32,
}

// The nearest hit once the triangle at `slot` was tested too. `origin` is the ray's, in its order; `reach` that of
// `Slabs`.
fn nearest_with(ray: Ray, reach: f32, origin: vec3<f32>, slot: u32, nearest: Nearest) -> Nearest {
    let dominant = ray.kind & KIND_AXIS;
    let triangle = triangles[slot];
    let a = vec3<f32>(triangle.vertices[0], triangle.vertices[1], triangle.vertices[2]);
    let b = vec3<f32>(triangle.vertices[3], triangle.vertices[4], triangle.vertices[5]);
    let c = vec3<f32>(triangle.vertices[6], triangle.vertices[7], triangle.vertices[8]);
    let p = in_order(a, dominant);
    let q = in_order(b, dominant);
    let r = in_order(c, dominant);
    if clearly_misses(ray, reach, origin, p, q, r) {
        return nearest;
    }
    if ray.excluded != MISS && primitives[slot] == ray.excluded {
        return nearest;
    }
    let meeting = meet(ray, nearest.limit, origin, p, q, r);
    if meeting.verdict == MISSES {
        return nearest;
    }
    if meeting.verdict == HITS && meeting.t == nearest.limit && nearest.slot != MISS
        && primitives[slot] >= primitives[nearest.slot] {
        return nearest;
    }
    if meeting.verdict == IN_DOUBT {
        // A ray that hits the triangle enters its box, which is padded beyond all rounding: where it does not, the
        // doubt is settled.
        let range = enter(slabs_of(ray), min(min(a, b), c), max(max(a, b), c), nearest.limit);
        if range.x > range.y {
            return nearest;
        }
        return Nearest(DOUBTFUL, nearest.limit);
    }
    return Nearest(slot, meeting.t);
}

// Whether nothing more need be looked at.
fn is_settled(nearest: Nearest) -> bool {
    return nearest.slot == DOUBTFUL || (ANY && nearest.slot != MISS);
}
