//! Outputs looked at before any work is done for them.

use super::partial::{self, Partial};
use super::place::{Place, parent, real_folder, refused};
use crate::usage::{Usage, usage};
use rt_scene::{scenes, view};
use std::collections::{BTreeMap, HashMap, HashSet};
use std::ffi::OsStr;
use std::fs::{self, File, Metadata};
use std::io;
use std::path::{Path, PathBuf};

/// What a command is going to write, and what it reads and must not overwrite.
#[derive(Clone, Debug, Default)]
pub struct Outputs {
    files: Vec<Wanted>,
    folders: Vec<Wanted>,
    inputs: Vec<Wanted>,
}

/// A path, and the option that names it.
#[derive(Clone, Debug)]
struct Wanted {
    option: String,
    path: PathBuf,
}

/// What makes two paths one file.
#[derive(Debug, PartialEq, Eq, Hash)]
enum Identity {
    #[cfg(unix)]
    Node(u64, u64),
    Path(PathBuf),
}

impl Outputs {
    /// Nothing yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// A file that `option` names.
    #[must_use]
    pub fn file(mut self, option: &str, path: &Path) -> Self {
        self.files.push(Wanted::new(option, path));
        self
    }

    /// Files in a folder that `option` names.
    #[must_use]
    pub fn folder<N: AsRef<Path>>(mut self, option: &str, folder: &Path, names: impl IntoIterator<Item = N>) -> Self {
        self.folders.push(Wanted::new(option, folder));
        self.files.extend(names.into_iter().map(|name| Wanted::new(option, &folder.join(name))));
        self
    }

    /// A file that is read; `what` says what it is, such as "the scene".
    #[must_use]
    pub fn input(mut self, what: &str, path: &Path) -> Self {
        self.inputs.push(Wanted::new(what, path));
        self
    }

    /// The files of scenes, and the lists of cameras beside them; those that are built in have none.
    #[must_use]
    pub fn scenes<S: AsRef<Path>>(self, scenes: impl IntoIterator<Item = S>) -> Self {
        let is_built_in = |scene: &Path| scene.to_str().is_some_and(|name| scenes::find(name).is_some());
        scenes.into_iter().fold(self, |outputs, scene| match scene.as_ref() {
            built_in if is_built_in(built_in) => outputs,
            file => outputs.input("the scene", file).input("the cameras", &view::list_beside(file)),
        })
    }

    /// Whether nothing is written over material files, which are known once a scene is read.
    ///
    /// # Errors
    /// Of wrong usage; the message names the option and the file.
    pub fn spare_materials<P: AsRef<Path>>(&self, files: impl IntoIterator<Item = P>) -> Result<(), Usage> {
        let Self { files: outputs, folders, .. } = self.clone();
        let only = Self { files: outputs, folders, inputs: Vec::new() };
        let inputs = files.into_iter().fold(only, |outputs, file| outputs.input("the materials", file.as_ref()));
        if inputs.inputs.is_empty() { Ok(()) } else { inputs.check() }
    }

    /// Whether everything can be written, no file twice, and none that is read. Leaves the disk as it is, but for what
    /// killed processes left of the same files.
    ///
    /// # Errors
    /// Of wrong usage, when something cannot be written; the message names the option, the path and the reason.
    pub fn check(&self) -> Result<(), Usage> {
        for Wanted { option, path } in &self.folders {
            let folder = path.display();
            if path.exists() && !path.is_dir() {
                return Err(usage(format!("{option}: `{folder}` is not a folder")));
            }
            real_folder(path).map_err(|why| usage(format!("{option}: cannot make the folder `{folder}`: {why}")))?;
        }
        let inputs: HashMap<Identity, &Wanted> =
            self.inputs.iter().filter_map(|input| Some((Identity::of(&input.path)?, input))).collect();
        let mut outputs: HashMap<Identity, &Wanted> = HashMap::new();
        let mut in_folders: BTreeMap<PathBuf, Vec<(PathBuf, &Wanted)>> = BTreeMap::new();
        for wanted in &self.files {
            let Wanted { option, path } = wanted;
            let place = Place::of(path).map_err(|why| wanted.cannot_be_written(&why))?;
            if let Some(identity) = place.identity() {
                if let Some(input) = inputs.get(&identity) {
                    return Err(usage(format!("{option} would overwrite {}, `{}`", input.option, path.display())));
                }
                if !matches!(place, Place::Descriptor(_))
                    && let Some((name, device)) = redirected(&identity)
                {
                    return Err(usage(format!(
                        "{option} names the file that {name} goes to, `{}`: name another one, or {device}",
                        path.display()
                    )));
                }
                if let Some(other) = outputs.insert(identity, wanted) {
                    return Err(usage(other.same_file_as(wanted)));
                }
            }
            place.check().map_err(|why| wanted.cannot_be_written(&why))?;
            if let Place::File { path: real, .. } = place {
                in_folders.entry(parent(&real).to_owned()).or_default().push((real, wanted));
            }
        }
        for files in in_folders.values() {
            // One file tells for all in its folder, but for the length of its name.
            let longest = files.iter().max_by_key(|(real, _)| real.as_os_str().len());
            if let Some((real, wanted)) = longest {
                try_to_make(real).map_err(|why| wanted.cannot_be_written(&why))?;
            }
        }
        for (folder, files) in &in_folders {
            let names: HashSet<&[u8]> =
                files.iter().filter_map(|(real, _)| real.file_name()).map(OsStr::as_encoded_bytes).collect();
            partial::clear(folder, |name| names.contains(name));
        }
        Ok(())
    }
}

