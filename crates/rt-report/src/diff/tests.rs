use super::*;
use serde_json::{Value, json};
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

fn stream(kind: &str, frame: u32, makespan_s: f64, bound_s: Option<f64>) -> Value {
    json!({
        "kind": kind, "frame": frame, "wave": 0, "rays": 1000, "makespan_s": makespan_s, "imbalance": 0.25,
        "lower_bound_s": bound_s, "estimate": { "estimator": "auto" },
        "devices": [{ "name": "CPU 0", "busy_s": 0.5 }, { "name": "CPU 1", "busy_s": 0.25 }],
    })
}

fn report() -> Value {
    json!({
        "schema": SCHEMA, "queue": "hybrid", "policy": "lpt",
        "scene": { "source": "/a/room.obj", "triangles": 12, "builder": "sah", "precision": "robust" },
        "streams": [stream("primary", 0, 1.0, Some(0.8)), stream("shadow 0", 0, 2.0, None), stream("primary", 1, 3.0, Some(3.2))],
        "seconds": { "load": 0.5, "trace": 4.0, "total": 6.0 },
        "provenance": {
            "seed": 1, "devices": ["CPU 0", "CPU 1"], "commit": "abc", "command": "raybalance render room.obj",
            "machine": { "processor": "P", "build": "release" },
        },
    })
}

/// A folder with files of these names.
fn folder(files: &[(&str, &Value)]) -> (TempDir, Vec<PathBuf>) {
    let dir = tempfile::tempdir().unwrap();
    let write = |(name, value): &(&str, &Value)| {
        let path = dir.path().join(name);
        fs::write(&path, value.to_string()).unwrap();
        path
    };
    let paths = files.iter().map(write).collect();
    (dir, paths)
}

fn diff(one: &Value, other: &Value) -> Result<Diff, ReportError> {
    let (_dir, paths) = folder(&[("a.json", one), ("b.json", other)]);
    Diff::of(&paths[0], &paths[1])
}

/// Mutants: frames of a kind not summed up; a bound of some of them; the ratio upside down; devices by place.
#[test]
fn seconds_are_summed_by_kind_and_set_side_by_side() {
    let mut other = report();
    other["streams"][1]["makespan_s"] = json!(1.0);
    other["streams"][1]["devices"][1]["busy_s"] = json!(1.25);
    other["seconds"]["trace"] = json!(3.0);
    other["queue"] = json!("static");
    other["scene"]["source"] = json!("elsewhere/room.obj");
    let diff = diff(&report(), &other).unwrap();
    assert!(diff.not_comparable.is_empty(), "{diff:?}");
    assert_eq!(
        diff.differing,
        [Difference { what: "queue".to_owned(), values: [Some("hybrid".to_owned()), Some("static".to_owned())] }]
    );
    let [primary, shadow] = &diff.rows[..] else { panic!("{diff:?}") };
    assert_eq!(primary.pair.seconds, [Some(4.0), Some(4.0)]);
    assert_eq!((primary.excess, primary.imbalance[0]), ([Some(0.0); 2], Some(0.25)));
    assert_eq!((shadow.pair.ratio, shadow.excess), (Some(0.5), [None; 2]));
    assert_eq!(diff.devices[1].seconds, [Some(0.75), Some(1.75)]);
    assert_eq!(diff.stages[1].ratio, Some(0.75));
    let text = diff.to_string();
    assert!(
        text.contains("Same scene, picture and seed") && text.contains("hybrid") && text.contains("0.500"),
        "{text}"
    );
}

/// Mutants: any of what must be the same left out; ratios of what is not comparable.
#[test]
fn what_is_not_comparable_is_said() {
    let changes = [
        ("/scene/source", json!("other.obj"), "other scene: room.obj, and other.obj"),
        ("/scene/triangles", json!(13), "other number of triangles: 12, and 13"),
        ("/provenance/seed", json!(2), "other seed: 1, and 2"),
        ("/scene/precision", json!("fast"), "other precision"),
        ("/streams/1/rays", json!(999), "other streams: 2000 primary, 1000 shadow 0, and 2000 primary, 999 shadow 0"),
    ];
    for (place, value, reason) in changes {
        let mut other = report();
        *other.pointer_mut(place).unwrap() = value;
        let diff = diff(&report(), &other).unwrap();
        assert!(diff.not_comparable[0].starts_with(reason), "{diff:?}");
        assert!(diff.rows.iter().all(|row| row.pair.ratio.is_none()) && diff.stages[0].ratio.is_none());
        assert!(diff.to_string().contains("Not comparable"));
    }
    let mut sized = [report(), report()];
    sized[0]["size"] = json!([8, 8]);
    assert!(diff(&sized[0], &sized[1]).unwrap().not_comparable.is_empty(), "one of them does not tell");
    sized[1]["size"] = json!([8, 9]);
    assert_eq!(diff(&sized[0], &sized[1]).unwrap().not_comparable, ["other size: 8, 8, and 8, 9"]);
}

