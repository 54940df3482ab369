//! The command started several times by `mpirun`: pictures and hits are those of one process, and what goes wrong is
//! said by whoever it goes wrong for.
//!
//! Built with the feature `mpi` alone, as by `cargo xtask test` where there is an MPI library.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::Duration;

const PROGRAM: &str = env!("CARGO_BIN_EXE_raybalance");

/// A small picture of which every pixel depends on all random numbers.
const PICTURE: [&str; 12] =
    ["render", "yard", "--size", "181x120", "--spp", "3", "--bounces", "1", "--seed", "5", "--devices", "cpu:1"];

/// Starts `ranks` processes on this machine, even where they are more than its cores.
fn mpirun(ranks: u32) -> Command {
    let mut command = Command::new("mpirun");
    command.env("OMPI_ALLOW_RUN_AS_ROOT", "1").env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1");
    command.args(["--oversubscribe", "-np", &ranks.to_string()]);
    command
}

fn succeeded(command: &mut Command) -> Output {
    let run = command.output().expect("the launcher starts");
    assert!(run.status.success(), "{command:?}: {}", String::from_utf8_lossy(&run.stderr));
    run
}

fn picture(out: &Path) -> Vec<u8> {
    fs::read(out.join("image.png")).expect("a picture")
}

/// Fails when a rank renders other pixels than it was dealt, or the order of sums depends on who renders.
#[test]
fn the_picture_is_the_same_for_any_number_of_ranks() {
    let dir = tempfile::tempdir().expect("a folder");
    let out = |name: &str| dir.path().join(name);
    succeeded(Command::new(PROGRAM).args(PICTURE).arg("--out").arg(out("alone")));
    let whole = picture(&out("alone"));
    for (ranks, network) in [(1, "sm"), (2, "sm"), (3, "sm"), (4, "sm"), (2, "tcp"), (4, "tcp")] {
        let name = format!("{ranks} by {network}");
        let mut run = mpirun(ranks);
        if network == "tcp" {
            run.args(["--mca", "btl", "tcp,self", "--mca", "pml", "ob1"]);
        }
        succeeded(run.arg(PROGRAM).args(PICTURE).arg("--out").arg(out(&name)));
        assert!(picture(&out(&name)) == whole, "another picture with {name}");
        if ranks > 1 {
            let report = fs::read(out(&name).join("report.json")).expect("a report");
            let report: serde_json::Value = serde_json::from_slice(&report).expect("JSON");
            let dealt = &report["cluster"][0];
            let tiles = dealt["ranks"].as_array().expect("ranks").iter().map(|rank| rank["tiles"].as_u64());
            assert_eq!(tiles.map(|tiles| tiles.expect("a number")).sum::<u64>(), dealt["tiles"], "{dealt}");
            assert_eq!(dealt["ranks"].as_array().map(Vec::len), Some(ranks as usize));
        }
    }
}

/// Fails when frames of an animation are taken for each other.
#[test]
fn an_animation_is_the_same_too() {
    let dir = tempfile::tempdir().expect("a folder");
    let render = |mut command: Command, name: &str| {
        let out = dir.path().join(name);
        succeeded(command.args(PICTURE).args(["--frames", "3", "--out"]).arg(&out));
        (0..3).map(|frame| fs::read(out.join(format!("image-{frame:04}.png"))).expect("a picture")).collect::<Vec<_>>()
    };
    let alone = render(Command::new(PROGRAM), "alone");
    let mut three = mpirun(3);
    three.arg(PROGRAM);
    assert!(render(three, "together") == alone);
}

/// What `report.json` and `trace.json` in a folder say.
fn said(out: &Path) -> [serde_json::Value; 2] {
    ["report.json", "trace.json"].map(|name| {
        let bytes = fs::read(out.join(name)).expect("a file");
        serde_json::from_slice(&bytes).expect("JSON")
    })
}

