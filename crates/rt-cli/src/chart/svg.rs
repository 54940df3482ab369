//! Rectangles, lines and text at places in pixels, as an SVG.

use anyhow::{Result, anyhow};
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// plotters places things at whole units; with eight to a pixel, gaps far thinner than a pixel keep their place.
const UNITS: f64 = 8.0;

pub(super) const INK: RGBColor = RGBColor(0x22, 0x22, 0x22);
pub(super) const FAINT: RGBColor = RGBColor(0x66, 0x66, 0x66);

pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub(super) type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

/// A place in pixels from the upper left corner.
pub(super) type Place = (f64, f64);

/// The text of a picture of the given size in pixels, white where `draw` leaves it so; `name` is for the error.
pub(super) fn picture(name: &str, (width, height): Place, draw: impl FnOnce(&Area<'_>) -> Drawn) -> Result<String> {
    let mut svg = String::new();
    let size = (units(width) as u32, units(height) as u32);
    {
        let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        let drawing = || -> Drawn {
            area.fill(&WHITE)?;
            draw(&area)?;
            area.present()
        };
        drawing().map_err(|error| anyhow!("cannot draw {name}: {error}"))?;
    }
    // The view box keeps the fine units; the picture is shown in pixels.
    let fine = format!("width=\"{}\" height=\"{}\"", size.0, size.1);
    Ok(svg.replacen(&fine, &format!("width=\"{width}\" height=\"{height}\""), 1))
}

fn units(pixels: f64) -> i32 {
    (pixels * UNITS).round() as i32
}

fn place((x, y): Place) -> (i32, i32) {
    (units(x), units(y))
}

pub(super) fn rectangle(area: &Area<'_>, from: Place, to: Place, color: &RGBColor) -> Drawn {
    // At least one unit wide, or nothing would be seen of it.
    let right = units(to.0).max(units(from.0) + 1);
    area.draw(&Rectangle::new([place(from), (right, units(to.1))], color.filled()))
}

/// A line through the places, `width` pixels wide.
pub(super) fn line(area: &Area<'_>, places: &[Place], width: f64, color: &RGBColor) -> Drawn {
    let style = color.stroke_width(units(width) as u32);
    area.draw(&PathElement::new(places.iter().copied().map(place).collect::<Vec<_>>(), style))
}

/// A polygon with a white border, which keeps neighbours apart.
pub(super) fn polygon(area: &Area<'_>, corners: &[Place], color: &RGBColor) -> Drawn {
    let mut corners: Vec<_> = corners.iter().copied().map(place).collect();
    area.draw(&Polygon::new(corners.clone(), color.filled()))?;
    corners.extend(corners.first().copied());
    area.draw(&PathElement::new(corners, WHITE.stroke_width(units(1.0) as u32)))
}

/// How text looks: size in pixels, and which end of it is at the place given. Its middle is at the height given.
#[derive(Clone, Copy)]
pub(super) struct Look {
    pub(super) size: f64,
    pub(super) bold: bool,
    pub(super) color: RGBColor,
    pub(super) align: HPos,
}

impl Default for Look {
    fn default() -> Self {
        Self { size: 13.0, bold: false, color: INK, align: HPos::Left }
    }
}

pub(super) fn text(area: &Area<'_>, text: &str, at: Place, look: Look) -> Drawn {
    let style = if look.bold { FontStyle::Bold } else { FontStyle::Normal };
    let font = ("sans-serif", units(look.size), style).into_font().color(&look.color);
    let style = font.pos(Pos::new(look.align, VPos::Center));
    area.draw(&Text::new(text.to_owned(), place(at), style))
}
