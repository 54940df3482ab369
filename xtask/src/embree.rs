//! Embree, the reference that the tests compare with: the library alone, in a folder of the project's own.
//!
//! Debian 12 has only Embree 3. The Python package `embreex` carries Embree 4 and oneTBB for the usual systems; pip
//! unpacks it, and nothing of it but the two libraries is used.

use crate::apt;
use crate::command::{root, run, succeeds};
use crate::files::remove;
use anyhow::{Context, Result, bail};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The package's release, whose first three numbers are Embree's version.
const RELEASE: &str = "4.4.0.post1";

/// The variable that names the library to the tests; someone who sets it wants that library tested.
pub(crate) const VARIABLE: &str = "RAYBALANCE_EMBREE";

/// The library, if this release of it is in place.
pub(crate) fn library() -> Option<PathBuf> {
    library_in(&folder())
}

/// Puts the library in place, and says where.
pub(crate) fn install() -> Result<String> {
    let (folder, staging) = (folder(), folder().with_extension("partial"));
    if !succeeds(Command::new("python3").args(["-m", "pip", "--version"])) {
        apt::install(&["python3-pip"]).context("Embree comes with a Python package, which pip unpacks")?;
    }
    remove(&staging)?;
    let mut pip = Command::new("python3");
    pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--root-user-action=ignore"]);
    pip.args(["--no-deps", "--only-binary", ":all:", "--target"]).arg(&staging).arg(format!("embreex=={RELEASE}"));
    run(pip.stdin(Stdio::null()))?;
    if library_in(&staging).is_none() {
        bail!("embreex {RELEASE} has no libembree4 for this system");
    }
    // Renamed when it is whole, so that an interruption leaves nothing that looks finished.
    remove(&folder)?;
    fs::rename(&staging, &folder).with_context(|| format!("cannot create `{}`", folder.display()))?;
    let library = library_in(&folder).context("the library vanished")?;
    Ok(format!("unpacked embreex {RELEASE}: {}", library.display()))
}

fn folder() -> PathBuf {
    root().join(".setup/embree")
}

fn library_in(folder: &Path) -> Option<PathBuf> {
    if !folder.join(format!("embreex-{RELEASE}.dist-info")).is_dir() {
        return None;
    }
    let is_library = |path: &PathBuf| path.file_name().is_some_and(|n| n.to_string_lossy().starts_with("libembree4"));
    let files = fs::read_dir(folder.join("embreex.libs")).ok()?;
    files.filter_map(|entry| Some(entry.ok()?.path())).find(is_library)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_whole_folder_of_this_release_has_the_library() {
        let dir = tempfile::tempdir().unwrap();
        let libraries = dir.path().join("embreex.libs");
        fs::create_dir(&libraries).unwrap();
        fs::write(libraries.join("libtbb-1.so.12"), "").unwrap();
        fs::write(libraries.join("libembree4-1.so.4"), "").unwrap();
        assert_eq!(library_in(dir.path()), None);
        fs::create_dir(dir.path().join("embreex-4.0.0.dist-info")).unwrap();
        assert_eq!(library_in(dir.path()), None);
        fs::create_dir(dir.path().join(format!("embreex-{RELEASE}.dist-info"))).unwrap();
        assert_eq!(library_in(dir.path()), Some(libraries.join("libembree4-1.so.4")));
        assert_eq!(library_in(Path::new("no such folder")), None);
    }
}
