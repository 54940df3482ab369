//! Rays from NumPy arrays (`.npy`): `N × 8` numbers, a row `origin x, y, z, tmin, direction x, y, z, tmax`.
//!
//! In `float32` the array is the in-memory layout of [`Ray`], little-endian and moved as bits: no value passes through
//! a float conversion on its way. In `float64` origins have more digits than single precision holds: the scene's offset
//! is subtracted before they are rounded. Either order will do, C's and Fortran's, as `np.save(rays.T)` writes it.

mod error;
mod header;
mod layout;

pub use error::{Fault, RayFileError};

use crate::memory::{NoMemory, grow};
use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use header::Header;
use layout::{Layout, Number};
use rt_core::Ray;
use std::fs::{File, Metadata};
use std::io::{BufReader, Read};
use std::path::Path;

/// Rows that are read at once: few enough to stay in a cache, many enough for few system calls.
const CHUNK: usize = 4096;

const RAY_COLUMNS: u64 = 8;
const COLUMNS: usize = RAY_COLUMNS as usize;

/// Rays in a file whose header is read and found to be one of rays.
#[derive(Debug)]
pub struct RayFile<R> {
    input: R,
    layout: Layout,
    /// Bytes of the file; `None` where only reading tells, as of a pipe.
    bytes: Option<u64>,
    /// For messages.
    name: String,
}

impl RayFile<BufReader<File>> {
    /// Opens a file of rays: an `N × 8` array of little-endian float32 or float64, in C or Fortran order.
    ///
    /// # Errors
    /// When the file cannot be read or is not such an array. The message names the file, what it holds and how to save
    /// what is wanted.
    pub fn open(path: &Path) -> Result<Self, RayFileError> {
        let name = path.display().to_string();
        match File::open(path) {
            Ok(file) => {
                let bytes = file.metadata().ok().filter(Metadata::is_file).map(|about| about.len());
                Ok(Self { bytes, ..Self::new(BufReader::new(file), name)? })
            }
            Err(error) => Err(RayFileError { file: name, fault: Fault::Open(error) }),
        }
    }
}

impl<R: Read> RayFile<R> {
    /// Rays from memory or any other place, which messages call `name`.
    ///
    /// # Errors
    /// As [`RayFile::open`].
    pub fn new(mut input: R, name: String) -> Result<Self, RayFileError> {
        match Header::read(&mut input).and_then(|header| Layout::of(&header)) {
            Ok(layout) => Ok(Self { input, layout, bytes: None, name }),
            Err(fault) => Err(RayFileError { file: name, fault }),
        }
    }

    /// Most rays that there can be: as many as the header says, or as a regular file has room for. The data may end
    /// before.
    #[must_use]
    pub fn most_rays(&self) -> u64 {
        let row = RAY_COLUMNS * self.layout.number.bytes();
        self.bytes.map_or(self.layout.rows, |bytes| self.layout.rows.min(bytes / row))
    }

    /// Reads the rays, with `offset` subtracted from their origins in double precision before those are rounded.
    ///
    /// # Errors
    /// When the file ends early, or the system refuses the memory for the rays.
    pub fn read(mut self, offset: DVec3) -> Result<Vec<Ray>, RayFileError> {
        let rays = match self.layout.number {
            Number::Single => self.read_numbers(|word: u32, column| single(u32::from_le(word), offset, column)),
            Number::Double => {
                self.read_numbers(|word: u64, column| double(f64::from_bits(u64::from_le(word)), offset, column))
            }
        };
        rays.map_err(|fault| RayFileError { file: self.name, fault })
    }

    /// Reads number after number; `to_single` gets each with its column and returns the bits that a ray has there.
    fn read_numbers<W: Pod>(&mut self, to_single: impl Fn(W, usize) -> u32) -> Result<Vec<Ray>, Fault> {
        let Layout { rows, by_columns, .. } = self.layout;
        let mut rays: Vec<Ray> = Vec::new();
        // So many numbers follow each other in a row, or in a column.
        let run = if by_columns { rows as usize } else { COLUMNS };
        let numbers = rows as usize * COLUMNS;
        let mut words = vec![W::zeroed(); numbers.clamp(1, CHUNK * COLUMNS)];
        for start in (0..numbers).step_by(words.len()) {
            let chunk = &mut words[..(numbers - start).min(CHUNK * COLUMNS)];
            let end = start + chunk.len();
            let ended = |source| Fault::Ended { rays: rows, numbers: start..end, source };
            self.input.read_exact(bytemuck::cast_slice_mut(chunk)).map_err(ended)?;
            // Grown as data arrives: a header that promises too much costs no memory.
            let known = if by_columns { end.min(rows as usize) } else { end / COLUMNS };
            let known = known.max(rays.len());
            let more = known - rays.len();
            grow(&mut rays, more).map_err(|NoMemory { bytes }| Fault::Memory { bytes })?;
            rays.resize(known, Ray::zeroed());
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

#[cfg(test)]
mod tests;
