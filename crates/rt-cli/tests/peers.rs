//! Embree and obvhs as devices of the command.
//!
//! Without Embree's library what needs it is ignored with the reason, unless `RT_REQUIRE` names `embree`.

use libtest_mimic::{Arguments, Completion, Failed, Trial, run};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};
use tempfile::TempDir;

/// The variable that names Embree's library, and a file that is none.
const NO_LIBRARY: (&str, &str) = ("RAYBALANCE_EMBREE", "/no/such/library.so");

/// Options that make a picture in an instant.
const SMALL: &str = "--size 64x40 --spp 1 --out out";

fn main() {
    let on_obvhs = |name, test: fn(&str) -> Result<(), Failed>| Trial::test(name, move || test("obvhs"));
    let on_embree = |name, test: fn(&str) -> Result<(), Failed>| Trial::ignorable_test(name, move || with_embree(test));
    let trials = vec![
        Trial::test("a_missing_library_is_told_with_where_it_was_looked_for", a_missing_library_is_told),
        Trial::test("what_cannot_be_is_wrong_usage", what_cannot_be_is_wrong_usage),
        on_obvhs("obvhs_is_measured_beside_ours", is_measured),
        on_embree("embree_is_measured_beside_ours", is_measured),
        on_obvhs("obvhs_renders_alone_and_with_ours", renders),
        on_embree("embree_renders_alone_and_with_ours", renders),
        on_obvhs("obvhs_counts_nothing", counts_nothing),
        on_embree("embree_counts_nothing", counts_nothing),
        on_embree("embree_is_verified", is_verified),
    ];
    run(&Arguments::from_args(), trials).exit();
}

fn ensure(holds: bool, message: impl Into<String>) -> Result<(), Failed> {
    if holds { Ok(()) } else { Err(message.into().into()) }
}

/// Runs a test with Embree, or says why it cannot be run.
fn with_embree(test: fn(&str) -> Result<(), Failed>) -> Result<Completion, Failed> {
    let listed = raybalance(Path::new("."), "devices").output()?;
    let text = String::from_utf8_lossy(&listed.stdout).into_owned();
    if text.contains("embree:1") {
        return test("embree").map(|()| Completion::Completed);
    }
    let required = std::env::var("RT_REQUIRE").unwrap_or_default();
    match required.split(',').any(|name| name.trim() == "embree") {
        true => Err(format!("required by RT_REQUIRE, but missing: {text}").into()),
        false => Ok(Completion::ignored_with("no Embree 4: `raybalance devices` says where it was looked for")),
    }
}

fn raybalance(folder: &Path, words: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_raybalance"));
    command.current_dir(folder).args(words.split_whitespace());
    command
}

/// What a command says that ends with such a code.
fn said(code: i32, words: &str, output: &Output) -> Result<String, Failed> {
    let text = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned()).concat();
    ensure(output.status.code() == Some(code), format!("{words}: {:?}: {text}", output.status))?;
    Ok(text)
}

/// Fails when the reason is lost on its way, or one peer's is another's.
fn a_missing_library_is_told() -> Result<(), Failed> {
    let folder = TempDir::new()?;
    for (words, code) in [("devices", 0), ("bench yard --quick --devices cpu:1,embree:2", 1)] {
        let output = raybalance(folder.path(), words).env(NO_LIBRARY.0, NO_LIBRARY.1).output()?;
        let text = said(code, words, &output)?;
        let tells = text.contains(NO_LIBRARY.1) && text.contains("RAYBALANCE_EMBREE");
        ensure(tells && text.matches(NO_LIBRARY.1).count() == 1, format!("{words}: {text}"))?;
        ensure(code == 1 || text.contains("obvhs:1"), text)?;
    }
    Ok(())
}

/// Fails when an option is said to be about peers, or a trade is measured that a peer has no part in.
fn what_cannot_be_is_wrong_usage() -> Result<(), Failed> {
    let folder = TempDir::new()?;
    for (words, part) in [
        ("bench yard --devices embree:0", "thread count"),
        ("bench yard --devices embree:x", "thread count"),
        ("bench yard --devices embre:1", "embree:THREADS"),
        ("bench yard --devices obvhs:1@2", "speed"),
        ("bench yard --devices embree:1 --isa avx2", "--isa"),
        ("render yard --devices obvhs:1 --layout wide", "--layout"),
        ("tradeoff yard --quick --devices cpu:1,obvhs:1", "peers"),
        ("tradeoff precision yard --quick --devices embree", "peers"),
    ] {
        let text = said(2, words, &raybalance(folder.path(), words).output()?)?;
        ensure(text.contains(part), format!("`{part}` is to be in {words}: {text}"))?;
    }
    Ok(())
}