/// The same picture from a scene that only rank 0 reads. Fails when a part of it is lost on the way, or a rank reads it
/// nevertheless.
#[test]
fn a_scene_that_is_sent_makes_the_same_picture() {
    let dir = tempfile::tempdir().expect("a folder");
    let out = |name: &str| dir.path().join(name);
    succeeded(Command::new(PROGRAM).args(PICTURE).arg("--out").arg(out("alone")));
    for ranks in [2, 3] {
        let name = ranks.to_string();
        succeeded(mpirun(ranks).arg(PROGRAM).args(PICTURE).arg("--broadcast").arg("--out").arg(out(&name)));
        assert!(picture(&out(&name)) == picture(&out("alone")), "another picture with {ranks} ranks");
        let [report, _] = said(&out(&name));
        for rank in report["cluster"][0]["ranks"].as_array().expect("ranks") {
            assert!(rank["memory_bytes"].as_u64() > Some(1 << 20), "{rank}");
        }
    }
    // Others have no file of that name.
    let scene = dir.path().join("scene.obj");
    fs::write(&scene, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").expect("a file");
    let render = ["--size", "96x64", "--devices", "cpu:1", "--spp", "4", "--broadcast", "--out"];
    let mut run = mpirun(1);
    run.arg(PROGRAM).arg("render").arg(&scene).args(render).arg(out("first"));
    succeeded(run.args([":", "-np", "1", PROGRAM, "render", "elsewhere.obj"]).args(render).arg(out("first")));
    // A scene that rank 0 cannot read ends them all.
    let mut run = mpirun(2);
    let run = run.args([PROGRAM, "render", "missing.obj"]).args(render).arg(out("none")).output().expect("it starts");
    let error = String::from_utf8_lossy(&run.stderr);
    assert!(!run.status.success() && error.contains("missing.obj"), "{error}");
}

/// Fails when a rank's times are those of its own clock, or one has no row.
#[test]
fn all_ranks_are_on_one_timeline() {
    let dir = tempfile::tempdir().expect("a folder");
    succeeded(mpirun(3).arg(PROGRAM).args(PICTURE).arg("--out").arg(dir.path()));
    let [report, trace] = said(dir.path());
    let events = trace["traceEvents"].as_array().expect("events");
    let number = |event: &serde_json::Value, field: &str| event[field].as_f64().expect("a number");
    // From before the first of its streams until the end of the command.
    let end = 1e6 * number(&report["seconds"], "total");
    for rank in 0..3 {
        let of_rank = || events.iter().filter(|event| event["pid"] == rank);
        assert_eq!(of_rank().filter(|event| event["name"] == "process_name").count(), 1, "rank {rank}");
        let streams = of_rank().filter(|event| event["cat"] == "stream").count() as u64;
        let tiles = report["cluster"][0]["ranks"][rank]["tiles"].as_u64().expect("a number");
        assert!(streams >= tiles, "{streams} streams of {tiles} tiles");
        for event in of_rank().filter(|event| event["ph"] == "X") {
            let (at, took) = (number(event, "ts"), number(event, "dur"));
            assert!(at > -end && at + took < end, "{event}");
        }
    }
}

/// Fails when others wait for rank 0 for ever or end without a word, or what it kept is lost.
#[test]
fn the_death_of_rank_0_ends_all_with_a_word() {
    let dir = tempfile::tempdir().expect("a folder");
    let [alone, out, kept] = ["alone", "out", "kept"].map(|name| dir.path().join(name));
    succeeded(Command::new(PROGRAM).args(PICTURE).arg("--out").arg(&alone));
    let ended = killed(dir.path(), 3, 0, true, 30_000);
    let error = String::from_utf8_lossy(&ended.stderr);
    // The run may have been over when it was killed.
    if out.join("image.png").exists() {
        assert!(picture(&out) == picture(&alone));
    } else {
        // The launcher itself (OpenMPI 4.1) is content whatever its processes end with, if it is to recover.
        assert!(!out.join("report.json").exists(), "{error}");
        for rank in [1, 2] {
            assert!(error.contains(&format!("rank {rank} on ")) && error.contains("rank 0 is lost"), "{error}");
        }
    }
    let mut again = mpirun(2);
    again.arg(PROGRAM).args(PICTURE).arg("--out").arg(&out).arg("--checkpoint").arg(&kept);
    succeeded(&mut again);
    assert!(picture(&out) == picture(&alone), "another picture after rank 0 was killed");
}

fn npy(rays: &[[f32; 8]]) -> Vec<u8> {
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, 8), }}", rays.len());
    let header = format!("{header:<117}\n");
    let numbers = rays.iter().flatten().flat_map(|number| number.to_le_bytes());
    b"\x93NUMPY\x01\x00\x76\x00".iter().copied().chain(header.into_bytes()).chain(numbers).collect()
}

