//! PLY: vertices and polygons, as text or binary of either order, read by the crate `ply-rs-bw`.

use super::malformed;
use super::soup::Soup;
use crate::obj::{Fault, LoadOptions, LoadStage, Watch};
use crate::progress::Meter;
use glam::DVec3;
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult};
use std::io::BufRead;

const FORMAT: &str = "PLY";

/// What a face's list of vertices is called.
const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];

/// What is read of an element.
#[derive(Debug, Default)]
struct Element {
    /// Of a vertex; NaN where it has none.
    position: [f64; 3],
    /// Of a face: its vertices. Numbers below 0 lead nowhere.
    corners: Vec<u32>,
}

impl PropertyAccess for Element {
    fn new() -> Self {
        Self { position: [f64::NAN; 3], corners: Vec::new() }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let axis = match name {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            name if CORNERS.contains(&name) => {
                return match corners(property) {
                    Some(corners) => {
                        self.corners = corners;
                        PropertyAccessResult::Set
                    }
                    None => PropertyAccessResult::UnsupportedType,
                };
            }
            _ => return PropertyAccessResult::Ignored,
        };
        match number(&property) {
            Some(number) => {
                self.position[axis] = number;
                PropertyAccessResult::Set
            }
            None => PropertyAccessResult::UnsupportedType,
        }
    }
}

fn number(property: &Property) -> Option<f64> {
    Some(match *property {
        Property::Char(number) => number.into(),
        Property::UChar(number) => number.into(),
        Property::Short(number) => number.into(),
        Property::UShort(number) => number.into(),
        Property::Int(number) => number.into(),
        Property::UInt(number) => number.into(),
        Property::Float(number) => number.into(),
        Property::Double(number) => number,
        _ => return None,
    })
}

fn corners(property: Property) -> Option<Vec<u32>> {
    fn all<T: TryInto<u32>>(list: Vec<T>) -> Vec<u32> {
        list.into_iter().map(|corner| corner.try_into().unwrap_or(u32::MAX)).collect()
    }
    Some(match property {
        Property::ListChar(list) => all(list),
        Property::ListUChar(list) => all(list),
        Property::ListShort(list) => all(list),
        Property::ListUShort(list) => all(list),
        Property::ListInt(list) => all(list),
        Property::ListUInt(list) => list,
        _ => return None,
    })
}

/// Reads a file.
pub(super) fn parse(bytes: &[u8], options: &LoadOptions, watch: &mut Watch<'_>) -> Result<Soup, Fault> {
    let parser = Parser::<Element>::new();
    let mut source = Reader::new(bytes);
    let header = parser.read_header(&mut source).map_err(fault)?;
    let total = header.elements.values().map(|element| element.count as u64).sum();
    let mut meter = Meter::begin(LoadStage::Parsing, total, watch)?;
    let mut soup = Soup::default();
    let mut line = source.line();
    let mut bytes = source.into_inner();
    let mut done = 0;
    for element in header.elements.values() {
        let has_corners = CORNERS.iter().any(|&name| element.properties.contains_key(name));
        if element.name == "tristrips" || element.name == "face" && !has_corners {
            return Err(malformed(FORMAT, format!("element `{}` has no list of vertices that is read", element.name)));
        }
        for number in 0..element.count {
            let read = read(&parser, &header, element, &mut bytes, &mut line)
                .map_err(|reason| malformed(FORMAT, format!("{} {number}: {reason}", element.name)))?;
            match element.name.as_str() {
                "vertex" => {
                    soup.vertex(DVec3::from(read.position))?;
                }
                "face" if read.corners.len() < 3 => {
                    let (count, rule) = (read.corners.len(), "of 3 or more that it needs");
                    return Err(malformed(FORMAT, format!("face {number} has {count} corners, {rule}")));
                }
                "face" => soup.polygon(&read.corners, options)?,
                "edge" => soup.lines += 1,
                _ => {}
            }
            done += 1;
            meter.at(done)?;
        }
    }
    if soup.triangles.is_empty() {
        soup.points = soup.vertices.len() as u64;
    }
    Ok(soup)
}

/// Reads one element, so that a file of millions never has them all in the parser's form.
fn read(
    parser: &Parser<Element>,
    header: &Header,
    element: &ElementDef,
    bytes: &mut &[u8],
    line: &mut usize,
) -> Result<Element, String> {
    match header.encoding {
        Encoding::Ascii => {
            let mut text = Vec::new();
            bytes.read_until(b'\n', &mut text).map_err(|error| error.to_string())?;
            if text.is_empty() {
                return Err("the file ends before it".to_owned());
            }
            let place = *line;
            *line += 1;
            let text = std::str::from_utf8(&text).map_err(|_| format!("line {place} is not text"))?;
            parser.read_ascii_element(text, element).map_err(|error| format!("line {place}: {}", told(error)))
        }
        Encoding::BinaryLittleEndian => parser.read_little_endian_element(bytes, element).map_err(told),
        Encoding::BinaryBigEndian => parser.read_big_endian_element(bytes, element).map_err(told),
    }
}

fn fault(error: ParseError) -> Fault {
    malformed(FORMAT, told(error))
}

/// The message without the text that it quotes over several lines.
fn told(error: ParseError) -> String {
    let message = error.to_string();
    message.lines().last().unwrap_or_default().trim().trim_start_matches("Error: ").to_owned()
}
