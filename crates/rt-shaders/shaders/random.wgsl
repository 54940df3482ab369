// rt_core::random, function for function.

fn pcg3d(words: vec3<u32>) -> vec3<u32> {
    var v = words * 1664525u + vec3<u32>(1013904223u);
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v ^= v >> vec3<u32>(16u);
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    return v;
}

// In [0, 1).
fn unit(word: u32) -> f32 {
    return f32(word >> 8u) * 5.9604644775390625e-8;
}

fn spread_pair(seed: u32, index: u32, dimension: u32, sample: u32) -> vec2<f32> {
    let hash = pcg3d(vec3<u32>(seed, index, dimension));
    return vec2<f32>(unit(hash.x + sample * 0xc13fa9a9u), unit(hash.y + sample * 0x91e10da5u));
}
