//! A drawing in pixels, written as SVG and as PNG: what the charts draw on.
//!
//! SVG is written by [`Svg`], PNG by [`Canvas`], whose embedded font makes the same file on a machine without fonts.

pub(super) use super::canvas::Align;
use super::canvas::{Canvas, Rgb};
use super::svg::Svg;
use crate::ReportError;
use std::path::Path;

// M. Okabe and K. Ito, Color Universal Design (2008): told apart with any colour vision.
pub(super) const ORANGE: Rgb = [0xe6, 0x9f, 0x00];
pub(super) const BLUE: Rgb = [0x00, 0x72, 0xb2];
pub(super) const SKY: Rgb = [0x56, 0xb4, 0xe9];
pub(super) const GREEN: Rgb = [0x00, 0x9e, 0x73];
pub(super) const VERMILION: Rgb = [0xd5, 0x5e, 0x00];
pub(super) const PURPLE: Rgb = [0xcc, 0x79, 0xa7];
pub(super) const YELLOW: Rgb = [0xf0, 0xe4, 0x42];

// These are also what html/page.css turns over for dark mode.
pub(super) const PAPER: Rgb = [0xff; 3];
pub(super) const PALE: Rgb = [0xe6; 3];
pub(super) const GRID: Rgb = [0xee; 3];
pub(super) const INK: Rgb = [0x22; 3];
pub(super) const FAINT: Rgb = [0x66; 3];

/// Narrowest rectangle in pixels, or nothing would be seen of it.
const NARROWEST: f64 = 0.125;

/// Pixels of a PNG for each pixel of the drawing: sharp on a screen of double density, and in print.
const PNG_SCALE: f64 = 2.0;

/// Width of a letter over its size, at most: the embedded font's, which is wider than what browsers take.
const LETTER: f64 = 0.61;

/// A place, in pixels from the upper left.
pub(super) type Place = (f64, f64);

/// Something drawn.
enum Shape {
    Rectangle { from: Place, to: Place, color: Rgb, tip: String },
    Line { points: Vec<Place>, width: f64, color: Rgb },
    Polygon { corners: Vec<Place>, color: Rgb },
    Dot { at: Place, radius: f64, color: Rgb },
    Text { text: String, at: Place, look: Look },
}

/// How text looks: size in pixels, and which end of it is at the place given. Its middle is at the height given.
#[derive(Clone, Copy)]
pub(super) struct Look {
    pub(super) size: f64,
    /// Without effect in PNG, whose font has one weight.
    pub(super) bold: bool,
    pub(super) color: Rgb,
    pub(super) align: Align,
}

impl Default for Look {
    fn default() -> Self {
        Self { size: 13.0, bold: false, color: INK, align: Align::Left }
    }
}

impl Look {
    /// The size and weight of a picture's title.
    pub(super) fn title() -> Self {
        Self { size: 20.0, bold: true, ..Self::default() }
    }

    /// Small and faint, as on axes.
    pub(super) fn axis(align: Align) -> Self {
        Self { size: 12.0, color: FAINT, align, ..Self::default() }
    }
}

/// A picture of `width × height` pixels.
pub(super) struct Sheet {
    width: f64,
    height: f64,
    shapes: Vec<Shape>,
}

impl Sheet {
    pub(super) fn new(width: f64, height: f64) -> Self {
        Self { width, height, shapes: Vec::new() }
    }

    pub(super) fn rectangle(&mut self, from: Place, to: Place, color: Rgb) {
        self.tipped(from, to, color, String::new());
    }

    /// A rectangle that says something when it is pointed at; without effect in PNG.
    pub(super) fn tipped(&mut self, from: Place, to: Place, color: Rgb, tip: String) {
        self.shapes.push(Shape::Rectangle { from, to, color, tip });
    }

    pub(super) fn line(&mut self, points: impl Into<Vec<Place>>, width: f64, color: Rgb) {
        self.shapes.push(Shape::Line { points: points.into(), width, color });
    }

    /// A polygon with a border of paper, which keeps neighbours apart.
    pub(super) fn polygon(&mut self, corners: Vec<Place>, color: Rgb) {
        self.shapes.push(Shape::Polygon { corners, color });
    }

    pub(super) fn dot(&mut self, at: Place, radius: f64, color: Rgb) {
        self.shapes.push(Shape::Dot { at, radius, color });
    }

