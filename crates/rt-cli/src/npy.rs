//! Rays, hits and counts as NumPy arrays (`.npy`).
//!
//! The arrays are the in-memory layouts of [`Ray`], [`Hit`] and [`TestCounts`], row by row in C order, little-endian,
//! moved as bits: no value passes through a float conversion on its way. Rays may also be `float64`, for origins with more
//! digits than single precision holds: the scene's offset is subtracted before they are rounded.
//!
//! | array  | type      | shape    | columns |
//! |--------|-----------|----------|---------|
//! | rays   | `float32` or `float64` | `(N, 8)` | origin x, y, z, tmin, direction x, y, z, tmax |
//! | hits   | `float32` | `(N, 4)` | t, u, v, primitive id as bits: `hits[:, 3].view(np.uint32)` |
//! | counts | `uint32`  | `(N, 2)` | box tests, triangle tests |
//!
//! A miss has `t = inf` and the id `0xffffffff`. Ids are bits because float32 holds whole numbers only up to 2²⁴.

use crate::output::write_atomically;
use anyhow::{Context, Result, bail, ensure};
use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use npyz::{DType, NpyHeader, Order, WriteOptions, WriterBuilder};
use rt_core::{Hit, Ray, TestCounts};
use std::fs::File;
use std::io::{BufReader, Read};
use std::ops::Range;
use std::path::Path;

/// Longest header that is read, in bytes: NumPy's own limit (`max_header_size`). Ours are 118 bytes long.
const MAX_HEADER: usize = 10_000;

/// Deepest nesting of brackets in a header: a plain array needs 2, records of arrays 4. The time of npyz's parser
/// doubles with each.
const MAX_NESTING: usize = 4;

/// Rows that are read or written at once: few enough to stay in a cache, many enough for few system calls.
const CHUNK: usize = 4096;

const RAY_COLUMNS: u64 = 8;

/// Rays in a file whose header is read and found to be one of rays.
#[derive(Debug)]
pub struct RayFile<R> {
    input: R,
    rows: u64,
    type_of: Type,
    /// For messages.
    name: String,
}

/// How numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Type {
    Single,
    Double,
}

impl RayFile<BufReader<File>> {
    /// Opens a file of rays: an `N × 8` array of little-endian float32 or float64 in C order.
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
        let layout = read_header(&mut input).and_then(|header| check_layout(&header));
        let (rows, type_of) = layout.with_context(|| format!("cannot read rays from `{name}`"))?;
        Ok(Self { input, rows, type_of, name })
    }

    /// Reads the rays, with `offset` subtracted from their origins in double precision before those are rounded.
    ///
    /// # Errors
    /// When the file ends early.
    pub fn read(mut self, offset: DVec3) -> Result<Vec<Ray>> {
        let rays = match self.type_of {
            Type::Single => self.read_single(offset),
            Type::Double => self.read_double(offset),
        };
        rays.with_context(|| format!("cannot read rays from `{}`", self.name))
    }

    fn read_single(&mut self, offset: DVec3) -> Result<Vec<Ray>> {
        let mut rays: Vec<Ray> = Vec::new();
        while let Some(rows) = self.next_rows(rays.len()) {
            // Grown as data arrives: a header that promises too much costs no memory.
            rays.resize(rows.end, Ray::zeroed());
            let chunk = &mut rays[rows.clone()];
            let words: &mut [u32] = bytemuck::cast_slice_mut(chunk);
            self.read_words(bytemuck::cast_slice_mut(words), rows)?;
            words.iter_mut().for_each(|word| *word = u32::from_le(*word));
            if offset != DVec3::ZERO {
                chunk.iter_mut().for_each(|ray| ray.origin = (ray.origin.as_dvec3() - offset).as_vec3());
            }
        }
        Ok(rays)
    }

    fn read_double(&mut self, offset: DVec3) -> Result<Vec<Ray>> {
        let mut rays: Vec<Ray> = Vec::new();
        let mut words = vec![[0_u64; RAY_COLUMNS as usize]; CHUNK];
        while let Some(rows) = self.next_rows(rays.len()) {
            let chunk = &mut words[..rows.len()];
            self.read_words(bytemuck::cast_slice_mut(chunk), rows)?;
            rays.extend(chunk.iter().map(|row| {
                let [x, y, z, tmin, dx, dy, dz, tmax] = row.map(|word| f64::from_bits(u64::from_le(word)));
                let origin = (DVec3::new(x, y, z) - offset).as_vec3();
                Ray::new(origin, DVec3::new(dx, dy, dz).as_vec3()).with_range(tmin as f32, tmax as f32)
            }));
        }
        Ok(rays)
    }

    /// The rows to read after so many; `None` after the last.
    fn next_rows(&self, done: usize) -> Option<Range<usize>> {
        let end = self.rows.min((done + CHUNK) as u64) as usize;
        (done < end).then_some(done..end)
    }

    fn read_words(&mut self, bytes: &mut [u8], Range { start, end }: Range<usize>) -> Result<()> {
        let context = || format!("its header promises {} rays, but the data end among rays {start}..{end}", self.rows);
        self.input.read_exact(bytes).with_context(context)
    }
}

/// Number of rows of an array that holds rays, and the type of its numbers.
fn check_layout(header: &NpyHeader) -> Result<(u64, Type)> {
    let dtype = header.dtype().descr();
    let shape = header.shape();
    let order = match header.order() {
        Order::C => "C",
        Order::Fortran => "Fortran",
    };
    let type_of = match dtype.as_str() {
        "'<f4'" => Some(Type::Single),
        "'<f8'" => Some(Type::Double),
        _ => None,
    };
    let advice = if type_of.is_none() {
        "convert it with `rays.astype('<f4')`"
    } else if !matches!(shape, [_, RAY_COLUMNS]) {
        "one row is origin x y z, tmin, direction x y z, tmax; see `rays.reshape(-1, 8)`"
    } else if header.order() != Order::C {
        "save `np.ascontiguousarray(rays)`"
    } else {
        let rows = shape[0];
        ensure!(rows <= u64::from(u32::MAX), "{rows} rays are more than {}: split the file", u32::MAX);
        return Ok((rows, type_of.unwrap_or(Type::Single)));
    };
    bail!(
        "found {dtype} of shape {shape:?} in {order} order, wanted little-endian float32 or float64 ('<f4', '<f8') of shape [N, 8] in C \
         order: {advice}"
    )
}

/// Reads the header and leaves `input` at the data.
fn read_header(input: &mut impl Read) -> Result<NpyHeader> {
    const NO_NPY: &str = "this is no .npy file: write it with `np.save`";
    let mut bytes = vec![0; 10];
    input.read_exact(&mut bytes).context(NO_NPY)?;
    ensure!(bytes.starts_with(b"\x93NUMPY"), NO_NPY);
    // Version 1 has a length of 16 bits, later ones of 32.
    if bytes[6] >= 2 {
        bytes.resize(12, 0);
        input.read_exact(&mut bytes[10..]).context(NO_NPY)?;
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
