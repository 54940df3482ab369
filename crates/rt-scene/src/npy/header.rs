//! The header of an array: a dictionary in Python's syntax, as `np.save` writes it.

use super::Fault;
use std::io::{self, Read};

/// Longest header that is read, in bytes: NumPy's own limit (`max_header_size`). Ours are 118 bytes long.
const MAX_HEADER: usize = 10_000;

/// Deepest nesting of brackets in a header: a plain array needs 2, records of arrays 4, and records within records 2
/// more for each.
const MAX_NESTING: usize = 16;

/// What a file says of the array that follows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Header {
    /// The type of its elements, as it is written.
    pub(super) written: String,
    pub(super) type_of: Type,
    /// Whether the file holds all first numbers, then all second ones and so on (Fortran order).
    pub(super) by_columns: bool,
    pub(super) shape: Vec<u64>,
}

/// What an array holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Type {
    Plain(Plain),
    /// Several fields an element: how many numbers, if they are nothing but numbers.
    Record(Option<u64>),
}

/// A type of NumPy's: `<f4`, `|b1`, `<U5`, `<M8[ns]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Plain {
    pub(super) is_little_endian: bool,
    /// `f` floats, `i` and `u` integers, `b` truth values, `c` complex numbers, `S` and `U` text, `O` Python objects.
    pub(super) kind: u8,
    /// Bytes, but for text.
    pub(super) size: u64,
}

impl Header {
    /// Reads it, and leaves `input` at the data.
    pub(super) fn read(input: &mut impl Read) -> Result<Self, Fault> {
        // A file that is too short is none either; one that cannot be read may be.
        let ended = |error: io::Error| match error.kind() {
            io::ErrorKind::UnexpectedEof => Fault::NotNpy,
            _ => Fault::Read(error),
        };
        let mut bytes = vec![0; 10];
        input.read_exact(&mut bytes).map_err(ended)?;
        if bytes.starts_with(b"PK") {
            return Err(Fault::Archive);
        }
        if !bytes.starts_with(b"\x93NUMPY") {
            return Err(Fault::NotNpy);
        }
        // Version 1 has a length of 16 bits, later ones of 32.
        if bytes[6] >= 2 {
            bytes.resize(12, 0);
            input.read_exact(&mut bytes[10..]).map_err(ended)?;
        }
        let length = bytes[8..].iter().rev().fold(0, |length, &byte| length << 8 | usize::from(byte));
        if length > MAX_HEADER {
            return Err(Fault::LongHeader { bytes: length, most: MAX_HEADER });
        }
        let mut text = vec![0; length];
        input.read_exact(&mut text).map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => Fault::Damaged("it ends in its header"),
            _ => Fault::Read(error),
        })?;
        Self::parse(&text).ok_or(Fault::Damaged("its header is not one that `np.save` writes"))
    }

    fn parse(text: &[u8]) -> Option<Self> {
        let mut parser = Parser { text, at: 0, nesting: 0 };
        let (mut descr, mut by_columns, mut shape) = (None, None, None);
        parser.symbol(b'{')?;
        while parser.symbol(b'}').is_none() {
            let Literal::Text(key) = parser.literal()? else { return None };
            parser.symbol(b':')?;
            parser.blank();
            let start = parser.at;
            let value = parser.literal()?;
            match (&*key, value) {
                ("descr", value) => {
                    descr = Some((String::from_utf8_lossy(&text[start..parser.at]).into_owned(), value))
                }
                ("fortran_order", Literal::Truth(truth)) => by_columns = Some(truth),
                ("shape", Literal::List(sides)) => {
                    shape = sides.iter().map(Literal::number).collect::<Option<Vec<u64>>>()
                }
                _ => return None,
            }
            if parser.symbol(b',').is_none() {
                parser.symbol(b'}')?;
                break;
            }
        }
        parser.blank();
        if parser.at < text.len() {
            return None;
        }
        let (written, literal) = descr?;
        let type_of = match &literal {
            Literal::Text(name) => Type::Plain(Plain::parse(name)?),
            Literal::List(_) => Type::Record(numbers_in(&literal)),
            _ => return None,
        };
        Some(Self { written, type_of, by_columns: by_columns?, shape: shape? })
    }
}

impl Plain {
    fn parse(name: &str) -> Option<Self> {
        let unordered = name.strip_prefix(['<', '>', '|', '=']).unwrap_or(name);
        let (&kind, rest) = unordered.as_bytes().split_first()?;
        let digits = rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
        let size = if digits == 0 { 0 } else { unordered.get(1..=digits)?.parse().ok()? };
        let is_little_endian = name.starts_with('<');
        kind.is_ascii_alphabetic().then_some(Self { is_little_endian, kind, size })
    }

    /// Whether its values are real numbers.
    const fn is_real(self) -> bool {
        matches!(self.kind, b'f' | b'i' | b'u' | b'b')
    }
}

/// Numbers in an element of this type; `None` if it holds anything else.
fn numbers_in(literal: &Literal) -> Option<u64> {
    match literal {
        Literal::Text(name) => Plain::parse(name)?.is_real().then_some(1),
        // Of each field the name, the type and, unless there is one of it, how many.
        Literal::List(fields) => fields.iter().try_fold(0_u64, |sum, field| {
            let Literal::List(field) = field else { return None };
            let count = match field.get(2) {
                None => 1,
                Some(Literal::Number(count)) => *count,
                Some(Literal::List(sides)) => {
                    sides.iter().try_fold(1_u64, |product, side| product.checked_mul(side.number()?))?
                }
                Some(_) => return None,
            };
            sum.checked_add(numbers_in(field.get(1)?)?.checked_mul(count)?)
        }),
        _ => None,
    }
}

