//! Installing Debian packages.

use crate::command::{run, shown, succeeds};
use anyhow::{Result, bail};
use std::process::{Command, Stdio};

/// Installs a package with apt, as root or through a sudo that asks for no password.
pub(crate) fn install(package: &str) -> Result<()> {
    if !succeeds(Command::new("apt-get").arg("--version")) {
        bail!("`{package}` is missing and this machine has no apt-get: install it with the system's package manager");
    }
    let mut install = apt_get(&["install", "--yes", "--no-install-recommends", package])?;
    if run(&mut install).is_ok() {
        return Ok(());
    }
    // A bare machine has no package lists; one that has been up for long has stale ones.
    run(&mut apt_get(&["update"])?)?;
    run(&mut install)
}

fn apt_get(arguments: &[&str]) -> Result<Command> {
    let mut command = if is_root() {
        Command::new("apt-get")
    } else if succeeds(Command::new("sudo").args(["--non-interactive", "true"])) {
        let mut sudo = Command::new("sudo");
        sudo.args(["--non-interactive", "apt-get"]);
        sudo
    } else {
        let mut needed = Command::new("apt-get");
        needed.args(arguments);
        bail!("neither root nor sudo without a password: run `{}` as root, then try again", shown(&needed));
    };
    command.args(arguments).env("DEBIAN_FRONTEND", "noninteractive").stdin(Stdio::null());
    Ok(command)
}

fn is_root() -> bool {
    Command::new("id").arg("-u").output().is_ok_and(|output| output.stdout.trim_ascii() == b"0")
}
