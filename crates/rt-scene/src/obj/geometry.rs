//! The parser: from statements to vertices and triangles.

use super::material::Uses;
use super::number::{self, vertex_part};
use super::polygon::{self, Shape};
use super::statement::{Name, Statement, Statements};
use super::{Defect, Fault, LoadOptions};
use crate::memory::{grow, push};
use crate::progress::{LoadStage, Meter, Watch};
use glam::DVec3;
use std::ops::Range;

/// Stands for the vertices of a face that is left out.
pub(super) const NOWHERE: u32 = u32::MAX;

/// Vertices are numbered below this, which leaves numbers for [`NOWHERE`] and one that is not finite.
pub(crate) const MOST_VERTICES: u32 = u32::MAX - 2;

/// Coordinates up to here stay within single precision whatever offset is subtracted: see [`super::place`].
const SURE: f64 = f32::MAX as f64 / 4.0;

/// What a text says.
#[derive(Debug, Default)]
pub(super) struct Geometry<'a> {
    /// Every vertex of the file; NaN where it is no three numbers.
    pub(super) vertices: Vec<DVec3>,
    /// Vertices of each triangle, counted from 0, or [`NOWHERE`].
    pub(super) triangles: Vec<[u32; 3]>,
    /// Vertices that may be beyond single precision, and those that are NaN.
    pub(super) doubtful: Vec<Doubtful>,
    /// Which triangle has which material.
    pub(super) uses: Uses<'a>,
    /// What statements `o` and `g` tell apart, in order.
    parts: Vec<Part<'a>>,
    /// Number of points (`p`).
    pub(super) points: u64,
    /// Number of lines (`l`).
    pub(super) lines: u64,
    /// Faces that are left out.
    pub(super) left_out: LeftOut,
    /// Polygons that cross themselves.
    pub(super) crossing: Noticed,
    /// Polygons that do not lie in a plane.
    pub(super) warped: Noticed,
}

impl Geometry<'_> {
    /// The same without names of materials, which are parts of the text.
    pub(super) fn without_text(self) -> Geometry<'static> {
        Geometry { uses: Uses::default(), parts: Vec::new(), ..self }
    }

    /// The objects and groups that have triangles, by their names; none where all triangles are in one without a name.
    pub(super) fn parts(&self) -> Vec<crate::Geometry> {
        let end = self.triangles.len() as u32;
        let named = self.parts.iter().filter(|part| part.first < end);
        let mut parts: Vec<crate::Geometry> = named.map(Part::geometry).collect();
        // What stands above the first of these statements.
        if parts.first().is_some_and(|part| part.first > 0) {
            parts.insert(0, crate::Geometry { name: String::new(), first: 0 });
        }
        if let [crate::Geometry { name, .. }] = &parts[..]
            && name.is_empty()
        {
            parts.clear();
        }
        parts
    }
}

/// Triangles of one object and group, up to the next part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Part<'a> {
    first: u32,
    object: Option<Name<'a>>,
    group: Option<Name<'a>>,
}

impl Part<'_> {
    fn geometry(&self) -> crate::Geometry {
        let names = [self.object, self.group].into_iter().flatten().map(|name| name.text());
        let mut names: Vec<_> = names.filter(|name| !name.is_empty()).collect();
        names.dedup();
        crate::Geometry { name: names.join("/"), first: self.first }
    }
}

/// A vertex that may not be finite in single precision, or is not.
#[derive(Clone, Copy, Debug)]
pub(super) struct Doubtful {
    pub(super) vertex: u32,
    pub(super) line: u64,
}

/// How often something was noticed, and the line of the first time.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Noticed {
    pub(super) count: u64,
    pub(super) line: u64,
}

impl Noticed {
    fn add(&mut self, line: u64) {
        self.count += 1;
        self.line = if self.count == 1 { line } else { self.line.min(line) };
    }
}

/// Faces that are left out because of a defect.
#[derive(Clone, Debug, Default)]
pub(super) struct LeftOut {
    pub(super) faces: u64,
    /// One of the defects, with its line.
    pub(super) example: Option<(u64, Defect)>,
}

impl LeftOut {
    fn add(&mut self, line: u64, defect: impl FnOnce() -> Defect) {
        self.faces += 1;
        self.example.get_or_insert_with(|| (line, defect()));
    }
}

/// A face that refers to vertices further down.
#[derive(Clone, Copy, Debug)]
struct Forward {
    line: u64,
    first_triangle: u32,
    corners: u32,
}

/// Parses a text.
pub(super) fn parse<'a>(
    text: &'a [u8],
    options: &'a LoadOptions,
    watch: &mut Watch<'_>,
) -> Result<Geometry<'a>, Fault> {
    let geometry = Geometry::default();
    let mut parser = Parser { options, geometry, forward: Vec::new(), corners: Vec::new(), object: None, group: None };
    let bytes = text.len() as u64;
    let mut statements = Statements::new(text);
    let mut meter = Meter::begin(LoadStage::Parsing, bytes, watch)?;
    while let Some(statement) = statements.next() {
        parser.read(&statement)?;
        meter.at(bytes - statements.remaining())?;
    }
    parser.resolve_forward(text)?;
    Ok(parser.geometry)
}

