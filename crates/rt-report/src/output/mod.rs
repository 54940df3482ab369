//! Writing files that are there in full or not at all, and finding out beforehand whether they can be.

mod check;
mod partial;
mod place;

pub use check::Outputs;
pub use partial::abandon;

use crate::ReportError;
use crate::print::Stdout;
use partial::Partial;
use place::{Place, refused};
use std::fs::{File, Metadata};
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Writes a file through a temporary one beside it, which takes the place of `path` only once it is complete.
///
/// Whatever stops the program in between (Ctrl-C, a crash, a full disk), `path` is either as it was or as it was meant
/// to be. The folder is created. A link is followed. What is not a regular file, such as a pipe, cannot be replaced and
/// is written directly; so is a file that is open already under the name of `/dev/stdout` or the like, behind what is
/// there.
///
/// # Errors
/// When the folder or file cannot be made, or `write` fails; the message names the path.
pub fn write_atomically(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), ReportError> {
    let written = Place::of(path).and_then(|place| match place {
        Place::File { path, about } => replace(&path, about.as_ref(), write),
        Place::Descriptor(number) => write_descriptor(number, write),
        Place::Stream(path, _) => write_to(File::options().write(true).open(path)?, write),
    });
    written.map_err(|source| ReportError::write(path, source))
}

/// What is written to, and gone back in.
#[cfg(feature = "exr")]
pub(crate) trait WriteSeek: Write + io::Seek {}

#[cfg(feature = "exr")]
impl<W: Write + io::Seek> WriteSeek for W {}

/// [`write_atomically`] for formats that fill in their beginning at the end. What is no regular file gets all of it at
/// once, from memory.
#[cfg(feature = "exr")]
pub(crate) fn write_seeking(
    path: &Path,
    write: impl FnOnce(&mut dyn WriteSeek) -> io::Result<()>,
) -> Result<(), ReportError> {
    match Place::of(path) {
        Ok(Place::File { path: file, about }) => {
            let written = Partial::create(&file).and_then(|partial| {
                let mut buffer = BufWriter::new(partial.file());
                write(&mut buffer)?;
                buffer.flush()?;
                drop(buffer);
                partial.persist(&file, about.as_ref())
            });
            written.map_err(|source| ReportError::write(path, source))
        }
        _ => {
            let mut memory = io::Cursor::new(Vec::new());
            write(&mut memory).map_err(|source| ReportError::write(path, source))?;
            write_atomically(path, |out| out.write_all(memory.get_ref()))
        }
    }
}

fn replace(
    path: &Path,
    before: Option<&Metadata>,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let partial = Partial::create(path)?;
    write_to(partial.file(), write)?;
    partial.persist(path, before)
}

fn write_descriptor(number: u32, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    match number {
        0 => Err(refused(io::ErrorKind::InvalidInput, "it is standard input")),
        // In order with whatever else is printed.
        1 => write_to(Stdout, write),
        2 => write_to(std::io::stderr(), write),
        // Opened anew, it has a place of its own in the file: the end is the only one that overwrites nothing.
        number => write_to(File::options().append(true).open(format!("/dev/fd/{number}"))?, write),
    }
}

fn write_to(out: impl Write, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let mut buffer = BufWriter::new(out);
    write(&mut buffer)?;
    buffer.flush()
}

/// Names in a folder for which `is` holds, in order; none where it cannot be read.
#[must_use]
pub fn names(folder: &Path, is: impl Fn(&str) -> bool) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> =
        entries.filter_map(|entry| entry.file_name().into_string().ok()).filter(|name| is(name)).collect();
    names.sort_unstable();
    names
}

/// Whether both are of one file.
#[cfg(unix)]
fn same_file(a: &Metadata, b: &Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    (a.dev(), a.ino()) == (b.dev(), b.ino())
}

/// Where files have no numbers, they are told apart by their names alone.
#[cfg(not(unix))]
fn same_file(_: &Metadata, _: &Metadata) -> bool {
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::usage::chain;
    use std::ffi::OsString;
    use std::fs;

    fn names(folder: &Path) -> Vec<OsString> {
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name()).collect()
    }

    #[test]
    fn a_new_file_comes_with_its_folder() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a/b/c.txt");
        write_atomically(&path, |out| out.write_all(b"new")).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(names(path.parent().unwrap()), ["c.txt"]);
    }

    // Fails when `replace` writes to `path` itself.
    #[test]
    fn a_failure_leaves_the_old_file_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("c.txt");
        fs::write(&path, "old").unwrap();
        let error = write_atomically(&path, |out| {
            out.write_all(&[b'x'; 100_000])?;
            Err(io::Error::other("the device is on fire"))
        });
        let message = chain(&error.unwrap_err());
        assert!(message.contains("c.txt") && message.contains("on fire"), "{message}");
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names(dir.path()), ["c.txt"]);
    }

    #[test]
    fn a_folder_is_refused_by_name() {
        let dir = tempfile::tempdir().unwrap();
        let error = write_atomically(dir.path(), |_| Ok(())).unwrap_err();
        assert!(chain(&error).contains("is a folder"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn links_stay_links_and_devices_stay_devices() {
        use std::os::unix::fs::{FileTypeExt, PermissionsExt};
        let dir = tempfile::tempdir().unwrap();
        let (file, link) = (dir.path().join("file"), dir.path().join("link"));
        fs::write(&file, "old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write_atomically(&link, |out| out.write_all(b"new")).unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        // A link to what is not there yet says where it is to be.
        fs::remove_file(&file).unwrap();
        write_atomically(&link, |out| out.write_all(b"new")).unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        // A temporary file's own permissions would be 0600, and nobody else could read the result.
        let plain = dir.path().join("plain");
        fs::write(&plain, "").unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&file), mode(&plain));
        // What its owner hid or showed stays so.
        fs::set_permissions(&file, fs::Permissions::from_mode(0o600)).unwrap();
        write_atomically(&link, |out| out.write_all(b"new")).unwrap();
        assert_eq!(mode(&file) & 0o777, 0o600);

        write_atomically(Path::new("/dev/null"), |out| out.write_all(b"gone")).unwrap();
        assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
    }

    // Mutants: the file behind an open one replaced; written from its beginning.
    #[cfg(unix)]
    #[test]
    fn what_is_open_already_is_appended_to() {
        use std::os::fd::AsRawFd;
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("log");
        fs::write(&path, "yesterday\n").unwrap();
        let log = File::options().append(true).open(&path).unwrap();
        let open = format!("/dev/fd/{}", log.as_raw_fd());
        let link = dir.path().join("link");
        std::os::unix::fs::symlink(&open, &link).unwrap();
        write_atomically(Path::new(&open), |out| out.write_all(b"today\n")).unwrap();
        write_atomically(&link, |out| out.write_all(b"tonight\n")).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"yesterday\ntoday\ntonight\n");
    }
}
