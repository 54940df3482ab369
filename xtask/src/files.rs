//! Folders.

use anyhow::{Context, Result};
use std::fs;
use std::path::{Path, PathBuf};

/// Removes a folder with all that is in it, if it is there.
pub(crate) fn remove(folder: &Path) -> Result<()> {
    if folder.exists() {
        fs::remove_dir_all(folder).with_context(|| format!("cannot remove `{}`", folder.display()))?;
    }
    Ok(())
}

/// What is in a folder, in the order of names.
pub(crate) fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    let unreadable = || format!("cannot read the folder `{}`", folder.display());
    let entries = fs::read_dir(folder).with_context(unreadable)?.map(|entry| entry.map(|entry| entry.path()));
    let mut paths = entries.collect::<Result<Vec<PathBuf>, _>>().with_context(unreadable)?;
    paths.sort_unstable();
    Ok(paths)
}
