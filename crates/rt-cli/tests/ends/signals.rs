//! SIGINT and SIGTERM end every command, wherever it is, with the exit code that says so, and leave no half-written
//! file.
//!
//! Nothing here is timed but for a limit that only a command deaf to signals reaches: when the signal arrives the
//! command may be anywhere, which is the point.

use crate::folder::{self, Folder};
use signal_hook::consts::{SIGINT, SIGTERM};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// Far more than a loaded machine needs for what is to take a second.
const LIMIT: Duration = Duration::from_secs(60);

/// Waits, but not for ever.
fn wait(mut child: Child, what: &str) -> ExitStatus {
    let begin = Instant::now();
    while begin.elapsed() < LIMIT {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    child.kill().unwrap();
    panic!("{what}: deaf to a signal");
}

fn send(child: &Child, signal: i32) {
    let status = Command::new("kill").arg(format!("-{signal}")).arg(child.id().to_string()).status().unwrap();
    assert!(status.success());
}

/// Everything below a folder that is being written.
fn partial_files(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(partial_files(&path));
        } else if path.to_string_lossy().ends_with(".partial") {
            found.push(path.display().to_string());
        }
    }
    found
}

/// A square of `2 n²` triangles: enough of them to be caught reading, parsing or building.
fn square(n: usize) -> String {
    let mut text = String::new();
    for i in 0..=n {
        (0..=n).for_each(|j| writeln!(text, "v {i} {j} 0").unwrap());
    }
    for i in 0..n {
        for j in 1..=n {
            let corner = i * (n + 1) + j;
            let above = corner + n + 1;
            writeln!(text, "f {corner} {above} {} {}", above + 1, corner + 1).unwrap();
        }
    }
    text
}

/// Each takes minutes unless it is ended.
const LONG: &[&str] = &[
    // Reading, parsing, building.
    "render large.obj --size 8000x8000 --spp 64 --devices cpu:1 --out out",
    "trace large.obj --rays large.npy --hits hits.npy --devices cpu:1@0.001",
    "verify --full",
    "compare large.obj --repeat 1000 --devices cpu:1,cpu:1",
    "figure1 large.obj yard --repeat 1000 --devices cpu:1",
    "tradeoff yard car --repeat 1000 --budget 100000",
    "tradeoff precision yard --repeat 10000",
    "bench yard large.obj --devices cpu --repeat 10000",
    // Asleep in a device that is slowed down.
    "render yard --size 960x600 --spp 16 --devices cpu:1@0.001 --queue static --out out",
    "render yard --size 960x600 --spp 16 --devices cpu:1,cpu:1@0.001 --reference --out out",
];

// Mutants: no thread that ends what does not end by itself; the codes exchanged; `abandon` that removes nothing.
#[test]
fn a_signal_ends_every_command_wherever_it_is() {
    let folder = Folder::new();
    fs::write(folder.at("large.obj"), square(400)).unwrap();
    let rays = folder::ray().repeat(1 << 20);
    fs::write(folder.at("large.npy"), folder::npy("<f4", "(1048576, 8)", &rays)).unwrap();
    let moments = [0.1, 0.4, 1.5];
    for (i, words) in LONG.iter().enumerate() {
        for (j, moment) in moments.into_iter().enumerate() {
            let (signal, code) = if (i + j) % 2 == 0 { (SIGTERM, 143) } else { (SIGINT, 130) };
            let what = format!("{words}, signal {signal} after {moment} s");
            let mut command = folder.raybalance();
            command.args(words.split_whitespace()).stdout(Stdio::null()).stderr(Stdio::null());
            let child = command.spawn().unwrap();
            std::thread::sleep(Duration::from_secs_f64(moment));
            send(&child, signal);
            assert_eq!(wait(child, &what).code(), Some(code), "{what}");
            assert_eq!(partial_files(&folder.at("")), [""; 0], "{what}");
        }
    }
}