impl Wanted {
    fn new(option: &str, path: &Path) -> Self {
        Self { option: option.to_owned(), path: path.to_owned() }
    }

    fn cannot_be_written(&self, why: &io::Error) -> Usage {
        usage(format!("{}: cannot write `{}`: {why}", self.option, self.path.display()))
    }

    fn same_file_as(&self, other: &Self) -> String {
        let [a, b] = [self, other].map(|wanted| wanted.path.display());
        match self.option == other.option {
            true => format!("{}: `{a}` and `{b}` are the same file", self.option),
            false if self.path == other.path => {
                format!("{} and {} name the same file, `{a}`", self.option, other.option)
            }
            false => format!("{} and {} name the same file, `{a}` and `{b}`", self.option, other.option),
        }
    }
}

impl Identity {
    fn of(path: &Path) -> Option<Self> {
        let about = fs::metadata(path).ok().filter(Metadata::is_file)?;
        Self::of_metadata(&about).or_else(|| path.canonicalize().ok().map(Self::Path))
    }

    #[cfg(unix)]
    fn of_metadata(about: &Metadata) -> Option<Self> {
        use std::os::unix::fs::MetadataExt;
        Some(Self::Node(about.dev(), about.ino()))
    }

    #[cfg(not(unix))]
    fn of_metadata(_: &Metadata) -> Option<Self> {
        None
    }
}

impl Place {
    /// What tells it from other places; `None` for devices, which take whatever is written to them.
    fn identity(&self) -> Option<Identity> {
        match self {
            Self::File { path, about } => {
                about.as_ref().and_then(Identity::of_metadata).or_else(|| Some(Identity::Path(path.clone())))
            }
            Self::Descriptor(number) => {
                let about = fs::metadata(format!("/dev/fd/{number}")).ok()?;
                if is_device(&about) { None } else { Identity::of_metadata(&about) }
            }
            Self::Stream(path, about) => match is_device(about) {
                true => None,
                false => Identity::of_metadata(about).or_else(|| Some(Identity::Path(path.clone()))),
            },
        }
    }

    /// Whether it can be written, as far as can be told without writing; new files are tried elsewhere.
    fn check(&self) -> io::Result<()> {
        let invalid = |why: &str| Err(refused(io::ErrorKind::InvalidInput, why));
        match self {
            Self::File { about: Some(about), .. } if about.permissions().readonly() => invalid("it is read-only"),
            Self::File { .. } => Ok(()),
            Self::Descriptor(0) => invalid("it is standard input"),
            Self::Descriptor(number) if !Path::new(&format!("/dev/fd/{number}")).exists() => {
                invalid("nothing is open under that number")
            }
            Self::Descriptor(_) => Ok(()),
            // A pipe cannot be opened before somebody reads from it.
            Self::Stream(_, about) if is_pipe(about) => Ok(()),
            Self::Stream(path, about) if is_device(about) => File::options().write(true).open(path).map(drop),
            Self::Stream(..) => invalid("it is neither a file, a pipe nor a device to write to"),
        }
    }
}

#[cfg(unix)]
fn is_device(about: &Metadata) -> bool {
    std::os::unix::fs::FileTypeExt::is_char_device(&about.file_type())
}

#[cfg(unix)]
fn is_pipe(about: &Metadata) -> bool {
    std::os::unix::fs::FileTypeExt::is_fifo(&about.file_type())
}

#[cfg(not(unix))]
fn is_device(_: &Metadata) -> bool {
    false
}

#[cfg(not(unix))]
fn is_pipe(_: &Metadata) -> bool {
    true
}

/// The standard stream that goes to a regular file, if it is this one: its name, and the path that stands for it.
#[cfg(unix)]
fn redirected(identity: &Identity) -> Option<(&'static str, &'static str)> {
    let streams = [("standard output", "/dev/stdout"), ("standard error", "/dev/stderr")];
    streams.into_iter().find(|(_, device)| Identity::of(Path::new(device)).as_ref() == Some(identity))
}

#[cfg(not(unix))]
fn redirected(_: &Identity) -> Option<(&'static str, &'static str)> {
    None
}

