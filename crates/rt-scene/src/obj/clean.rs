//! The pre-pass: checks what `tobj` does not, and writes a text that it reads without surprises.

use super::progress::STEP;
use super::statement::{Statement, Statements};
use super::{LoadError, LoadOptions, LoadProgress, LoadStage, diagnose};
use std::io::Write as _;

/// What the pre-pass leaves: two texts for the parser, vertices first, so that faces may stand above their vertices.
#[derive(Clone, Debug, Default)]
pub(super) struct Clean {
    /// `v x y z` lines.
    pub(super) vertices: Vec<u8>,
    /// `f a b c …` lines with positive indices only, and the `mtllib` and `usemtl` lines between them.
    pub(super) faces: Vec<u8>,
    /// Number of `p` statements.
    pub(super) points: u64,
    /// Number of `l` statements.
    pub(super) lines: u64,
    vertex_count: u64,
    triangle_count: u64,
    largest_index: u64,
}

impl Clean {
    /// Length of both texts in bytes.
    pub(super) fn bytes(&self) -> u64 {
        (self.vertices.len() + self.faces.len()) as u64
    }
}

/// Runs the pre-pass over the text of the file called `name`.
pub(super) fn clean(
    bytes: &[u8],
    name: &str,
    options: &LoadOptions,
    progress: &mut dyn FnMut(LoadProgress),
) -> Result<Clean, LoadError> {
    let file = || name.to_owned();
    let total_bytes = bytes.len() as u64;
    let mut out = Clean::default();
    let mut statements = Statements::new(bytes);
    let mut reported = 0;
    while let Some(statement) = statements.next() {
        match statement.keyword() {
            b"v" => out.add_vertex(&statement, name)?,
            b"f" => out.add_face(&statement, name)?,
            b"p" => out.points += 1,
            b"l" => out.lines += 1,
            keyword @ (b"mtllib" | b"usemtl") => out.add_name(keyword, &statement.name()),
            // Normals, texture coordinates, groups, free-form surfaces and what other programs add: nothing we need.
            _ => {}
        }
        if out.triangle_count > u64::from(options.max_triangles) {
            return Err(LoadError::TooLarge { file: file(), what: "triangles", limit: options.max_triangles });
        }
        let done_bytes = total_bytes - statements.remaining();
        if done_bytes - reported >= STEP {
            reported = done_bytes;
            progress(LoadProgress { stage: LoadStage::Checking, done_bytes, total_bytes });
        }
    }
    if out.vertex_count == 0 && out.triangle_count == 0 {
        return Err(LoadError::NotObj { file: file(), looks_like: diagnose::looks_like(bytes) });
    }
    if out.triangle_count == 0 {
        return Err(LoadError::NoTriangles { file: file(), vertices: out.vertex_count });
    }
    if out.vertex_count >= u64::from(u32::MAX) {
        return Err(LoadError::TooLarge { file: file(), what: "vertices", limit: u32::MAX - 1 });
    }
    if out.largest_index > out.vertex_count {
        return Err(diagnose::index_beyond(bytes, name, out.vertex_count));
    }
    Ok(out)
}

impl Clean {
    /// Copies three coordinates. A fourth number is a weight of rational curves and more are colours: not used here.
    fn add_vertex(&mut self, statement: &Statement<'_>, name: &str) -> Result<(), LoadError> {
        let mut found = 0;
        self.vertices.push(b'v');
        for word in statement.arguments().take(3) {
            self.vertices.push(b' ');
            copy_ascii(&mut self.vertices, word);
            found += 1;
        }
        self.vertices.push(b'\n');
        if found < 3 {
            return Err(LoadError::Vertex { file: name.to_owned(), line: statement.line, found });
        }
        self.vertex_count += 1;
        Ok(())
    }

    /// Copies the vertex indices of a face, negative ones resolved.
    fn add_face(&mut self, statement: &Statement<'_>, name: &str) -> Result<(), LoadError> {
        let (file, line) = (|| name.to_owned(), statement.line);
        let mut corners = 0;
        self.faces.push(b'f');
        for word in statement.arguments() {
            let index = vertex_part(word);
            let number = parse_index(index).ok_or_else(|| LoadError::Number {
                file: file(),
                line,
                text: diagnose::shorten(word),
            })?;
            // Index 0 and counts from before the first vertex lead nowhere; so does what saturated.
            let position = if number < 0 { self.vertex_count as i64 + 1 + number } else { number };
            if position <= 0 {
                let vertices = self.vertex_count;
                return Err(LoadError::Index { file: file(), line, index: diagnose::shorten(index), vertices });
            }
            self.largest_index = self.largest_index.max(position as u64);
            self.faces.push(b' ');
            if number == position && index[0] != b'+' {
                self.faces.extend_from_slice(index);
            } else {
                let written = write!(self.faces, "{position}");
                debug_assert!(written.is_ok(), "writing to a vector cannot fail");
            }
            corners += 1;
        }
        self.faces.push(b'\n');
        if corners < 3 {
            return Err(LoadError::Face { file: file(), line, corners });
        }
        self.triangle_count += corners as u64 - 2;
        Ok(())
    }

    /// Copies a statement that carries a name. Without one it means nothing, and the parser would refuse it.
    fn add_name(&mut self, keyword: &[u8], name: &str) {
        if !name.is_empty() {
            self.faces.extend_from_slice(keyword);
            self.faces.push(b' ');
            // What joins lines elsewhere (a bare carriage return) must not begin a new statement here.
            self.faces.extend(name.bytes().map(|byte| if byte == b'\r' || byte == b'\n' { b' ' } else { byte }));
            self.faces.push(b'\n');
        }
    }
}

/// The part of a face's corner before the first slash.
pub(super) fn vertex_part(word: &[u8]) -> &[u8] {
    word.split(|&byte| byte == b'/').next().unwrap_or_default()
}

/// A whole number; one with too many digits becomes the largest of its sign, which no file has vertices for.
pub(super) fn parse_index(text: &[u8]) -> Option<i64> {
    let (negative, digits) = match text {
        [b'-', digits @ ..] => (true, digits),
        [b'+', digits @ ..] => (false, digits),
        digits => (false, digits),
    };
    if digits.is_empty() {
        return None;
    }
    // One less than the limits, so that a vertex count can be added without overflow.
    const LARGEST: i64 = i64::MAX / 2;
    let mut number = 0_i64;
    for digit in digits {
        if !digit.is_ascii_digit() {
            return None;
        }
        number = number.saturating_mul(10).saturating_add(i64::from(digit - b'0')).min(LARGEST);
    }
    Some(if negative { -number } else { number })
}

/// Copies a word; bytes that cannot belong to a number become `?`, since the parser takes some of them for spaces.
fn copy_ascii(out: &mut Vec<u8>, word: &[u8]) {
    out.extend(word.iter().map(|&byte| if byte.is_ascii_graphic() { byte } else { b'?' }));
}