/// Fails when hits or counts of one rank are written where another's belong.
#[test]
fn hits_and_counts_are_the_same_for_any_number_of_ranks() {
    let dir = tempfile::tempdir().expect("a folder");
    let rays = dir.path().join("rays.npy");
    let ray = |i: u32| {
        let [x, y] = [(i % 331) as f32 / 331.0 - 0.5, (i / 331) as f32 / 331.0 - 0.5];
        [20.0 * x, 8.0, 20.0 * y, 0.0, 0.3 * y, -1.0, x * y, f32::INFINITY]
    };
    fs::write(&rays, npy(&(0..100_000).map(ray).collect::<Vec<_>>())).expect("a file");
    let trace = |mut command: Command, name: &str| {
        let [hits, counts] = ["hits", "counts"].map(|what| dir.path().join(format!("{name}-{what}.npy")));
        command.args(["trace", "yard", "--devices", "cpu:1", "--rays"]).arg(&rays);
        succeeded(command.arg("--hits").arg(&hits).arg("--counts").arg(&counts));
        [hits, counts].map(|file| fs::read(file).expect("a file"))
    };
    let alone = trace(Command::new(PROGRAM), "alone");
    for ranks in [2, 3] {
        let mut command = mpirun(ranks);
        command.arg(PROGRAM);
        assert!(trace(command, &ranks.to_string()) == alone, "other hits with {ranks} ranks");
    }
}

/// Fails when a rank that would render something else is dealt tiles, or says not who it is.
#[test]
fn a_rank_with_other_options_is_refused_by_name() {
    let dir = tempfile::tempdir().expect("a folder");
    let mut run = mpirun(1);
    run.arg(PROGRAM).args(PICTURE).arg("--out").arg(dir.path());
    run.args([":", "-np", "1", PROGRAM]).args(PICTURE.map(|word| if word == "5" { "6" } else { word }));
    let run = run.arg("--out").arg(dir.path()).output().expect("the launcher starts");
    let error = String::from_utf8_lossy(&run.stderr);
    assert!(!run.status.success(), "{error}");
    assert!(error.contains("rank 1 on ") && error.contains("same files on all nodes"), "{error}");
}

/// The processes of a run that writes to this folder, with their ranks.
fn processes(out: &Path) -> Vec<(u32, u32)> {
    let out = out.to_string_lossy();
    let read = |process: &Path, file: &str| fs::read(process.join(file)).unwrap_or_default();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let folders = fs::read_dir("/proc").expect("Linux").filter_map(|entry| Some(entry.ok()?.path()));
    let found = folders.filter_map(|process| {
        let number = process.file_name()?.to_str()?.parse().ok()?;
        let words = text(&read(&process, "cmdline"));
        let is_ours = words.starts_with(PROGRAM) && words.split('\0').any(|word| word == out);
        let variables = text(&read(&process, "environ"));
        let rank =
            variables.split('\0').find_map(|variable| variable.strip_prefix("OMPI_COMM_WORLD_RANK=")?.parse().ok());
        Some((number, rank.filter(|_| is_ours)?))
    });
    found.collect()
}

/// Kills one of `ranks` processes when about so many bytes of the picture are there; how the run ended.
fn killed(dir: &Path, ranks: u32, rank: u32, recovers: bool, bytes: u64) -> Output {
    let [out, kept] = ["out", "kept"].map(|name| dir.join(name));
    for folder in [&out, &kept] {
        let _ = fs::remove_dir_all(folder);
    }
    let mut run = mpirun(ranks);
    if recovers {
        run.arg("--enable-recovery");
    }
    run.arg(PROGRAM).args(PICTURE).arg("--out").arg(&out).arg("--checkpoint").arg(&kept);
    let mut run = run.stderr(Stdio::piped()).stdout(Stdio::null()).spawn().expect("the launcher starts");
    let file = kept.join("frame-0000.tiles");
    loop {
        let is_over = run.try_wait().expect("a child").is_some();
        if is_over || fs::metadata(&file).is_ok_and(|about| about.len() >= bytes) {
            break;
        }
        thread::sleep(Duration::from_millis(1));
    }
    for (number, _) in processes(&out).into_iter().filter(|&(_, other)| other == rank) {
        let _ = Command::new("kill").args(["-KILL", &number.to_string()]).status();
    }
    run.wait_with_output().expect("a child")
}

/// How often a rank is killed: `RAYBALANCE_TRIALS` for more.
fn trials() -> u32 {
    std::env::var("RAYBALANCE_TRIALS").ok().and_then(|trials| trials.parse().ok()).unwrap_or(4)
}

