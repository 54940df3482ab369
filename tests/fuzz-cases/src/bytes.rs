//! Reading structure out of arbitrary bytes.

use glam::Vec3;

/// Bytes read from the front; zeros where they end.
#[derive(Debug)]
pub(crate) struct Bytes<'a>(pub &'a [u8]);

impl Bytes<'_> {
    pub(crate) fn byte(&mut self) -> u8 {
        let (&first, rest) = self.0.split_first().unwrap_or((&0, &[]));
        self.0 = rest;
        first
    }

    pub(crate) fn word(&mut self) -> u32 {
        u32::from_le_bytes(std::array::from_fn(|_| self.byte()))
    }

    /// Any bits: infinite, NaN, denormal too.
    pub(crate) fn float(&mut self) -> f32 {
        f32::from_bits(self.word())
    }

    pub(crate) fn vector(&mut self) -> Vec3 {
        Vec3::new(self.float(), self.float(), self.float())
    }

    /// A small whole number as a float, or any bits: small numbers make shared vertices, equal planes and ties.
    pub(crate) fn coordinate(&mut self) -> f32 {
        match self.byte() {
            255 => self.float(),
            byte => f32::from(byte as i8) * 0.25,
        }
    }

    pub(crate) fn point(&mut self) -> Vec3 {
        Vec3::new(self.coordinate(), self.coordinate(), self.coordinate())
    }

    pub(crate) const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}
