//! The error that means wrong usage: what was asked for can be done on no machine, or cannot be written.

use crate::print::causes;
use std::error::Error;
use std::fmt;

/// What was asked for is wrong, in a way that no parser could see.
#[derive(Debug)]
pub struct Usage(String);

impl fmt::Display for Usage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl Error for Usage {}

/// An error of wrong usage; says which option is wrong, why, and what to give instead.
#[must_use]
pub fn usage(message: impl Into<String>) -> Usage {
    Usage(message.into())
}

/// Makes an error one of wrong usage.
pub trait OrUsage<T> {
    /// The same with an error of wrong usage, which names the option that it is about.
    ///
    /// # Errors
    /// As before.
    fn or_usage(self, option: &str) -> Result<T, Usage>;
}

impl<T, E: Error + 'static> OrUsage<T> for Result<T, E> {
    fn or_usage(self, option: &str) -> Result<T, Usage> {
        self.map_err(|error| usage(format!("{option}: {}", chain(&error))))
    }
}

/// An error and its causes on one line.
pub(crate) fn chain(error: &(dyn Error + 'static)) -> String {
    causes(error).map(ToString::to_string).collect::<Vec<_>>().join(": ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ReportError;
    use std::path::Path;

    // Mutant: causes left out of the message.
    #[test]
    fn any_error_can_be_one_of_wrong_usage() {
        let refused = "no".parse::<u32>().or_usage("--tasks").unwrap_err();
        assert_eq!(refused.to_string(), "--tasks: invalid digit found in string");
        let deep = Err::<(), _>(ReportError::read(Path::new("a"), std::io::Error::other("gone")));
        assert_eq!(deep.or_usage("--out").unwrap_err().to_string(), "--out: cannot read `a`: gone");
    }
}
