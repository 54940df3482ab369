//! The colours of the car.

use crate::builtin::mesh::{Colour, Palette};

/// Every colour of the car by its use.
#[derive(Debug)]
pub(super) struct Paint {
    pub(super) floor: Colour,
    pub(super) body: Colour,
    pub(super) gap: Colour,
    pub(super) black: Colour,
    pub(super) rubber: Colour,
    pub(super) chrome: Colour,
    pub(super) alloy: Colour,
    pub(super) steel: Colour,
    pub(super) caliper: Colour,
    pub(super) lens: Colour,
    pub(super) amber: Colour,
    pub(super) tail: Colour,
    pub(super) tail_bright: Colour,
    pub(super) leather: Colour,
    pub(super) leather_dark: Colour,
    pub(super) carpet: Colour,
    pub(super) plate: Colour,
    pub(super) mirror: Colour,
}

impl Paint {
    /// Enters every colour in `palette`.
    pub(super) fn new(palette: &mut Palette) -> Self {
        Self {
            floor: palette.add(0xb4_b4_b0),
            body: palette.add(0xb0_1c_20),
            gap: palette.add(0x14_0a_0a),
            black: palette.add(0x1c_1c_1e),
            rubber: palette.add(0x26_26_28),
            chrome: palette.add(0xd8_da_dc),
            alloy: palette.add(0xb4_b8_bc),
            steel: palette.add(0x8a_8c_90),
            caliper: palette.add(0xd8_a8_20),
            lens: palette.add(0xe8_ee_f2),
            amber: palette.add(0xe0_8a_20),
            tail: palette.add(0x8c_10_14),
            tail_bright: palette.add(0xe0_30_30),
            leather: palette.add(0xb8_8a_5a),
            leather_dark: palette.add(0x4a_34_28),
            carpet: palette.add(0x30_2c_2a),
            plate: palette.add(0xe8_e6_d8),
            mirror: palette.add(0x9a_a8_b4),
        }
    }
}
