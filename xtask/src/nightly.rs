//! The nightly compiler, for what stable cannot do: sanitizers.

use crate::command::{root, succeeds};
use anyhow::{Result, bail};
use std::process::Command;

/// Nightly's cargo with arguments split at spaces, in the repository's root.
pub(crate) fn cargo(arguments: &str) -> Command {
    let mut command = Command::new("rustup");
    command.args(["run", "nightly", "cargo"]).args(arguments.split_whitespace()).current_dir(root());
    // Those of the cargo that runs this program.
    for variable in ["CARGO", "RUSTC", "RUSTUP_TOOLCHAIN"] {
        command.env_remove(variable);
    }
    command
}

/// An error that says how to get it, if it is not there.
pub(crate) fn require(reason: &str) -> Result<()> {
    if succeeds(cargo("").arg("--version")) {
        return Ok(());
    }
    bail!("{reason} needs the nightly compiler: `rustup toolchain install nightly`")
}
