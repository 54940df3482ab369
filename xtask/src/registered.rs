//! What earlier versions of `cargo xtask setup` left below the home folder: manifests of the software driver, by which
//! the Vulkan loader found it for every program of the user.

use crate::command::say;
use anyhow::{Context, Result};
use std::fs;
use std::path::{Path, PathBuf};

/// As many as those versions made devices.
const NAMES: [&str; 3] = ["raybalance_lvp_0.json", "raybalance_lvp_1.json", "raybalance_lvp_2.json"];

/// The manifests that are still there.
pub(crate) fn found() -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> = data_folders().iter().flat_map(|data| found_in(data)).collect();
    found.dedup();
    found
}

/// Removes them, and the folders that they leave empty.
pub(crate) fn undo() -> Result<()> {
    let found = found();
    for manifest in &found {
        fs::remove_file(manifest).with_context(|| format!("cannot remove `{}`", manifest.display()))?;
        say(format_args!("setup: removed {}", manifest.display()));
    }
    for data in data_folders() {
        // What is not empty belongs to others, and stays.
        for folder in ["vulkan/icd.d", "vulkan"] {
            let _ = found.iter().any(|manifest| manifest.starts_with(&data)).then(|| fs::remove_dir(data.join(folder)));
        }
    }
    if found.is_empty() {
        say("setup: nothing is registered for this user");
    }
    Ok(())
}

/// Where the loader looks for a user's own drivers, as the XDG Base Directory Specification has it: by the variable,
/// and by the default that held if it was not set at the time.
fn data_folders() -> Vec<PathBuf> {
    let variable = |name| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let default = variable("HOME").map(|home| home.join(".local/share"));
    let mut folders: Vec<PathBuf> = variable("XDG_DATA_HOME").into_iter().chain(default).collect();
    folders.dedup();
    folders
}

fn found_in(data: &Path) -> Vec<PathBuf> {
    let paths = NAMES.iter().map(|name| data.join("vulkan/icd.d").join(name));
    paths.filter(|path| path.symlink_metadata().is_ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mutant: every manifest of the folder.
    #[test]
    fn only_our_own_manifests_are_found() {
        let data = tempfile::tempdir().unwrap();
        assert!(found_in(data.path()).is_empty());
        let folder = data.path().join("vulkan/icd.d");
        fs::create_dir_all(&folder).unwrap();
        for name in ["radeon_icd.json", "lvp_icd.json", NAMES[1]] {
            fs::write(folder.join(name), "").unwrap();
        }
        assert_eq!(found_in(data.path()), [folder.join(NAMES[1])]);
    }
}