/// Makes the file's folder and a new file in it, and removes both.
fn try_to_make(target: &Path) -> io::Result<()> {
    let is_missing = |folder: &&Path| !folder.exists();
    // From the innermost to the outermost.
    let missing: Vec<&Path> = parent(target).ancestors().take_while(is_missing).collect();
    let made = Partial::create(target);
    let made = made.map(drop);
    // Another process may have put something into them by now; then they stay.
    missing.iter().for_each(|folder| drop(fs::remove_dir(folder)));
    made
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::fs::{PermissionsExt, symlink};

    fn refusal(outputs: &Outputs) -> String {
        outputs.check().expect_err("must be refused").to_string()
    }

    fn entries(folder: &Path) -> usize {
        fs::read_dir(folder).expect("a folder").count()
    }

    // Mutants: paths compared as they are written; the real folder of what does not exist yet left out; only files that
    // exist compared.
    #[test]
    fn the_same_file_is_refused_by_whatever_names() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        fs::write(at("there"), "old").unwrap();
        fs::create_dir(at("sub")).unwrap();
        fs::hard_link(at("there"), at("hard")).unwrap();
        symlink(at("there"), at("soft")).unwrap();
        symlink("soft", at("softer")).unwrap();
        symlink("sub", at("folder")).unwrap();
        symlink("nothing", at("dangling")).unwrap();
        let twice = [
            ("there", "there"),
            ("new", "new"),
            ("new", "sub/../new"),
            ("new", "newer/../new"),
            ("a/b/new", "a/./b/new"),
            ("there", "hard"),
            ("there", "soft"),
            ("hard", "softer"),
            ("sub/new", "folder/new"),
            ("nothing", "dangling"),
        ];
        let before = entries(dir.path());
        for (a, b) in twice {
            let message = refusal(&Outputs::new().file("--hits", &at(a)).file("--counts", &at(b)));
            assert!(message.starts_with("--hits and --counts name the same file"), "{a}, {b}: {message}");
            if at(a).exists() {
                let message = refusal(&Outputs::new().file("--hits", &at(a)).input("the scene", &at(b)));
                assert!(message.starts_with("--hits would overwrite the scene"), "{a}, {b}: {message}");
            }
        }
        assert_eq!(entries(dir.path()), before);
        let both =
            Outputs::new().file("--hits", &at("new")).file("--counts", &at("newer")).input("the rays", &at("there"));
        both.check().unwrap();
        assert_eq!(entries(dir.path()), before);
        // A device forgets what it is given.
        let null = Path::new("/dev/null");
        Outputs::new().file("--hits", null).file("--counts", null).check().unwrap();
    }

    // Mutants: no attempt to make the file; the folders that were made for it left behind.
    #[test]
    fn what_cannot_be_written_is_refused_and_nothing_is_left_of_the_attempt() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        fs::write(at("file"), "old").unwrap();
        fs::write(at("read-only"), "old").unwrap();
        fs::set_permissions(at("read-only"), fs::Permissions::from_mode(0o444)).unwrap();
        fs::create_dir(at("sub")).unwrap();
        symlink("loop", at("loop")).unwrap();
        drop(std::os::unix::net::UnixListener::bind(at("socket")).unwrap());
        let long = "x".repeat(300);
        let before = entries(dir.path());
        for (name, reason) in [
            ("file/new", "not a folder"),
            ("sub", "folder"),
            ("sub/", "folder"),
            ("sub/..", "folder"),
            ("new/", "folder"),
            ("read-only", "read-only"),
            ("loop", "link"),
            ("socket", "neither"),
            (&format!("new/{long}"), "long"),
            (&format!("{long}/new"), "long"),
        ] {
            let message = refusal(&Outputs::new().file("--hits", &at(name)));
            assert!(message.starts_with("--hits: cannot write") && message.contains(reason), "{name}: {message}");
        }
        assert!(refusal(&Outputs::new().file("--hits", Path::new(""))).contains("folder"));
        assert!(refusal(&Outputs::new().file("--hits", Path::new("/dev/stdin"))).contains("standard input"));
        assert!(refusal(&Outputs::new().file("--hits", Path::new("/proc/new"))).contains("--hits"));
        let message = refusal(&Outputs::new().folder("--out", &at("file"), ["image.png"]));
        assert!(message.starts_with("--out: ") && message.ends_with("is not a folder"), "{message}");
        let message = refusal(&Outputs::new().folder("--out", &at("file/sub"), ["image.png"]));
        assert!(message.starts_with("--out: ") && message.contains("file"), "{message}");
        Outputs::new().folder("--out", &at("new/er"), ["image.png", "cost.png"]).check().unwrap();
        assert_eq!(entries(dir.path()), before);
        assert_eq!(fs::read(at("file")).unwrap(), b"old");
    }

    #[test]
    fn files_in_a_folder_are_checked_by_their_names() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        fs::write(at("room.obj"), "v 0 0 0").unwrap();
        let outputs = Outputs::new().folder("--out", dir.path(), ["image.png", "cost.png"]);
        let outputs = outputs.input("the scene", &at("room.obj"));
        outputs.check().unwrap();
        symlink("room.obj", at("cost.png")).unwrap();
        assert!(refusal(&outputs).starts_with("--out would overwrite the scene"));
        fs::remove_file(at("cost.png")).unwrap();
        symlink("image.png", at("cost.png")).unwrap();
        assert!(refusal(&outputs).ends_with("are the same file"));
    }
}
