//! Rays, hits and counts as NumPy arrays (`.npy`).
//!
//! The arrays are the in-memory layouts of [`Ray`], [`Hit`] and [`TestCounts`], row by row in C order, little-endian,
//! moved as bits: no value passes through a float conversion on its way. Rays may also be `float64`, for origins with more
//! digits than single precision holds: the scene's offset is subtracted before they are rounded. They may be in Fortran order, as `np.save(rays.T)` writes them.
//!
//! | array  | type      | shape    | columns |
//! |--------|-----------|----------|---------|
//! | rays   | `float32` or `float64` | `(N, 8)` | origin x, y, z, tmin, direction x, y, z, tmax |
//! | hits   | `float32` | `(N, 4)` | t, u, v, primitive id as bits: `hits[:, 3].view(np.uint32)` |
//! | counts | `uint32`  | `(N, 2)` | box tests, triangle tests |
//!
//! A miss has `t = inf` and the id `0xffffffff`. Ids are bits because float32 holds whole numbers only up to 2²⁴.

mod layout;

use crate::output::write_atomically;
use anyhow::{Context, Result, anyhow, ensure};
use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use layout::{Layout, Type};
use npyz::{DType, NpyHeader, WriteOptions, WriterBuilder};
use rt_core::{Hit, Ray, TestCounts};
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

/// Longest header that is read, in bytes: NumPy's own limit (`max_header_size`). Ours are 118 bytes long.
const MAX_HEADER: usize = 10_000;

/// Deepest nesting of brackets in a header: a plain array needs 2, records of arrays 4. The time of npyz's parser
/// doubles with each.
const MAX_NESTING: usize = 4;

/// Rows that are read or written at once: few enough to stay in a cache, many enough for few system calls.
const CHUNK: usize = 4096;

const RAY_COLUMNS: u64 = 8;
const COLUMNS: usize = RAY_COLUMNS as usize;

/// Rays in a file whose header is read and found to be one of rays.
#[derive(Debug)]
pub struct RayFile<R> {
    input: R,
    layout: Layout,
    /// For messages.
    name: String,
}

impl RayFile<BufReader<File>> {
    /// Opens a file of rays: an `N × 8` array of little-endian float32 or float64, in C or Fortran order.
    ///
    /// # Errors
    /// When the file cannot be read or is not such an array. The message names the file, what it holds and how to save what
    /// is wanted.
    pub fn open(path: &Path) -> Result<Self> {
        let file = File::open(path).with_context(|| format!("cannot open `{}`", path.display()))?;
        Self::new(BufReader::new(file), path.display().to_string())
    }
}

impl<R: Read> RayFile<R> {
    /// Rays from memory or any other place, which messages call `name`.
    ///
    /// # Errors
    /// As [`RayFile::open`].
    pub fn new(mut input: R, name: String) -> Result<Self> {
        let layout = read_header(&mut input).and_then(|header| Layout::of(&header));
        let layout = layout.with_context(|| format!("cannot read rays from `{name}`"))?;
        Ok(Self { input, layout, name })
    }

    /// Reads the rays, with `offset` subtracted from their origins in double precision before those are rounded.
    ///
    /// # Errors
    /// When the file ends early.
    pub fn read(mut self, offset: DVec3) -> Result<Vec<Ray>> {
        let rays = match self.layout.type_of {
            Type::Single => self.read_numbers(|word: u32, column| single(u32::from_le(word), offset, column)),
            Type::Double => {
                self.read_numbers(|word: u64, column| double(f64::from_bits(u64::from_le(word)), offset, column))
            }
        };
        rays.with_context(|| format!("cannot read rays from `{}`", self.name))
    }

    /// Reads number after number; `to_single` gets each with its column and returns the bits that a ray has there.
    fn read_numbers<W: Pod>(&mut self, to_single: impl Fn(W, usize) -> u32) -> Result<Vec<Ray>> {
        let Layout { rows, by_columns, .. } = self.layout;
        let mut rays: Vec<Ray> = Vec::new();
        // So many numbers follow each other in a row, or in a column.
        let run = if by_columns { rows as usize } else { COLUMNS };
        let numbers = rows as usize * COLUMNS;
        let mut words = vec![W::zeroed(); numbers.clamp(1, CHUNK * COLUMNS)];
        for start in (0..numbers).step_by(words.len()) {
            let chunk = &mut words[..(numbers - start).min(CHUNK * COLUMNS)];
            let end = start + chunk.len();
            let context = || format!("its header promises {rows} rays, but the data end among numbers {start}..{end}");
            self.input.read_exact(bytemuck::cast_slice_mut(chunk)).with_context(context)?;
            // Grown as data arrives: a header that promises too much costs no memory.
            let known = if by_columns { end.min(rows as usize) } else { end / COLUMNS };
            rays.resize(known.max(rays.len()), Ray::zeroed());
            let columns: &mut [[u32; COLUMNS]] = bytemuck::cast_slice_mut(&mut rays);
            let (mut outer, mut inner) = (start / run, start % run);
            for &word in &*chunk {
                let (row, column) = if by_columns { (inner, outer) } else { (outer, inner) };
                columns[row][column] = to_single(word, column);
                inner += 1;
                if inner == run {
                    (outer, inner) = (outer + 1, 0);
                }
            }
        }
        Ok(rays)
    }
}

