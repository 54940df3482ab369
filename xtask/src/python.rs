//! The Python package: its wheel is built, installed into a virtual environment and tested there, away from its
//! sources.

use crate::command::{cargo, root, run, succeeds};
use crate::deny;
use crate::pip::Environment;
use anyhow::{Context, Result, bail};
use std::fs;
use std::path::PathBuf;
use std::process::Command;

/// A workspace of its own, which shares the main one's built dependencies.
const MANIFEST: &str = "--manifest-path python/Cargo.toml";

/// What the tests need, maturin too. There are hashes of NumPy for the Pythons that [`SUPPORTED`] names.
const REQUIREMENTS: &str = include_str!("../../python/tests/requirements.txt");

/// Whether there are files for this kind of machine.
pub(crate) const SUPPORTED: bool = cfg!(all(target_os = "linux", target_env = "gnu", target_arch = "x86_64"));

/// The environment of the tests.
fn environment() -> Environment {
    Environment { folder: root().join(".setup/python"), requirements: REQUIREMENTS }
}

/// Whether the environment is in place.
pub(crate) fn is_set_up() -> bool {
    environment().is_current()
}

/// Makes the environment.
pub(crate) fn install() -> Result<String> {
    let least = "import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 14))";
    if !succeeds(Command::new("python3").args(["-c", least])) {
        bail!("`python3` is not there, or none of 3.11 to 3.14");
    }
    let environment = environment();
    environment.make()?;
    Ok(format!("made {}", environment.folder.display()))
}

/// Checks the native half, and tests the wheel.
pub(crate) fn test() -> Result<()> {
    install_wheel()?;
    run(&mut tests())
}

/// Formatting, lints and licences of the native half; then the wheel is built and installed.
pub(crate) fn install_wheel() -> Result<()> {
    let environment = environment();
    let python = environment.program("python");
    run(&mut cargo(&format!("fmt {MANIFEST} --check")))?;
    let lints = format!("clippy {MANIFEST} --target-dir target -- -D warnings");
    run(cargo(&lints).env("PYO3_PYTHON", &python))?;
    if deny::availability() == deny::Availability::Present {
        deny::check_workspace("python/Cargo.toml")?;
    }
    let wheel = wheel(&environment)?;
    let mut install = environment.install();
    run(install.args(["--no-deps", "--no-index", "--force-reinstall"]).arg(wheel))
}

/// What tests the installed wheel.
pub(crate) fn tests() -> Command {
    // From another folder: whoever imports the sources instead of the wheel shall find none.
    let mut pytest = Command::new(environment().program("python"));
    pytest.args(["-m", "pytest", "--quiet", "-p", "no:cacheprovider"]).arg(root().join("python/tests"));
    pytest.current_dir(std::env::temp_dir()).env("PYTHONDONTWRITEBYTECODE", "1");
    pytest
}

/// Builds the wheel, and says where it is.
fn wheel(environment: &Environment) -> Result<PathBuf> {
    let folder = root().join("target/wheels/tested");
    crate::files::remove(&folder)?;
    let mut maturin = Command::new(environment.program("maturin"));
    maturin.args(["build", "--quiet", "--profile", "dev"]).arg("--out").arg(&folder);
    maturin.arg("--target-dir").arg(root().join("target")).arg("--interpreter").arg(environment.program("python"));
    run(maturin.current_dir(root().join("python")))?;
    let mut files = fs::read_dir(&folder).with_context(|| format!("cannot read `{}`", folder.display()))?;
    let wheel = files.next().context("maturin made no wheel")?.context("cannot read a folder")?;
    Ok(wheel.path())
}
