//! Files: found, refused, and read under the eyes of a watch that can stop it.

use super::TRIANGLE;
use rt_scene::obj::{Fault, LoadOptions, LoadProgress, LoadStage, load_obj, unwatched};
use std::ops::ControlFlow;
use std::path::Path;

#[test]
fn files_that_cannot_be_read_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let fail = |path: &Path| load_obj(path, &LoadOptions::default(), &mut unwatched).unwrap_err().to_string();
    let missing = folder.path().join("missing.obj");
    assert_eq!(fail(&missing), format!("{}: no such file: check the path", missing.display()));
    assert!(fail(folder.path()).contains("is a directory"));
    assert!(fail(Path::new("")).contains("no file name"));
}

/// A file of several megabytes, and of more triangles than a step has.
fn large_file(folder: &Path) -> std::path::PathBuf {
    let mut text = String::from(TRIANGLE);
    for _ in 0..150_000 {
        text += "v 0.25 0.25 1\nf 1 2 -1\n";
    }
    let path = folder.join("large.obj");
    std::fs::write(&path, &text).expect("a file");
    path
}

#[test]
fn progress_covers_every_stage_and_any_call_can_stop_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = large_file(folder.path());
    let mut seen: Vec<LoadProgress> = Vec::new();
    let mut watch = |at| {
        seen.push(at);
        ControlFlow::Continue(())
    };
    load_obj(&path, &LoadOptions::default(), &mut watch).unwrap();
    assert!(seen.iter().all(|at| at.done <= at.total), "{seen:?}");
    assert!(seen.is_sorted_by_key(|at| (at.stage, at.done)), "{seen:?}");
    for stage in [LoadStage::Reading, LoadStage::Parsing, LoadStage::Placing] {
        assert!(seen.iter().filter(|at| at.stage == stage).count() > 2, "{stage:?}: {seen:?}");
    }
    for last in 0..seen.len() {
        let mut calls = 0;
        let mut watch = |at| {
            assert_eq!(at, seen[calls]);
            calls += 1;
            if calls > last { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let error = load_obj(&path, &LoadOptions::default(), &mut watch).unwrap_err();
        assert!(matches!(error.fault, Fault::Stopped), "{error}");
        assert_eq!(calls, last + 1, "called again after it said to stop");
    }
}
