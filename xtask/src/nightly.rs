//! The nightly compiler, for what stable cannot do: sanitizers.

use crate::command::{root, succeeds};
use anyhow::{Result, bail};
use std::process::Command;

/// Where tools of cargo's are installed that only these checks need, in the repository.
pub(crate) const TOOLS: &str = ".setup/cargo";

/// Nightly's cargo with arguments split at spaces, in the repository's root.
pub(crate) fn cargo(arguments: &str) -> Command {
    let mut command = Command::new("rustup");
    command.args(["run", "nightly", "cargo"]).args(arguments.split_whitespace()).current_dir(root());
    // Those of the cargo that runs this program.
    for variable in ["CARGO", "RUSTC", "RUSTUP_TOOLCHAIN"] {
        command.env_remove(variable);
    }
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders = std::env::split_paths(&path).chain([root().join(TOOLS).join("bin")]);
    if let Ok(path) = std::env::join_paths(folders) {
        command.env("PATH", path);
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
