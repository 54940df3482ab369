//! How a program ends: all exit codes, and what is said of a failure.

use crate::print::{Stdout, StdoutError, causes, note};
use crate::usage::{Usage, chain};
use std::error::Error;
use std::io::Write;
use std::process::ExitCode;

/// Runs a program and ends as the table says: the `main` of whatever has no signals of its own to look after.
pub fn main<E: AsRef<dyn Error>>(run: impl FnOnce() -> Result<(), E>) -> ExitCode {
    Exit::after(run()).into()
}

/// Every exit code there is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// All was done.
    Success = 0,
    /// Something could not be done, or a promise was not kept.
    Failure = 1,
    /// The command line can be carried out on no machine, or names files that cannot be written; nothing was done.
    Usage = 2,
    /// 128 + SIGINT, as shells have it.
    Interrupted = 130,
    /// 128 + SIGPIPE: whoever read standard output has gone.
    ClosedPipe = 141,
    /// 128 + SIGTERM.
    Terminated = 143,
}

impl Exit {
    /// The table for people.
    pub const HELP: &str = "Exit codes: 0 success, 1 failure, 2 wrong usage, 130 interrupted (SIGINT), \
        141 nobody reads standard output any more, 143 terminated (SIGTERM)";

    /// What a run ends in, unless a signal was the cause of its failure. Says what went wrong.
    pub fn after<E: AsRef<dyn Error>>(result: Result<(), E>) -> Self {
        match result.map(|()| Stdout.flush()) {
            Ok(Ok(())) => Self::Success,
            Ok(Err(lost)) => Self::of(&lost),
            Err(error) => Self::of(error.as_ref()),
        }
    }

    /// What an error ends in; says it, unless it is that nobody listens.
    fn of(error: &(dyn Error + 'static)) -> Self {
        if StdoutError::of(error).is_some_and(StdoutError::is_closed) {
            return Self::ClosedPipe;
        }
        // Causes on one line: the chain ends with what to do.
        note(format_args!("error: {}", chain(error)));
        if causes(error).any(<dyn Error>::is::<Usage>) { Self::Usage } else { Self::Failure }
    }

    /// The number.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit.code())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::usage::usage;
    use anyhow::Context;

    #[test]
    fn the_help_names_every_code() {
        let all = [Exit::Success, Exit::Failure, Exit::Usage, Exit::Interrupted, Exit::ClosedPipe, Exit::Terminated];
        for exit in all {
            assert!(Exit::HELP.contains(&format!(" {} ", exit.code())), "{exit:?}");
        }
    }

    // Mutant: only the innermost error is looked at, or only the outermost.
    #[test]
    fn wrong_usage_is_known_through_what_is_said_of_it() {
        let wrong: anyhow::Result<()> = Err(usage("--fov must be above 0").into());
        assert_eq!(Exit::after(wrong.context("the camera")), Exit::Usage);
        assert_eq!(Exit::after(Err(anyhow::Error::from(usage("--fov must be above 0")))), Exit::Usage);
        assert_eq!(Exit::after(Err(anyhow::anyhow!("no"))), Exit::Failure);
        let plain: Result<(), Box<dyn Error>> = Err("no".into());
        assert_eq!(Exit::after(plain), Exit::Failure);
    }

    // Mutant: a closed pipe told as a failure like any other.
    #[test]
    fn a_reader_that_has_gone_is_no_failure() {
        let closed = std::io::Error::from(std::io::ErrorKind::BrokenPipe);
        let closed: anyhow::Result<()> = Err(StdoutError::wrap(closed).into());
        assert_eq!(Exit::after(closed.context("the table")), Exit::ClosedPipe);
        assert_eq!(Exit::after::<anyhow::Error>(Ok(())), Exit::Success);
    }
}