struct Parser<'a> {
    options: &'a LoadOptions,
    geometry: Geometry<'a>,
    forward: Vec<Forward>,
    /// Of the present face.
    corners: Vec<u32>,
    /// What faces belong to.
    object: Option<Name<'a>>,
    group: Option<Name<'a>>,
}

impl<'a> Parser<'a> {
    fn read(&mut self, statement: &Statement<'a>) -> Result<(), Fault> {
        let keyword = statement.keyword();
        match keyword {
            b"v" | b"V" => self.vertex(statement, None)?,
            // `fo` is an older form.
            b"f" | b"F" | b"fo" => self.face(statement, None)?,
            b"p" | b"P" => self.geometry.points += 1,
            b"l" | b"L" => self.geometry.lines += 1,
            b"o" | b"O" => {
                (self.object, self.group) = (Some(statement.name()), None);
                self.part()?;
            }
            b"g" | b"G" => {
                self.group = Some(statement.name());
                self.part()?;
            }
            word if word.eq_ignore_ascii_case(b"usemtl") => {
                let first = self.geometry.triangles.len() as u32;
                self.geometry.uses.begin(first, statement.name(), statement.line)?;
            }
            word if word.eq_ignore_ascii_case(b"mtllib") => self.geometry.uses.add_library(statement.name())?,
            // No keyword looks so: a blank is missing, or one that is not ASCII's.
            [b'v' | b'V', next, ..] if runs_on(*next) => self.vertex(statement, Some(number::defect(keyword)))?,
            [b'f' | b'F', next, ..] if runs_on(*next) => self.face(statement, Some(number::defect(keyword)))?,
            // Normals, texture coordinates, free-form surfaces and what other programs add: nothing we need.
            _ => {}
        }
        Ok(())
    }

    /// Begins a part, unless faces go on with the one before. One without faces makes room for the next.
    fn part(&mut self) -> Result<(), Fault> {
        let Self { object, group, .. } = *self;
        let Geometry { parts, triangles, .. } = &mut self.geometry;
        let part = Part { first: triangles.len() as u32, object, group };
        while parts.last().is_some_and(|last| last.first == part.first) {
            parts.pop();
        }
        if parts.last().is_none_or(|last| (last.object, last.group) != (object, group)) {
            push(parts, part)?;
        }
        Ok(())
    }

    /// Reads three coordinates. A fourth number is a weight of rational curves and more are colours: not used here.
    fn vertex(&mut self, statement: &Statement<'_>, mut defect: Option<Defect>) -> Result<(), Fault> {
        let line = statement.line;
        let mut coordinates = [f64::NAN; 3];
        let mut found = 0;
        for (slot, word) in coordinates.iter_mut().zip(statement.arguments()) {
            match number::coordinate(word) {
                Some(number) => *slot = number,
                None => defect = defect.or_else(|| Some(number::defect(word))),
            }
            found += 1;
        }
        if found < 3 {
            defect = defect.or(Some(Defect::Coordinates(found)));
        }
        let mut position = DVec3::from(coordinates);
        if let Some(defect) = defect {
            if !self.options.drop_invalid {
                return Err(Fault::Defect { line, defect });
            }
            position = DVec3::NAN;
        }
        let geometry = &mut self.geometry;
        let vertex = u32::try_from(geometry.vertices.len()).unwrap_or(u32::MAX);
        if vertex >= MOST_VERTICES {
            return Err(Fault::TooMany { what: "vertices", limit: MOST_VERTICES });
        }
        if !position.abs().cmple(DVec3::splat(SURE)).all() {
            push(&mut geometry.doubtful, Doubtful { vertex, line })?;
        }
        Ok(push(&mut geometry.vertices, position)?)
    }

    /// Reads the corners of a face, negative indices resolved.
    fn face(&mut self, statement: &Statement<'_>, mut defect: Option<Defect>) -> Result<(), Fault> {
        let line = statement.line;
        let known = self.geometry.vertices.len();
        let mut is_forward = false;
        self.corners.clear();
        for word in statement.arguments() {
            let text = vertex_part(word);
            let corner = match number::index(text) {
                None => {
                    defect = defect.or_else(|| Some(number::defect(word)));
                    NOWHERE
                }
                Some(index) => corner(index, known).unwrap_or_else(|| {
                    let (index, vertices) = (number::shorten(text), known as u64);
                    defect.get_or_insert(Defect::Index { index, vertices });
                    NOWHERE
                }),
            };
            is_forward |= corner as usize >= known;
            push(&mut self.corners, corner)?;
        }
        let count = self.corners.len();
        if count < 3 {
            defect = defect.or(Some(Defect::Corners(count)));
        }
        if let Some(defect) = defect {
            return self.leave_out(count, line, defect);
        }
        let first = self.geometry.triangles.len();
        self.make_room(count - 2)?;
        let Geometry { triangles, vertices, .. } = &mut self.geometry;
        triangles.extend(polygon::fan(&self.corners));
        if is_forward {
            let (first_triangle, corners) = (first as u32, count as u32);
            push(&mut self.forward, Forward { line, first_triangle, corners })?;
        } else if count > 3 {
            let shape = polygon::cover(&self.corners, &mut triangles[first..], vertices);
            self.note(shape, line, first..first + count - 2);
        }
        Ok(())
    }

