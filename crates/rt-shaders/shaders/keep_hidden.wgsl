// Rounded results stay as they are, for APIs that cannot say so: no compiler may fuse, reorder or cancel operations
// across an exclusive or with bits that it does not know. WGSL allows all three (section "Floating Point Evaluation"),
// and Mesa, for one, cancels (a + b) - a.

// The zero that the host writes to a buffer.
var<private> unknown: u32;

fn keep(x: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) ^ unknown);
}

// Called once, first, with what the buffer holds.
fn hide(zero: u32) {
    unknown = zero;
}
