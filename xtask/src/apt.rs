//! Installing Debian packages, and unpacking those of another suite without installing them.

use crate::command::{run, say, shown, succeeds};
use anyhow::{Context, Result, bail};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Keys that sign every suite of Debian, where the package debian-archive-keyring puts them.
const DEBIAN_KEYS: &str = "/usr/share/keyrings/debian-archive-keyring.gpg";

/// Installs those of the packages that are missing, as root or through a sudo that asks for no password, and says
/// before what that is.
///
/// What is installed already is not upgraded.
pub(crate) fn install<S: AsRef<str>>(packages: &[S]) -> Result<()> {
    let missing: Vec<&str> = packages.iter().map(AsRef::as_ref).filter(|package| !is_installed(package)).collect();
    if missing.is_empty() {
        return Ok(());
    }
    require_apt().with_context(|| format!("missing: {}", missing.join(", ")))?;
    let mut install = apt_get_as_root(&[&["install", "--yes", "--no-install-recommends"], &missing[..]].concat())?;
    if let Some(size) = size_of(&missing)? {
        announce(&missing, &size);
        if run(&mut install).is_ok() {
            return Ok(());
        }
    }
    // A bare machine has no package lists; one that has been up for long has stale ones.
    run(&mut apt_get_as_root(&["update"])?)?;
    let size = size_of(&missing)?.with_context(|| format!("apt knows no way to install {}", missing.join(", ")))?;
    announce(&missing, &size);
    run(&mut install)
}

/// What an installation takes, in apt's own words.
#[derive(Debug, PartialEq, Eq)]
struct Size {
    /// Packages, with those that the named ones need.
    packages: u32,
    /// Such as `80.7 MB`.
    download: String,
    /// Such as `312 MB`.
    disk: String,
}

fn announce(packages: &[&str], Size { packages: all, download, disk }: &Size) {
    let named = packages.join(", ");
    say(format_args!("setup: apt installs {named} (packages in all: {all}): {download} to download, {disk} on disk"));
}

/// Asks apt, which changes nothing; `None` where it knows no way to install them.
fn size_of(packages: &[&str]) -> Result<Option<Size>> {
    let mut question = Command::new("apt-get");
    // Neither does it need root then, nor does it wait for another apt.
    question.args(["install", "--assume-no", "--no-install-recommends", "--option", "Debug::NoLocking=true"]);
    question.args(packages).env("LC_ALL", "C").stdin(Stdio::null());
    // Its exit code says that the answer was no.
    let output = question.output().context("cannot start apt-get")?;
    Ok(size(&String::from_utf8_lossy(&output.stdout)))
}

fn size(answer: &str) -> Option<Size> {
    let between = |start: &str, end: &str| {
        let mut found = answer.lines().filter_map(|line| line.trim().strip_prefix(start)?.split_once(end));
        found.next().map(|(words, _)| words.to_owned())
    };
    let counted =
        answer.lines().find_map(|line| line.split_once(" newly installed")?.0.rsplit(' ').next()?.parse().ok());
    Some(Size {
        packages: counted?,
        // With `A/B` A are missing, the others are in apt's cache.
        download: between("Need to get ", " of archives").unwrap_or_else(|| "nothing".to_owned()),
        disk: between("After this operation, ", " of additional disk space").unwrap_or_else(|| "nothing".to_owned()),
    })
}

/// Downloads the package's version of this Debian release's backports into `folder`, which is for this alone.
///
/// Sources, lists and caches lie in that folder too: those of the machine stay as they are, and no root is needed.
pub(crate) fn download_backport(package: &str, folder: &Path) -> Result<PathBuf> {
    require_apt()?;
    let release = release()?;
    let suite = format!("{release}-backports");
    let (sources, lists, cache) = (folder.join("sources"), folder.join("lists"), folder.join("cache"));
    for folder in [&sources, &lists.join("partial"), &cache.join("archives/partial")] {
        fs::create_dir_all(folder).with_context(|| format!("cannot create `{}`", folder.display()))?;
    }
    let keys = if Path::new(DEBIAN_KEYS).exists() { format!("[signed-by={DEBIAN_KEYS}] ") } else { String::new() };
    let source = format!("deb {keys}{} {suite} main\n", repository(&release)?);
    fs::write(sources.join("backports.list"), source).context("cannot write the source of backports")?;

    let private = |arguments: &[&str]| {
        let mut command = Command::new("apt-get");
        for (option, path) in [
            ("Dir::Etc::SourceList", Path::new("/dev/null")),
            ("Dir::Etc::SourceParts", &sources),
            ("Dir::State::Lists", &lists),
            ("Dir::Cache", &cache),
        ] {
            command.arg("-o").arg(format!("{option}={}", path.display()));
        }
        command.args(arguments).current_dir(folder).stdin(Stdio::null());
        command
    };
    run(&mut private(&["update"]))?;
    run(&mut private(&["download", &format!("{package}/{suite}")]))?;
    let files = fs::read_dir(folder).with_context(|| format!("cannot list `{}`", folder.display()))?;
    let mut files = files.filter_map(|entry| entry.ok().map(|entry| entry.path()));
    let archive = files.find(|path| path.extension().is_some_and(|extension| extension == "deb"));
    archive.with_context(|| format!("apt-get left no package in `{}`", folder.display()))
}

/// Unpacks a package's files below `folder`, without installing it.
pub(crate) fn unpack(archive: &Path, folder: &Path) -> Result<()> {
    run(Command::new("dpkg-deb").arg("--extract").args([archive, folder]))
}

