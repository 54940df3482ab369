//! Standard output, files and their names as the outside world has them: closed, full, in use, no text.

use crate::folder::{Ended, Folder, SMALL, ray};
use rt_report::Provenance;
use std::ffi::OsStr;
use std::fs::{self, File};
use std::os::unix::ffi::OsStrExt;
use std::process::Stdio;

/// Commands that print something, in each of their forms.
const PRINTING: &[&str] = &[
    "--help",
    "--version",
    "devices",
    "devices --json",
    "scenes",
    "scenes --json",
    "render scene.obj --size 8x8 --spp 1 --devices cpu:1",
    "render scene.obj --size 8x8 --spp 1 --devices cpu:1 --json",
    "trace scene.obj --rays rays.npy --hits hits.npy --devices cpu:1",
    "trace scene.obj --rays rays.npy --hits hits.npy --devices cpu:1 --json",
    "trace scene.obj --rays rays.npy --hits /dev/stdout --devices cpu:1",
    "verify scene.obj --case ties --rays 100 --devices cpu:1",
    "verify scene.obj --case ties --rays 100 --devices cpu:1 --json",
    "bench scene.obj --quick --devices cpu:1 --rays 64 --repeat 1",
    "bench scene.obj --quick --devices cpu:1 --json",
    "compare scene.obj --quick --size 16x16 --repeat 1 --estimator uniform --devices cpu:1",
    "compare scene.obj --quick --size 16x16 --repeat 1 --estimator uniform --devices cpu:1 --json",
    "figure1 scene.obj --quick --size 16x16 --repeat 1 --task-sizes 64 --devices cpu:1",
    "tradeoff build scene.obj --quick --size 16x16 --repeat 1 --devices cpu:1",
];

/// A pipe that nobody reads.
fn closed_pipe() -> Stdio {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    writer.into()
}

// Mutant: any `println!`; an error of printing that is not handed on.
#[test]
fn a_reader_that_goes_away_ends_a_command_quietly() {
    let folder = Folder::new();
    for words in PRINTING.iter().filter(|words| !words.contains("--quick --devices cpu:1 --rays")) {
        let mut command = folder.raybalance();
        command.args(words.split_whitespace()).stdout(closed_pipe()).stderr(Stdio::piped());
        let ended = Ended::of(command.spawn().unwrap().wait_with_output().unwrap());
        assert!(ended.code == Some(141) && ended.err.is_empty(), "{words}: {ended:?}");
    }
    // What was to be written is there.
    assert!(["hits.npy", "out"].iter().all(|name| folder.at(name).exists()));
    assert!(folder.at("out/report.html").exists() && folder.at("out/figure1/report.html").exists());
}

#[test]
fn a_full_disk_behind_standard_output_is_an_error() {
    let folder = Folder::new();
    for words in
        ["scenes", "devices --json", "--help", "trace scene.obj --rays rays.npy --hits /dev/full --devices cpu:1"]
    {
        let mut command = folder.raybalance();
        command.args(words.split_whitespace()).stdout(File::options().write(true).open("/dev/full").unwrap());
        let ended = Ended::of(command.stderr(Stdio::piped()).spawn().unwrap().wait_with_output().unwrap());
        assert_eq!(ended.code, Some(1), "{words}: {ended:?}");
        assert!(
            ended.err.contains("No space left on device") && ended.err.starts_with("error: cannot write"),
            "{ended:?}"
        );
    }
}

#[test]
fn nobody_need_read_standard_error() {
    let folder = Folder::new();
    for (words, code) in [("render missing.obj", 1), ("render --nonsense", 2), ("scenes", 0)] {
        for stderr in [closed_pipe(), File::options().write(true).open("/dev/full").unwrap().into()] {
            let mut command = folder.raybalance();
            command.args(words.split_whitespace()).stdout(Stdio::null()).stderr(stderr);
            assert_eq!(command.status().unwrap().code(), Some(code), "{words}");
        }
    }
}

