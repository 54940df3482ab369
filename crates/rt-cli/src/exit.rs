//! How a command ends: all exit codes.

use rt_report::usage::Usage;
use std::process::ExitCode;

/// Every exit code there is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Exit {
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
    pub(crate) const HELP: &str = "Exit codes: 0 success, 1 failure, 2 wrong usage, 130 interrupted (SIGINT), \
        141 nobody reads standard output any more, 143 terminated (SIGTERM)";

    /// What an error ends in, unless a signal was its cause.
    pub(crate) fn of(error: &anyhow::Error) -> Self {
        if error.is::<Usage>() { Self::Usage } else { Self::Failure }
    }

    pub(crate) const fn code(self) -> u8 {
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
    use anyhow::Context;
    use rt_report::usage::usage;

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
        let error = wrong.context("the camera").unwrap_err();
        assert_eq!(Exit::of(&error), Exit::Usage);
        assert_eq!(Exit::of(&anyhow::anyhow!("no")), Exit::Failure);
    }
}
