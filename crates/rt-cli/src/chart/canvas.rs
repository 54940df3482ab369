//! A bitmap to draw rectangles and text on.

use crate::image::write_rgb;
use ab_glyph::{Font, FontRef, PxScale, ScaleFont, point};
use anyhow::{Context, Result};
use std::path::Path;

/// 8-bit sRGB.
pub(super) type Rgb = [u8; 3];

/// Which end of a text is at the place given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Align {
    Left,
    Center,
}

/// A picture in memory, with the origin at the upper left.
pub(super) struct Canvas {
    width: u32,
    height: u32,
    pixels: Vec<Rgb>,
    font: FontRef<'static>,
}

impl Canvas {
    /// An empty picture of one colour.
    pub(super) fn new(width: u32, height: u32, color: Rgb) -> Result<Self> {
        // Hack (MIT and Bitstream Vera licences), embedded so that a machine without fonts writes the same file.
        let font =
            FontRef::try_from_slice(epaint_default_fonts::HACK_REGULAR).context("the embedded font is broken")?;
        Ok(Self { width, height, pixels: vec![color; width as usize * height as usize], font })
    }

    /// Sets one pixel; outside the picture nothing happens.
    pub(super) fn set(&mut self, x: u32, y: u32, color: Rgb) {
        self.blend(i64::from(x), i64::from(y), color, 1.0);
    }

    /// Covers a share of one pixel; outside the picture nothing happens.
    pub(super) fn blend(&mut self, x: i64, y: i64, color: Rgb, cover: f32) {
        if x < 0 || y < 0 || x >= i64::from(self.width) || y >= i64::from(self.height) {
            return;
        }
        let pixel = &mut self.pixels[y as usize * self.width as usize + x as usize];
        for (channel, ink) in pixel.iter_mut().zip(color) {
            *channel = (f32::from(*channel) + (f32::from(ink) - f32::from(*channel)) * cover.min(1.0)).round() as u8;
        }
    }

    /// Fills a rectangle.
    pub(super) fn fill(&mut self, x: u32, y: u32, width: u32, height: u32, color: Rgb) {
        for row in y..y.saturating_add(height).min(self.height) {
            for column in x..x.saturating_add(width).min(self.width) {
                self.set(column, row, color);
            }
        }
    }

    /// Writes text of `size` pixels with its baseline at `y`.
    pub(super) fn text(&mut self, text: &str, x: u32, y: u32, size: f32, align: Align, color: Rgb) {
        let font = self.font.clone();
        let scaled = font.as_scaled(PxScale::from(size));
        let width = self.text_width(text, size);
        let mut pen = x as f32
            - match align {
                Align::Left => 0.0,
                Align::Center => width / 2.0,
            };
        for letter in text.chars() {
            let id = scaled.glyph_id(letter);
            let glyph = id.with_scale_and_position(size, point(pen, y as f32));
            pen += scaled.h_advance(id);
            // Blank letters have no outline.
            let Some(outline) = font.outline_glyph(glyph) else { continue };
            let corner = outline.px_bounds().min;
            outline.draw(|dx, dy, cover| {
                self.blend(corner.x as i64 + i64::from(dx), corner.y as i64 + i64::from(dy), color, cover);
            });
        }
    }

    /// Width of a text in pixels.
    pub(super) fn text_width(&self, text: &str, size: f32) -> f32 {
        let scaled = self.font.as_scaled(PxScale::from(size));
        text.chars().map(|letter| scaled.h_advance(scaled.glyph_id(letter))).sum()
    }

    /// Writes the picture.
    pub(super) fn write_png(&self, path: &Path) -> Result<()> {
        write_rgb(path, self.width, self.height, self.pixels.as_flattened())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_leaves_ink_and_stays_inside() {
        let mut canvas = Canvas::new(60, 20, [255; 3]).unwrap();
        canvas.text("µs ≥ 12·3", 30, 15, 14.0, Align::Center, [0; 3]);
        assert!(canvas.pixels.iter().filter(|pixel| pixel[0] < 100).count() > 20);
        canvas.text("beyond every edge", 0, 0, 80.0, Align::Center, [0; 3]);
    }

    #[test]
    fn the_font_has_every_sign_the_charts_use() {
        let canvas = Canvas::new(1, 1, [255; 3]).unwrap();
        for sign in "≥µ·–×".chars() {
            assert_ne!(canvas.font.glyph_id(sign).0, 0, "{sign}");
        }
    }
}
