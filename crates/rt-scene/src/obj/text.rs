//! What a file's bytes are: text in some encoding, or something else.

use crate::memory::{NoMemory, grow};
use std::borrow::Cow;

/// The text of a file in bytes that agree with ASCII: UTF-16 becomes UTF-8, all else stays as it is. Numbers and
/// keywords are ASCII, and names are read as UTF-8 or, failing that, Latin-1.
pub(super) fn decode(bytes: Cow<'_, [u8]>) -> Result<Cow<'_, [u8]>, NoMemory> {
    let unit = match bytes[..] {
        [0xff, 0xfe, 0, 0, ..] | [0, 0, 0xfe, 0xff, ..] => return Ok(bytes), // UTF-32
        [0xff, 0xfe, ..] => u16::from_le_bytes,
        [0xfe, 0xff, ..] => u16::from_be_bytes,
        // Without its mark: every character of a keyword or a comment's beginning is ASCII.
        [1..=127, 0, 1..=127, 0, ..] => u16::from_le_bytes,
        [0, 1..=127, 0, 1..=127, ..] => u16::from_be_bytes,
        _ => return Ok(bytes),
    };
    let mut text = Vec::new();
    grow(&mut text, bytes.len() / 2)?;
    let units = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
    for character in char::decode_utf16(units) {
        let character = character.unwrap_or(char::REPLACEMENT_CHARACTER);
        let mut buffer = [0; 4];
        let encoded = character.encode_utf8(&mut buffer).as_bytes();
        if text.capacity() - text.len() < encoded.len() {
            grow(&mut text, encoded.len())?;
        }
        text.extend_from_slice(encoded);
    }
    Ok(Cow::Owned(text))
}

/// What bytes without vertices and faces seem to be.
pub(super) fn looks_like(bytes: &[u8]) -> &'static str {
    match bytes {
        [] => "it is empty",
        [b'p', b'l', b'y', b'\n' | b'\r', ..] => "it looks like PLY",
        [b'g', b'l', b'T', b'F', ..] => "it looks like binary glTF",
        [b's', b'o', b'l', b'i', b'd', b' ', ..] => "it looks like STL",
        [0x1f, 0x8b, ..] => "it is compressed by gzip (unpack it first)",
        [0xfd, b'7', b'z', b'X', b'Z', ..] => "it is compressed by xz (unpack it first)",
        [b'B', b'Z', b'h', ..] => "it is compressed by bzip2 (unpack it first)",
        [0x28, 0xb5, 0x2f, 0xfd, ..] => "it is compressed by zstd (unpack it first)",
        [b'P', b'K', 3, 4, ..] => "it is a zip archive (unpack it first)",
        [0xff, 0xfe, 0, 0, ..] | [0, 0, 0xfe, 0xff, ..] => "it is text in UTF-32 (save it as UTF-8)",
        _ if bytes.iter().take(4096).any(|&byte| byte == 0) && !is_utf16(bytes) => "it is binary",
        _ => "it has no vertices and no faces",
    }
}

const fn is_utf16(bytes: &[u8]) -> bool {
    matches!(bytes, [0xff, 0xfe, ..] | [0xfe, 0xff, ..])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_orders_of_utf16_are_read_with_and_without_their_mark() {
        let text = "v 1 2 3 \u{2028} gr\u{fc}n \u{1f6b2}\r\n";
        for mark in ["\u{feff}", ""] {
            let units: Vec<u16> = mark.encode_utf16().chain(text.encode_utf16()).collect();
            let expected = format!("{mark}{text}");
            for bytes in [u16::to_le_bytes, u16::to_be_bytes] {
                let mut encoded: Vec<u8> = units.iter().flat_map(|&unit| bytes(unit)).collect();
                // A torn last character is lost, nothing else.
                encoded.push(0x20);
                assert_eq!(decode(encoded.into()).unwrap(), expected.as_bytes());
            }
        }
        for same in [&b""[..], b"v", b"v 1", b"\xef\xbb\xbfv", b"\xe9 v", b"\xff\xfe\0\0v\0\0\0", b"\0\0\0\0", b"\0v"] {
            assert_eq!(decode(same.into()).unwrap(), same);
        }
        assert_eq!(decode(b"\xff\xfe\0\xd8v\0"[..].into()).unwrap(), "\u{feff}\u{fffd}v".as_bytes());
    }
}