/// Fails when a walk is asked for that peers do not have, or one is said to have our tree.
fn is_measured(peer: &str) -> Result<(), Failed> {
    let folder = TempDir::new()?;
    let words = format!("bench yard --rays 4096 --repeat 1 --devices cpu:1,{peer}:2 --json");
    let text = said(0, &words, &raybalance(folder.path(), &words).output()?)?;
    let report: Value = serde_json::from_str(&text)?;
    let devices = report["results"].as_array().ok_or("no results")?;
    ensure(devices.len() == 2, text.clone())?;
    for (device, is_peer) in devices.iter().zip([false, true]) {
        ensure(device["device"]["own_tree"] == is_peer, device.to_string())?;
        let kinds = device["rays"].as_array().ok_or("no rays")?;
        ensure(kinds.len() == 4, device.to_string())?;
        for kind in kinds {
            let walks = kind["walks_mray_s"].as_object().map_or(0, serde_json::Map::len);
            let speed = kind["full_mray_s"]["median"].as_f64().unwrap_or(0.0);
            ensure(walks == if is_peer { 0 } else { 3 } && speed > 0.0, kind.to_string())?;
        }
    }
    let words = format!("bench yard --rays 4096 --repeat 1 --devices {peer}:1");
    let text = said(0, &words, &raybalance(folder.path(), &words).output()?)?;
    ensure(text.contains("own tree") && !text.contains("precision"), text)
}

/// Fails when hits are not believed, or devices that count nothing stop an estimate.
fn renders(peer: &str) -> Result<(), Failed> {
    let folder = TempDir::new()?;
    for devices in [format!("{peer}:1"), format!("{peer}:2,cpu:1"), format!("{peer}:1@0.5,{peer}:1")] {
        let words = format!("render yard --devices {devices} {SMALL}");
        said(0, &words, &raybalance(folder.path(), &words).output()?)?;
        let report = std::fs::read(folder.path().join("out/report.json"))?;
        let report: Value = serde_json::from_slice(&report)?;
        for stream in report["streams"].as_array().ok_or("no streams")? {
            for device in stream["devices"].as_array().ok_or("no devices")? {
                ensure(device["error"].is_null(), format!("{devices}: {device}"))?;
            }
        }
    }
    Ok(())
}

/// Fails when somebody asks a peer for samples or counts, or does not say why there are none.
fn counts_nothing(peer: &str) -> Result<(), Failed> {
    let folder = TempDir::new()?;
    let ray: Vec<u8> = [0.0_f32, 5.0, 0.0, 0.0, 0.0, -1.0, 0.0, 99.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    let mut file = b"\x93NUMPY\x01\x00\x3e\x00{'descr': '<f4', 'fortran_order': False, 'shape': (1, 8), }".to_vec();
    file.resize(71, b' ');
    file.push(b'\n');
    file.extend(ray);
    std::fs::write(folder.path().join("rays.npy"), file)?;
    for (words, code, part) in [
        ("trace car --rays rays.npy --hits hits.npy", 0, "1 of 1 rays hit"),
        ("trace car --rays rays.npy --hits hits.npy --counts counts.npy", 1, "count"),
        ("render yard --estimator exact --size 64x40 --spp 1 --out out", 1, "choose another estimator"),
        ("compare yard --quick --size 32x20 --repeat 1 --out out", 0, "left out, since no device counts"),
    ] {
        let words = format!("{words} --devices {peer}:1");
        let text = said(code, &words, &raybalance(folder.path(), &words).output()?)?;
        ensure(text.contains(part), format!("`{part}` is to be in {words}: {text}"))?;
    }
    let words = format!("compare yard --quick --size 32x20 --repeat 1 --out out --devices {peer}:1,cpu:1");
    let text = said(0, &words, &raybalance(folder.path(), &words).output()?)?;
    ensure(!text.contains("left out") && text.contains("reduced"), text)
}

/// A peer promises less than we do, and is not asked for our trees.
fn is_verified(peer: &str) -> Result<(), Failed> {
    let folder = TempDir::new()?;
    let words = format!("verify yard --case self-hits,containment --rays 2000 --devices {peer}:1");
    let text = said(0, &words, &raybalance(folder.path(), &words).output()?)?;
    ensure(text.contains("skipped"), text)
}