/// The packages that a package file depends on: of alternatives the first, and any version.
pub(crate) fn dependencies(archive: &Path) -> Result<Vec<String>> {
    let mut query = Command::new("dpkg-deb");
    query.arg("--field").arg(archive).arg("Depends");
    let output = query.output().context("cannot start dpkg-deb")?;
    if !output.status.success() {
        bail!("`{}` failed ({})", shown(&query), output.status);
    }
    Ok(dependency_names(&String::from_utf8_lossy(&output.stdout)))
}

fn dependency_names(field: &str) -> Vec<String> {
    let first_word = |entry: &str| entry.split_whitespace().next().map(str::to_owned);
    field.split(',').filter_map(first_word).collect()
}

/// Whether a package of this name is installed.
pub(crate) fn is_installed(package: &str) -> bool {
    let mut query = Command::new("dpkg-query");
    query.args(["--show", "--showformat=${db:Status-Status}\\n", package]);
    // One line for each architecture.
    query.output().is_ok_and(|output| output.stdout.split(|&byte| byte == b'\n').any(|status| status == b"installed"))
}

/// Code name of this machine's Debian release, such as bookworm.
fn release() -> Result<String> {
    let text = fs::read_to_string("/etc/os-release").context("cannot read /etc/os-release")?;
    let mut names = text.lines().filter_map(|line| line.strip_prefix("VERSION_CODENAME="));
    let name = names.next().map(|name| name.trim_matches('"').to_owned());
    name.context("/etc/os-release names no VERSION_CODENAME")
}

/// Address of the repository that this machine takes Debian's own packages from.
fn repository(release: &str) -> Result<String> {
    let configured = || {
        let mut list = Command::new("apt-get");
        list.args(["indextargets", "--format", "$(ORIGIN)|$(CODENAME)|$(REPO_URI)", "Created-By: Packages"]);
        let output = list.output().context("cannot start apt-get")?;
        anyhow::Ok(debian_repository(&String::from_utf8_lossy(&output.stdout), release))
    };
    if let Some(address) = configured()? {
        return Ok(address);
    }
    // apt knows a repository's origin only from its package lists.
    run(&mut apt_get_as_root(&["update"])?)?;
    let address = configured()?;
    address
        .with_context(|| format!("apt has no source of Debian's release `{release}`: other systems are not supported"))
}

fn debian_repository(targets: &str, release: &str) -> Option<String> {
    let mut targets = targets.lines().map(|line| line.splitn(3, '|').collect::<Vec<_>>());
    targets.find_map(|target| match target[..] {
        ["Debian", codename, address] if codename == release => Some(address.to_owned()),
        _ => None,
    })
}

fn require_apt() -> Result<()> {
    if !succeeds(Command::new("apt-get").arg("--version")) {
        bail!("this machine has no apt-get: install what is missing with the system's package manager");
    }
    Ok(())
}

fn apt_get_as_root(arguments: &[&str]) -> Result<Command> {
    let mut command = if is_root() {
        Command::new("apt-get")
    } else if succeeds(Command::new("sudo").args(["--non-interactive", "true"])) {
        let mut sudo = Command::new("sudo");
        sudo.args(["--non-interactive", "apt-get"]);
        sudo
    } else {
        let mut needed = Command::new("apt-get");
        needed.args(arguments);
        bail!("neither root nor sudo without a password: run `{}` as root, then try again", shown(&needed));
    };
    command.args(arguments).env("DEBIAN_FRONTEND", "noninteractive").stdin(Stdio::null());
    Ok(command)
}

fn is_root() -> bool {
    Command::new("id").arg("-u").output().is_ok_and(|output| output.stdout.trim_ascii() == b"0")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dependencies_lose_versions_and_all_alternatives_but_the_first() {
        assert_eq!(dependency_names("libc6 (>= 2.34), libllvm15\n"), ["libc6", "libllvm15"]);
        assert_eq!(dependency_names("a | b (>= 1), c:any"), ["a", "c:any"]);
        assert!(dependency_names("\n").is_empty());
    }

    #[test]
    fn sizes_are_those_that_apt_says() {
        let answer = "The following NEW packages will be installed:\n  chromium libvpx7\n\
                      0 upgraded, 2 newly installed, 0 to remove and 137 not upgraded.\nNeed to get 80.7 MB of archives.\n\
                      After this operation, 312 MB of additional disk space will be used.\n\
                      Do you want to continue? [Y/n] N\nAbort.\n";
        let said = |download: &str, disk: &str| Size { packages: 2, download: download.into(), disk: disk.into() };
        assert_eq!(size(answer), Some(said("80.7 MB", "312 MB")));
        assert_eq!(size(&answer.replace("80.7 MB", "0 B/80.7 MB")), Some(said("0 B/80.7 MB", "312 MB")));
        assert_eq!(size("0 upgraded, 2 newly installed, 0 to remove\n"), Some(said("nothing", "nothing")));
        assert_eq!(size("Reading package lists...\n"), None);
    }

    #[test]
    fn backports_come_from_where_the_release_itself_comes_from() {
        let targets = "Vendor|bookworm|https://vendor.invalid/\n\
                       Debian|bookworm-security|https://mirror.invalid/security/\n\
                       Debian|bookworm|https://mirror.invalid/debian/\n";
        assert_eq!(debian_repository(targets, "bookworm").as_deref(), Some("https://mirror.invalid/debian/"));
        assert_eq!(debian_repository(targets, "trixie"), None);
        assert_eq!(debian_repository("", "bookworm"), None);
    }
}
