//! STL: triangles alone, as text or binary, read by the crate `stl_io`.

use super::malformed;
use super::soup::Soup;
use crate::obj::{Fault, LoadOptions, LoadStage, Watch};
use crate::progress::Meter;
use glam::{DVec3, Vec3};
use std::io::Cursor;

const FORMAT: &str = "STL";

/// Bytes before the first triangle of a binary file, and of each triangle.
const HEAD: usize = 84;
const TRIANGLE: usize = 50;

/// Whether these are as many bytes as a binary file of the number of triangles in its head has. Many such files begin
/// with `solid` as text does, so that their beginning says nothing.
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    let count = bytes.get(HEAD - 4..HEAD).and_then(|count| count.try_into().ok()).map(u32::from_le_bytes);
    count.is_some_and(|count| count > 0 && (bytes.len() - HEAD) as u64 == u64::from(count) * TRIANGLE as u64)
}

/// Whether a text begins as STL.
pub(super) fn is_text(text: &[u8]) -> bool {
    text.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"))
        && text.get(5).is_none_or(u8::is_ascii_whitespace)
}

/// Reads a file. Vertices at the same place are not joined.
pub(super) fn parse(mut bytes: Vec<u8>, options: &LoadOptions, watch: &mut Watch<'_>) -> Result<Soup, Fault> {
    // The crate takes a file for text that begins with `solid` and a blank, and for binary otherwise.
    if is_binary(&bytes) {
        bytes[0] = b' ';
    } else {
        if bytes.starts_with(b"\xef\xbb\xbf") {
            bytes.drain(..3);
        }
        let begin = bytes.len() - bytes.trim_ascii_start().len();
        bytes.drain(..begin);
        bytes.make_ascii_lowercase();
        if bytes.get(5) != Some(&b' ') {
            bytes.insert(5, b' ');
        }
    }
    let expected = (bytes.len() / TRIANGLE) as u64;
    let mut meter = Meter::begin(LoadStage::Parsing, expected, watch)?;
    let mut source = Cursor::new(bytes);
    let triangles = stl_io::create_stl_reader(&mut source).map_err(|error| malformed(FORMAT, error.to_string()))?;
    let mut soup = Soup::default();
    for (number, triangle) in (0_u64..).zip(triangles) {
        let triangle = triangle.map_err(|error| malformed(FORMAT, format!("facet {number}: {error}")))?;
        let mut corners = [0; 3];
        for (corner, vertex) in corners.iter_mut().zip(triangle.vertices) {
            *corner = soup.vertex(place(vertex.0))?;
        }
        soup.triangle(corners, options)?;
        meter.at(number)?;
    }
    Ok(soup)
}

fn place(coordinates: [f32; 3]) -> DVec3 {
    Vec3::from(coordinates).as_dvec3()
}
