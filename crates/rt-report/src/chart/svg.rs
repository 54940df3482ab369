//! SVG as text: the few elements that drawings are made of, in pixels.

use super::canvas::Rgb;
use super::sheet::{Align, Look, Place};
use crate::html::escaped;
use std::fmt::Write as _;

/// A document in the making; every element has a line of its own.
pub(super) struct Svg {
    text: String,
}

impl Svg {
    /// A picture of `width × height` pixels, filled with one colour.
    pub(super) fn new(width: f64, height: f64, paper: Rgb) -> Self {
        let text = format!(
            "<svg width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
             xmlns=\"http://www.w3.org/2000/svg\">\n"
        );
        let mut svg = Self { text };
        svg.rectangle((0.0, 0.0), (width, height), paper);
        svg
    }

    fn rectangle(&mut self, from: Place, to: Place, color: Rgb) {
        self.tipped(from, to, color, "");
    }

    /// A rectangle that browsers explain when it is pointed at.
    pub(super) fn tipped(&mut self, from: Place, to: Place, color: Rgb, tip: &str) {
        let [x, y] = [from.0.min(to.0), from.1.min(to.1)].map(number);
        let [width, height] = [(to.0 - from.0).abs(), (to.1 - from.1).abs()].map(number);
        let fill = hex(color);
        let rect = format!("<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" fill=\"{fill}\"");
        match tip {
            "" => self.line(format_args!("{rect}/>")),
            tip => self.line(format_args!("{rect}><title>{}</title></rect>", escaped(tip))),
        }
    }

    pub(super) fn polyline(&mut self, points: &[Place], width: f64, color: Rgb) {
        let (points, width, stroke) = (places(points), number(width), hex(color));
        self.line(format_args!(
            "<polyline fill=\"none\" stroke=\"{stroke}\" stroke-width=\"{width}\" points=\"{points}\"/>"
        ));
    }

    pub(super) fn polygon(&mut self, corners: &[Place], color: Rgb) {
        let (points, fill) = (places(corners), hex(color));
        self.line(format_args!("<polygon fill=\"{fill}\" points=\"{points}\"/>"));
    }

    pub(super) fn circle(&mut self, at: Place, radius: f64, color: Rgb) {
        let ([x, y, r], fill) = ([at.0, at.1, radius].map(number), hex(color));
        self.line(format_args!("<circle cx=\"{x}\" cy=\"{y}\" r=\"{r}\" fill=\"{fill}\"/>"));
    }

    pub(super) fn text(&mut self, text: &str, at: Place, look: &Look) {
        let anchor = match look.align {
            Align::Left => "start",
            Align::Center => "middle",
            Align::Right => "end",
        };
        let weight = if look.bold { " font-weight=\"bold\"" } else { "" };
        let ([x, y, size], fill) = ([at.0, at.1, look.size].map(number), hex(look.color));
        // Half the height of small letters down: the middle of the text is at the place.
        self.line(format_args!(
            "<text x=\"{x}\" y=\"{y}\" dy=\"0.5ex\" text-anchor=\"{anchor}\" font-family=\"sans-serif\" \
             font-size=\"{size}\"{weight} fill=\"{fill}\">{}</text>",
            escaped(text)
        ));
    }

    /// The whole document.
    pub(super) fn finish(mut self) -> String {
        self.text.push_str("</svg>\n");
        self.text
    }

    fn line(&mut self, element: std::fmt::Arguments<'_>) {
        let _ = writeln!(self.text, "{element}");
    }
}

/// Hundredths of a pixel, without zeros that say nothing; 0 for what is not finite, which would make the document
/// invalid.
fn number(value: f64) -> String {
    let rounded = if value.is_finite() { (value * 100.0).round() / 100.0 } else { 0.0 };
    // Not −0.
    format!("{}", rounded + 0.0)
}

fn places(points: &[Place]) -> String {
    let place = |&(x, y): &Place| format!("{},{}", number(x), number(y));
    points.iter().map(place).collect::<Vec<_>>().join(" ")
}

fn hex([r, g, b]: Rgb) -> String {
    format!("#{r:02X}{g:02X}{b:02X}")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mutants: a rectangle of negative width; `NaN` in an attribute; text that is not escaped.
    #[test]
    fn elements_are_well_formed() {
        let mut svg = Svg::new(60.0, 40.5, [0xff; 3]);
        svg.rectangle((20.0, 1.0), (1.004, 20.0), [0, 0x72, 0xb2]);
        svg.tipped((0.0, 0.0), (1.0, 1.0), [0; 3], "1 < 2");
        svg.polyline(&[(0.0, -0.001), (f64::NAN, f64::INFINITY)], 1.5, [0x22; 3]);
        svg.text("a < \"b\"", (1.0, 2.0), &Look { bold: true, align: Align::Right, ..Look::default() });
        let text = svg.finish();
        assert!(text.starts_with("<svg width=\"60\" height=\"40.5\" viewBox=\"0 0 60 40.5\" xmlns="));
        assert!(text.contains("<rect x=\"1\" y=\"1\" width=\"19\" height=\"19\" fill=\"#0072B2\"/>"), "{text}");
        assert!(text.contains("<title>1 &lt; 2</title></rect>"), "{text}");
        assert!(text.contains("points=\"0,0 0,0\"") && !text.contains("NaN") && !text.contains("inf"), "{text}");
        assert!(text.contains("text-anchor=\"end\"") && text.contains("font-weight=\"bold\""));
        assert!(text.contains(">a &lt; &quot;b&quot;</text>\n</svg>\n"), "{text}");
    }
}
