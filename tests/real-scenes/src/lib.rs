//! Real scenes: the `.obj` and `.obj.xz` files of the folder that the environment variable `RAYBALANCE_SCENES` names.
//!
//! Packed ones are unpacked, once, into a folder of the project's own, beside `cameras.tsv` and the scenes that are not
//! packed. `cargo xtask setup` does so beforehand; a test that is started by hand does it when it looks for scenes.
//!
//! # Current state and limits
//!
//! * Unpacking is done by the program `xz`.
#![forbid(unsafe_code)]

use anyhow::{Context, Result, bail};
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use tempfile::NamedTempFile;

/// The environment variable.
pub const VARIABLE: &str = "RAYBALANCE_SCENES";

/// Name of the table of cameras beside the scenes.
const CAMERAS: &str = "cameras.tsv";

/// A scene that can be loaded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RealScene {
    /// File name without `.obj`.
    pub name: String,
    /// The file, unpacked.
    pub path: PathBuf,
}

/// Where scenes come from and where they are unpacked to.
#[derive(Debug)]
pub struct Folders {
    source: PathBuf,
    target: PathBuf,
}

/// One file to bring over.
#[derive(Debug, PartialEq)]
struct Item {
    from: PathBuf,
    to: PathBuf,
    packed: bool,
}

/// The scenes of the folder that [`VARIABLE`] names, by name, unpacked.
///
/// # Errors
/// The reason why there are none, for a person.
pub fn find() -> Result<Vec<RealScene>> {
    let Some(folders) = Folders::named()? else {
        bail!("{VARIABLE} is not set: let it name a folder of .obj or .obj.xz files");
    };
    folders.scenes()
}

impl Folders {
    /// The folder that [`VARIABLE`] names, with the project's own as target; `None` where it is not set.
    ///
    /// # Errors
    /// When it names no folder.
    pub fn named() -> Result<Option<Self>> {
        let source = std::env::var_os(VARIABLE).filter(|value| !value.is_empty());
        let root =
            Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).context("this package lies two folders deep")?;
        source.map(|source| Self::new(source.into(), root.join(".setup/scenes"))).transpose()
    }

    fn new(source: PathBuf, target: PathBuf) -> Result<Self> {
        if !source.is_dir() {
            bail!("{VARIABLE} names `{}`, which is not a folder: correct or unset it", source.display());
        }
        let source = source.canonicalize().with_context(|| format!("cannot resolve `{}`", source.display()))?;
        Ok(Self { source, target })
    }

    /// Where all scenes lie unpacked once they are up to date: the source itself where none is packed.
    ///
    /// # Errors
    /// When the source cannot be read.
    pub fn unpacked(&self) -> Result<&Path> {
        Ok(if self.items()?.is_empty() { &self.source } else { &self.target })
    }

    /// Whether any scene needs xz.
    ///
    /// # Errors
    /// When the source cannot be read.
    pub fn any_packed(&self) -> Result<bool> {
        Ok(!self.items()?.is_empty())
    }

    /// Whether nothing is missing in the target, or older there than its source.
    ///
    /// # Errors
    /// When the source cannot be read.
    pub fn is_up_to_date(&self) -> Result<bool> {
        Ok(self.outdated()?.is_empty())
    }

    /// Brings over what is outdated, and says what that was.
    ///
    /// # Errors
    /// When a file cannot be read, unpacked or written; it is named.
    pub fn update(&self) -> Result<String> {
        let items = self.outdated()?;
        if !items.is_empty() {
            fs::create_dir_all(&self.target).with_context(|| format!("cannot create `{}`", self.target.display()))?;
        }
        for item in &items {
            item.bring().with_context(|| format!("cannot bring `{}` over", item.from.display()))?;
        }
        let unpacked = items.iter().filter(|item| item.packed).count();
        let copied = items.len() - unpacked;
        Ok(format!("{unpacked} files unpacked and {copied} copied into {}", self.target.display()))
    }

    /// The scenes by name, brought up to date.
    ///
    /// # Errors
    /// When there is none, or one cannot be brought over.
    pub fn scenes(&self) -> Result<Vec<RealScene>> {
        self.update()?;
        let items = self.items()?;
        let paths = if items.is_empty() { self.listed()? } else { items.into_iter().map(|item| item.to).collect() };
        let scene = |path: PathBuf| {
            let name = path.file_name()?.to_str()?.strip_suffix(".obj")?.to_owned();
            Some(RealScene { name, path })
        };
        let scenes: Vec<RealScene> = paths.into_iter().filter_map(scene).collect();
        if scenes.is_empty() {
            bail!("no .obj or .obj.xz file in `{}`", self.source.display());
        }
        Ok(scenes)
    }

    fn outdated(&self) -> Result<Vec<Item>> {
        let modified = |path: &Path| fs::metadata(path).and_then(|data| data.modified());
        let mut items = self.items()?;
        items.retain(|item| match (modified(&item.from), modified(&item.to)) {
            (Ok(from), Ok(to)) => from > to,
            _ => true,
        });
        Ok(items)
    }

    /// What has to lie in the target, sorted by name; a packed scene gives way to the same scene unpacked. Nothing
    /// where none is packed, or where the source is the target itself.
    fn items(&self) -> Result<Vec<Item>> {
        if self.target.canonicalize().is_ok_and(|target| target == self.source) {
            return Ok(Vec::new());
        }
        let mut items = Vec::new();
        for from in self.listed()? {
            let Some(name) = from.file_name().and_then(OsStr::to_str).map(str::to_owned) else { continue };
            let packed = name.ends_with(".obj.xz");
            if packed && from.with_extension("").exists() || !packed && !name.ends_with(".obj") && name != CAMERAS {
                continue;
            }
            let to = self.target.join(name.trim_end_matches(".xz"));
            items.push(Item { from, to, packed });
        }
        if !items.iter().any(|item| item.packed) {
            items.clear();
        }
        Ok(items)
    }

    /// All files of the source, sorted.
    fn listed(&self) -> Result<Vec<PathBuf>> {
        let list = || fs::read_dir(&self.source)?.map(|entry| Ok(entry?.path())).collect::<io::Result<Vec<_>>>();
        let mut paths = list().with_context(|| format!("cannot list `{}`", self.source.display()))?;
        paths.sort();
        Ok(paths)
    }
}

