//! `raybalance compare` and `raybalance diff`: what they print and write.

use crate::folder::{Ended, Folder};
use serde_json::Value;
use std::fs;

/// A cube, every side of two triangles: less than that has no shadows and nothing to bounce off.
const CUBE: &str = "\
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8
";

/// An instant each round.
const SMALL: &str = "--quick --size 40x30 --spp 2 --devices cpu:1,cpu:1";

fn folder() -> Folder {
    let folder = Folder::new();
    fs::write(folder.at("cube.obj"), CUBE).unwrap();
    folder
}

fn succeeds(folder: &Folder, words: &str) -> Ended {
    let ended = folder.run(words);
    assert_eq!(ended.code, Some(0), "{words}: {ended:?}");
    ended
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

/// All that docs/report.md says of compare.json.
// Mutants: a round that is not counted in the file; a way without its rounds; another way first.
#[test]
fn a_comparison_measures_every_way_in_every_round() {
    let folder = folder();
    let ended = succeeds(&folder, &format!("compare cube.obj {SMALL} --repeat 4 --reference --json"));
    let file = json(&fs::read_to_string(folder.at("out/compare/compare.json")).unwrap());
    assert_eq!(json(&ended.out), file);
    assert_eq!((&file["schema"], &file["kind"]), (&1.into(), &"compare".into()));
    assert!(file["provenance"]["command"].as_str().unwrap().starts_with("raybalance compare cube.obj"));
    assert_eq!(file["scene"]["triangles"], 12);
    assert_eq!(
        (&file["size"], &file["samples"], &file["bounces"]),
        (&[40, 30].as_slice().into(), &2.into(), &1.into())
    );
    assert_eq!(file["seeds"], Value::from([2, 3, 4, 5].as_slice()));
    assert_eq!(file["devices"].as_array().unwrap().len(), 2);
    let ways = file["ways"].as_array().unwrap();
    assert_eq!((&ways[0]["queue"], &ways[0]["estimator"]), (&"hybrid".into(), &"auto".into()));
    assert!(ways.len() >= 10, "{}", ways.len());
    for way in ways {
        for times in ["trace_s", "picture_s"] {
            let times = way[times].as_array().unwrap();
            assert!(times.len() == 4 && times.iter().all(|time| time.as_f64().unwrap() > 0.0), "{way}");
        }
        assert!(way["excess"].is_f64() && way["imbalance"].is_f64() && way["overhead"].is_f64(), "{way}");
        assert!(["median", "low", "high", "confidence"].iter().all(|field| way["of_default"][field].is_f64()), "{way}");
        let kinds: Vec<&str> = way["streams"].as_array().unwrap().iter().map(|s| s["kind"].as_str().unwrap()).collect();
        // What leaves a convex body meets nothing.
        assert_eq!(kinds, ["primary", "shadow 0", "diffuse 0"]);
        let traced: f64 = way["streams"].as_array().unwrap().iter().map(|s| s["makespan_s"][0].as_f64().unwrap()).sum();
        assert!((traced / way["trace_s"][0].as_f64().unwrap() - 1.0).abs() < 1e-9);
    }
    let alone = file["alone"].as_array().unwrap();
    assert!(alone.len() == 1 && alone[0]["entry"] == "cpu:1" && alone[0]["trace_s"].as_array().unwrap().len() == 4);
    let verdict = &file["verdict"];
    let way = &ways[verdict["way"].as_u64().unwrap() as usize];
    assert!(
        ["queue", "policy", "estimator"].iter().all(|part| way[part] == verdict[part]) && way["later_frames"] == false
    );
    assert!(verdict["together"]["trace"]["median"].is_f64() && verdict["larger_than_noise"].is_boolean(), "{verdict}");
    assert!(verdict["sentences"].as_array().unwrap().len() >= 3);

    let csv = fs::read_to_string(folder.at("out/compare/compare.csv")).unwrap();
    assert!(csv.starts_with("# command: raybalance compare"), "{csv}");
    assert_eq!(csv.lines().filter(|line| !line.starts_with('#')).count(), 1 + ways.len() * 3 * 4);
    let page = fs::read_to_string(folder.at("out/compare/report.html")).unwrap();
    let sentence = verdict["sentences"][0].as_str().unwrap();
    assert!(page.contains(sentence) && page.contains("<svg role=\"img\""), "{sentence}");
}

/// Mutants: ways that were not asked for; a table wider than a terminal; verdict or command left out; an interval of
/// one round.
#[test]
fn a_comparison_of_what_is_named_fits_the_terminal() {
    let folder = folder();
    let ways =
        "--queue static,central --policy permuted-regions --estimator uniform,reduced-unshortened --fraction 1/4096";
    let ended = succeeds(&folder, &format!("compare cube.obj {SMALL} {ways} --repeat 3"));
    for part in ["permuted-regions", "reduced-unshortened 1/4096", "auto, later frames", "devices cpu:1,cpu:1"] {
        assert!(ended.out.contains(part), "`{part}` is to be in {}", ended.out);
    }
    assert!(!ended.out.contains("block") && ended.out.contains("These 2 devices together are"), "{}", ended.out);
    assert!(ended.out.contains("Use "), "{}", ended.out);
    let wide: Vec<&str> = ended.out.lines().filter(|line| line.chars().count() > 100).collect();
    assert!(wide.is_empty(), "{wide:#?}");
    let few = succeeds(&folder, &format!("compare cube.obj {SMALL} --repeat 1 --estimator uniform"));
    assert!(few.out.contains("1 round is too few") && !few.out.contains("%]"), "{}", few.out);
    let files =
        ["compare.md", "report.html"].map(|name| fs::read_to_string(folder.at("out/compare").join(name)).unwrap());
    assert!(files.iter().all(|text| text.contains("there are no intervals") && !text.contains("%]")));
}

/// Mutants: files told apart by their names; a difference of what must be the same not told.
#[test]
fn two_runs_are_set_side_by_side() {
    let folder = folder();
    let small = "--size 16x12 --spp 2 --devices cpu:1,cpu:1";
    succeeds(&folder, &format!("render cube.obj {small} --out a"));
    succeeds(&folder, &format!("render cube.obj {small} --queue static --policy block --out b"));
    succeeds(&folder, &format!("render cube.obj {small} --seed 2 --out c"));
    let ended = succeeds(&folder, "diff a/report.json b/report.json");
    for part in ["A: a/report.json", "Same scene", "queue", "static", "block", "primary", "B/A", "total"] {
        assert!(ended.out.contains(part), "`{part}` is to be in {}", ended.out);
    }
    assert!(ended.out.lines().all(|line| line.chars().count() <= 100), "{}", ended.out);
    let diff = json(&succeeds(&folder, "diff a/report.json b/report.json --json").out);
    assert_eq!((&diff["kind"], &diff["not_comparable"]), (&"render".into(), &Value::Array(Vec::new())));
    assert!(diff["rows"].as_array().unwrap().iter().all(|row| row["ratio"].as_f64().unwrap() > 0.0), "{diff}");
    let other = succeeds(&folder, "diff a/report.json c/report.json");
    assert!(other.out.contains("Not comparable") && other.out.contains("other seed: 1, and 2"), "{}", other.out);

    succeeds(&folder, &format!("compare cube.obj {SMALL} --repeat 1 --estimator uniform"));
    let compared = succeeds(&folder, "diff out/compare/compare.json out/compare/compare.json");
    assert!(compared.out.contains("hybrid, lpt, uniform") && compared.out.contains("1.000"), "{}", compared.out);

    fs::write(folder.at("old.json"), r#"{ "schema": 1, "streams": [], "seconds": {} }"#).unwrap();
    for (words, part) in [
        ("diff a/report.json missing.json", "cannot read `missing.json`"),
        ("diff a/report.json cube.obj", "`cube.obj`: it is no JSON"),
        ("diff a/report.json a/trace.json", "has no `schema`"),
        ("diff old.json a/report.json", "`schema` is 1, of an older program"),
        ("diff a/report.json out/compare/compare.json", "is of `compare`"),
    ] {
        let ended = folder.run(words);
        assert!(ended.code == Some(1) && ended.err.contains(part), "`{part}` is to be in {words}: {ended:?}");
    }
}
