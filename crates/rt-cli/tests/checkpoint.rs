//! Checkpoints: a process that is killed at any moment goes on where it was, to the same picture.

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::Duration;

const SIZE: u64 = 181 * 120;

const PICTURE: [&str; 12] =
    ["render", "yard", "--size", "181x120", "--spp", "3", "--bounces", "1", "--seed", "5", "--devices", "cpu:1"];

/// How often a process is killed: `RAYBALANCE_TRIALS` for more.
fn kills() -> u32 {
    std::env::var("RAYBALANCE_TRIALS").ok().and_then(|trials| trials.parse().ok()).unwrap_or(15)
}

fn render(out: &Path, checkpoint: Option<&Path>) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_raybalance"));
    command.args(PICTURE).arg("--out").arg(out).stdout(Stdio::null());
    if let Some(folder) = checkpoint {
        command.arg("--checkpoint").arg(folder);
    }
    command
}

fn length(file: &Path) -> u64 {
    fs::metadata(file).map_or(0, |about| about.len())
}

/// Waits until a file is so long, or the process has ended; whether it has.
fn wait(child: &mut Child, file: &Path, least: u64) -> bool {
    loop {
        if child.try_wait().expect("a child").is_some() {
            return true;
        }
        if length(file) >= least {
            return false;
        }
        thread::sleep(Duration::from_millis(1));
    }
}

/// Fails when a tile that was being written is taken for whole, when one in the file is rendered again, or when a
/// picture is made of a part of them.
#[test]
fn a_process_killed_at_any_moment_goes_on_where_it_was() {
    let dir = tempfile::tempdir().expect("a folder");
    let [alone, out, kept] = ["alone", "out", "kept"].map(|name| dir.path().join(name));
    assert!(render(&alone, None).status().expect("it starts").success());
    let whole = fs::read(alone.join("image.png")).expect("a picture");
    let file = kept.join("frame-0000.tiles");
    let (most, mut kills, mut pictures) = (kills(), 0, 0);
    while kills < most || pictures == 0 {
        let mut child = render(&out, Some(&kept)).spawn().expect("it starts");
        // Somewhere in the next tiles, or before the first.
        let more = u64::from(kills.wrapping_mul(2_654_435_761) >> 12) % 60_000;
        if !wait(&mut child, &file, length(&file) + more) {
            // SIGKILL, which no process hears.
            child.kill().expect("a process of ours");
            child.wait().expect("a child");
            assert!(!out.join("image.png").exists(), "a picture of a part");
            kills += 1;
            continue;
        }
        assert!(child.wait().expect("a child").success());
        assert!(fs::read(out.join("image.png")).expect("a picture") == whole, "another picture after {kills} kills");
        let report = fs::read(out.join("report.json")).expect("a report");
        let report: serde_json::Value = serde_json::from_slice(&report).expect("JSON");
        let dealt = &report["cluster"][0];
        let number = |value: &serde_json::Value| value.as_u64().expect("a number");
        assert_eq!(number(&dealt["resumed"]) + number(&dealt["ranks"][0]["tiles"]), number(&dealt["tiles"]));
        // Each tile is in the file once.
        assert_eq!(length(&file), 24 + 16 * number(&dealt["tiles"]) + 12 * SIZE);
        pictures += 1;
        fs::remove_dir_all(&out).expect("a folder of ours");
        fs::remove_dir_all(&kept).expect("a folder of ours");
    }
}

/// Fails when what is in a checkpoint is taken for tiles of another picture.
#[test]
fn a_checkpoint_of_another_picture_is_refused() {
    let dir = tempfile::tempdir().expect("a folder");
    let [out, kept] = ["out", "kept"].map(|name| dir.path().join(name));
    assert!(render(&out, Some(&kept)).status().expect("it starts").success());
    let other = render(&out, Some(&kept)).args(["--fov", "33"]).output().expect("it starts");
    let error = String::from_utf8_lossy(&other.stderr);
    assert_eq!(other.status.code(), Some(1), "{error}");
    assert!(error.contains("frame-0000.tiles") && error.contains("other options"), "{error}");
}

/// Frames of two shards that share both folders, one of which is killed in the middle of a frame and goes on.
///
/// Fails when a shard takes the tiles or the report of another, renders frames of another, or begins a frame anew.
#[test]
fn a_shard_that_is_killed_goes_on_within_its_frame() {
    let dir = tempfile::tempdir().expect("a folder");
    let [alone, out, kept] = ["alone", "out", "kept"].map(|name| dir.path().join(name));
    let frames = ["--frames", "0..3"];
    assert!(render(&alone, None).args(frames).status().expect("it starts").success());
    let shard = |number: &str| {
        let mut command = render(&out, Some(&kept));
        command.args(frames).args(["--shard", number]);
        command
    };
    let file = kept.join("frame-0000.tiles");
    let mut first = shard("1/2").spawn().expect("it starts");
    if !wait(&mut first, &file, 24 + SIZE * 4) {
        first.kill().expect("a process of ours");
    }
    first.wait().expect("a child");
    // On a busy machine it may have gone on for long until it heard of that.
    let was_within = !out.join("image-0000.json").exists();
    let found = length(&file);
    assert!(shard("2/2").status().expect("it starts").success());
    assert!(shard("1/2").status().expect("it starts").success());
    assert!(length(&file) >= found, "tiles that were there are gone");
    for frame in 0..3 {
        let [picture, tiles] = [format!("image-{frame:04}.png"), format!("frame-{frame:04}.tiles")];
        let [whole, found] = [&alone, &out].map(|folder| fs::read(folder.join(&picture)).expect("a picture"));
        assert!(whole == found, "another frame {frame}");
        assert!(length(&kept.join(tiles)) > 12 * SIZE);
    }
    assert!(out.join("contact.png").exists(), "all frames are whole");
    let report = |name: &str| -> serde_json::Value {
        serde_json::from_slice(&fs::read(out.join(name)).expect("a report")).expect("JSON")
    };
    let number = |value: &serde_json::Value| value.as_u64().expect("a number");
    assert_eq!(number(&report("report-2-of-2.json")["picture"]["frames"]), 1);
    if was_within {
        let first = report("report-1-of-2.json");
        assert_eq!(number(&first["picture"]["frames"]), 2);
        assert!(number(&first["cluster"][0]["resumed"]) > 0, "{}", first["cluster"][0]);
    }
}
