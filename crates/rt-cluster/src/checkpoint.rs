//! Finished tiles on disk, so that what was done before a process ended need not be done again.
//!
//! A checkpoint is a file that is only ever added to: a header, then each tile as it is finished, with a checksum. So
//! whenever the process is killed, what is in front of the last whole tile is good, and writing a tile costs its own
//! bytes, not those of all others.

use crate::Finished;
use std::error::Error;
use std::fmt;
use std::fs::{File, TryLockError};
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// The first bytes of every checkpoint, with the version of its layout.
const MAGIC: [u8; 8] = *b"RBTILES1";

/// Bytes of the header: magic, fingerprint, number of tiles, checksum.
const HEADER: usize = 24;

/// Bytes in front of each tile's own: number, seconds, length, checksum.
const RECORD: usize = 16;

/// A file of finished tiles, held by one process at a time.
#[derive(Debug)]
pub struct Checkpoint {
    path: PathBuf,
    file: File,
}

/// Why a file cannot be used as a checkpoint.
#[derive(Debug)]
#[non_exhaustive]
pub enum CheckpointError {
    /// It cannot be read or written.
    File(PathBuf, io::Error),
    /// Another process writes it.
    InUse(PathBuf),
    /// It is something else.
    NoCheckpoint(PathBuf),
    /// It is of another job.
    Other(PathBuf),
}

impl fmt::Display for CheckpointError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let instead = "give another folder, or delete it";
        match self {
            Self::File(path, _) => write!(f, "the checkpoint `{}` cannot be read or written", path.display()),
            Self::InUse(path) => write!(f, "the checkpoint `{}` is in use by another process", path.display()),
            Self::NoCheckpoint(path) => write!(f, "`{}` is no checkpoint: {instead}", path.display()),
            Self::Other(path) => write!(
                f,
                "the checkpoint `{}` is of another scene, other options or another program: {instead}",
                path.display()
            ),
        }
    }
}

impl Error for CheckpointError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::File(_, source) => Some(source),
            Self::InUse(_) | Self::NoCheckpoint(_) | Self::Other(_) => None,
        }
    }
}

impl Checkpoint {
    /// Opens the checkpoint of a job of `tiles` tiles, or begins one, with its folder. `take` gets the tiles that are
    /// in it; their numbers are returned.
    ///
    /// # Errors
    /// When the file cannot be used, is of another job, or `take` fails.
    pub fn open(
        path: &Path,
        fingerprint: u64,
        tiles: u32,
        take: &mut dyn FnMut(Finished<'_>) -> io::Result<()>,
    ) -> Result<(Self, Vec<u32>), CheckpointError> {
        let failed = |error| CheckpointError::File(path.to_owned(), error);
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(failed)?;
        }
        let mut options = File::options();
        let file = options.read(true).write(true).create(true).truncate(false).open(path).map_err(failed)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(CheckpointError::InUse(path.to_owned())),
            Err(TryLockError::Error(error)) => return Err(failed(error)),
        }
        let mut checkpoint = Self { path: path.to_owned(), file };
        let finished = checkpoint.resume(fingerprint, tiles, take)?;
        Ok((checkpoint, finished))
    }

    fn resume(
        &mut self,
        fingerprint: u64,
        tiles: u32,
        take: &mut dyn FnMut(Finished<'_>) -> io::Result<()>,
    ) -> Result<Vec<u32>, CheckpointError> {
        let Self { path, file } = self;
        let failed = |error| CheckpointError::File(path.clone(), error);
        let length = file.metadata().map_err(failed)?.len();
        let expected = header(fingerprint, tiles);
        if length < HEADER as u64 {
            let mut begin = Vec::new();
            file.read_to_end(&mut begin).map_err(failed)?;
            if !expected.starts_with(&begin) && !MAGIC.starts_with(&begin[..begin.len().min(MAGIC.len())]) {
                return Err(CheckpointError::NoCheckpoint(path.clone()));
            }
            // Nothing was finished when the process that began it was killed.
            file.set_len(0).and_then(|()| file.seek(SeekFrom::Start(0))).map_err(failed)?;
            file.write_all(&expected).map_err(failed)?;
            return Ok(Vec::new());
        }
        let mut reader = BufReader::new(&*file);
        let mut found = [0; HEADER];
        reader.read_exact(&mut found).map_err(failed)?;
        if found[..MAGIC.len()] != MAGIC {
            return Err(CheckpointError::NoCheckpoint(path.clone()));
        }
        if found != expected {
            return Err(CheckpointError::Other(path.clone()));
        }
        let (mut finished, mut is_finished) = (Vec::new(), vec![false; tiles as usize]);
        let mut good = HEADER as u64;
        while let Some((tile, seconds, bytes)) = next(&mut reader, length - good).map_err(failed)? {
            good += (RECORD + bytes.len()) as u64;
            let Some(known) = is_finished.get_mut(tile as usize) else { break };
            if !std::mem::replace(known, true) {
                take(Finished { tile, seconds, bytes: &bytes }).map_err(failed)?;
                finished.push(tile);
            }
        }
        // What was being written when the process was killed.
        file.set_len(good).and_then(|()| file.seek(SeekFrom::End(0))).map_err(failed)?;
        Ok(finished)
    }

    /// Adds a tile.
    ///
    /// # Errors
    /// When it cannot be written; the message names the file.
    pub fn add(&mut self, Finished { tile, seconds, bytes }: Finished<'_>) -> io::Result<()> {
        let mut record = Vec::with_capacity(RECORD + bytes.len());
        record.extend(tile.to_le_bytes());
        record.extend(seconds.to_le_bytes());
        record.extend(u32::try_from(bytes.len()).map_err(io::Error::other)?.to_le_bytes());
        record.extend(checksum(&[&record, bytes]).to_le_bytes());
        record.extend(bytes);
        let about = |error: io::Error| io::Error::new(error.kind(), format!("`{}`: {error}", self.path.display()));
        self.file.write_all(&record).map_err(about)
    }
}