/// The bits of a number in a ray: those of the file, but that origins are relative to the scene's offset.
fn single(bits: u32, offset: DVec3, column: usize) -> u32 {
    match offset.to_array().get(column) {
        Some(&offset) if offset != 0.0 => ((f64::from(f32::from_bits(bits)) - offset) as f32).to_bits(),
        _ => bits,
    }
}

/// The same of one in double precision, which is rounded last.
fn double(number: f64, offset: DVec3, column: usize) -> u32 {
    ((number - offset.to_array().get(column).unwrap_or(&0.0)) as f32).to_bits()
}

/// Reads the header and leaves `input` at the data.
fn read_header(input: &mut impl Read) -> Result<NpyHeader> {
    const NO_NPY: &str = "this is no .npy file: write it with `np.save`";
    // A file that is too short is none either; one that cannot be read may be.
    let ended = |error: io::Error| match error.kind() {
        io::ErrorKind::UnexpectedEof => anyhow!(NO_NPY),
        _ => error.into(),
    };
    let mut bytes = vec![0; 10];
    input.read_exact(&mut bytes).map_err(ended)?;
    ensure!(!bytes.starts_with(b"PK"), "this is an archive (.npz): save the one array with `np.save`");
    ensure!(bytes.starts_with(b"\x93NUMPY"), NO_NPY);
    // Version 1 has a length of 16 bits, later ones of 32.
    if bytes[6] >= 2 {
        bytes.resize(12, 0);
        input.read_exact(&mut bytes[10..]).map_err(ended)?;
    }
    let start = bytes.len();
    let length = bytes[8..].iter().rev().fold(0, |length, &byte| length << 8 | usize::from(byte));
    ensure!(length <= MAX_HEADER, "its header claims {length} bytes, more than {MAX_HEADER}: the file is damaged");
    bytes.resize(start + length, 0);
    input.read_exact(&mut bytes[start..]).context("it ends in its header: the file is damaged")?;
    ensure!(is_sane(&bytes[start..]), "its header is not one that `np.save` writes: the file is damaged");
    NpyHeader::from_reader(&bytes[..]).context("its header cannot be understood")
}

/// Whether npyz can be trusted with a header: its parser backtracks for ever in nested brackets, and it multiplies the
/// lengths of a shape without looking.
fn is_sane(text: &[u8]) -> bool {
    let mut quoted = false;
    let mut nesting = 0_usize;
    let mut product = Some(1_u64);
    let mut number = Some(0_u64);
    for &byte in text.iter().chain(b" ") {
        if byte.is_ascii_digit() {
            number = number.and_then(|n| n.checked_mul(10)?.checked_add(u64::from(byte - b'0')));
            continue;
        }
        // Every number counts, inside quotes too: more than the shape's product, so never too little.
        product = product.zip(number).and_then(|(product, n)| product.checked_mul(n.max(1)));
        number = Some(0);
        match byte {
            b'\'' | b'"' => quoted = !quoted,
            b'\\' => return false,
            _ if quoted => {}
            b'(' | b'[' | b'{' => nesting += 1,
            b')' | b']' | b'}' => nesting = nesting.saturating_sub(1),
            // `True` and `False`; other letters could write numbers in other ways.
            b',' | b':' | b'-' | b' ' | b'\n' | b'T' | b'r' | b'u' | b'e' | b'F' | b'a' | b'l' | b's' => {}
            _ => return false,
        }
        if nesting > MAX_NESTING {
            return false;
        }
    }
    product.is_some()
}

/// Writes hits as an `N × 4` array of float32: `t`, `u`, `v`, and the primitive id's bits.
///
/// # Errors
/// When the file cannot be written.
pub fn write_hits(path: &Path, hits: &[Hit]) -> Result<()> {
    write_rows(path, hits, "<f4")
}

/// Writes counts as an `N × 2` array of uint32: box tests, triangle tests.
///
/// # Errors
/// When the file cannot be written.
pub fn write_counts(path: &Path, counts: &[TestCounts]) -> Result<()> {
    write_rows(path, counts, "<u4")
}

/// Writes rows of 32-bit words.
fn write_rows<Row: Pod>(path: &Path, rows: &[Row], descr: &str) -> Result<()> {
    let columns = size_of::<Row>() / size_of::<u32>();
    let descr = descr.parse().context("not a NumPy type")?;
    write_atomically(path, |out| {
        let header = WriteOptions::new_header_only().dtype(DType::Plain(descr));
        header.shape(&[rows.len() as u64, columns as u64]).writer(&mut *out).write_header_only()?;
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

#[cfg(test)]
mod tests;
