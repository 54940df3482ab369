// Numbers of about 48 bits as the sum of two single-precision ones, `x` the nearer, `y` the rest.
//
// After T. J. Dekker, "A Floating-Point Technique for Extending the Available Precision" (1971). Error bounds, relative
// to the result and with u = 2^-24, from M. Joldes, J.-M. Muller and V. Popescu, "Tight and Rigorous Error Bounds for
// Basic Building Blocks of Double-Word Arithmetic", ACM TOMS 44-2 (2017): 3 u² for a sum, 7 u² for a product.
//
// They hold only where additions and multiplications are rounded to nearest, one by one. Hence every arithmetic
// instruction of the module is decorated NoContraction. `fma` is not used: it need not fuse.

fn two_sum(a: f32, b: f32) -> vec2<f32> {
    let s = a + b;
    let t = s - a;
    return vec2<f32>(s, (a - (s - t)) + (b - t));
}

// For |a| >= |b|.
fn fast_two_sum(a: f32, b: f32) -> vec2<f32> {
    let s = a + b;
    return vec2<f32>(s, b - (s - a));
}

// Halves of 12 bits each: their products are exact.
fn halves(a: f32) -> vec2<f32> {
    let c = 4097.0 * a;
    let high = c - (c - a);
    return vec2<f32>(high, a - high);
}

fn two_product(a: f32, b: f32) -> vec2<f32> {
    let p = a * b;
    let x = halves(a);
    let y = halves(b);
    return vec2<f32>(p, (((x.x * y.x - p) + x.x * y.y) + x.y * y.x) + x.y * y.y);
}

fn add(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let s = two_sum(a.x, b.x);
    let t = two_sum(a.y, b.y);
    let v = fast_two_sum(s.x, s.y + t.x);
    return fast_two_sum(v.x, t.y + v.y);
}

fn mul(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let p = two_product(a.x, b.x);
    return fast_two_sum(p.x, p.y + (a.x * b.y + a.y * b.x));
}

// A sum of three quotients in single precision, each of what the ones before it left over: right to 2^-46 even where a
// division is off by 2.5 units in the last place, which devices may be.
fn divide(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let q1 = a.x / b.x;
    let r1 = add(a, -mul(b, vec2<f32>(q1, 0.0)));
    let q2 = r1.x / b.x;
    let r2 = add(r1, -mul(b, vec2<f32>(q2, 0.0)));
    let q3 = r2.x / b.x;
    return add(fast_two_sum(q1, q2), vec2<f32>(q3, 0.0));
}
