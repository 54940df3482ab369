//! Whether a device rounds sums and products as the kernels rely on: to nearest, and one by one.

use crate::buffer::{Buffer, Use};
use crate::commands::{Commands, Stage};
use crate::device::Shared;
use crate::pipeline::Bindings;
use crate::timeline::Timeline;
use bytemuck::{Pod, Zeroable};
use rt_core::{DeviceError, random};
use rt_shaders::Purpose;
use std::time::Duration;

/// Pairs of numbers: enough that every way of rounding shows in some.
const PAIRS: u32 = 4096;

/// The longest that computing them may take. It takes microseconds, and on a software device compiling comes first.
const LIMIT: Duration = Duration::from_secs(30);

/// Largest relative error that a quotient of double floats may have: what the bound on distances counts with.
const QUOTIENT: f64 = 1.0 / (1_u64 << 46) as f64;

/// The shader's structure `Answer`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
struct Answer {
    sum: [f32; 2],
    product: [f32; 2],
    chained: [f32; 2],
    quotient: [f32; 2],
}

/// The first pair of numbers with which the device does not compute as it must; `None` if it always does.
pub(crate) fn first_fault(shared: &Shared) -> Result<Option<String>, DeviceError> {
    let logical = &shared.logical;
    let pairs: Vec<[f32; 2]> = (0..PAIRS).map(pair).collect();
    let (given, wanted) = (size_of_val(&pairs[..]) as u64, u64::from(PAIRS) * size_of::<Answer>() as u64);
    let mut upload = Buffer::new(logical, "numbers", given, Use::Upload)?;
    let [numbers, answers] = [given, wanted].map(|size| Buffer::new(logical, "numbers", size, Use::Kernel));
    let (numbers, answers) = (numbers?, answers?);
    let download = Buffer::new(logical, "numbers", wanted, Use::Download)?;
    upload.write(0, &pairs);
    let pipeline = shared.pipeline(Purpose::Arithmetic, 0)?;
    let mut bindings = Bindings::new(shared.layout())?;
    bindings.choose([&numbers, &numbers, &numbers, &numbers, &numbers, &numbers, &answers, &numbers]);
    let (mut commands, mut timeline) = (Commands::new(logical)?, Timeline::new(logical)?);
    commands.record(|to| {
        to.copy(&upload, &numbers, 0, given);
        to.barrier(Stage::Copy, Stage::Kernel);
        to.run(&pipeline, &bindings, PAIRS);
        to.barrier(Stage::Kernel, Stage::Copy);
        to.copy(&answers, &download, 0, wanted);
        to.barrier(Stage::Copy, Stage::Host);
    })?;
    let value = timeline.submit(commands.raw())?;
    if let Err(error) = timeline.wait(value, LIMIT) {
        // The device may still use all of them: better lost than freed.
        std::mem::forget((upload, numbers, answers, download, pipeline, bindings, commands, timeline));
        return Err(error);
    }
    let answers: &[Answer] = download.read(pairs.len());
    let fault = pairs.iter().zip(answers).find(|(pair, answer)| !is_right(**pair, answer));
    Ok(fault.map(|([a, b], answer)| format!("with {a:e} and {b:e} it computes {answer:?}, not {:?}", right(*a, *b))))
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