// Mutant: the log replaced, or written from its beginning.
#[test]
fn what_is_appended_to_a_log_leaves_the_log() {
    let folder = Folder::new();
    fs::write(folder.at("log"), "of yesterday\n").unwrap();
    let log = || File::options().append(true).open(folder.at("log")).unwrap();
    let words = "trace scene.obj --rays rays.npy --hits /dev/stdout --devices cpu:1";
    let status = folder.raybalance().args(words.split_whitespace()).stdout(log()).status().unwrap();
    assert_eq!(status.code(), Some(0));
    let held = fs::read(folder.at("log")).unwrap();
    assert!(held.starts_with(b"of yesterday\n\x93NUMPY"), "{}", String::from_utf8_lossy(&held));

    // By its name it would be replaced, and what is printed would be lost with the old one.
    let ended =
        folder.raybalance().args("trace scene.obj --rays rays.npy --hits log".split(' ')).stdout(log()).output();
    let ended = Ended::of(ended.unwrap());
    assert!(ended.code == Some(2) && ended.err.contains("/dev/stdout"), "{ended:?}");
    assert_eq!(fs::read(folder.at("log")).unwrap(), held);
}

/// Material libraries are found in the scene's file, wherever and however it names them.
// Mutants: libraries left out of `Prepared`; one of the commands that does not ask; names compared instead of files.
#[test]
fn materials_of_a_scene_are_not_overwritten() {
    let folder = Folder::new();
    fs::create_dir(folder.at("sub")).unwrap();
    let scene = fs::read_to_string(folder.at("scene.obj")).unwrap();
    fs::write(folder.at("scene.obj"), format!("mtllib a.mtl sub/B.mtl\nmtllib report.json\n{scene}")).unwrap();
    for name in ["a.mtl", "sub/b.mtl", "report.json"] {
        fs::write(folder.at(name), "newmtl red\nKd 1 0 0\n").unwrap();
    }
    let before = folder.names();
    for words in [
        "trace scene.obj --rays rays.npy --hits a.mtl",
        "trace scene.obj --rays rays.npy --hits hits.npy --counts ./sub/b.mtl",
        "render scene.obj --out .",
        "bench scene.obj --quick --devices cpu:1 --out sub/b.mtl",
    ] {
        let ended = folder.run(words);
        assert!(ended.code == Some(2) && ended.err.contains("would overwrite the materials"), "{words}: {ended:?}");
        assert_eq!(folder.names(), before, "{words}");
    }
    fs::write(folder.at("scene.obj"), format!("mtllib report.html\n{scene}")).unwrap();
    fs::write(folder.at("report.html"), "newmtl red\n").unwrap();
    for words in [
        "compare scene.obj --quick --devices cpu:1",
        "figure1 scene.obj --quick --devices cpu:1",
        "tradeoff precision scene.obj",
        "tradeoff build scene.obj",
    ] {
        let ended = folder.run(&format!("{words} --out ."));
        assert!(ended.code == Some(2) && ended.err.contains("would overwrite the materials"), "{words}: {ended:?}");
    }
    assert_eq!(fs::read_to_string(folder.at("report.html")).unwrap(), "newmtl red\n");
}

/// Mutants: all pixels on the page; no way to them; more than the picture on the page grows with it.
#[test]
fn a_page_stays_small() {
    let folder = Folder::new();
    let ended = folder.run("render yard --size 2000x1200 --spp 1 --bounces 0 --task-size 32 --out out");
    assert_eq!(ended.code, Some(0), "{ended:?}");
    let page = fs::read_to_string(folder.at("out/report.html")).unwrap();
    assert!(page.len() < rt_report::html::LARGEST, "{}", page.len());
    assert!(page.contains("Scaled to 1/2") && page.contains("href=\"image.png\""));
    assert!(page.contains("75,000 tasks of primary rays are more than fit this page"));
}

