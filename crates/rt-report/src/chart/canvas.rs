//! A bitmap to draw rectangles and text on.

use crate::ReportError;
use crate::image::write_rgb;
use ab_glyph::{Font, FontRef, PxScale, ScaleFont, point};
use std::path::Path;

/// 8-bit sRGB.
pub(super) type Rgb = [u8; 3];

/// Which end of a text is at the place given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Align {
    Left,
    Center,
    Right,
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
    pub(super) fn new(width: u32, height: u32, color: Rgb) -> Result<Self, ReportError> {
        // Hack (MIT and Bitstream Vera licences), embedded so that a machine without fonts writes the same file.
        let font = FontRef::try_from_slice(epaint_default_fonts::HACK_REGULAR).map_err(|_| ReportError::Font)?;
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

    /// Fills a rectangle whose edges may lie between pixels.
    pub(super) fn cover(&mut self, from: [f64; 2], to: [f64; 2], color: Rgb) {
        let side = |pixel: f64, axis: usize| (to[axis].min(pixel + 1.0) - from[axis].max(pixel)).clamp(0.0, 1.0);
        self.shade(from, to, color, |x, y| side(x, 0) * side(y, 1));
    }

    /// Draws a line with round ends; one of no length is a disc.
    pub(super) fn stroke(&mut self, from: [f64; 2], to: [f64; 2], width: f64, color: Rgb) {
        let along = [to[0] - from[0], to[1] - from[1]];
        let length2 = along[0] * along[0] + along[1] * along[1];
        let reach = width / 2.0 + 1.0;
        let low = [from[0].min(to[0]) - reach, from[1].min(to[1]) - reach];
        let high = [from[0].max(to[0]) + reach, from[1].max(to[1]) + reach];
        self.shade(low, high, color, |x, y| {
            let [dx, dy] = [x + 0.5 - from[0], y + 0.5 - from[1]];
            let t = if length2 > 0.0 { ((dx * along[0] + dy * along[1]) / length2).clamp(0.0, 1.0) } else { 0.0 };
            let distance = (dx - t * along[0]).hypot(dy - t * along[1]);
            (width / 2.0 + 0.5 - distance).clamp(0.0, 1.0)
        });
    }

    /// Fills a convex polygon, whichever way round its corners are named.
    pub(super) fn polygon(&mut self, corners: &[[f64; 2]], color: Rgb) {
        let ends = |axis: usize| {
            corners.iter().map(|c| c[axis]).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)))
        };
        let ((left, right), (top, bottom)) = (ends(0), ends(1));
        let edges = || corners.iter().zip(corners.iter().cycle().skip(1));
        let area: f64 = edges().map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum();
        self.shade([left, top], [right, bottom], color, |x, y| {
            // Covered as far as the pixel's middle lies inside the nearest edge.
            let inside = |(a, b): (&[f64; 2], &[f64; 2])| {
                let [dx, dy] = [b[0] - a[0], b[1] - a[1]];
                let side = dx * (y + 0.5 - a[1]) - dy * (x + 0.5 - a[0]);
                area.signum() * side / dx.hypot(dy).max(f64::MIN_POSITIVE)
            };
            (edges().map(inside).fold(f64::INFINITY, f64::min) + 0.5).clamp(0.0, 1.0)
        });
    }

    /// Blends pixels between two corners by how much of each is covered; nothing where a corner is not a number.
    fn shade(&mut self, low: [f64; 2], high: [f64; 2], color: Rgb, covered: impl Fn(f64, f64) -> f64) {
        if low.iter().chain(&high).any(|c| c.is_nan()) {
            return;
        }
        // Casts saturate, so that what lies outside is cut.
        let span = |axis: usize, side: u32| (low[axis].floor() as u32).min(side)..(high[axis].ceil() as u32).min(side);
        for y in span(1, self.height) {
            for x in span(0, self.width) {
                let cover = covered(f64::from(x), f64::from(y));
                if cover > 0.0 {
                    self.blend(i64::from(x), i64::from(y), color, cover as f32);
                }
            }
        }
    }

    /// Writes text of `size` pixels with its baseline at `y`.
    pub(super) fn text(&mut self, text: &str, x: u32, y: u32, size: f32, align: Align, color: Rgb) {
        let left = match align {
            Align::Left => x as f32,
            Align::Center => x as f32 - self.text_width(text, size) / 2.0,
            Align::Right => x as f32 - self.text_width(text, size),
        };
        self.text_at(text, left, y as f32, size, color);
    }

    /// Writes text of `size` pixels from `left` on, with its baseline at `y`.
    pub(super) fn text_at(&mut self, text: &str, left: f32, y: f32, size: f32, color: Rgb) {
        let font = self.font.clone();
        let scaled = font.as_scaled(PxScale::from(size));
        let mut pen = left;
        for letter in text.chars() {
            let id = scaled.glyph_id(letter);
            let glyph = id.with_scale_and_position(size, point(pen, y));
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
    pub(super) fn write_png(&self, path: &Path) -> Result<(), ReportError> {
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
