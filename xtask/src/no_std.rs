//! `cargo xtask no-std`: the proof that rt-core, rt-bvh and rt-sched need no std.

use crate::command::{cargo, run, say, shown};
use anyhow::{Context, Result, bail};

const MANIFEST: &str = "--manifest-path tools/no-std/Cargo.toml";

/// What the compiler says when std comes in beside the proof's own panic handler: "found duplicate lang item".
const DUPLICATE_LANG_ITEM: &str = "error[E0152]";

/// Whether the proof can be linked here: its entry point is written for this one system.
pub(crate) const SUPPORTED: bool = cfg!(all(target_os = "linux", target_arch = "x86_64"));

/// Builds and runs the program without std, then checks that it would have noticed std.
pub(crate) fn prove() -> Result<()> {
    if !SUPPORTED {
        bail!("the program in tools/no-std is written for Linux on x86-64");
    }
    run(&mut cargo(&format!("fmt {MANIFEST} --check")))?;
    run(&mut cargo(&format!("clippy --release {MANIFEST} -- -D warnings")))?;
    run(&mut cargo(&format!("build --release {MANIFEST}")))?;
    run(&mut cargo(&format!("run --quiet --release {MANIFEST}")))
        .context("tools/no-std gave a wrong answer: its exit code is the number of the failed check, 101 a panic")?;
    negative_control()
}

/// With obvhs, which uses std, the same program must not compile; otherwise the proof proves nothing.
fn negative_control() -> Result<()> {
    let mut check = cargo(&format!("check --color never --features obvhs {MANIFEST}"));
    say(format_args!("$ {} (must fail with E0152)", shown(&check)));
    let output = check.output().context("cannot start cargo")?;
    let messages = String::from_utf8_lossy(&output.stderr);
    if output.status.success() {
        bail!("the negative control compiled: tools/no-std no longer notices std");
    }
    if !messages.contains(DUPLICATE_LANG_ITEM) {
        bail!("the negative control failed for another reason than {DUPLICATE_LANG_ITEM}:\n{messages}");
    }
    Ok(())
}
