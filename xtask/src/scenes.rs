//! Unpacking scenes into a folder of the project's own.

use anyhow::{Context, Result, bail};
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Name of the table of cameras beside the scenes.
const CAMERAS: &str = "cameras.tsv";

/// Where scenes come from and where they are unpacked to.
#[derive(Debug)]
pub(crate) struct Folders {
    source: PathBuf,
    target: PathBuf,
}

/// One file to bring over.
#[derive(Debug, PartialEq)]
pub(crate) struct Item {
    from: PathBuf,
    to: PathBuf,
    packed: bool,
}

impl Folders {
    /// Checks that `source` is a folder.
    pub(crate) fn new(source: PathBuf, target: PathBuf) -> Result<Self> {
        if !source.is_dir() {
            bail!("RAYBALANCE_SCENES names `{}`, which is not a folder: correct or unset it", source.display());
        }
        let source = source.canonicalize().with_context(|| format!("cannot resolve `{}`", source.display()))?;
        Ok(Self { source, target })
    }

    pub(crate) fn into_target(self) -> PathBuf {
        self.target
    }

    /// Whether any scene needs xz.
    pub(crate) fn any_packed(&self) -> Result<bool> {
        Ok(self.items()?.iter().any(|item| item.packed))
    }

    /// What is missing in the target, or older there than its source.
    pub(crate) fn outdated(&self) -> Result<Vec<Item>> {
        let modified = |path: &Path| fs::metadata(path).and_then(|data| data.modified());
        let mut items = self.items()?;
        items.retain(|item| match (modified(&item.from), modified(&item.to)) {
            (Ok(from), Ok(to)) => from > to,
            _ => true,
        });
        Ok(items)
    }

    /// Brings over what is outdated, and says what that was.
    pub(crate) fn update(&self) -> Result<String> {
        fs::create_dir_all(&self.target).with_context(|| format!("cannot create `{}`", self.target.display()))?;
        let items = self.outdated()?;
        for item in &items {
            item.bring().with_context(|| format!("cannot bring `{}` over", item.from.display()))?;
        }
        let unpacked = items.iter().filter(|item| item.packed).count();
        let copied = items.len() - unpacked;
        Ok(format!("{unpacked} files unpacked and {copied} copied into {}", self.target.display()))
    }

    /// Every scene of the source, sorted by name; a packed one gives way to the same scene unpacked.
    fn items(&self) -> Result<Vec<Item>> {
        // Someone who names the target itself has nothing to unpack.
        if self.target.canonicalize().is_ok_and(|target| target == self.source) {
            return Ok(Vec::new());
        }
        let context = || format!("cannot list `{}`", self.source.display());
        let mut items = Vec::new();
        for entry in fs::read_dir(&self.source).with_context(context)? {
            let from = entry.with_context(context)?.path();
            let Some(name) = from.file_name().and_then(OsStr::to_str).map(str::to_owned) else { continue };
            let packed = name.ends_with(".obj.xz");
            if packed && from.with_extension("").exists() || !packed && !name.ends_with(".obj") && name != CAMERAS {
                continue;
            }
            let to = self.target.join(name.trim_end_matches(".xz"));
            items.push(Item { from, to, packed });
        }
        items.sort_by(|a, b| a.to.cmp(&b.to));
        Ok(items)
    }
}

impl Item {
    /// Through a partial file, so that an interruption leaves nothing that looks finished.
    fn bring(&self) -> Result<()> {
        let mut partial = self.to.clone().into_os_string();
        partial.push(".partial");
        let mut file = File::create(&partial)?;
        if self.packed {
            let mut unpack = Command::new("xz");
            unpack.args(["--decompress", "--stdout", "--"]).arg(&self.from).stdin(Stdio::null()).stdout(file);
            let status = unpack.status().context("cannot start xz")?;
            if !status.success() {
                bail!("xz failed ({status}): the file may be damaged");
            }
        } else {
            io::copy(&mut File::open(&self.from)?, &mut file)?;
        }
        fs::rename(&partial, &self.to)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::{Duration, SystemTime};

    fn folders(dir: &Path) -> Folders {
        let source = dir.join("source");
        fs::create_dir_all(&source).unwrap();
        Folders::new(source, dir.join("target")).unwrap()
    }

    #[test]
    fn plain_scenes_and_cameras_come_over_once_and_again_when_newer() {
        let dir = tempfile::tempdir().unwrap();
        let folders = folders(dir.path());
        for name in ["a.obj", CAMERAS, "LICENCES.md"] {
            fs::write(folders.source.join(name), name).unwrap();
        }
        folders.update().unwrap();
        assert_eq!(fs::read_to_string(folders.target.join("a.obj")).unwrap(), "a.obj");
        assert!(folders.target.join(CAMERAS).exists() && !folders.target.join("LICENCES.md").exists());
        assert_eq!(folders.outdated().unwrap(), []);

        let source = File::options().write(true).open(folders.source.join("a.obj")).unwrap();
        source.set_modified(SystemTime::now() + Duration::from_secs(10)).unwrap();
        assert_eq!(folders.outdated().unwrap().len(), 1);
    }

    #[test]
    fn a_damaged_archive_leaves_no_scene() {
        let dir = tempfile::tempdir().unwrap();
        let folders = folders(dir.path());
        fs::write(folders.source.join("a.obj.xz"), "no archive").unwrap();
        assert!(folders.any_packed().unwrap());
        assert!(folders.update().is_err());
        assert!(!folders.target.join("a.obj").exists());
    }

    #[test]
    fn a_missing_folder_is_refused_by_name() {
        let error = Folders::new("no/such/folder".into(), "target".into()).unwrap_err();
        assert!(error.to_string().contains("no/such/folder"), "{error}");
    }
}