/// Mutants: a field that is missing or of another kind taken for 0; a schema that nobody looks at.
#[test]
fn bad_files_are_named_with_the_field() {
    let without = |place: &str, field: &str| {
        let mut report = report();
        report.pointer_mut(place).unwrap().as_object_mut().unwrap().remove(field);
        report
    };
    let with = |place: &str, value: Value| {
        let mut report = report();
        *report.pointer_mut(place).unwrap() = value;
        report
    };
    let cases = [
        (without("", "schema"), "has no `schema`: name a report.json"),
        (with("/schema", json!(1)), "`schema` is 1, of an older program, and this one reads 2"),
        (with("/schema", json!(9)), "`schema` is 9, of a newer program"),
        (with("/schema", json!("two")), "`schema` is no number"),
        (without("/streams/1", "makespan_s"), "`streams[1].makespan_s` is missing"),
        (with("/streams/1/makespan_s", json!("long")), "`streams[1].makespan_s` is no number"),
        (with("/streams", json!({})), "`streams` is no list"),
        (without("/streams/2/devices/0", "name"), "`streams[2].devices[0].name` is missing"),
        (without("", "seconds"), "`seconds` is missing"),
        (json!({ "schema": 2, "results": [] }), "has neither `streams` nor `seconds`"),
        (json!({ "schema": 1, "kind": "compare" }), "is of `compare`, and the first file of `render`"),
        (json!([1]), "has no `schema`"),
    ];
    for (bad, message) in cases {
        let error = diff(&report(), &bad).unwrap_err().to_string();
        assert!(error.contains("b.json`") && error.contains(message), "`{message}` is to be in {error}");
    }
    let (dir, paths) = folder(&[("a.json", &report())]);
    let text = dir.path().join("image.png");
    fs::write(&text, "no JSON").unwrap();
    let error = Diff::of(&paths[0], &text).unwrap_err().to_string();
    assert!(error.contains("image.png") && error.contains("no JSON"), "{error}");
    assert!(matches!(Diff::of(&dir.path().join("none"), &paths[0]), Err(ReportError::Read { .. })));
}

/// Mutants: ways matched by place; a way that one comparison lacks left out.
#[test]
fn comparisons_are_set_side_by_side_by_way() {
    let comparison = |ways: &[(&str, bool, f64)]| {
        let way = |(queue, later, seconds): &(&str, bool, f64)| {
            json!({
                "queue": queue, "policy": "lpt", "estimator": "auto", "later_frames": later,
                "trace": { "median": seconds }, "imbalance": 0.0, "excess": null,
            })
        };
        let ways: Vec<Value> = ways.iter().map(way).collect();
        json!({ "schema": 1, "kind": "compare", "prepare_s": 1.0, "setup_s": 0.5, "ways": ways, "alone": [] })
    };
    let one = comparison(&[("hybrid", false, 2.0), ("hybrid", true, 1.0)]);
    let other = comparison(&[("static", false, 9.0), ("hybrid", true, 3.0), ("hybrid", false, 1.0)]);
    let diff = diff(&one, &other).unwrap();
    let found: Vec<_> = diff.rows.iter().map(|row| (row.pair.what.as_str(), row.pair.ratio)).collect();
    assert_eq!(
        found,
        [("hybrid, lpt, auto", Some(0.5)), ("hybrid, lpt, auto, later frames", Some(3.0)), ("static, lpt, auto", None)]
    );
}

/// Lines of tables fit a terminal of 100 columns, however long names are.
#[test]
fn tables_fit_a_terminal() {
    let mut other = report();
    for place in ["/queue", "/provenance/command", "/streams/0/devices/0/name"] {
        *other.pointer_mut(place).unwrap() = json!("x".repeat(300));
    }
    let text = diff(&report(), &other).unwrap().to_string();
    let tables = text.lines().filter(|line| line.starts_with("  "));
    assert!(tables.clone().all(|line| line.chars().count() <= 100), "{text}");
}
