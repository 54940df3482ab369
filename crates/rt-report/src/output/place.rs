//! Where the path of an output leads.

use anyhow::{Context, Result, bail, ensure};
use std::ffi::OsStr;
use std::fs::{self, Metadata};
use std::io;
use std::path::{Component, Path, PathBuf};

/// Most links that are followed, as Linux has it.
const MAX_LINKS: usize = 40;

/// What is behind a path when all links are followed.
#[derive(Debug)]
pub(super) enum Place {
    /// A regular file, which can be replaced as a whole, or none yet.
    File {
        /// Its real folder, which may have to be made, and its name.
        path: PathBuf,
        /// What is there.
        about: Option<Metadata>,
    },
    /// A file that this process has open already, such as `/dev/stdout`. Opened by its name, it would be written from its
    /// beginning even where it was opened to be appended to.
    Descriptor(u32),
    /// A pipe or a device, which takes bytes as they come.
    Stream(PathBuf, Metadata),
}

impl Place {
    /// # Errors
    /// When nothing can be written there; the message does not name the path.
    pub(super) fn of(path: &Path) -> Result<Self> {
        let ends_in_slash = path.as_os_str().as_encoded_bytes().last().is_some_and(|&byte| byte == b'/');
        ensure!(!ends_in_slash, "it names a folder: name a file in it");
        let mut path = path.to_owned();
        for _ in 0..MAX_LINKS {
            let Some(name) = path.file_name() else { bail!("it names a folder: name a file in it") };
            let folder = real_folder(parent(&path))?;
            if let Some(number) = descriptor(&folder, name) {
                return Ok(Self::Descriptor(number));
            }
            let real = folder.join(name);
            let about = match fs::symlink_metadata(&real) {
                Ok(about) => about,
                Err(error) if error.kind() == io::ErrorKind::NotFound => {
                    return Ok(Self::File { path: real, about: None });
                }
                Err(error) => return Err(error.into()),
            };
            if about.is_symlink() {
                path = folder.join(fs::read_link(&real)?);
            } else if about.is_dir() {
                bail!("it is a folder: name a file in it");
            } else if about.is_file() {
                return Ok(Self::File { path: real, about: Some(about) });
            } else {
                return Ok(Self::Stream(real, about));
            }
        }
        bail!("it is a link to a link, {MAX_LINKS} times over")
    }
}

/// The folder a path lies in.
pub(super) fn parent(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    }
}

/// A folder without links, as far as it exists; what has to be made is behind that as it stands.
pub(super) fn real_folder(folder: &Path) -> Result<PathBuf> {
    let mut missing = Vec::new();
    for ancestor in folder.ancestors() {
        let ancestor = if ancestor == Path::new("") { Path::new(".") } else { ancestor };
        match ancestor.canonicalize() {
            Ok(mut real) => {
                ensure!(real.is_dir(), "`{}` is not a folder", ancestor.display());
                for part in missing.iter().rev() {
                    match part {
                        Component::ParentDir => drop(real.pop()),
                        part => real.push(part),
                    }
                }
                return Ok(real);
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => missing.extend(ancestor.components().next_back()),
            Err(error) if error.kind() == io::ErrorKind::NotADirectory => {
                missing.extend(ancestor.components().next_back());
            }
            Err(error) => return Err(error).with_context(|| format!("the folder `{}`", ancestor.display())),
        }
    }
    bail!("the current folder is gone")
}

/// The number of the open file that a name stands for, if its folder is the one where these are listed.
fn descriptor(folder: &Path, name: &OsStr) -> Option<u32> {
    let number = name.to_str()?.parse().ok()?;
    let listed = |list: &str| Path::new(list).canonicalize().is_ok_and(|list| list == folder);
    (listed("/proc/self/fd") || listed("/dev/fd")).then_some(number)
}
