//! The task array of `--emit hq` on a HyperQueue cluster of this machine.
//!
//! Without the Python package `hyperqueue` in `.setup/python`, where `cargo xtask setup` puts it, the test is ignored
//! with the reason, unless `RT_REQUIRE` names `hyperqueue`.

use libtest_mimic::{Arguments, Completion, Failed, Trial, run};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const PROGRAM: &str = env!("CARGO_BIN_EXE_raybalance");

/// Parts of the animation, which has more frames than these.
const SHARDS: &str = "3";

fn main() {
    let trial = Trial::ignorable_test("a_task_array_renders_all_frames", || match python() {
        Some(python) => task_array_renders_all_frames(&python).map(|()| Completion::Completed),
        None => {
            let required = std::env::var("RT_REQUIRE").unwrap_or_default();
            let reason = "no Python package hyperqueue in .setup/python";
            match required.split(',').any(|name| name.trim() == "hyperqueue") {
                true => Err(format!("required by RT_REQUIRE, but missing: {reason}").into()),
                false => Ok(Completion::ignored_with(reason)),
            }
        }
    });
    run(&Arguments::from_args(), vec![trial]).exit();
}

/// A Python that has the package.
fn python() -> Option<PathBuf> {
    let python = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../.setup/python/bin/python");
    let found = Command::new(&python).args(["-c", "import hyperqueue"]).output();
    found.is_ok_and(|found| found.status.success()).then_some(python)
}

fn succeeded(command: &mut Command) -> Result<Output, Failed> {
    let run = command.output()?;
    let said = || format!("{}{}", String::from_utf8_lossy(&run.stdout), String::from_utf8_lossy(&run.stderr));
    if run.status.success() { Ok(run) } else { Err(format!("{command:?}: {}", said()).into()) }
}

/// Fails when a task does not find its number, or its words are not those of the command.
fn task_array_renders_all_frames(python: &Path) -> Result<(), Failed> {
    let dir = tempfile::tempdir()?;
    let words = "render yard --size 48x30 --spp 2 --seed 5 --devices cpu:1 --frames 0..5";
    let render = |out: &str| {
        let mut command = Command::new(PROGRAM);
        command.args(words.split(' ')).args(["--out", out]).current_dir(dir.path());
        command
    };
    succeeded(&mut render("alone"))?;
    let script = succeeded(render("together").args(["--emit", "hq", "--shards", SHARDS]))?.stdout;
    fs::write(dir.path().join("frames.sh"), script)?;
    let runner = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/task_array.py");
    succeeded(Command::new(python).arg(runner).arg(dir.path().join("frames.sh")).arg(SHARDS).arg(dir.path()))?;
    for frame in 0..5 {
        let [alone, together] =
            ["alone", "together"].map(|out| fs::read(dir.path().join(format!("{out}/image-{frame:04}.png"))));
        if alone? != together? {
            return Err(format!("another frame {frame}").into());
        }
    }
    if dir.path().join("together/contact.png").exists() { Ok(()) } else { Err("no sheet of all frames".into()) }
}
