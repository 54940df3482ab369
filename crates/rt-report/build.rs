//! Finds the commit that is built, for what results say of their origin.

use std::env;
use std::process::Command;

fn main() {
    let commit = commit().unwrap_or_else(|| "unknown".to_owned());
    println!("cargo::rustc-env=RAYBALANCE_COMMIT={commit}");
    // Asked again after each commit; and in release builds, whose figures count, after each change of a source.
    let mut watched = ["HEAD", "logs/HEAD"].map(|file| git(&["rev-parse", "--git-path", file])).to_vec();
    watched.push(Some("build.rs".to_owned()));
    if env::var("PROFILE").is_ok_and(|profile| profile == "release") {
        watched
            .extend(["..", "../../benches", "../../tests/src", "../../Cargo.lock"].map(|path| Some(path.to_owned())));
    }
    for path in watched.into_iter().flatten() {
        println!("cargo::rerun-if-changed={path}");
    }
}

/// What the working tree was made from, and whether it differs from that.
fn commit() -> Option<String> {
    // A package of somebody's, unpacked below a repository of their own, is none of its files.
    git(&["ls-files", "--error-unmatch", "Cargo.toml"])?;
    let commit = git(&["rev-parse", "--short=12", "HEAD"])?;
    let changed = !git(&["status", "--porcelain", "--untracked-files=no"])?.is_empty();
    Some(if changed { format!("{commit}+changes") } else { commit })
}

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}
