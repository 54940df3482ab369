//! How much memory there is, and large lists that may fail.

mod room;

pub use room::{
    BYTES_PER_GIVEN_RAY, BYTES_PER_MEASURED_RAY, BYTES_PER_PATH, BYTES_PER_TASK, NoRoom, PictureNeeds, Room,
};
use std::error::Error;
use std::fmt;

/// The system refused memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NoMemory {
    /// What it was for.
    pub what: String,
    /// How much it was.
    pub bytes: u64,
}

impl fmt::Display for NoMemory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "no memory for {}: {} were asked for", self.what, size(self.bytes))
    }
}

impl Error for NoMemory {}

/// Bytes as people read them, in powers of 1000.
#[must_use]
pub fn size(bytes: u64) -> String {
    let bytes = bytes as f64;
    match bytes {
        b if b >= 1e10 => format!("{:.0} GB", b / 1e9),
        b if b >= 1e9 => format!("{:.1} GB", b / 1e9),
        b if b >= 1e6 => format!("{:.0} MB", b / 1e6),
        b => format!("{:.0} kB", b / 1e3),
    }
}

/// `count` times `value`.
///
/// # Errors
/// When there is no memory for it; the message says for what, and how many bytes were asked for.
pub fn filled<T: Clone>(value: T, count: usize, what: &str) -> Result<Vec<T>, NoMemory> {
    let mut all = Vec::new();
    let bytes = (count as u64).saturating_mul(size_of::<T>() as u64);
    all.try_reserve_exact(count).map_err(|_| NoMemory { what: what.to_owned(), bytes })?;
    all.resize(count, value);
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fails when vectors are asked for without a way to fail.
    #[test]
    fn no_memory_is_an_error_that_names_the_bytes() {
        let error = filled([0_u8; 16], usize::MAX / 32, "the hits").unwrap_err().to_string();
        assert!(error.contains("no memory for the hits") && error.contains("GB"), "{error}");
    }
}