/// A value in Python's syntax, as far as headers need it.
#[derive(Debug)]
enum Literal {
    Text(String),
    Number(u64),
    Truth(bool),
    /// A list or a tuple.
    List(Vec<Self>),
}

impl Literal {
    const fn number(&self) -> Option<u64> {
        if let Self::Number(number) = self { Some(*number) } else { None }
    }
}

/// A place in a header.
struct Parser<'t> {
    text: &'t [u8],
    at: usize,
    /// Brackets that are open.
    nesting: usize,
}

impl Parser<'_> {
    fn blank(&mut self) {
        self.at += self.text[self.at..].iter().take_while(|byte| byte.is_ascii_whitespace()).count();
    }

    /// Takes a character that may be there.
    fn symbol(&mut self, symbol: u8) -> Option<()> {
        self.blank();
        (self.text.get(self.at) == Some(&symbol)).then(|| self.at += 1)
    }

    /// Takes a word that may be there.
    fn word(&mut self, word: &str) -> Option<()> {
        self.text[self.at..].starts_with(word.as_bytes()).then(|| self.at += word.len())
    }

    fn literal(&mut self) -> Option<Literal> {
        self.blank();
        match *self.text.get(self.at)? {
            quote @ (b'\'' | b'"') => self.quoted(quote),
            b'(' => self.list(b')'),
            b'[' => self.list(b']'),
            b'0'..=b'9' => self.number(),
            b'T' => self.word("True").map(|()| Literal::Truth(true)),
            b'F' => self.word("False").map(|()| Literal::Truth(false)),
            _ => None,
        }
    }

    /// A string without escapes: names of types have none.
    fn quoted(&mut self, quote: u8) -> Option<Literal> {
        let rest = &self.text[self.at + 1..];
        let length = rest.iter().position(|&byte| byte == quote)?;
        let inside = &rest[..length];
        self.at += length + 2;
        (!inside.contains(&b'\\')).then(|| Literal::Text(String::from_utf8_lossy(inside).into_owned()))
    }

    fn number(&mut self) -> Option<Literal> {
        let digits = self.text[self.at..].iter().take_while(|byte| byte.is_ascii_digit()).count();
        let number = str::from_utf8(&self.text[self.at..self.at + digits]).ok()?.parse().ok()?;
        self.at += digits;
        // Python 2 wrote long numbers so.
        let _ = self.word("L");
        Some(Literal::Number(number))
    }

    fn list(&mut self, end: u8) -> Option<Literal> {
        self.at += 1;
        self.nesting += 1;
        if self.nesting > MAX_NESTING {
            return None;
        }
        let mut values = Vec::new();
        while self.symbol(end).is_none() {
            values.push(self.literal()?);
            if self.symbol(b',').is_none() {
                self.symbol(end)?;
                break;
            }
        }
        self.nesting -= 1;
        Some(Literal::List(values))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Option<Header> {
        Header::parse(text.as_bytes())
    }

    /// Any order, any blanks, either quotes, with and without the last comma.
    #[test]
    fn headers_are_read_as_python_reads_them() {
        let plain = Type::Plain(Plain { is_little_endian: true, kind: b'f', size: 4 });
        let header = |written: &str, by_columns, shape: &[u64]| Header {
            written: written.to_owned(),
            type_of: plain.clone(),
            by_columns,
            shape: shape.to_vec(),
        };
        for (text, wanted) in [
            ("{'descr': '<f4', 'fortran_order': False, 'shape': (3, 8), }  \n", header("'<f4'", false, &[3, 8])),
            ("{\"shape\":(3L,),\"fortran_order\":True,\"descr\":\"<f4\"}", header("\"<f4\"", true, &[3])),
            ("{'descr':'<f4','fortran_order':False,'shape':()}", header("'<f4'", false, &[])),
        ] {
            assert_eq!(parse(text), Some(wanted), "{text}");
        }
    }

    /// Mutants: fields not multiplied by how many there are; text counted as a number; a record within a record left
    /// out.
    #[test]
    fn numbers_of_records_are_counted() {
        for (descr, numbers) in [
            ("[('o', '<f4', (3,)), ('n', '<f4'), ('d', '<f4', (3,)), ('f', '>i8')]", Some(8)),
            ("[('a', [('b', '<f8', (2, 3)), ('c', '|b1')], 2)]", Some(14)),
            ("[(('title', 'name'), '<f4')]", Some(1)),
            ("[('a', '<f4'), ('b', '<U5')]", None),
            ("[('a', '<f4', (18446744073709551615, 2))]", None),
            ("[]", Some(0)),
        ] {
            let text = format!("{{'descr': {descr}, 'fortran_order': False, 'shape': (5,), }}");
            let header = parse(&text).expect(descr);
            assert_eq!((header.type_of, &*header.written), (Type::Record(numbers), descr));
        }
    }

    #[test]
    fn what_numpy_does_not_write_is_refused() {
        for text in [
            "",
            "{}",
            "{'descr': '<f4', 'fortran_order': False}",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (0x8,)}",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (-8,)}",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (99999999999999999999,)}",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (8,)} junk",
            "{'descr': '\\x3cf4', 'fortran_order': False, 'shape': (8,)}",
            "{'descr': '<f4', 'fortran_order': 'False', 'shape': (8,)}",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (8,",
            "{'descr': '<', 'fortran_order': False, 'shape': (8,)}",
            "{'descr' '<f4', 'fortran_order': False, 'shape': (8,)}",
        ] {
            assert_eq!(parse(text), None, "{text}");
        }
    }
}
