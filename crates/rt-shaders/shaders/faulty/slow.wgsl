// Wrong on purpose: the first item takes a second or more and misses; the others are not answered.

// Steps that depend on each other: about a second of one invocation on a processor, some more on a graphics card.
const ROUNDS: u32 = 268435456u;

@compute @workgroup_size(64)
fn slow(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x != 0u || id.y != 0u {
        return;
    }
    // G. Marsaglia, Xorshift RNGs (2003): no compiler finds a short cut, and 0 is never reached.
    var state = list.count | 1u;
    for (var round = 0u; round < ROUNDS; round += 1u) {
        state ^= state << 13u;
        state ^= state >> 17u;
        state ^= state << 5u;
    }
    found[0] = select(MISS, 0u, state == 0u);
}
