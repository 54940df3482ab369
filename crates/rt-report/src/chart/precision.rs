//! `precision.svg`: speed against wrong answers, one panel per scene and device.

use super::canvas::Rgb;
use super::sheet::{Align, BLUE, FAINT, GREEN, GRID, INK, Look, ORANGE, PURPLE, Place, SKY, Sheet, VERMILION};
use std::f64::consts::TAU;

/// One setting of the knob on one stream of rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Kind of rays: points of one kind are joined and have one colour.
    pub kind: &'static str,
    /// Setting of the knob: has one shape.
    pub setting: &'static str,
    /// Wrong answers per million rays.
    pub wrong_ppm: f64,
    /// 95% bounds of it.
    pub wrong_bounds: [f64; 2],
    /// Million rays per second.
    pub mray_s: f64,
    /// 95% interval of it.
    pub mray_s_bounds: [f64; 2],
}

/// The points of one panel.
#[derive(Clone, Debug, PartialEq)]
pub struct Front {
    /// Scene and device.
    pub title: String,
    /// In the order of kinds, and of settings within a kind.
    pub points: Vec<Point>,
}

/// Sizes in pixels.
const WIDTH: f64 = 1100.0;
const MARGIN: f64 = 24.0;
const HEADER: f64 = 92.0;
const COLUMNS: usize = 2;
const PANEL_HEIGHT: f64 = 360.0;
const PANEL_TOP: f64 = 40.0;
const PANEL_BOTTOM: f64 = 64.0;
const PANEL_LEFT: f64 = 62.0;
const PANEL_RIGHT: f64 = 20.0;
/// The column of points without a wrong answer, which a logarithmic axis has no place for.
const ZERO: f64 = 180.0;
const RADIUS: f64 = 5.5;
/// How far apart settings of one kind stand there.
const APART: f64 = 9.0;

/// Decades of the axis of wrong answers per million.
const DECADES: [i32; 2] = [-1, 6];

const COLORS: [Rgb; 6] = [BLUE, ORANGE, GREEN, PURPLE, VERMILION, SKY];
pub(super) const COLUMN: Rgb = [0xf4, 0xf6, 0xf8];

