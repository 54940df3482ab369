// Sums and products whose bits say whether a device rounds as the other kernels rely on.

struct Answer {
    sum: vec2<f32>,
    product: vec2<f32>,
    // a b + a and a b - b a: another number, and not zero, where a multiplication and an addition are fused.
    chained: vec2<f32>,
    // a / b as a double float.
    quotient: vec2<f32>,
}

// A pair of zeros, then the pairs of numbers.
@group(0) @binding(4) var<storage, read> pairs: array<vec2<f32>>;
@group(0) @binding(6) var<storage, read_write> answers: array<Answer>;

@compute @workgroup_size(64)
fn check(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= arrayLength(&answers) {
        return;
    }
    hide(bitcast<u32>(pairs[0].x));
    let a = pairs[id.x + 1u].x;
    let b = pairs[id.x + 1u].y;
    let chained = vec2<f32>(keep(keep(a * b) + a), keep(keep(a * b) - keep(b * a)));
    answers[id.x] =
        Answer(two_sum(a, b), two_product(a, b), chained, divide(vec2<f32>(a, 0.0), vec2<f32>(b, 0.0)));
}
