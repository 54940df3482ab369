//! `raybalance tradeoff` where devices differ in what they can do: graphics cards have two layouts, one kernel and
//! fewer walks.

use super::Outcome;
use libtest_mimic::Failed;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// A cube, every side of two triangles: less than that has no shadows and nothing to bounce off.
const CUBE: &str = "\
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8
";

/// What every command here measures, short of the trade's name.
const SMALL: [&str; 7] = ["cube.obj", "--quick", "--size", "32x24", "--repeat", "2", "--devices"];

/// Runs a trade of the cube on a device, in a folder of its own.
fn trade(folder: &Path, name: &str, device: &str) -> Result<Output, Failed> {
    fs::write(folder.join("cube.obj"), CUBE)?;
    let mut raybalance = Command::new(env!("CARGO_BIN_EXE_raybalance"));
    raybalance.current_dir(folder).args(["tradeoff", name]).args(SMALL).args([device, "--out", "out"]);
    Ok(raybalance.output()?)
}

fn succeeds(output: &Output) -> Result<String, Failed> {
    if !output.status.success() {
        return Err(format!("it failed: {}", String::from_utf8_lossy(&output.stderr)).into());
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

fn contains(text: &str, part: &str) -> Outcome {
    if text.contains(part) { Ok(()) } else { Err(format!("`{part}` is missing in:\n{text}").into()) }
}

pub(crate) fn layout_says_what_to_do() -> Outcome {
    let folder = tempfile::tempdir()?;
    let output = trade(folder.path(), "layout", "cpu:1")?;
    let said = String::from_utf8_lossy(&output.stderr);
    contains(&said, "cpu:1 walks the two-wide tree alone: name a graphics card")?;
    if output.status.code() == Some(2) && !folder.path().join("out").exists() {
        return Ok(());
    }
    Err("it must fail and write nothing".into())
}

/// Fails when both rows of a pair describe one layout, when rounds are dropped, or when hits differ.
pub(crate) fn layout_is_measured() -> Outcome {
    let folder = tempfile::tempdir()?;
    let said = succeeds(&trade(folder.path(), "layout", "vulkan:0")?)?;
    contains(&said, "eight-wide")?;
    let out = folder.path().join("out");
    for file in ["layout.md", "layout-cube.svg", "report.html"] {
        let size = fs::metadata(out.join(file)).map_err(|error| format!("{file}: {error}"))?.len();
        if size == 0 {
            return Err(format!("{file} is empty").into());
        }
    }
    let csv = fs::read_to_string(out.join("layout.csv"))?;
    // Four kinds of rays, two layouts, two rounds.
    let lines = csv.lines().filter(|line| line.starts_with("\"cube\"")).count();
    let json: serde_json::Value = serde_json::from_slice(&fs::read(out.join("layout.json"))?)?;
    let rows = json["results"][0]["rows"].as_array().ok_or("layout.json has no rows")?;
    if (lines, rows.len()) != (16, 8) {
        return Err(format!("{lines} lines and {} rows:\n{csv}", rows.len()).into());
    }
    for pair in rows.chunks(2) {
        let [two, wide] = pair else { return Err("a layout without the other".into()) };
        let differ = |field: &str| two[field] != wide[field];
        // Tests of so small a scene may be as many over both.
        if !differ("layout") || !differ("bytes_per_triangle") || !differ("held_bytes_per_triangle") {
            return Err(format!("one layout twice: {two} {wide}").into());
        }
        let ratio = wide["over_two"]["median"].as_f64().unwrap_or(f64::NAN);
        if wide["differing"] != 0 || !(ratio > 0.0 && ratio.is_finite()) {
            return Err(format!("hits differ, or speeds were not compared: {wide}").into());
        }
    }
    Ok(())
}

/// Fails when a card has not every reduced walk, or one of them vanishes without a word.
pub(crate) fn sampling_has_every_walk() -> Outcome {
    let folder = tempfile::tempdir()?;
    let said = succeeds(&trade(folder.path(), "sampling", "vulkan:0")?)?;
    let csv = fs::read_to_string(folder.path().join("out/sampling.csv"))?;
    contains(&csv, "\"reduced\"")?;
    contains(&csv, "\"reduced-unshortened\"")?;
    if said.contains("no kernel") { Err(format!("a walk was left out: {said}").into()) } else { Ok(()) }
}

/// Fails when a card's rows claim a kernel that it does not have.
pub(crate) fn precision_says_so() -> Outcome {
    let folder = tempfile::tempdir()?;
    let said = succeeds(&trade(folder.path(), "precision", "vulkan:0")?)?;
    contains(&said, "vulkan:0: graphics cards have one kernel, that of robust.")?;
    let json: serde_json::Value = serde_json::from_slice(&fs::read(folder.path().join("out/precision.json"))?)?;
    let rows = json["rows"].as_array().ok_or("precision.json has no rows")?;
    if rows.len() == 15 && rows.iter().all(|row| row["kernel"] == "robust") {
        return Ok(());
    }
    Err(format!("{} rows: {json}", rows.len()).into())
}