/// Different values in the order in which they first come.
fn distinct(fronts: &[Front], of: impl Fn(&Point) -> &'static str) -> Vec<&'static str> {
    let mut found = Vec::new();
    for value in fronts.iter().flat_map(|front| &front.points).map(of) {
        if !found.contains(&value) {
            found.push(value);
        }
    }
    found
}

/// The chart as an SVG document, panels in the order given.
#[must_use]
pub fn to_svg(fronts: &[Front]) -> String {
    let kinds = distinct(fronts, |point| point.kind);
    let settings = distinct(fronts, |point| point.setting);
    let height = HEADER + PANEL_HEIGHT * fronts.len().div_ceil(COLUMNS) as f64 + MARGIN;
    let mut sheet = Sheet::new(WIDTH, height);
    header(&mut sheet, &kinds, &settings);
    for (i, front) in fronts.iter().enumerate() {
        let width = (WIDTH - 2.0 * MARGIN) / COLUMNS as f64;
        let corner = (MARGIN + (i % COLUMNS) as f64 * width, HEADER + (i / COLUMNS) as f64 * PANEL_HEIGHT);
        Panel::new(corner, width, front).draw(&mut sheet, front, &kinds, &settings);
    }
    sheet.to_svg()
}

fn header(sheet: &mut Sheet, kinds: &[&str], settings: &[&str]) {
    let title = "Speed against wrong answers";
    sheet.text(title, (MARGIN, 30.0), Look::title());
    let note = "wrong: misses, hits and triangles that are not those of double precision; bars: intervals of both";
    sheet.text(note, (MARGIN + 290.0, 31.0), Look { color: FAINT, ..Look::default() });
    let mut x = MARGIN;
    for (i, kind) in kinds.iter().enumerate() {
        sheet.rectangle((x, 60.0), (x + 18.0, 64.0), color(i));
        sheet.text(*kind, (x + 24.0, 62.0), Look::default());
        x += 44.0 + 7.5 * kind.len() as f64;
    }
    x += 24.0;
    for (i, setting) in settings.iter().enumerate() {
        sheet.polygon(shape(i, (x + 6.0, 62.0)), FAINT);
        sheet.text(*setting, (x + 20.0, 62.0), Look::default());
        x += 40.0 + 7.5 * setting.len() as f64;
    }
}

fn color(kind: usize) -> Rgb {
    COLORS[kind % COLORS.len()]
}

/// A triangle, a disc, a square, a diamond.
fn shape(setting: usize, (x, y): Place) -> Vec<Place> {
    let (corners, turn, radius) = [(3, -0.25, 1.25), (24, 0.0, 1.0), (4, 0.125, 1.2), (4, 0.0, 1.25)][setting % 4];
    let corner = |i: i32| {
        let (sin, cos) = (TAU * (f64::from(i) / f64::from(corners) + turn)).sin_cos();
        (x + RADIUS * radius * cos, y + RADIUS * radius * sin)
    };
    (0..corners).map(corner).collect()
}

/// Where a panel's axes are.
struct Panel {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
    corner: Place,
    /// Least and greatest speed shown; the axis is logarithmic, since kinds of rays differ by a factor of twenty.
    speeds: [f64; 2],
}

impl Panel {
    fn new(corner: Place, width: f64, front: &Front) -> Self {
        let speeds = front.points.iter().flat_map(|p| [p.mray_s_bounds[0], p.mray_s, p.mray_s_bounds[1]]);
        let usable = speeds.filter(|speed| *speed > 0.0 && speed.is_finite());
        let [least, most] = usable.fold([f64::INFINITY, 0.0], |[low, high], s| [s.min(low), s.max(high)]);
        Self {
            left: corner.0 + PANEL_LEFT,
            right: corner.0 + width - PANEL_RIGHT,
            top: corner.1 + PANEL_TOP,
            bottom: corner.1 + PANEL_HEIGHT - PANEL_BOTTOM,
            corner,
            speeds: if most > 0.0 { [least / 1.2, most * 1.2] } else { [0.1, 10.0] },
        }
    }

    /// The place of a rate; those beyond the axis are at its end.
    fn x(&self, ppm: f64) -> f64 {
        let [first, last] = DECADES.map(f64::from);
        let share = (ppm.log10().clamp(first, last) - first) / (last - first);
        self.left + ZERO + share * (self.right - self.left - ZERO)
    }

    fn y(&self, mray_s: f64) -> f64 {
        let [least, most] = self.speeds;
        self.bottom
            - (mray_s / least).ln().clamp(0.0, (most / least).ln()) / (most / least).ln() * (self.bottom - self.top)
    }

    /// Points without a wrong answer stand side by side, a place for each kind and in it one for each setting.
    fn place(&self, point: &Point, (kind, kinds): (usize, usize), (setting, settings): (usize, usize)) -> Place {
        let x = if point.wrong_ppm > 0.0 {
            self.x(point.wrong_ppm)
        } else {
            let aside = APART * (setting as f64 - 0.5 * settings.saturating_sub(1) as f64);
            self.left + ZERO * (kind as f64 + 0.5) / kinds.max(1) as f64 + aside
        };
        (x, self.y(point.mray_s))
    }

    fn draw(&self, sheet: &mut Sheet, front: &Front, kinds: &[&str], settings: &[&str]) {
        sheet.text(front.title.as_str(), (self.left, self.corner.1 + 20.0), Look { bold: true, ..Look::default() });
        self.axes(sheet);
        for (k, kind) in kinds.iter().enumerate() {
            let points: Vec<&Point> = front.points.iter().filter(|point| point.kind == *kind).collect();
            let setting = |point: &Point| settings.iter().position(|s| *s == point.setting).unwrap_or(0);
            let place = |p: &&Point| self.place(p, (k, kinds.len()), (setting(p), settings.len()));
            let places: Vec<Place> = points.iter().map(place).collect();
            if places.len() > 1 {
                sheet.line(places.clone(), 1.5, color(k));
            }
            for (point, &(x, y)) in points.iter().zip(&places) {
                let [low, high] = point.mray_s_bounds.map(|m| self.y(m));
                sheet.line([(x, low), (x, high)], 1.5, color(k));
                if point.wrong_ppm > 0.0 {
                    let [from, to] = point.wrong_bounds.map(|ppm| self.x(ppm));
                    sheet.line([(from, y), (to, y)], 1.5, color(k));
                }
            }
            for (point, place) in points.iter().zip(places) {
                sheet.polygon(shape(setting(point), place), color(k));
            }
        }
    }

    fn axes(&self, sheet: &mut Sheet) {
        sheet.rectangle((self.left, self.top), (self.left + ZERO, self.bottom), COLUMN);
        let small = Look { size: 12.0, color: FAINT, ..Look::default() };
        for tick in round_speeds(self.speeds) {
            let y = self.y(tick);
            sheet.rectangle((self.left, y), (self.right, y + 0.75), GRID);
            sheet.text(format!("{tick}"), (self.left - 8.0, y), Look { align: Align::Right, ..small });
        }
        for decade in DECADES[0]..=DECADES[1] {
            let x = self.x(10.0_f64.powi(decade));
            sheet.rectangle((x, self.top), (x + 0.75, self.bottom), GRID);
            let label = match decade {
                -1 => "0.1".to_owned(),
                6 => "all".to_owned(),
                _ if decade >= 3 => format!("{} k", 10_u64.pow(decade.unsigned_abs() - 3)),
                _ => 10_u64.pow(decade.unsigned_abs()).to_string(),
            };
            sheet.text(label, (x, self.bottom + 14.0), Look { align: Align::Center, ..small });
        }
        let none = (self.left + ZERO / 2.0, self.bottom + 14.0);
        sheet.text("none", none, Look { align: Align::Center, ..small });
        sheet.rectangle((self.left, self.bottom), (self.right, self.bottom + 1.0), INK);
        let label = Look { align: Align::Right, ..small };
        sheet.text("wrong answers per million rays", (self.right, self.bottom + 34.0), label);
        sheet.text("Mray/s", (self.left - 8.0, self.top - 14.0), label);
    }
}

/// 1, 2 and 5 times powers of ten between two speeds.
fn round_speeds([least, most]: [f64; 2]) -> Vec<f64> {
    let decades = -6..=6_i32;
    // Decimal text gives the nearest numbers, which print as short as they were written.
    let round = |decade: i32| ["1", "2", "5"].map(|digit| format!("{digit}e{decade}").parse().unwrap_or(f64::NAN));
    decades.flat_map(round).filter(|speed| (least..=most).contains(speed)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(kind: &'static str, setting: &'static str, wrong_ppm: f64) -> Point {
        let wrong_bounds = [wrong_ppm / 2.0, wrong_ppm * 2.0];
        Point { kind, setting, wrong_ppm, wrong_bounds, mray_s: 2.0, mray_s_bounds: [1.5, 2.5] }
    }

    // Fails when a rate of zero is put on the logarithmic axis, or one beyond its end outside of the panel.
    #[test]
    fn every_point_is_inside_its_panel() {
        let front = Front { title: "a <scene>".to_owned(), points: vec![point("primary", "fast", 30.0)] };
        let panel = Panel::new((0.0, 0.0), 500.0, &front);
        for ppm in [0.0, 1e-9, 1.0, 1e6, 1e9, f64::NAN] {
            let (x, y) = panel.place(&point("primary", "fast", ppm), (0, 5), (0, 3));
            assert!(!(x < panel.left || x > panel.right) && (panel.top..=panel.bottom).contains(&y), "{ppm}: {x} {y}");
        }
        assert!(panel.place(&point("", "", 0.0), (4, 5), (2, 3)).0 < panel.left + ZERO);
        assert!(panel.place(&point("", "", 0.2), (4, 5), (2, 3)).0 > panel.left + ZERO);
    }

    #[test]
    fn charts_name_their_scenes_and_may_be_empty() {
        let front = Front {
            title: "a <scene>".to_owned(),
            points: vec![point("primary", "fast", 30.0), point("primary", "robust", 0.0)],
        };
        let svg = to_svg(&[front.clone(), front.clone(), front]);
        assert!(svg.contains("a &lt;scene&gt;") && svg.contains("width=\"1100\""));
        assert!(to_svg(&[]).ends_with("</svg>\n"));
        assert_eq!(round_speeds([0.15, 6.0]), [0.2, 0.5, 1.0, 2.0, 5.0]);
    }
}
