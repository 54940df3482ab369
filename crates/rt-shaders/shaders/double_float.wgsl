// Numbers of about 48 bits as the sum of two single-precision ones, `x` the nearer, `y` the rest.
//
// After T. J. Dekker, "A Floating-Point Technique for Extending the Available Precision" (1971). Error bounds, relative
// to the result and with u = 2^-24, from M. Joldes, J.-M. Muller and V. Popescu, "Tight and Rigorous Error Bounds for
// Basic Building Blocks of Double-Word Arithmetic", ACM TOMS 44-2 (2017): 3 u² for a sum, 7 u² for a product.
//
// They hold only where additions and multiplications are rounded to nearest, one by one: hence `keep` around every one
// of them, which the build defines for the API that runs the kernel. `fma` is not used: it need not fuse.

fn two_sum(a: f32, b: f32) -> vec2<f32> {
    let s = keep(a + b);
    let t = keep(s - a);
    return vec2<f32>(s, keep(keep(a - keep(s - t)) + keep(b - t)));
}

// For |a| >= |b|.
fn fast_two_sum(a: f32, b: f32) -> vec2<f32> {
    let s = keep(a + b);
    return vec2<f32>(s, keep(b - keep(s - a)));
}

// Halves of 12 bits each: their products are exact.
fn halves(a: f32) -> vec2<f32> {
    let c = keep(4097.0 * a);
    let high = keep(c - keep(c - a));
    return vec2<f32>(high, keep(a - high));
}

fn two_product(a: f32, b: f32) -> vec2<f32> {
    let p = keep(a * b);
    let x = halves(a);
    let y = halves(b);
    let high = keep(keep(x.x * y.x) - p);
    let middle = keep(keep(high + keep(x.x * y.y)) + keep(x.y * y.x));
    return vec2<f32>(p, keep(middle + keep(x.y * y.y)));
}

fn add(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let s = two_sum(a.x, b.x);
    let t = two_sum(a.y, b.y);
    let v = fast_two_sum(s.x, keep(s.y + t.x));
    return fast_two_sum(v.x, keep(t.y + v.y));
}

fn mul(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let p = two_product(a.x, b.x);
    return fast_two_sum(p.x, keep(p.y + keep(keep(a.x * b.y) + keep(a.y * b.x))));
}

// A sum of three quotients in single precision, each of what the ones before it left over. Divisions may be off by 2.5
// units in the last place, so that each quotient is right to 7 u; the products of b and the first two are right to 3 u²
// of the dividend. With the last sum that makes 6 u² of the quotient, and terms of u³.
fn divide(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let q1 = keep(a.x / b.x);
    let r1 = add(a, -mul(b, vec2<f32>(q1, 0.0)));
    let q2 = keep(r1.x / b.x);
    let r2 = add(r1, -mul(b, vec2<f32>(q2, 0.0)));
    let q3 = keep(r2.x / b.x);
    return add(fast_two_sum(q1, q2), vec2<f32>(q3, 0.0));
}