    pub(super) fn text(&mut self, text: impl Into<String>, at: Place, look: Look) {
        self.shapes.push(Shape::Text { text: text.into(), at, look });
    }

    /// The drawing as an SVG document.
    pub(super) fn to_svg(&self) -> String {
        let mut svg = Svg::new(self.width, self.height, PAPER);
        self.shapes.iter().for_each(|shape| shape.to_svg(&mut svg));
        svg.finish()
    }

    /// Writes the drawing as a PNG.
    pub(super) fn write_png(&self, path: &Path) -> Result<(), ReportError> {
        let [width, height] = [self.width, self.height].map(|side| (side * PNG_SCALE).ceil() as u32);
        let mut canvas = Canvas::new(width, height, PAPER)?;
        self.shapes.iter().for_each(|shape| shape.to_canvas(&mut canvas));
        canvas.write_png(path)
    }
}

/// The width that text of `size` pixels has at most.
pub(super) fn text_room(text: &str, size: f64) -> f64 {
    text.chars().count() as f64 * LETTER * size
}

impl Shape {
    fn to_svg(&self, svg: &mut Svg) {
        match self {
            Self::Rectangle { from, to, color, tip } => {
                svg.tipped(*from, (to.0.max(from.0 + NARROWEST), to.1), *color, tip);
            }
            Self::Line { points, width, color } => svg.polyline(points, *width, *color),
            Self::Polygon { corners, color } => {
                svg.polygon(corners, *color);
                let border: Vec<Place> = corners.iter().chain(corners.first()).copied().collect();
                svg.polyline(&border, 1.0, PAPER);
            }
            Self::Dot { at, radius, color } => svg.circle(*at, *radius, *color),
            Self::Text { text, at, look } => svg.text(text, *at, look),
        }
    }

    fn to_canvas(&self, canvas: &mut Canvas) {
        let place = |at: &Place| [at.0 * PNG_SCALE, at.1 * PNG_SCALE];
        match self {
            Self::Rectangle { from, to, color, .. } => canvas.cover(place(from), place(to), *color),
            Self::Line { points, width, color } => {
                for pair in points.windows(2) {
                    canvas.stroke(place(&pair[0]), place(&pair[1]), width * PNG_SCALE, *color);
                }
            }
            Self::Polygon { corners, color } => {
                let corners: Vec<[f64; 2]> = corners.iter().map(place).collect();
                canvas.polygon(&corners, *color);
            }
            Self::Dot { at, radius, color } => canvas.stroke(place(at), place(at), 2.0 * radius * PNG_SCALE, *color),
            Self::Text { text, at, look } => {
                let size = (look.size * PNG_SCALE) as f32;
                let width = f64::from(canvas.text_width(text, size));
                let [x, y] = place(at);
                let left = match look.align {
                    Align::Left => x,
                    Align::Center => x - width / 2.0,
                    Align::Right => x - width,
                };
                // The middle of small letters is about a third of the size above the baseline.
                let baseline = y + f64::from(size) / 3.0;
                canvas.text_at(text, left as f32, baseline as f32, size, look.color);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_are_written_and_the_svg_is_shown_in_pixels() {
        let mut sheet = Sheet::new(60.0, 40.0);
        sheet.rectangle((1.0, 1.0), (20.0, 20.0), BLUE);
        sheet.line([(0.0, 0.0), (30.0, 30.0), (f64::NAN, 1e9)], 1.5, INK);
        sheet.dot((30.0, 20.0), 3.0, ORANGE);
        sheet.polygon(vec![(5.0, 25.0), (15.0, 25.0), (10.0, 35.0)], GREEN);
        for align in [Align::Left, Align::Center, Align::Right] {
            sheet.text("a < b", (30.0, 20.0), Look { align, ..Look::default() });
        }
        let svg = sheet.to_svg();
        assert!(svg.contains("width=\"60\" height=\"40\""));
        assert!(
            svg.contains("a &lt; b")
                && svg.contains("<circle")
                && svg.contains("<polyline")
                && svg.contains("<polygon")
        );
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("sheet.png");
        sheet.write_png(&path).unwrap();
        let file = std::io::BufReader::new(std::fs::File::open(&path).unwrap());
        let reader = png::Decoder::new(file).read_info().unwrap();
        assert_eq!((reader.info().width, reader.info().height), (120, 80));
    }
}
