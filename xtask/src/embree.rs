//! Embree, the reference that the tests compare with: the library alone, in a folder of the project's own.
//!
//! Debian 12 has only Embree 3. The Python package `embreex` carries Embree 4 and oneTBB; nothing of it but these two
//! libraries is used.

use crate::command::root;
use crate::pip::Package;
use anyhow::{Context, Result};
use std::fs;
use std::path::{Path, PathBuf};

/// The release's first three numbers are Embree's version. There is a file for each version of Python, with the same
/// libraries: one will do for all.
const PACKAGE: Package = Package {
    name: "embreex",
    release: "4.4.0.post1",
    hashes: &["2cd0f7d5c6342e6247e31f700761689cae7829454d8c6de0c41e62124a023e1f"],
    options: &["--python-version=3.11", "--implementation=cp", "--abi=cp311", "--platform=manylinux_2_28_x86_64"],
    megabytes: 15,
};

/// Whether there is a file for this kind of machine.
pub(crate) const SUPPORTED: bool = cfg!(all(target_os = "linux", target_arch = "x86_64"));

/// The variable that names the library to the tests; someone who sets it wants that library tested.
pub(crate) const VARIABLE: &str = "RAYBALANCE_EMBREE";

/// The library, if this release of it is in place.
pub(crate) fn library() -> Option<PathBuf> {
    library_in(&folder())
}

/// Puts the library in place, and says where.
pub(crate) fn install() -> Result<String> {
    let whole = |staging: &Path| library_in(staging).map(drop).context("embreex has no libembree4 for this system");
    PACKAGE.unpack(&folder(), whole)?;
    let library = library().context("the library vanished")?;
    Ok(format!("unpacked {}", library.display()))
}

fn folder() -> PathBuf {
    root().join(".setup/embree")
}

fn library_in(folder: &Path) -> Option<PathBuf> {
    if !PACKAGE.is_in(folder) {
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
        fs::create_dir(dir.path().join(format!("embreex-{}.dist-info", PACKAGE.release))).unwrap();
        assert_eq!(library_in(dir.path()), Some(libraries.join("libembree4-1.so.4")));
        assert_eq!(library_in(Path::new("no such folder")), None);
    }
}
