//! What `render` says on a terminal: in lines that fit, and with a last word.

use std::process::Command;

/// Fails when a table is as wide as it likes, a sentence is not broken, or the headline is not the end.
#[test]
fn a_run_fits_the_terminal_and_ends_with_its_headline() {
    let dir = tempfile::tempdir().expect("a folder");
    for (columns, devices, estimator) in [("80", "cpu:1,cpu:1", "auto"), ("100", "cpu:1,cpu:1@0.5", "exact")] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_raybalance"));
        command.args([
            "render",
            "yard",
            "--size",
            "64x40",
            "--spp",
            "2",
            "--reference",
            "--explain",
            "--devices",
            devices,
        ]);
        command.args(["--estimator", estimator, "--out", "out"]).current_dir(dir.path()).env("COLUMNS", columns);
        let run = command.output().expect("the program starts");
        assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
        let text = String::from_utf8(run.stdout).expect("text");
        let limit: usize = columns.parse().expect("a number");
        for line in text.lines() {
            assert!(line.chars().count() <= limit, "more than {limit} columns: {line}");
            assert_eq!(line.trim_end(), line);
        }
        for part in ["wall: load ", "set-up ", "(the scene made ready: once per start)", "written to out:"] {
            assert!(text.replace("\n    ", " ").contains(part), "{part}: {text}");
        }
        let report = std::fs::read(dir.path().join("out/report.json")).expect("a report");
        let report: serde_json::Value = serde_json::from_slice(&report).expect("JSON");
        let headline = report["headline"]["sentence"].as_str().expect("a headline");
        assert!(text.replace("\n  ", " ").trim_end().ends_with(headline), "{headline}: {text}");
        assert!(headline.starts_with("2 devices were busy "), "{headline}");
    }
}

/// Fails when a description is as wide as it likes.
#[test]
fn the_list_of_scenes_fits_the_terminal() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_raybalance"));
    let run = command.arg("scenes").env("COLUMNS", "80").output().expect("the program starts");
    let text = String::from_utf8(run.stdout).expect("text");
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
    assert!(["yard", "213,802 triangles", "car", "raybalance FILE"].iter().all(|part| text.contains(part)), "{text}");
}
