//! Animations: camera paths, parts of the frames, and processes that are killed and go on.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::Duration;

const PROGRAM: &str = env!("CARGO_BIN_EXE_raybalance");

/// Small frames of which every pixel depends on all random numbers.
const FRAMES: [&str; 14] = [
    "render",
    "yard",
    "--size",
    "64x40",
    "--spp",
    "3",
    "--bounces",
    "1",
    "--seed",
    "5",
    "--devices",
    "cpu:1",
    "--frames",
    "0..6",
];

/// How often a process is killed.
const KILLS: u32 = 12;

fn render(out: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(PROGRAM);
    command.args(FRAMES).args(more).arg("--out").arg(out).stdout(Stdio::null());
    command
}

fn succeeded(command: &mut Command) -> Output {
    let run = command.output().expect("it starts");
    assert!(run.status.success(), "{command:?}: {}", String::from_utf8_lossy(&run.stderr));
    run
}

/// What a command says on standard error.
fn told(command: &mut Command) -> String {
    String::from_utf8_lossy(&succeeded(command).stderr).into_owned()
}

/// The pictures in a folder.
fn pictures(out: &Path) -> BTreeMap<String, Vec<u8>> {
    let names = fs::read_dir(out).into_iter().flatten().map(|entry| entry.expect("an entry").file_name());
    let names = names.map(|name| name.into_string().expect("text")).filter(|name| name.ends_with(".png"));
    names.filter(|name| name != "cost.png").map(|name| (name.clone(), fs::read(out.join(name)).expect("it"))).collect()
}

/// When the report of a frame was written.
fn written(out: &Path, frame: u32) -> Option<std::time::SystemTime> {
    fs::metadata(out.join(format!("image-{frame:04}.json"))).and_then(|about| about.modified()).ok()
}

/// Mutants: a picture of a part of its samples under a frame's name with a report of this run; frames that are whole
/// rendered again, or taken for whole by their names; an exposure of the first frame that a process renders.
#[test]
fn a_process_killed_at_any_moment_goes_on_to_the_same_frames() {
    let dir = tempfile::tempdir().expect("a folder");
    let [alone, out] = ["alone", "out"].map(|name| dir.path().join(name));
    succeeded(&mut render(&alone, &[]));
    let whole = pictures(&alone);
    assert_eq!(whole.len(), 7, "six frames and the sheet: {:?}", whole.keys());
    let (mut kills, mut ends) = (0, 0_u32);
    while kills < KILLS || ends == 0 {
        let before: Vec<_> = (0..6).map(|frame| written(&out, frame)).collect();
        let mut child = render(&out, &[]).stderr(Stdio::null()).spawn().expect("it starts");
        // Some frames further, and somewhere in one.
        let frames = before.iter().flatten().count() + (kills as usize % 3);
        let pause = Duration::from_micros(u64::from(kills.wrapping_mul(2_654_435_761) >> 12) % 60_000);
        let is_over = loop {
            if child.try_wait().expect("a child").is_some() {
                break true;
            }
            if (0..6).filter(|&frame| written(&out, frame).is_some()).count() >= frames {
                thread::sleep(pause);
                break child.try_wait().expect("a child").is_some();
            }
            thread::sleep(Duration::from_millis(1));
        };
        // SIGKILL, which no process hears.
        let _ = child.kill();
        let status = child.wait().expect("a child");
        for frame in 0..6 {
            let name = format!("image-{frame:04}.png");
            let was_whole = before[frame as usize];
            assert!(was_whole.is_none() || written(&out, frame) == was_whole, "frame {frame} was rendered again");
            let picture = fs::read(out.join(&name)).ok();
            assert!(picture.is_none() || picture.as_ref() == whole.get(&name), "frame {frame} in part");
        }
        if is_over {
            assert!(status.success());
            assert!(pictures(&out) == whole, "other frames after {kills} kills");
            assert!(told(&mut render(&out, &[])).contains("6 of 6 frames are whole"));
            fs::remove_dir_all(&out).expect("a folder of ours");
            ends += 1;
        } else {
            kills += 1;
        }
    }
}

/// Fails when frames depend on which others a process renders, or what is of another run is taken for whole.
#[test]
fn shards_and_ranges_make_the_frames_of_one_process() {
    let dir = tempfile::tempdir().expect("a folder");
    let [alone, shards] = ["alone", "shards"].map(|name| dir.path().join(name));
    succeeded(&mut render(&alone, &[]));
    let whole = pictures(&alone);
    for (shard, frames) in [("1/4", 2), ("3/4", 1), ("2/4", 2)] {
        succeeded(&mut render(&shards, &["--shard", shard]));
        let report = fs::read(shards.join(format!("report-{}.json", shard.replace('/', "-of-")))).expect("a report");
        let report: serde_json::Value = serde_json::from_slice(&report).expect("JSON");
        let picture = &report["picture"];
        assert_eq!((picture["frames"].as_u64(), picture["shard"].as_str()), (Some(frames), Some(shard)), "{picture}");
    }
    assert!(!shards.join("contact.png").exists(), "a sheet of a part");
    assert!(!shards.join("image-0003.png").exists());
    succeeded(&mut render(&shards, &["--shard", "4/4"]));
    assert!(pictures(&shards) == whole, "other frames by shards");
    assert!(told(&mut render(&shards, &["--shard", "1/4"])).contains("2 of 2 frames are whole"));
    assert!(!shards.join("report.html").exists());
    // With another seed all of them, and a changed one.
    fs::write(shards.join("image-0002.png"), "no picture").expect("a file");
    assert!(told(&mut render(&shards, &[])).contains("5 of 6 frames are whole"));
    assert!(pictures(&shards) == whole);
    let seed = FRAMES.map(|word| if word == "5" { "6" } else { word });
    let mut other = Command::new(PROGRAM);
    let said = told(other.args(seed).arg("--out").arg(&shards).stdout(Stdio::null()));
    assert!(!said.contains("whole") && pictures(&shards) != whole, "{said}");
}