/// Fails when the tiles of a killed rank are lost or counted twice, or when the others wait for it.
#[test]
fn a_killed_rank_costs_nothing_with_recovery() {
    let dir = tempfile::tempdir().expect("a folder");
    let alone = dir.path().join("alone");
    succeeded(Command::new(PROGRAM).args(PICTURE).arg("--out").arg(&alone));
    for trial in 0..trials() {
        let bytes = u64::from(trial.wrapping_mul(2_654_435_761) >> 8) % 250_000;
        let ended = killed(dir.path(), 3 + trial % 2, 1 + trial % 2, true, bytes);
        let error = String::from_utf8_lossy(&ended.stderr);
        assert!(picture(&dir.path().join("out")) == picture(&alone), "another picture: {error}");
        let report = fs::read(dir.path().join("out/report.json")).expect("a report");
        let report: serde_json::Value = serde_json::from_slice(&report).expect("JSON");
        let dealt = &report["cluster"][0];
        let tiles = dealt["ranks"].as_array().expect("ranks").iter().map(|rank| rank["tiles"].as_u64());
        assert_eq!(tiles.map(|tiles| tiles.expect("a number")).sum::<u64>(), dealt["tiles"], "{dealt}");
    }
}

/// Fails when a part of a picture is passed off as whole, or what was finished is lost.
#[test]
fn without_recovery_a_run_ends_and_can_be_resumed() {
    let dir = tempfile::tempdir().expect("a folder");
    let [alone, out, kept] = ["alone", "out", "kept"].map(|name| dir.path().join(name));
    succeeded(Command::new(PROGRAM).args(PICTURE).arg("--out").arg(&alone));
    for rank in [0, 1] {
        let ended = killed(dir.path(), 3, rank, false, 30_000);
        assert!(!ended.stderr.is_empty() || ended.status.success(), "an end without a word");
        // The run may have been over when the process was killed.
        assert!(!out.join("image.png").exists() || picture(&out) == picture(&alone), "a picture of a part");
        // With another number of processes.
        let mut again = mpirun(2);
        again.arg(PROGRAM).args(PICTURE).arg("--out").arg(&out).arg("--checkpoint").arg(&kept);
        succeeded(&mut again);
        assert!(picture(&out) == picture(&alone), "another picture after rank {rank} was killed");
    }
}

#[test]
fn a_rank_without_the_file_says_so_by_name() {
    let dir = tempfile::tempdir().expect("a folder");
    let scene = dir.path().join("scene.obj");
    fs::write(&scene, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").expect("a file");
    let render = ["--size", "64x64", "--devices", "cpu:1", "--out"];
    let mut run = mpirun(1);
    run.arg(PROGRAM).arg("render").arg(&scene).args(render).arg(dir.path());
    run.args([":", "-np", "1", PROGRAM, "render", "elsewhere.obj"]).args(render).arg(dir.path());
    let run = run.output().expect("the launcher starts");
    let error = String::from_utf8_lossy(&run.stderr);
    assert!(!run.status.success(), "{error}");
    assert!(error.contains("rank 1 on ") && error.contains("elsewhere.obj"), "{error}");
}

/// Fails when ranks render other frames than rank 0 says, or a shard those of another.
#[test]
fn the_ranks_of_a_shard_render_its_frames() {
    let dir = tempfile::tempdir().expect("a folder");
    let [alone, out] = ["alone", "out"].map(|name| dir.path().join(name));
    let frames = ["--frames", "0..3"];
    succeeded(Command::new(PROGRAM).args(PICTURE).args(frames).arg("--out").arg(&alone));
    for (shard, own) in [("1/2", 2), ("2/2", 1)] {
        let mut run = mpirun(2);
        succeeded(run.arg(PROGRAM).args(PICTURE).args(frames).args(["--shard", shard]).arg("--out").arg(&out));
        let report = fs::read(out.join(format!("report-{}.json", shard.replace('/', "-of-")))).expect("a report");
        let report: serde_json::Value = serde_json::from_slice(&report).expect("JSON");
        assert_eq!(report["cluster"].as_array().map(Vec::len), Some(own), "{report}");
        assert_eq!(out.join("image-0001.png").exists(), shard == "2/2");
    }
    for frame in 0..3 {
        let name = format!("image-{frame:04}.png");
        assert!(fs::read(alone.join(&name)).expect("a picture") == fs::read(out.join(&name)).expect("a picture"));
    }
}
