//! Standard output and standard error, which may be closed or full like any other file.
//!
//! The macros of the standard library panic then, so lints forbid them outside tests: every program prints through this
//! module and ends by [`exit`](crate::exit).

use std::error::Error;
use std::fmt::{self, Display};
use std::io::{self, Write};

/// Standard output. What cannot be written is an error that [`StdoutError::of`] finds again.
#[derive(Clone, Copy, Debug)]
pub struct Stdout;

impl Write for Stdout {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        io::stdout().write(bytes).map_err(StdoutError::wrap)
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stdout().flush().map_err(StdoutError::wrap)
    }
}

/// Standard output could not be written.
#[derive(Debug)]
pub struct StdoutError(io::Error);

impl StdoutError {
    /// As an error of input and output, of the same kind, since callers of [`Write`] look at it.
    pub fn wrap(error: io::Error) -> io::Error {
        io::Error::new(error.kind(), Self(error))
    }

    /// The failure of standard output that is behind an error, if one is.
    #[must_use]
    pub fn of<'a>(error: &'a (dyn Error + 'static)) -> Option<&'a Self> {
        causes(error).find_map(|cause| cause.downcast_ref::<io::Error>()?.get_ref()?.downcast_ref())
    }

    /// Whether whoever read it has gone, as `head` does: nothing that people need to be told.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.0.kind() == io::ErrorKind::BrokenPipe
    }
}

impl Display for StdoutError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("cannot write to standard output")
    }
}

impl Error for StdoutError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        Some(&self.0)
    }
}

/// An error, and what is behind it.
pub(crate) fn causes<'a>(error: &'a (dyn Error + 'static)) -> impl Iterator<Item = &'a (dyn Error + 'static)> {
    std::iter::successors(Some(error), |&cause| cause.source())
}

/// Prints a line for people on standard error. Where nobody can read it, it is lost.
pub fn note(line: impl Display) {
    let _ = writeln!(io::stderr(), "{line}");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ReportError;
    use std::path::Path;

    // Mutants: only the outermost error is looked at; the kind is lost.
    #[test]
    fn a_failure_of_standard_output_is_found_behind_other_errors() {
        let closed = StdoutError::wrap(io::ErrorKind::BrokenPipe.into());
        let error = ReportError::write(Path::new("/dev/stdout"), closed);
        assert!(StdoutError::of(&error).unwrap().is_closed());
        let full = StdoutError::wrap(io::ErrorKind::StorageFull.into());
        assert_eq!(full.kind(), io::ErrorKind::StorageFull);
        assert!(!StdoutError::of(&full).unwrap().is_closed());
        // A pipe that is an output file like any other is not standard output.
        assert!(StdoutError::of(&io::Error::from(io::ErrorKind::BrokenPipe)).is_none());
    }
}