/// A pipe that nobody reads is full after 64 KiB; the command is caught writing to it.
#[test]
fn a_signal_ends_a_command_that_waits_for_its_reader() {
    let folder = Folder::new();
    let rays = folder::ray().repeat(1 << 16);
    fs::write(folder.at("many.npy"), folder::npy("<f4", "(65536, 8)", &rays)).unwrap();
    assert!(Command::new("mkfifo").arg(folder.at("pipe")).status().unwrap().success());
    for hits in ["/dev/stdout", "pipe"] {
        let mut command = folder.raybalance();
        command.args(["trace", "scene.obj", "--rays", "many.npy", "--devices", "cpu:1", "--hits", hits]);
        let (reader, writer) = std::io::pipe().unwrap();
        let child = command.stdout(writer).stderr(Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_secs(1));
        send(&child, SIGTERM);
        assert_eq!(wait(child, hits).code(), Some(143), "{hits}");
        drop(reader);
    }
}

/// The signal comes while a large picture is written, over and over: the last file is whole, or not there.
#[test]
fn what_a_signal_finds_half_written_is_removed() {
    let folder = Folder::new();
    let rays = folder::ray().repeat(1 << 21);
    fs::write(folder.at("many.npy"), folder::npy("<f4", "(2097152, 8)", &rays)).unwrap();
    let words = "trace scene.obj --rays many.npy --devices cpu:2 --hits hits.npy --counts counts.npy";
    let mut seen_writing = 0;
    for _ in 0..4 {
        let mut command = folder.raybalance();
        let child = command.args(words.split_whitespace()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let begin = Instant::now();
        while partial_files(&folder.at("")).is_empty() && begin.elapsed() < LIMIT {
            std::thread::yield_now();
        }
        seen_writing += usize::from(!partial_files(&folder.at("")).is_empty());
        // Twice: the second has no patience.
        send(&child, SIGINT);
        send(&child, SIGINT);
        // Who is nearly done when it hears of it may finish.
        let code = wait(child, words).code();
        assert!(code == Some(130) || code == Some(0), "{code:?}");
        assert_eq!(partial_files(&folder.at("")), [""; 0]);
        if let Ok(file) = fs::metadata(folder.at("hits.npy")) {
            assert!(file.len() > (1 << 21) * 16, "{}", file.len());
            fs::remove_file(folder.at("hits.npy")).unwrap();
        }
    }
    assert!(seen_writing > 0, "it was never caught writing");
}

/// What was whole when the signal came is kept and said, with charts and page about it. On a busy machine the process
/// may be ended from outside before it has stopped tracing: then it is tried again.
///
/// Mutants: a picture of fewer samples than the report says; nothing said; exit code 1; charts of nothing, or cut short
/// by the signal.
#[test]
fn passes_that_are_whole_are_kept() {
    const TRIES: u32 = 20;
    for _ in 0..TRIES {
        let folder = Folder::new();
        let words = "render yard --size 320x200 --spp 4096 --devices cpu:1 --out out";
        let mut command = folder.raybalance();
        command.args(words.split_whitespace());
        let mut child = command.stderr(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap();
        let picture = folder.at("out/image.png");
        let begin = Instant::now();
        while !picture.exists() && begin.elapsed() < LIMIT {
            std::thread::sleep(Duration::from_millis(20));
        }
        assert!(picture.exists(), "no pass in time");
        send(&child, SIGINT);
        let told = std::io::read_to_string(child.stderr.take().unwrap()).unwrap();
        assert_eq!(wait(child, "render").code(), Some(130), "{told}");
        let decoder = png::Decoder::new(std::io::BufReader::new(fs::File::open(&picture).unwrap()));
        assert_eq!(decoder.read_info().unwrap().info().width, 320);
        assert_eq!(partial_files(&folder.at("")), [""; 0]);
        if let Ok(page) = fs::read_to_string(folder.at("out/report.html")) {
            let report: serde_json::Value =
                serde_json::from_slice(&fs::read(folder.at("out/report.json")).unwrap()).unwrap();
            let samples = report["picture"]["samples"].as_u64().unwrap();
            assert!((1..4096).contains(&samples), "{samples}");
            let missing = format!("interrupted: {samples} of 4096 samples of each pixel");
            assert!(told.contains(&missing) && page.contains(&missing), "{told}");
            for chart in ["cost.png", "timeline.svg", "trace.json", "tasks.csv"] {
                assert!(folder.at("out").join(chart).exists(), "{chart}");
            }
            return;
        }
    }
    panic!("no page in {TRIES} tries");
}