/// Every file of results says where it comes from.
// Mutants: a file written without; the seed of another option.
#[test]
fn every_file_says_where_it_comes_from() {
    let folder = Folder::new();
    let cube = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
        f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
    fs::write(folder.at("cube.obj"), cube).unwrap();
    let small = "--quick --size 16x16 --seed 77 --devices cpu:1";
    for words in [
        "render cube.obj --size 16x16 --spp 1 --seed 77 --devices cpu:1 --out a".to_owned(),
        format!("figure1 cube.obj {small} --repeat 1 --task-sizes 64 --out b"),
        format!("compare cube.obj {small} --repeat 1 --estimator uniform --out g"),
        format!("tradeoff build cube.obj {small} --repeat 1 --out c"),
        format!("tradeoff sampling cube.obj {small} --repeat 1 --out d"),
        "tradeoff precision cube.obj --quick --size 16x16 --seed 77 --repeat 1 --devices cpu:1 --out e".to_owned(),
        "bench cube.obj --seed 77 --devices cpu:1 --rays 64 --repeat 1 --out f/bench.json".to_owned(),
    ] {
        let ended = folder.run(&words);
        assert_eq!(ended.code, Some(0), "{words}: {ended:?}");
    }
    let mut seen = 0;
    for out in ["a", "b", "c", "d", "e", "f", "g"] {
        for entry in fs::read_dir(folder.at(out)).unwrap() {
            let path = entry.unwrap().path();
            // Pictures have none: they are the same whenever and wherever they are made.
            if path.extension().is_some_and(|kind| kind == "png") {
                continue;
            }
            let text = fs::read_to_string(&path).unwrap();
            let provenance = Provenance::now(77, [""]);
            for part in [
                provenance.commit,
                &provenance.machine.processor,
                &provenance.date[..8],
                "77",
                "cube.obj",
                "raybalance",
            ] {
                assert!(text.contains(part), "`{part}` is missing in {}", path.display());
            }
            seen += 1;
        }
    }
    assert_eq!(seen, 5 + 4 + 5 + 5 + 5 + 1 + 5);
}

#[test]
fn names_need_not_be_text() {
    let folder = Folder::new();
    let name = |bytes: &[u8]| OsStr::from_bytes(bytes).to_owned();
    let (scene, out, hits) = (name(b"scene_\xff.obj"), name(b"out_\xff"), name(b"hits_\xff.npy"));
    fs::rename(folder.at("scene.obj"), folder.at("").join(&scene)).unwrap();

    let ended = Ended::of(
        folder
            .raybalance()
            .arg("render")
            .arg(&scene)
            .args(SMALL)
            .arg("--json")
            .arg("--out")
            .arg(&out)
            .output()
            .unwrap(),
    );
    assert_eq!(ended.code, Some(0), "{ended:?}");
    let report: serde_json::Value = serde_json::from_str(&ended.out).unwrap();
    assert!(report["provenance"]["command"].as_str().unwrap().ends_with("--out 'out_\u{fffd}'"), "{report}");
    let out = folder.at("").join(&out);
    assert!(["image.png", "report.json", "report.html"].iter().all(|name| out.join(name).exists()));

    let mut trace = folder.raybalance();
    trace.arg("trace").arg(&scene).args(["--rays", "rays.npy", "--json", "--hits"]).arg(&hits);
    let ended = Ended::of(trace.output().unwrap());
    assert_eq!(ended.code, Some(0), "{ended:?}");
    assert!(folder.at("").join(&hits).exists());

    let mut build = folder.raybalance();
    build.args(["tradeoff", "build"]).arg(&scene).args(["--quick", "--size", "16x16", "--repeat", "1"]);
    let ended = Ended::of(build.output().unwrap());
    assert!(ended.code == Some(0) && folder.at("out/tradeoff/build-scene_\u{fffd}.svg").exists(), "{ended:?}");
}

#[test]
fn devices_and_pipes_are_written_as_they_are() {
    let folder = Folder::new();
    let words = "trace scene.obj --rays rays.npy --devices cpu:1 --hits";
    let null = folder.run(&format!("{words} /dev/null --counts /dev/null"));
    assert_eq!(null.code, Some(0), "{null:?}");
    // Rays from a pipe, hits to standard output.
    let mut piped = folder.raybalance();
    piped.args(words.split_whitespace()).arg("/dev/stdout");
    let ended = piped.output().unwrap();
    assert!(ended.stdout.starts_with(b"\x93NUMPY"), "{ended:?}");
}

#[test]
fn leftovers_of_killed_runs_are_cleared() {
    let folder = Folder::new();
    fs::write(folder.at(".hits.npy.aB3xYz.partial"), "half").unwrap();
    fs::write(folder.at(".other.npy.aB3xYz.partial"), "half").unwrap();
    let ended = folder.run("trace scene.obj --rays rays.npy --hits hits.npy --devices cpu:1");
    assert_eq!(ended.code, Some(0), "{ended:?}");
    assert_eq!(folder.names(), [".other.npy.aB3xYz.partial", "hits.npy", "rays.npy", "scene.obj"]);
    assert_eq!(ray().len(), 32);
}
