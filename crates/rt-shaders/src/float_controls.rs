//! What a kernel asks of a device's floating-point arithmetic, where the device can promise it.
//!
//! SPIR-V has such promises since the extension `SPV_KHR_float_controls` (in Vulkan since 1.2). naga cannot say them,
//! and a kernel that asks a device for what it does not offer is invalid: so they are added when the kernel is compiled
//! for the device.

/// What a device promises of numbers in single precision, for kernels that ask for it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct FloatControls {
    /// The sign of zero, infinities and NaN are what IEEE 754 says. Slab tests divide by zero and compare infinities.
    pub signed_zero_inf_nan: bool,
    /// Numbers too small for the full precision are not flushed to zero.
    pub denormals: bool,
    /// Rounding is to the nearest number, to even ones among two, which error bounds and double floats count with.
    pub round_to_nearest: bool,
}

// Numbers of the SPIR-V specification.
const HEADER: usize = 5;
const OP_EXTENSION: u32 = 10;
const OP_ENTRY_POINT: u32 = 15;
const OP_EXECUTION_MODE: u32 = 16;
const OP_CAPABILITY: u32 = 17;
const WIDTH: u32 = 32;

impl FloatControls {
    /// Capability and execution mode of each promise that is made.
    fn modes(self) -> impl Iterator<Item = (u32, u32)> + Clone {
        // DenormPreserve, SignedZeroInfNanPreserve, RoundingModeRTE.
        let all = [
            (self.denormals, (4464, 4459)),
            (self.signed_zero_inf_nan, (4466, 4461)),
            (self.round_to_nearest, (4467, 4462)),
        ];
        all.into_iter().filter_map(|(there, numbers)| there.then_some(numbers))
    }

    /// The module, which is valid and has one entry point, asking for all that is promised.
    pub(crate) fn apply(self, words: Vec<u32>) -> Vec<u32> {
        let (header, mut rest) = words.split_at(HEADER.min(words.len()));
        let mut out = header.to_vec();
        let mut asked = self.modes().next().is_none();
        while let [first, ..] = rest {
            let (instruction, later) = rest.split_at(((first >> 16) as usize).clamp(1, rest.len()));
            // The order of a module: capabilities, extensions, … entry points, their modes.
            if !asked && first & 0xffff != OP_CAPABILITY {
                asked = true;
                out.extend(self.modes().flat_map(|(capability, _)| [2 << 16 | OP_CAPABILITY, capability]));
                out.extend(extension());
            }
            out.extend(instruction);
            if let (OP_ENTRY_POINT, [_, _, id, ..]) = (first & 0xffff, instruction) {
                let mode = |(_, mode)| [4 << 16 | OP_EXECUTION_MODE, *id, mode, WIDTH];
                out.extend(self.modes().flat_map(mode));
            }
            rest = later;
        }
        out
    }
}

/// `OpExtension "SPV_KHR_float_controls"`: without it, only SPIR-V from 1.4 on knows the modes.
fn extension() -> Vec<u32> {
    // Four characters a word, the last one followed by at least one zero.
    let name = b"SPV_KHR_float_controls\0\0";
    let text = name.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]));
    std::iter::once((1 + name.len() as u32 / 4) << 16 | OP_EXTENSION).chain(text).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Purpose, kernel};

    const ALL: FloatControls = FloatControls { signed_zero_inf_nan: true, denormals: true, round_to_nearest: true };

    #[test]
    fn modules_ask_for_what_is_promised_and_are_otherwise_the_same() {
        let kernel = kernel(crate::Layout::Two, Purpose::Closest, 20).expect("one for each depth");
        let plain = kernel.spirv();
        assert_eq!(kernel.spirv_with(FloatControls::default()), plain);
        let one = FloatControls { signed_zero_inf_nan: true, ..FloatControls::default() };
        for (controls, promises) in [(one, 1), (ALL, 3)] {
            let words = kernel.spirv_with(controls);
            assert_eq!(words.len(), plain.len() + promises * (2 + 4) + extension().len());
            let modes = words.windows(4).filter(|w| w[0] == 4 << 16 | OP_EXECUTION_MODE && w[3] == WIDTH);
            let asked: Vec<u32> = modes.map(|w| w[2]).collect();
            assert_eq!(asked, controls.modes().map(|(_, mode)| mode).collect::<Vec<_>>());
        }
    }
}
