//! Installing Debian packages, and unpacking those of another suite without installing them.

use crate::command::{run, shown, succeeds};
use anyhow::{Context, Result, bail};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Keys that sign every suite of Debian, where the package debian-archive-keyring puts them.
const DEBIAN_KEYS: &str = "/usr/share/keyrings/debian-archive-keyring.gpg";

/// Installs those of the packages that are missing, as root or through a sudo that asks for no password.
///
/// What is installed already is not upgraded.
pub(crate) fn install<S: AsRef<str>>(packages: &[S]) -> Result<()> {
    let missing: Vec<&str> = packages.iter().map(AsRef::as_ref).filter(|package| !is_installed(package)).collect();
    if missing.is_empty() {
        return Ok(());
    }
    require_apt().with_context(|| format!("missing: {}", missing.join(", ")))?;
    let mut install = apt_get_as_root(&[&["install", "--yes", "--no-install-recommends"], &missing[..]].concat())?;
    if run(&mut install).is_ok() {
        return Ok(());
    }
    // A bare machine has no package lists; one that has been up for long has stale ones.
    run(&mut apt_get_as_root(&["update"])?)?;
    run(&mut install)
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

fn is_installed(package: &str) -> bool {
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
    fn backports_come_from_where_the_release_itself_comes_from() {
        let targets = "Vendor|bookworm|https://vendor.invalid/\n\
                       Debian|bookworm-security|https://mirror.invalid/security/\n\
                       Debian|bookworm|https://mirror.invalid/debian/\n";
        assert_eq!(debian_repository(targets, "bookworm").as_deref(), Some("https://mirror.invalid/debian/"));
        assert_eq!(debian_repository(targets, "trixie"), None);
        assert_eq!(debian_repository("", "bookworm"), None);
    }
}