    /// Keeps the numbers of a defective face's triangles, and refuses the file unless it may be left out.
    fn leave_out(&mut self, corners: usize, line: u64, defect: Defect) -> Result<(), Fault> {
        if !self.options.drop_invalid {
            return Err(Fault::Defect { line, defect });
        }
        let triangles = corners.saturating_sub(2);
        self.make_room(triangles)?;
        self.geometry.triangles.extend(std::iter::repeat_n([NOWHERE; 3], triangles));
        self.geometry.left_out.add(line, || defect);
        Ok(())
    }

    /// Makes room for so many triangles more.
    fn make_room(&mut self, more: usize) -> Result<(), Fault> {
        let triangles = &mut self.geometry.triangles;
        let limit = self.options.max_triangles;
        if triangles.len() + more > limit as usize {
            return Err(Fault::TooMany { what: "triangles", limit });
        }
        if triangles.capacity() - triangles.len() < more {
            grow(triangles, more)?;
        }
        Ok(())
    }

    /// Notes what was found about the polygon that has these triangles.
    fn note(&mut self, shape: Shape, line: u64, triangles: Range<usize>) {
        let geometry = &mut self.geometry;
        match shape {
            Shape::Plain => {}
            Shape::Warped => geometry.warped.add(line),
            Shape::Crossing => geometry.crossing.add(line),
            // Where such faces are not left out, the triangles at fault are found with the vertices.
            Shape::NotFinite if !self.options.drop_invalid => {}
            Shape::NotFinite => {
                geometry.triangles[triangles].fill([NOWHERE; 3]);
                let doubtful = |corner| geometry.doubtful.binary_search_by_key(corner, |doubtful| doubtful.vertex).ok();
                let vertex = self.corners.iter().find_map(doubtful);
                let line = vertex.map_or(line, |index| geometry.doubtful[index].line);
                geometry.left_out.add(line, || Defect::NotFinite { vertices: 1 });
            }
        }
    }

    /// Looks at the faces whose vertices stand below them.
    fn resolve_forward(&mut self, text: &[u8]) -> Result<(), Fault> {
        for Forward { line, first_triangle, corners } in std::mem::take(&mut self.forward) {
            let range = first_triangle as usize..first_triangle as usize + corners as usize - 2;
            let Geometry { triangles, vertices, left_out, .. } = &mut self.geometry;
            let fan = &mut triangles[range.clone()];
            self.corners.clear();
            self.corners.extend(polygon::corners_of(fan));
            if self.corners.iter().any(|&corner| corner as usize >= vertices.len()) {
                let defect = || index_beyond(text, line, vertices.len() as u64);
                if !self.options.drop_invalid {
                    return Err(Fault::Defect { line, defect: defect() });
                }
                fan.fill([NOWHERE; 3]);
                left_out.add(line, defect);
            } else if corners > 3 {
                let shape = polygon::cover(&self.corners, fan, vertices);
                self.note(shape, line, range);
            }
        }
        Ok(())
    }
}

/// The vertex, counted from 0, that an index leads to, where it can be one; `known` vertices stand above.
fn corner(index: i64, known: usize) -> Option<u32> {
    let position = if index < 0 { known as i64 + index } else { index - 1 };
    // Beyond the largest number of a vertex: beyond the last, whatever stands below.
    (position >= 0).then(|| u32::try_from(position).unwrap_or(NOWHERE))
}

/// The defect of the face in `line`, which uses more than the `vertices` there are: found by a second look.
fn index_beyond(text: &[u8], line: u64, vertices: u64) -> Defect {
    let face = Statements::new(text).find(|statement| statement.line == line);
    let mut indices = face.iter().flat_map(Statement::arguments).map(vertex_part);
    let beyond = indices.find(|text| number::index(text).is_some_and(|index| index > 0 && index as u64 > vertices));
    Defect::Index { index: number::shorten(beyond.unwrap_or_default()), vertices }
}

/// Whether a keyword of one letter has run into what follows it.
const fn runs_on(next: u8) -> bool {
    next.is_ascii_digit() || matches!(next, b'-' | b'+' | b'.') || !next.is_ascii()
}
