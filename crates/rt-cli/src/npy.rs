//! Rays, hits and counts as NumPy arrays (`.npy`).
//!
//! The arrays are the in-memory layouts of [`Ray`], [`Hit`] and [`TestCounts`], row by row in C order, little-endian,
//! moved as bits: no value passes through a float conversion on its way.
//!
//! | array  | type      | shape    | columns |
//! |--------|-----------|----------|---------|
//! | rays   | `float32` | `(N, 8)` | origin x, y, z, tmin, direction x, y, z, tmax |
//! | hits   | `float32` | `(N, 4)` | t, u, v, primitive id as bits: `hits[:, 3].view(np.uint32)` |
//! | counts | `uint32`  | `(N, 2)` | box tests, triangle tests |
//!
//! A miss has `t = inf` and the id `0xffffffff`. Ids are bits because float32 holds whole numbers only up to 2²⁴.

use crate::output::write_atomically;
use anyhow::{Context, Result, bail, ensure};
use bytemuck::{Pod, Zeroable};
use npyz::{DType, NpyHeader, Order, WriteOptions, WriterBuilder};
use rt_core::{Hit, Ray, TestCounts};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

/// Longest header that is read, in bytes: NumPy's own limit (`max_header_size`). Ours are 118 bytes long.
const MAX_HEADER: usize = 10_000;

/// Deepest nesting of brackets in a header: a plain array needs 2, records of arrays 4. The time of npyz's parser
/// doubles with each.
const MAX_NESTING: usize = 4;

/// Rows that are read or written at once: few enough to stay in a cache, many enough for few system calls.
const CHUNK: usize = 4096;

const RAY_COLUMNS: u64 = 8;

/// Reads rays: an `N × 8` array of little-endian float32 in C order.
///
/// # Errors
/// When the file cannot be read, is not such an array, or ends early. The message names the file, what it holds and
/// how to save what is wanted.
pub fn read_rays(path: &Path) -> Result<Vec<Ray>> {
    let file = File::open(path).with_context(|| format!("cannot open `{}`", path.display()))?;
    parse_rays(&mut BufReader::new(file)).with_context(|| format!("cannot read rays from `{}`", path.display()))
}

/// Reads rays as [`read_rays`] does, from memory or any other place.
///
/// # Errors
/// Likewise; the message names no file.
pub fn parse_rays(input: &mut impl Read) -> Result<Vec<Ray>> {
    let header = read_header(input)?;
    let rows = check_layout(&header)?;
    let mut rays: Vec<Ray> = Vec::new();
    while rays.len() < rows as usize {
        // Grown as data arrives: a header that promises too much costs no memory.
        let start = rays.len();
        let end = rows.min(start as u64 + CHUNK as u64) as usize;
        rays.resize(end, Ray::zeroed());
        let words: &mut [u32] = bytemuck::cast_slice_mut(&mut rays[start..]);
        let context = || format!("its header promises {rows} rays, but the data end among rays {start}..{end}");
        input.read_exact(bytemuck::cast_slice_mut(words)).with_context(context)?;
        words.iter_mut().for_each(|word| *word = u32::from_le(*word));
    }
    Ok(rays)
}

/// Number of rows of an array that holds rays.
fn check_layout(header: &NpyHeader) -> Result<u64> {
    let dtype = header.dtype().descr();
    let shape = header.shape();
    let order = match header.order() {
        Order::C => "C",
        Order::Fortran => "Fortran",
    };
    let advice = if dtype != "'<f4'" {
        "convert it with `rays.astype('<f4')`"
    } else if !matches!(shape, [_, RAY_COLUMNS]) {
        "one row is origin x y z, tmin, direction x y z, tmax; see `rays.reshape(-1, 8)`"
    } else if header.order() != Order::C {
        "save `np.ascontiguousarray(rays)`"
    } else {
        let rows = shape[0];
        ensure!(rows <= u64::from(u32::MAX), "{rows} rays are more than {}: split the file", u32::MAX);
        return Ok(rows);
    };
    bail!(
        "found {dtype} of shape {shape:?} in {order} order, wanted little-endian float32 ('<f4') of shape [N, 8] in C \
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
