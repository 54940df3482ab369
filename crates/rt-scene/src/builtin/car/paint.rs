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
            floor: palette.add(0xb4b4b0),
            body: palette.add(0xb01c20),
            gap: palette.add(0x140a0a),
            black: palette.add(0x1c1c1e),
            rubber: palette.add(0x262628),
            chrome: palette.add(0xd8dadc),
            alloy: palette.add(0xb4b8bc),
            steel: palette.add(0x8a8c90),
            caliper: palette.add(0xd8a820),
            lens: palette.add(0xe8eef2),
            amber: palette.add(0xe08a20),
            tail: palette.add(0x8c1014),
            tail_bright: palette.add(0xe03030),
            leather: palette.add(0xb88a5a),
            leather_dark: palette.add(0x4a3428),
            carpet: palette.add(0x302c2a),
            plate: palette.add(0xe8e6d8),
            mirror: palette.add(0x9aa8b4),
        }
    }
}