fn header(fingerprint: u64, tiles: u32) -> [u8; HEADER] {
    let mut header = [0; HEADER];
    header[..8].copy_from_slice(&MAGIC);
    header[8..16].copy_from_slice(&fingerprint.to_le_bytes());
    header[16..20].copy_from_slice(&tiles.to_le_bytes());
    let sum = checksum(&[&header[..20]]);
    header[20..].copy_from_slice(&sum.to_le_bytes());
    header
}

/// The next tile that is whole; `left` bytes are left.
fn next(reader: &mut impl Read, left: u64) -> io::Result<Option<(u32, f32, Vec<u8>)>> {
    let mut front = [0; RECORD];
    if left < RECORD as u64 {
        return Ok(None);
    }
    reader.read_exact(&mut front)?;
    let [tile, seconds, length, sum] = [0, 4, 8, 12].map(|at| u32::from_le_bytes([0, 1, 2, 3].map(|i| front[at + i])));
    if u64::from(length) > left - RECORD as u64 {
        return Ok(None);
    }
    let mut bytes = vec![0; length as usize];
    reader.read_exact(&mut bytes)?;
    let is_whole = checksum(&[&front[..12], &bytes]) == sum;
    Ok(is_whole.then(|| (tile, f32::from_bits(seconds), bytes)))
}

fn checksum(parts: &[&[u8]]) -> u32 {
    let mut sum = crc32fast::Hasher::new();
    parts.iter().for_each(|part| sum.update(part));
    sum.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn bytes(tile: u32) -> Vec<u8> {
        vec![tile as u8; tile as usize % 50]
    }

    fn open(path: &Path, fingerprint: u64) -> Result<(Checkpoint, Vec<u32>), CheckpointError> {
        Checkpoint::open(path, fingerprint, 20, &mut |done| {
            assert_eq!(done.bytes, bytes(done.tile));
            Ok(())
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(100))]

        /// Guards: wherever the file ends, or a byte of its end is wrong, the tiles in front are there, and what is
        /// added behind is there the next time. Fails when the rest of a broken tile is left in the file.
        #[test]
        fn whatever_is_cut_off_the_tiles_in_front_are_there(
            tiles in prop::collection::vec(0..20_u32, 0..8), cut in 0..400_u64, flips: bool,
        ) {
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join("new/frame.tiles");
            let (mut checkpoint, found) = open(&path, 7).unwrap();
            prop_assert!(found.is_empty());
            let mut ends = vec![(HEADER as u64, 0)];
            for (number, &tile) in tiles.iter().enumerate() {
                checkpoint.add(Finished { tile, seconds: 0.5, bytes: &bytes(tile) }).unwrap();
                ends.push((checkpoint.file.metadata().unwrap().len(), number + 1));
            }
            let length = ends.last().unwrap().0;
            let kept = length.saturating_sub(cut);
            drop(checkpoint);
            let flips = flips && kept > HEADER as u64;
            if flips {
                let mut all = std::fs::read(&path).unwrap();
                all[kept as usize - 1] ^= 1;
                std::fs::write(&path, all).unwrap();
            }
            let keep = if flips { kept.saturating_sub(1) } else { kept };
            File::options().write(true).open(&path).unwrap().set_len(if flips { length } else { kept }).unwrap();
            let whole = ends.iter().filter(|(end, _)| *end <= keep.max(HEADER as u64)).map(|(_, n)| *n).max().unwrap_or(0);
            let mut expected: Vec<u32> = Vec::new();
            tiles[..whole].iter().for_each(|tile| if !expected.contains(tile) { expected.push(*tile) });
            let (mut checkpoint, found) = open(&path, 7).unwrap();
            prop_assert_eq!(&found, &expected);
            checkpoint.add(Finished { tile: 19, seconds: 0.5, bytes: &bytes(19) }).unwrap();
            drop(checkpoint);
            let (_, found) = open(&path, 7).unwrap();
            prop_assert!(found.contains(&19) && expected.iter().all(|tile| found.contains(tile)));
        }
    }

    #[test]
    fn what_is_of_another_job_or_something_else_is_refused_and_left_alone() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("frame.tiles");
        let (checkpoint, _) = open(&path, 7).unwrap();
        assert!(matches!(open(&path, 7), Err(CheckpointError::InUse(_))));
        drop(checkpoint);
        let error = open(&path, 8).unwrap_err().to_string();
        assert!(error.contains("frame.tiles") && error.contains("delete"), "{error}");
        for text in ["my diary", "x", "a text that is longer than the header of a checkpoint"] {
            std::fs::write(&path, text).unwrap();
            assert!(matches!(open(&path, 7), Err(CheckpointError::NoCheckpoint(_))), "{text}");
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        }
    }
}
