//! Files that are being written, hidden beside the ones whose places they are to take.
//!
//! Each is locked while its process lives. So what a killed process left behind can be told from what another one is
//! writing, and [`clear`] removes the former alone.

use super::place::{parent, refused};
use std::ffi::OsString;
use std::fs::{self, File, Metadata, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tempfile::NamedTempFile;

const SUFFIX: &str = ".partial";

/// Random characters in the name.
const RANDOM: usize = 6;

/// Attempts to make a file, which fail only where another process removes folder or file in the same instant.
const ATTEMPTS: usize = 5;

/// Those of this process.
static LIVE: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn live() -> MutexGuard<'static, Vec<PathBuf>> {
    LIVE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file that is being written.
#[derive(Debug)]
pub(super) struct Partial {
    // Removed before it is forgotten.
    file: NamedTempFile,
    _listed: Listed,
}

/// An entry of [`LIVE`].
#[derive(Debug)]
struct Listed(PathBuf);

impl Drop for Listed {
    fn drop(&mut self) {
        live().retain(|path| *path != self.0);
    }
}

impl Partial {
    /// Makes a file beside `target`, whose folder is made if need be.
    pub(super) fn create(target: &Path) -> io::Result<Self> {
        let folder = parent(target);
        let mut prefix = OsString::from(".");
        let name = target.file_name();
        prefix.push(name.ok_or_else(|| refused(io::ErrorKind::InvalidInput, "the path names no file"))?);
        prefix.push(".");
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix).suffix(SUFFIX).rand_bytes(RANDOM);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // What any program gives a new file, less the user's umask; without this only the owner could read it.
            builder.permissions(fs::Permissions::from_mode(0o666));
        }
        let attempt = || -> io::Result<Option<NamedTempFile>> {
            fs::create_dir_all(folder)?;
            let file = builder.tempfile_in(folder)?;
            // A file system without locks has none to look for either, so nobody takes the file for a leftover.
            let taken = matches!(file.as_file().try_lock(), Err(TryLockError::WouldBlock));
            Ok((!taken && is_still_there(&file)?).then_some(file))
        };
        let failed = |error: &io::Error| {
            refused(error.kind(), format!("no new file can be made in `{}`: {error}", folder.display()))
        };
        let mut live = live();
        for left in (0..ATTEMPTS).rev() {
            match attempt() {
                Ok(Some(file)) => {
                    live.push(file.path().to_owned());
                    let listed = Listed(file.path().to_owned());
                    return Ok(Self { file, _listed: listed });
                }
                Ok(None) => {}
                Err(error) if error.kind() == io::ErrorKind::NotFound && left > 0 => {}
                Err(error) => return Err(failed(&error)),
            }
        }
        Err(failed(&io::ErrorKind::ResourceBusy.into()))
    }

    pub(super) fn file(&self) -> &File {
        self.file.as_file()
    }

    /// Gives the file its target's name. What was there, `before`, lends it its permissions.
    pub(super) fn persist(self, target: &Path, before: Option<&Metadata>) -> io::Result<()> {
        if let Some(before) = before {
            self.file().set_permissions(before.permissions())?;
        }
        // The data must be on the disk before the name points to it, or a power cut leaves an empty file.
        self.file().sync_all()?;
        let Self { file, _listed } = self;
        // None of them after `abandon`.
        let live = live();
        let done = file.persist(target);
        drop(live);
        Ok(done.map(drop)?)
    }
}

/// Whether the file has its name still: between its making and its locking it could be taken for a leftover.
fn is_still_there(file: &NamedTempFile) -> io::Result<bool> {
    match fs::symlink_metadata(file.path()) {
        Ok(named) => Ok(super::same_file(&named, &file.as_file().metadata()?)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error),
    }
}

/// Removes what is being written, and lets nothing more be written or take its place: the process is about to end, from
/// another thread than the one that writes.
///
/// Waits a fifth of a second at most for a file system that does not answer.
pub fn abandon() {
    const TRIES: u32 = 20;
    const NAP: Duration = Duration::from_millis(10);
    for _ in 0..TRIES {
        if let Ok(live) = LIVE.try_lock() {
            live.iter().for_each(|path| drop(fs::remove_file(path)));
            std::mem::forget(live);
            return;
        }
        std::thread::sleep(NAP);
    }
}

/// Removes what killed processes left in a folder of files whose names `is_target` knows.
pub(super) fn clear(folder: &Path, is_target: impl Fn(&[u8]) -> bool) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        if target_of(entry.file_name().as_encoded_bytes()).is_some_and(&is_target) {
            remove_if_dead(&entry.path());
        }
    }
}

/// The name that a partial file was to get.
fn target_of(name: &[u8]) -> Option<&[u8]> {
    let rest = name.strip_prefix(b".")?.strip_suffix(SUFFIX.as_bytes())?;
    let (target, random) = rest.split_at_checked(rest.len().checked_sub(RANDOM + 1)?)?;
    (random[0] == b'.' && random[1..].iter().all(u8::is_ascii_alphanumeric)).then_some(target)
}

fn remove_if_dead(path: &Path) {
    if !fs::symlink_metadata(path).is_ok_and(|about| about.is_file()) {
        return;
    }
    if let Ok(file) = File::open(path)
        && file.try_lock().is_ok()
    {
        // What cannot be removed was not in the way so far.
        let _ = fs::remove_file(path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Mutants: the random part not looked at; its length off by one.
    #[test]
    fn only_our_own_names_are_leftovers() {
        assert_eq!(target_of(b".hits.npy.aB3xYz.partial"), Some(&b"hits.npy"[..]));
        assert_eq!(target_of(b".\xff.aB3xYz.partial"), Some(&b"\xff"[..]));
        for other in
            ["hits.npy", ".hits.npy.partial", ".hits.npy.aB3xY.partial", ".hits.npy-aB3xYz.partial", ".partial"]
        {
            assert_eq!(target_of(other.as_bytes()), None, "{other}");
        }
    }

    // Mutant: `clear` that looks at no lock removes a file that is being written.
    #[test]
    fn leftovers_are_cleared_and_files_in_the_making_are_not() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("hits.npy");
        let alive = Partial::create(&target).unwrap();
        let dead = dir.path().join(".hits.npy.aB3xYz.partial");
        let foreign = dir.path().join(".rays.npy.aB3xYz.partial");
        [&dead, &foreign].iter().for_each(|path| fs::write(path, "half").unwrap());
        clear(dir.path(), |name| name == b"hits.npy");
        assert!(!dead.exists() && foreign.exists() && alive.file.path().exists());
        alive.persist(&target, None).unwrap();
        assert!(target.exists());
    }
}
