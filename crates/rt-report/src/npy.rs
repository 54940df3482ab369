//! Hits and counts as NumPy arrays (`.npy`).
//!
//! The arrays are the in-memory layouts of [`Hit`] and [`TestCounts`], row by row in C order, little-endian, moved as
//! bits.
//!
//! | array  | type      | shape    | columns |
//! |--------|-----------|----------|---------|
//! | hits   | `float32` | `(N, 4)` | t, u, v, primitive id as bits: `hits[:, 3].view(np.uint32)` |
//! | counts | `uint32`  | `(N, 2)` | box tests, triangle tests |
//!
//! A miss has `t = inf` and the id `0xffffffff`. Ids are bits because float32 holds whole numbers only up to 2²⁴.

use crate::ReportError;
use crate::output::write_atomically;
use bytemuck::Pod;
use rt_core::{Hit, TestCounts};
use std::path::Path;

/// Rows that are written at once: few enough to stay in a cache, many enough for few system calls.
const CHUNK: usize = 4096;

/// Writes hits as an `N × 4` array of float32: `t`, `u`, `v`, and the primitive id's bits.
///
/// # Errors
/// When the file cannot be written.
pub fn write_hits(path: &Path, hits: &[Hit]) -> Result<(), ReportError> {
    write_rows(path, hits, "<f4")
}

/// Writes counts as an `N × 2` array of uint32: box tests, triangle tests.
///
/// # Errors
/// When the file cannot be written.
pub fn write_counts(path: &Path, counts: &[TestCounts]) -> Result<(), ReportError> {
    write_rows(path, counts, "<u4")
}

/// Writes rows of 32-bit words.
fn write_rows<Row: Pod>(path: &Path, rows: &[Row], descr: &str) -> Result<(), ReportError> {
    let columns = size_of::<Row>() / size_of::<u32>();
    write_atomically(path, |out| {
        out.write_all(&header(descr, [rows.len(), columns]))?;
        for chunk in rows.chunks(CHUNK) {
            let words = bytemuck::cast_slice::<Row, u32>(chunk);
            if cfg!(target_endian = "little") {
                out.write_all(bytemuck::cast_slice(words))?;
            } else {
                words.iter().try_for_each(|word| out.write_all(&word.to_le_bytes()))?;
            }
        }
        Ok(())
    })
}

/// Everything before the data: version 1.0, padded to whole units of 64 bytes, as NumPy writes it.
fn header(descr: &str, [rows, columns]: [usize; 2]) -> Vec<u8> {
    const BEFORE: usize = 10;
    let dictionary = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({rows}, {columns}), }}");
    let length = (BEFORE + dictionary.len() + 1).next_multiple_of(64) - BEFORE;
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((length as u16).to_le_bytes());
    bytes.extend(format!("{dictionary:<width$}\n", width = length - 1).bytes());
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where the data begin, and the header's text.
    fn header_of(file: &[u8]) -> (usize, &str) {
        assert!(file.starts_with(b"\x93NUMPY\x01\x00"));
        let data = 10 + usize::from(u16::from_le_bytes([file[8], file[9]]));
        assert!(data.is_multiple_of(64));
        (data, std::str::from_utf8(&file[10..data]).unwrap().trim_end())
    }

    #[test]
    fn hits_and_counts_are_written_as_bits() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("hits.npy");
        // The bits of the ids are, as floats: a subnormal, a signalling NaN and a quiet one.
        let ids = [5, 0x7f80_0001, u32::MAX];
        let hits: Vec<Hit> = ids.iter().map(|&primitive| Hit { primitive, ..Hit::MISS }).collect();
        write_hits(&path, &hits).unwrap();
        let file = std::fs::read(&path).unwrap();
        let (data, header) = header_of(&file);
        assert_eq!(header, "{'descr': '<f4', 'fortran_order': False, 'shape': (3, 4), }");
        let data = &file[data..];
        let id = |row: usize| u32::from_le_bytes(data[row * 16 + 12..][..4].try_into().unwrap());
        assert_eq!((data.len(), [id(0), id(1), id(2)]), (48, ids));
        assert_eq!(data[..4], f32::INFINITY.to_le_bytes());

        write_counts(&path, &[TestCounts { boxes: 1, triangles: u32::MAX }]).unwrap();
        let file = std::fs::read(&path).unwrap();
        let (data, header) = header_of(&file);
        assert_eq!(header, "{'descr': '<u4', 'fortran_order': False, 'shape': (1, 2), }");
        assert_eq!(file[data..], [1, 0, 0, 0, 255, 255, 255, 255]);
    }
}
