//! The error that means wrong usage: what was asked for can be done on no machine, or cannot be written.

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
pub fn usage(message: impl Into<String>) -> anyhow::Error {
    anyhow::Error::new(Usage(message.into()))
}

/// Makes an error one of wrong usage.
pub trait OrUsage<T> {
    /// The same with an error of wrong usage.
    ///
    /// # Errors
    /// As before.
    fn or_usage(self) -> anyhow::Result<T>;
}

impl<T, E: Into<anyhow::Error>> OrUsage<T> for Result<T, E> {
    fn or_usage(self) -> anyhow::Result<T> {
        self.map_err(|error| usage(format!("{:#}", error.into())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::Context;

    // Mutant: causes left out of the message.
    #[test]
    fn any_error_can_be_one_of_wrong_usage() {
        let refused = "no".parse::<u32>().context("--tasks").or_usage().unwrap_err();
        assert!(refused.is::<Usage>());
        assert_eq!(refused.to_string(), "--tasks: invalid digit found in string");
    }
}
