//! `cargo xtask fuzz`: libFuzzer on every target in `fuzz/`.

use crate::command::{cargo, complain, root, run, succeeds};
use crate::files::entries;
use crate::nightly;
use anyhow::{Context, Result, bail};

/// Where the programs are.
const PROGRAMS: &str = "fuzz/fuzz_targets";

/// Longest input in bytes: enough for some hundred triangles and rays.
const LONGEST: u32 = 8192;

/// Memory in MiB above which an input counts as a defect: the machines that run this have a few GiB.
const MEMORY: u32 = 2048;

/// Fuzzes each target for an equal share of `minutes`, starting from the corpus.
///
/// What is found goes to `fuzz/target/corpus`, what breaks something to `fuzz/artifacts`: then move it to
/// `fuzz/corpus`, where the tests replay it, and mend the code.
pub(crate) fn fuzz(minutes: u32) -> Result<()> {
    if !succeeds(nightly::cargo("fuzz").arg("--version")) {
        nightly::require("libFuzzer's instrumentation")?;
        run(cargo("install cargo-fuzz --locked --root").arg(root().join(nightly::TOOLS)))
            .context("installing cargo-fuzz")?;
    }
    let targets = targets()?;
    let seconds = (minutes * 60 / targets.len().max(1) as u32).max(1);
    let mut broken = Vec::new();
    for target in targets {
        let found = root().join("fuzz/target/corpus").join(&target);
        std::fs::create_dir_all(&found).with_context(|| format!("cannot make {}", found.display()))?;
        let mut command = nightly::cargo("fuzz run");
        command.arg(&target).arg(found).arg(root().join("fuzz/corpus").join(&target));
        command.arg("--").arg(format!("-max_total_time={seconds}"));
        command.args([format!("-max_len={LONGEST}"), format!("-rss_limit_mb={MEMORY}"), "-timeout=20".to_owned()]);
        if let Err(error) = run(&mut command) {
            complain(&error);
            broken.push(target);
        }
    }
    if broken.is_empty() {
        return Ok(());
    }
    bail!("{} broke: the inputs are in fuzz/artifacts; move them to fuzz/corpus/TARGET and mend", broken.join(", "))
}

/// Their names, in order.
fn targets() -> Result<Vec<String>> {
    let files = entries(&root().join(PROGRAMS))?;
    Ok(files.iter().filter_map(|file| file.file_stem()).map(|name| name.to_string_lossy().into_owned()).collect())
}
