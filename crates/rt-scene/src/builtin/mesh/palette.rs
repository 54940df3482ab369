//! Colours of a scene.

use glam::Vec3;

/// Index of a colour in a [`Palette`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::builtin) struct Colour(u16);

impl Colour {
    /// The index.
    pub(in crate::builtin) const fn index(self) -> u16 {
        self.0
    }
}

/// The colours of a scene, in linear light.
#[derive(Debug, Default)]
pub(in crate::builtin) struct Palette(Vec<Vec3>);

impl Palette {
    /// Adds a colour given as one reads it from a picture: `0xRRGGBB`, sRGB.
    pub(in crate::builtin) fn add(&mut self, rgb: u32) -> Colour {
        let index = self.0.len() as u16;
        let [_, r, g, b] = rgb.to_be_bytes();
        self.0.push(Vec3::from([r, g, b].map(|byte| linear(f32::from(byte) / 255.0))));
        Colour(index)
    }

    /// Adds several colours.
    pub(in crate::builtin) fn add_all<const N: usize>(&mut self, rgb: [u32; N]) -> [Colour; N] {
        rgb.map(|colour| self.add(colour))
    }

    /// The colours in the order they were added.
    pub(in crate::builtin) fn into_colours(self) -> Vec<Vec3> {
        self.0
    }
}

/// Linear light from an sRGB component (IEC 61966-2-1).
fn linear(component: f32) -> f32 {
    if component <= 0.040_45 { component / 12.92 } else { libm::powf((component + 0.055) / 1.055, 2.4) }
}
