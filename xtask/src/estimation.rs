//! `cargo xtask estimation`: the measurements behind docs/results/estimation.md, one program after the other.

use crate::command::{cargo, root, run, say, shown};
use crate::setup::setup;
use anyhow::{Context, Result, bail};
use real_scenes::{Folders, RealScene, VARIABLE};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Where everything is written.
const OUT: &str = "out/estimation";

/// Scenes whose makespans are measured on real devices: five minutes each.
const BALANCED: [&str; 1] = ["yard"];

/// How much is measured.
struct Extent {
    /// Options of the program `estimation`.
    errors: &'static [&'static str],
    /// Options of `raybalance compare`.
    makespans: &'static [&'static str],
    /// Options of `raybalance figure1`.
    figure: &'static [&'static str],
}

const FULL: Extent = Extent {
    errors: &["--task-sizes", "1024", "--repeat", "4", "--passes", "4"],
    makespans: &["--tasks", "1024", "--repeat", "6", "--size", "1200x750", "--spp", "8"],
    figure: &["--repeat", "6"],
};

/// A look at the form in less than three minutes.
const QUICK: Extent = Extent {
    errors: &["--task-sizes", "1024", "--size", "160x160", "--repeat", "1", "--passes", "2"],
    makespans: &["--tasks", "64", "--repeat", "1", "--quick"],
    figure: &["--quick"],
};

/// Builds the programs, runs them, and writes their tables into one file.
pub(crate) fn estimation(quick: bool) -> Result<()> {
    let extent = if quick { QUICK } else { FULL };
    let scenes = scenes(setup()?.scenes.as_ref())?;
    run(&mut cargo("build --release -p rt-cli -p rt-lab --bins"))?;
    let out = root().join(OUT);
    fs::create_dir_all(&out).with_context(|| format!("cannot create `{}`", out.display()))?;
    let mut tables = format!("`cargo xtask estimation{}`\n", if quick { " --quick" } else { "" });

    tables.push_str("\n## Errors and overhead\n\n");
    // Relative, since the tables repeat the command and programs run in the root.
    let file = |name: &str| Path::new(OUT).join(name);
    let mut errors = program("estimation");
    errors.args(&scenes).args(extent.errors).args(["--published", "--json"]).arg(file("errors.json"));
    let full = output(errors.arg("--summary").arg(file("errors.md")))?;
    tables.push_str(&read(&file("errors.md"))?);

    tables.push_str("\n## Makespans\n\n");
    for scene in BALANCED {
        let Some(path) = scenes.iter().find(|path| path.file_stem().is_some_and(|stem| stem == scene)) else {
            continue;
        };
        let folder = file(&format!("compare-{scene}"));
        let mut compare = program("raybalance");
        compare.arg("compare").arg(path).args(["--devices", "cpu:1,cpu:1", "--reference", "--out"]).arg(&folder);
        run(compare.args(extent.makespans))?;
        tables.push_str(&read(&folder.join("compare.md"))?);
    }
    run(program("raybalance").arg("figure1").args(extent.figure).arg("--out").arg(Path::new(OUT).join("figure1")))?;
    tables.push_str("\n## Every scene\n\n");
    tables.push_str(&full);
    let file = out.join("tables.md");
    fs::write(&file, tables).with_context(|| format!("cannot write `{}`", file.display()))?;
    say(format_args!("\ntables in {OUT}/tables.md, raw numbers in errors.json, the figure in figure1"));
    Ok(())
}

/// The built-in scenes, and those of the folder, in order of their names.
fn scenes(folders: Option<&Folders>) -> Result<Vec<PathBuf>> {
    let mut found = vec![PathBuf::from("yard"), PathBuf::from("car")];
    let Some(folders) = folders else {
        say(format_args!("{VARIABLE} is not set: built-in scenes only"));
        return Ok(found);
    };
    // Programs run in the root; tables need not say where that is.
    let relative =
        |scene: RealScene| scene.path.strip_prefix(root()).map_or_else(|_| scene.path.clone(), Path::to_owned);
    found.extend(folders.scenes()?.into_iter().map(relative));
    Ok(found)
}

/// A text below the root.
fn read(file: &Path) -> Result<String> {
    fs::read_to_string(root().join(file)).with_context(|| format!("cannot read `{}`", file.display()))
}

/// A program that was built for release.
fn program(name: &str) -> Command {
    let folder = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from);
    let mut command = Command::new(folder.join("release").join(name));
    command.current_dir(root());
    command
}

/// What a program prints; its progress goes to the terminal.
fn output(command: &mut Command) -> Result<String> {
    let line = shown(command);
    say(format_args!("$ {line}"));
    let result = command.stderr(Stdio::inherit()).output().with_context(|| format!("cannot start `{line}`"))?;
    if !result.status.success() {
        bail!("`{line}` failed ({})", result.status);
    }
    Ok(String::from_utf8_lossy(&result.stdout).into_owned())
}
