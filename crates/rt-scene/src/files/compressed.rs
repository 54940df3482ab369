//! Files that gzip or xz has made smaller.

use crate::obj::{Fault, Watch};
use crate::reading::read_all;
use std::io::Read;

/// Most memory that unpacking may ask for, in KiB: xz's own limit for files that it made without options is 9 MiB.
const MEMORY: u32 = 256 << 10;

/// The bytes, unpacked where they are packed.
pub(super) fn unpack(bytes: Vec<u8>, watch: &mut Watch<'_>) -> Result<Vec<u8>, Fault> {
    let (packer, source): (_, Box<dyn Read + '_>) = match bytes[..] {
        [0x1f, 0x8b, ..] => ("gzip", Box::new(flate2::read::MultiGzDecoder::new(&bytes[..]))),
        [0xfd, b'7', b'z', b'X', b'Z', 0, ..] => {
            ("xz", Box::new(lzma_rust2::XzReader::new_mem_limit(&bytes[..], true, MEMORY)))
        }
        _ => return Ok(bytes),
    };
    let mut source = source;
    read_all(&mut source, 0, watch).map_err(|fault| match fault {
        Fault::Read(error) => Fault::Malformed { format: packer, reason: format!("it cannot be unpacked ({error})") },
        fault => fault,
    })
}
