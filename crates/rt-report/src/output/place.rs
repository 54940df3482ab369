//! Where the path of an output leads.

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
    /// A file that this process has open already, such as `/dev/stdout`. Opened by its name, it would be written from
    /// its beginning even where it was opened to be appended to.
    Descriptor(u32),
    /// A pipe or a device, which takes bytes as they come.
    Stream(PathBuf, Metadata),
}

impl Place {
    /// # Errors
    /// When nothing can be written there; the message does not name the path.
    pub(super) fn of(path: &Path) -> io::Result<Self> {
        let ends_in_slash = path.as_os_str().as_encoded_bytes().last().is_some_and(|&byte| byte == b'/');
        let names_folder = || refused(io::ErrorKind::IsADirectory, "it names a folder: name a file in it");
        if ends_in_slash {
            return Err(names_folder());
        }
        let mut path = path.to_owned();
        for _ in 0..MAX_LINKS {
            let name = path.file_name().ok_or_else(names_folder)?;
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
                Err(error) => return Err(error),
            };
            if about.is_symlink() {
                path = folder.join(fs::read_link(&real)?);
            } else if about.is_dir() {
                return Err(refused(io::ErrorKind::IsADirectory, "it is a folder: name a file in it"));
            } else if about.is_file() {
                return Ok(Self::File { path: real, about: Some(about) });
            } else {
                return Ok(Self::Stream(real, about));
            }
        }
        let links = format!("it is a link to a link, {MAX_LINKS} times over");
        Err(refused(io::ErrorKind::InvalidInput, links))
    }
}

/// Why a path cannot be written to, where it is not the system that says so.
pub(super) fn refused(kind: io::ErrorKind, why: impl Into<String>) -> io::Error {
    io::Error::new(kind, why.into())
}

/// The folder a path lies in.
pub(super) fn parent(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    }
}

/// A folder without links, as far as it exists; what has to be made is behind that as it stands.
pub(super) fn real_folder(folder: &Path) -> io::Result<PathBuf> {
    let mut missing = Vec::new();
    for ancestor in folder.ancestors() {
        let ancestor = if ancestor == Path::new("") { Path::new(".") } else { ancestor };
        match ancestor.canonicalize() {
            Ok(mut real) => {
                if !real.is_dir() {
                    let what = format!("`{}` is not a folder", ancestor.display());
                    return Err(refused(io::ErrorKind::NotADirectory, what));
                }
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
            Err(error) => {
                return Err(refused(error.kind(), format!("the folder `{}`: {error}", ancestor.display())));
            }
        }
    }
    Err(refused(io::ErrorKind::NotFound, "the current folder is gone"))
}

/// The number of the open file that a name stands for, if its folder is the one where these are listed.
fn descriptor(folder: &Path, name: &OsStr) -> Option<u32> {
    let number = name.to_str()?.parse().ok()?;
    let listed = |list: &str| Path::new(list).canonicalize().is_ok_and(|list| list == folder);
    (listed("/proc/self/fd") || listed("/dev/fd")).then_some(number)
}
