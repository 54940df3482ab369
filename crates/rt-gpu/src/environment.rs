//! Environment variables that switch something on.

use core::fmt;
use std::error::Error;
use std::ffi::{OsStr, OsString};

/// Whether a variable switches something on: `1` does; `0`, nothing and no variable do not.
///
/// # Errors
/// When it says anything else.
pub fn switch(variable: &'static str) -> Result<bool, BadVariable> {
    read(variable, std::env::var_os(variable))
}

fn read(variable: &'static str, value: Option<OsString>) -> Result<bool, BadVariable> {
    match value.as_deref().and_then(OsStr::to_str) {
        Some("1") => Ok(true),
        Some("0" | "") => Ok(false),
        _ => value.map_or(Ok(false), |value| Err(BadVariable { variable, value })),
    }
}

/// An environment variable says what it cannot say.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BadVariable {
    variable: &'static str,
    value: OsString,
}

impl fmt::Display for BadVariable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { variable, value } = self;
        write!(f, "the environment variable {variable} is `{}`: set it to 1 or 0, or unset it", value.display())
    }
}

impl Error for BadVariable {}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mutants: anything but `1` taken for 0; an unset variable refused.
    #[test]
    fn a_switch_is_on_or_off() {
        let read = |value: Option<&str>| read("RAYBALANCE_SWITCH", value.map(Into::into));
        assert_eq!([Some("1"), Some("0"), Some(""), None].map(read), [true, false, false, false].map(Ok));
        for bad in ["true", "2", " 1", "yes"] {
            let message = read(Some(bad)).unwrap_err().to_string();
            assert!(message.contains("RAYBALANCE_SWITCH") && message.contains(bad), "{message}");
        }
    }
}