/// Fails when a script leaves frames out, or its words are not those of the command.
#[test]
fn emitted_commands_render_all_frames() {
    let dir = tempfile::tempdir().expect("a folder");
    let [alone, out] = ["alone", "it's out"].map(|name| dir.path().join(name));
    succeeded(&mut render(&alone, &[]));
    let emit = |engine: &str, shards: &str| {
        let mut command = render(&out, &["--emit", engine, "--shards", shards]);
        String::from_utf8(succeeded(command.stdout(Stdio::piped())).stdout).expect("text")
    };
    let lines = emit("parallel", "4");
    assert_eq!(lines.lines().count(), 4, "{lines}");
    assert!(lines.lines().all(|line| line.starts_with(PROGRAM) && !line.contains("--emit")), "{lines}");
    assert!(!out.exists(), "nothing is rendered yet");
    for line in lines.lines() {
        succeeded(Command::new("sh").arg("-c").arg(line).stdout(Stdio::null()));
    }
    assert!(pictures(&out) == pictures(&alone), "other frames by the script");
    for (engine, array, number) in
        [("slurm", "#SBATCH --array=1-3", "${SLURM_ARRAY_TASK_ID}/3"), ("hq", "#HQ --array=1-3", "${HQ_TASK_ID}/3")]
    {
        let script = emit(engine, "3");
        assert!(script.starts_with("#!/bin/sh\n") && script.contains(array), "{script}");
        let last = script.lines().next_back().expect("a line");
        assert!(last.starts_with(&format!("exec {PROGRAM} render yard ")), "{script}");
        assert!(last.ends_with(&format!(" --shard \"{number}\"")), "{script}");
        // A shell takes it, with the number in the variable.
        let variable = number.trim_start_matches("${").trim_end_matches("}/3");
        let said = told(Command::new("sh").args(["-c", &script]).env(variable, "2").stdout(Stdio::null()));
        assert!(said.contains("2 of 2 frames are whole"), "{said}");
    }
}

/// Fails when key frames are taken for other frames, or light and exposure depend on which of them are rendered.
#[test]
fn cameras_follow_their_path() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = |name: &str| dir.path().join(name);
    let still = "3\t9 4 12\t0 1 0\t0 1 0\t35\n";
    fs::write(at("still.tsv"), format!("# frame\teye\ttarget\tup\tfov\n{still}")).expect("a file");
    let path = |file: &str| at(file).display().to_string();
    succeeded(&mut render(&at("still"), &["--camera", &path("still.tsv")]));
    let view = ["--orbit", "0", "--eye", "9,4,12", "--target", "0,1,0", "--up", "0,1,0", "--fov", "35"];
    succeeded(&mut render(&at("orbit"), &view));
    assert!(pictures(&at("still")) == pictures(&at("orbit")), "another camera than the one of the path");
    let rest = "9 4 12\t0 1 0\t0 1 0\t35";
    fs::write(at("flight.tsv"), format!("0\t{rest}\n4\t{rest}\n5\t-9 6 9\t0 1 0\t0 1 0\t50\n")).expect("a file");
    succeeded(&mut render(&at("flight"), &["--camera", &path("flight.tsv")]));
    let (flight, still) = (pictures(&at("flight")), pictures(&at("still")));
    assert!(flight["image-0002.png"] == still["image-0002.png"], "it is to stand still for a while");
    assert!(flight["image-0005.png"] != still["image-0005.png"]);
    let report = fs::read(at("flight/report.json")).expect("a report");
    let report: serde_json::Value = serde_json::from_slice(&report).expect("JSON");
    assert_eq!(report["picture"]["camera_path"], path("flight.tsv"));
    for (text, part) in [
        ("0\t1 2 3\t1 2 3\t0 1 0\t40\n", "line 1: no camera for frame 0"),
        ("0\t9 4 12\t0 1 0\t0 1 0\t35\n0\t9 4 12\t0 1 0\t0 1 0\t35\n", "line 2: frame 0 follows frame 0"),
    ] {
        fs::write(at("bad.tsv"), text).expect("a file");
        let run = render(&at("bad"), &["--camera", &path("bad.tsv")]).output().expect("it starts");
        let error = String::from_utf8_lossy(&run.stderr);
        assert_eq!(run.status.code(), Some(1), "{error}");
        assert!(error.contains("bad.tsv") && error.contains(part), "{error}");
        assert!(!at("bad").exists());
    }
    // A path is no output.
    let run = render(&at("flight"), &["--camera", &path("flight/image-0001.png")]).output().expect("it starts");
    let error = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.code() == Some(2) && error.contains("the camera path"), "{error}");
}
