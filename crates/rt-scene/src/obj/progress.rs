//! How far a loader got.

use std::io::{self, BufRead, Read};

/// Bytes between two calls of a progress callback: about a hundred calls per second at the loader's speed.
pub(super) const STEP: u64 = 1 << 20;

/// How far a loader got in its present stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadProgress {
    /// What is being done.
    pub stage: LoadStage,
    /// Bytes done.
    pub done_bytes: u64,
    /// Bytes to do in this stage; 0 where the size is not known.
    pub total_bytes: u64,
}

/// The stages of loading, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum LoadStage {
    /// Reading the file into memory.
    Reading,
    /// Checking the text line by line.
    Checking,
    /// Parsing numbers and faces.
    Parsing,
}

/// A reader that reports how much of it was consumed.
pub(super) struct Counted<'a, R> {
    inner: R,
    done: u64,
    total: u64,
    progress: &'a mut dyn FnMut(LoadProgress),
}

impl<'a, R> Counted<'a, R> {
    pub(super) fn new(inner: R, total: u64, progress: &'a mut dyn FnMut(LoadProgress)) -> Self {
        Self { inner, done: 0, total, progress }
    }
}

impl<R: BufRead> Read for Counted<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.inner.read(buffer)?;
        self.done += read as u64;
        Ok(read)
    }
}

impl<R: BufRead> BufRead for Counted<'_, R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        self.inner.fill_buf()
    }

    fn consume(&mut self, amount: usize) {
        let before = self.done / STEP;
        self.done += amount as u64;
        self.inner.consume(amount);
        if self.done / STEP > before {
            let (done_bytes, total_bytes) = (self.done, self.total);
            (self.progress)(LoadProgress { stage: LoadStage::Parsing, done_bytes, total_bytes });
        }
    }
}