impl Item {
    /// Through a file of another name, so that an interruption leaves nothing that looks finished, and tests that run
    /// at the same time do not write into each other's.
    fn bring(&self) -> Result<()> {
        let folder = self.to.parent().context("it has no folder")?;
        let mut partial = tempfile::Builder::new().suffix(".partial").tempfile_in(folder)?;
        if self.packed {
            self.unpack(&partial)?;
        } else {
            io::copy(&mut File::open(&self.from)?, &mut partial)?;
        }
        partial.persist(&self.to)?;
        Ok(())
    }

    fn unpack(&self, to: &NamedTempFile) -> Result<()> {
        let mut unpack = Command::new("xz");
        unpack.args(["--decompress", "--stdout", "--"]).arg(&self.from).stdin(Stdio::null()).stdout(to.reopen()?);
        let status = unpack.status().context("cannot start xz, which unpacks it (install xz-utils)")?;
        if !status.success() {
            bail!("xz failed ({status}): the file may be damaged");
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::{Duration, SystemTime};

    fn folders(dir: &Path, files: &[&str]) -> Folders {
        let source = dir.join("source");
        fs::create_dir_all(&source).unwrap();
        for name in files {
            fs::write(source.join(name), name).unwrap();
        }
        Folders::new(source, dir.join("target")).unwrap()
    }

    // Guards against: scenes copied though they could be read where they are, other files taken for scenes.
    #[test]
    fn plain_scenes_stay_where_they_are() {
        let dir = tempfile::tempdir().unwrap();
        let folders = folders(dir.path(), &["b.obj", "a.obj", CAMERAS, "LICENCES.md"]);
        let scenes = folders.scenes().unwrap();
        let names: Vec<_> = scenes.iter().map(|scene| scene.name.as_str()).collect();
        assert_eq!(names, ["a", "b"]);
        assert_eq!(fs::read_to_string(&scenes[0].path).unwrap(), "a.obj");
        assert_eq!(folders.unpacked().unwrap(), folders.source);
        assert!(folders.is_up_to_date().unwrap() && !folders.target.exists());
    }

    // Guards against: a table of cameras that is left behind, an old copy that is kept, a packed scene beside itself
    // unpacked.
    #[test]
    fn what_lies_beside_a_packed_scene_comes_over_once_and_again_when_newer() {
        let dir = tempfile::tempdir().unwrap();
        let folders = folders(dir.path(), &["a.obj", "a.obj.xz", "b.obj.xz", CAMERAS, "LICENCES.md"]);
        let outdated = |names: &[&str]| {
            let found: Vec<_> = folders.outdated().unwrap().into_iter().map(|item| item.to).collect();
            assert_eq!(found, names.iter().map(|name| folders.target.join(name)).collect::<Vec<_>>());
        };
        outdated(&["a.obj", "b.obj", CAMERAS]);
        fs::create_dir_all(&folders.target).unwrap();
        for item in folders.outdated().unwrap().iter().filter(|item| !item.packed) {
            item.bring().unwrap();
        }
        assert_eq!(fs::read_to_string(folders.target.join("a.obj")).unwrap(), "a.obj");
        outdated(&["b.obj"]);
        let source = File::options().write(true).open(folders.source.join("a.obj")).unwrap();
        source.set_modified(SystemTime::now() + Duration::from_secs(10)).unwrap();
        outdated(&["a.obj", "b.obj"]);
    }

    #[test]
    fn a_damaged_archive_leaves_no_scene() {
        let dir = tempfile::tempdir().unwrap();
        let folders = folders(dir.path(), &["a.obj.xz"]);
        assert!(folders.any_packed().unwrap());
        let error = folders.scenes().unwrap_err();
        assert!(format!("{error:#}").contains("a.obj.xz"), "{error:#}");
        assert_eq!(fs::read_dir(&folders.target).unwrap().count(), 0);
    }

    #[test]
    fn a_folder_without_scenes_is_refused_by_name() {
        let dir = tempfile::tempdir().unwrap();
        assert!(folders(dir.path(), &["a.txt"]).scenes().unwrap_err().to_string().contains("source"));
        let error = Folders::new("no/such/folder".into(), "target".into()).unwrap_err();
        assert!(error.to_string().contains("no/such/folder"), "{error}");
    }
}
