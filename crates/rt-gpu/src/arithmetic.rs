//! Whether a device rounds sums and products as the kernels rely on: to nearest, and one by one.

use bytemuck::{Pod, Zeroable};
use rt_core::random;

/// Pairs of numbers: enough that every way of rounding shows in some.
pub const PAIRS: u32 = 4096;

/// Largest relative error that a quotient of double floats may have: 6 u², what the bound on distances counts with.
const QUOTIENT: f64 = 6.0 / (1_u64 << 48) as f64;

/// What the kernel writes for each pair, at binding 6: the shader's structure `Answer`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Answer {
    /// a + b, and what rounding left out.
    pub sum: [f32; 2],
    /// a b, and what rounding left out.
    pub product: [f32; 2],
    /// a b + a and a b - b a.
    pub chained: [f32; 2],
    /// a / b, in two parts.
    pub quotient: [f32; 2],
}

/// What the kernel [`Purpose::Arithmetic`](rt_shaders::Purpose::Arithmetic) is given at binding 4: a pair of zeros,
/// behind which it hides results from its compiler, then [`PAIRS`] pairs of numbers.
#[must_use]
pub fn questions() -> Vec<[f32; 2]> {
    std::iter::once([0.0; 2]).chain((0..PAIRS).map(pair)).collect()
}

/// The first of [`questions`] with which a device does not compute as it must, in words; `None` if it always does.
#[must_use]
pub fn first_fault(answers: &[Answer]) -> Option<String> {
    if answers.len() != PAIRS as usize {
        return Some(format!("it gives {} answers to {PAIRS} questions", answers.len()));
    }
    let mut answered = (0..PAIRS).map(pair).zip(answers);
    let ([a, b], answer) = answered.find(|(pair, answer)| !is_right(*pair, answer))?;
    Some(format!("with {a:e} and {b:e} it computes {answer:?}, not {:?}", right(a, b)))
}

/// Two numbers of either sign between 2⁻¹⁰ and 2¹⁰, so close that their sum has fewer than 53 bits.
fn pair(index: u32) -> [f32; 2] {
    let bits = random::pcg3d([index, 17, 4]);
    let number = |bits: u32, exponent: u32| {
        // Sign and fraction as they are, an exponent from the range.
        f32::from_bits(bits & 0x807f_ffff | (127 - 10 + exponent % 20) << 23)
    };
    [number(bits[0], bits[2]), number(bits[1], bits[2] >> 16)]
}

/// What IEEE arithmetic gives, operation by operation.
fn right(a: f32, b: f32) -> Answer {
    let (sum, product) = (a + b, a * b);
    // Both rests are single-precision numbers, and exact in double precision for exponents this close.
    let rest_of_sum = f64::from(a) + f64::from(b) - f64::from(sum);
    let rest_of_product = f64::from(a) * f64::from(b) - f64::from(product);
    let quotient = f64::from(a) / f64::from(b);
    let near = quotient as f32;
    Answer {
        sum: [sum, rest_of_sum as f32],
        product: [product, rest_of_product as f32],
        chained: [product + a, 0.0],
        quotient: [near, (quotient - f64::from(near)) as f32],
    }
}

fn is_right([a, b]: [f32; 2], answer: &Answer) -> bool {
    let expected = right(a, b);
    let value = |[high, low]: [f32; 2]| f64::from(high) + f64::from(low);
    let quotient = (value(answer.quotient) / value(expected.quotient) - 1.0).abs() <= QUOTIENT;
    quotient && *answer == Answer { quotient: answer.quotient, ..expected }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The pairs tell a device that fuses from one that does not, in every place.
    #[test]
    fn fused_operations_would_show() {
        let fused = |index: u32| {
            let [a, b] = pair(index);
            let honest = right(a, b);
            let chained = [(a as f64).mul_add(b.into(), a.into()) as f32, honest.product[1]];
            (is_right([a, b], &honest), is_right([a, b], &Answer { chained, ..honest }))
        };
        assert!((0..PAIRS).all(|i| fused(i).0));
        assert!((0..PAIRS).filter(|&i| fused(i).1).count() < PAIRS as usize / 10);
        let truncated = |index: u32| {
            let [a, b] = pair(index);
            let honest = right(a, b);
            // A rest of the same sign as the product says that rounding to nearest went down, as truncation does.
            honest.product[1] == 0.0 || (honest.product[0] > 0.0) == (honest.product[1] > 0.0)
        };
        assert!((0..PAIRS).any(|i| !truncated(i)));
    }
}
