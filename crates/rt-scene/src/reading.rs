//! Files into memory.

use crate::memory::grow;
use crate::obj::Fault;
use crate::progress::{LoadStage, Meter, Watch};
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Reads a whole file.
pub(crate) fn read_file(path: &Path, watch: &mut Watch<'_>) -> Result<Vec<u8>, Fault> {
    let mut file = File::open(path).map_err(Fault::Read)?;
    let about = file.metadata().map_err(Fault::Read)?;
    if about.is_dir() {
        return Err(Fault::Read(io::ErrorKind::IsADirectory.into()));
    }
    // One more than the size, so that the end is seen without growing. Pipes have no size: their list just grows.
    read_all(&mut file, about.len(), watch)
}

/// Reads to the end, where some `size` bytes are expected; 0: nobody knows.
pub(crate) fn read_all(source: &mut dyn Read, size: u64, watch: &mut Watch<'_>) -> Result<Vec<u8>, Fault> {
    let mut meter = Meter::begin(LoadStage::Reading, size, watch)?;
    let mut bytes = Vec::new();
    grow(&mut bytes, usize::try_from(size.saturating_add(1)).unwrap_or(usize::MAX))?;
    loop {
        if bytes.len() == bytes.capacity() {
            grow(&mut bytes, LoadStage::Reading.step() as usize)?;
        }
        let room = LoadStage::Reading.step().min((bytes.capacity() - bytes.len()) as u64);
        if source.take(room).read_to_end(&mut bytes).map_err(Fault::Read)? == 0 {
            return Ok(bytes);
        }
        meter.at(bytes.len() as u64)?;
    }
}
