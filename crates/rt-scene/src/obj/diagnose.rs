//! Finding the line of a defect: slow second looks that only broken files pay for.

use super::LoadError;
use super::clean::{parse_index, vertex_part};
use super::statement::Statements;

/// The error for the first face that uses a vertex beyond the last one.
pub(super) fn index_beyond(bytes: &[u8], name: &str, vertices: u64) -> LoadError {
    for statement in Statements::new(bytes).filter(|s| s.keyword() == b"f") {
        for index in statement.arguments().map(vertex_part) {
            if parse_index(index).is_some_and(|number| number > 0 && number as u64 > vertices) {
                let (file, line) = (name.to_owned(), statement.line);
                return LoadError::Index { file, line, index: shorten(index), vertices };
            }
        }
    }
    LoadError::Parser { file: name.to_owned(), message: "an index out of range that cannot be found again".into() }
}

/// The error for what the parser refused: after the pre-pass that can only be a coordinate.
pub(super) fn parser_error(bytes: &[u8], name: &str, error: tobj::LoadError) -> LoadError {
    for statement in Statements::new(bytes).filter(|s| s.keyword() == b"v") {
        if let Some(word) = statement.arguments().take(3).find(|word| coordinate(word).is_none()) {
            return LoadError::Number { file: name.to_owned(), line: statement.line, text: shorten(word) };
        }
    }
    LoadError::Parser { file: name.to_owned(), message: error.to_string() }
}

/// Line of the first vertex that is not finite, and the number of all such vertices.
pub(super) fn invalid_vertices(bytes: &[u8]) -> (u64, u64) {
    let is_invalid = |word: &[u8]| coordinate(word).is_some_and(|x| !x.is_finite());
    let vertices = Statements::new(bytes).filter(|s| s.keyword() == b"v");
    let mut invalid = vertices.filter(|s| s.arguments().take(3).any(is_invalid)).map(|s| s.line);
    invalid.next().map_or((0, 0), |line| (line, 1 + invalid.count() as u64))
}

/// What a text without vertices and faces seems to be.
pub(super) fn looks_like(bytes: &[u8]) -> &'static str {
    match bytes {
        [] => "it is empty",
        [b'p', b'l', b'y', b'\n' | b'\r', ..] => "it looks like PLY",
        [b'g', b'l', b'T', b'F', ..] => "it looks like binary glTF",
        [b's', b'o', b'l', b'i', b'd', b' ', ..] => "it looks like STL",
        _ if bytes.iter().take(4096).any(|&byte| byte == 0) => "it is binary",
        _ => "it has no vertices and no faces",
    }
}

/// At most 40 characters of a word, printable.
pub(super) fn shorten(word: &[u8]) -> String {
    const LONGEST: usize = 40;
    let text = word.iter().take(LONGEST).map(|&byte| if byte.is_ascii_graphic() { char::from(byte) } else { '?' });
    let more = if word.len() > LONGEST { "…" } else { "" };
    text.chain(more.chars()).collect()
}

/// A coordinate as the parser reads it.
fn coordinate(word: &[u8]) -> Option<f32> {
    str::from_utf8(word).ok()?.parse().ok()
}
