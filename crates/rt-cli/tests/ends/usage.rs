//! Whatever is wrong with a command line ends in exit code 2, whoever finds it, with a message that names it, before
//! any work.

use crate::folder::{self, Folder, SMALL};

/// Wrong for every machine: the words, and what the message must contain.
const WRONG: &[(&str, &str)] = &[
    ("nonsense", "nonsense"),
    ("render scene.obj --nonsense", "--nonsense"),
    ("render scene.obj other.obj", "other.obj"),
    ("render nothing", "yard, car"),
    ("render scene.obj --devices cpu:0", "cpu:0"),
    ("render scene.obj --devices cuda:0", "cuda:0"),
    ("render scene.obj --devices cpu:1,", "backend"),
    ("render scene.obj --devices cpu:1@0", "speed"),
    ("render scene.obj --devices cpu:1@1e-300", "speed"),
    ("render scene.obj --devices cpu:1,cpu:1@1e-6", "cpu:1@1e-6"),
    ("render scene.obj --devices cpu:1@-1", "speed"),
    ("render scene.obj --devices cpu:1@nan", "speed"),
    ("render scene.obj --devices cpu:1@2", "speed"),
    ("render scene.obj --devices vulkan", "vulkan:0"),
    ("render scene.obj --fov 0", "--fov"),
    ("render scene.obj --fov 180", "--fov"),
    ("render scene.obj --fov -40", "--fov"),
    ("render scene.obj --fov nan", "--fov"),
    ("render scene.obj --devices cpu:1 --eye 1,1,1 --target 1,1,1", "--eye"),
    ("render scene.obj --devices cpu:1 --eye 0,0,1 --target 0,0,0 --up 0,0,1", "--up"),
    ("render scene.obj --eye 1,2", "--eye"),
    ("render scene.obj --frames 0", "--frames"),
    ("render scene.obj --frames 8..8", "8..16"),
    ("render scene.obj --camera path.tsv", "--frames"),
    ("render scene.obj --frames 4 --camera path.tsv --eye 1,2,3", "--eye"),
    ("render scene.obj --shard 1/2", "--frames"),
    ("render scene.obj --frames 4 --shard 3/2", "8/8"),
    ("render scene.obj --frames 4 --shard 1/2 --reference", "--reference"),
    ("render scene.obj --frames 4 --emit hq", "--shards"),
    ("render scene.obj --frames 4 --emit sge --shards 2", "slurm, hq, parallel"),
    ("render scene.obj --frames 4 --shards 2", "--emit"),
    ("render nothing --frames 4 --emit hq --shards 2", "yard, car"),
    ("render scene.obj --size 0x8", "--size"),
    ("render scene.obj --spp 0", "--spp"),
    ("render yard --wind", "--frames"),
    ("render yard --frames 1 --wind", "--frames 2"),
    ("render yard --frames 2 --wind=0", "a fresh breeze"),
    ("render scene.obj --frames 2 --wind", "scene.obj"),
    ("render scene.obj --memory 1K", "--memory"),
    ("render scene.obj --tasks 0", "--tasks"),
    ("render scene.obj --tasks 4 --task-size 4", "--task-size"),
    ("render scene.obj --queue central --policy none", "--policy"),
    ("render scene.obj --fraction 1/64", "--fraction"),
    ("render scene.obj --estimator uniform --fraction 1/64", "--fraction"),
    ("render scene.obj --estimator exact --fraction 2", "--fraction"),
    ("render scene.obj --budget 0.01", "--budget"),
    ("render scene.obj --estimator exact --reduced leaf", "--reduced"),
    ("render scene.obj --devices cpu:1 --layout wide", "--layout"),
    ("render scene.obj --devices cpu:1 --persistent 64", "--persistent"),
    ("render scene.obj --devices vulkan:0 --isa portable", "--isa"),
    ("render scene.obj --explain --json", "--explain"),
    ("compare scene.obj --devices cpu:1 --layout two", "--layout"),
    ("bench scene.obj --devices vulkan:0 --isa avx2", "--isa"),
    ("render scene.obj --builder oak", "--builder"),
    ("render scene.obj --precision half", "--precision"),
    ("render scene.obj --out scene.obj", "--out"),
    ("render scene.obj --out scene.obj/out", "--out"),
    ("trace scene.obj --rays rays.npy", "--hits"),
    ("trace scene.obj --hits hits.npy", "--rays"),
    ("trace nothing --rays rays.npy --hits hits.npy", "yard, car"),
    ("trace scene.obj --rays rays.npy --hits hits.npy --devices cpu:0", "cpu:0"),
    ("trace scene.obj --rays rays.npy --hits hits.npy --fraction 1/64", "--fraction"),
    ("trace scene.obj --rays rays.npy --hits hits.npy --counts hits.npy", "--hits and --counts"),
    ("trace scene.obj --rays rays.npy --hits rays.npy", "the rays"),
    ("trace scene.obj --rays rays.npy --hits scene.obj", "the scene"),
    ("trace scene.obj --rays rays.npy --hits hits.npy --counts ./scene.obj", "the scene"),
    ("trace scene.obj --rays rays.npy --hits .", "folder"),
    ("trace scene.obj --rays rays.npy --hits scene.obj/hits.npy", "folder"),
    ("trace scene.obj --rays rays.npy --hits hits.npy/", "folder"),
    ("compare", "SCENE"),
    ("compare scene.obj --devices cpu:0", "cpu:0"),
    ("compare scene.obj --queue static,stack", "stack"),
    ("compare scene.obj --estimator uniform --fraction 1/64", "--fraction"),
    ("compare scene.obj --tasks 4 --task-size 4", "--task-size"),
    ("compare scene.obj --repeat 0", "--repeat"),
    ("compare scene.obj --runs 3", "--runs"),
    ("compare scene.obj --out scene.obj", "--out"),
    ("diff report.json", "AFTER"),
    ("tradeoff build scene.obj --runs 3", "--runs"),
    ("verify scene.obj --backend cpu", "--backend"),
    ("figure1 scene.obj --devices cpu:0", "cpu:0"),
    ("figure1 scene.obj --task-sizes 64,64", "--task-sizes"),
    ("figure1 scene.obj --task-sizes 0", "--task-sizes"),
    ("figure1 scene.obj --replay 3 --devices cpu:1,cpu:1", "--replay"),
    ("figure1 scene.obj --fraction 1/64", "--fraction"),
    ("figure1 scene.obj --repeat 0", "--repeat"),
    ("figure1 scene.obj --out scene.obj", "--out"),
    ("figure1 nothing --quick --devices cpu:1", "yard, car"),
    ("simulate scene.obj --devices 0", "--devices"),
    ("simulate scene.obj --speeds 1,0", "--speeds"),
    ("simulate scene.obj --nodes 0", "--nodes"),
    ("simulate scene.obj --from report.json", "--from"),
    ("simulate scene.obj --out scene.obj", "--out"),
    ("simulate nothing --devices 2", "yard, car"),
    ("tradeoff scene.obj --devices cpu:0", "cpu:0"),
    ("tradeoff scene.obj --out scene.obj", "--out"),
    ("tradeoff build scene.obj --devices cpu:1,cpu:1", "one device"),
    ("tradeoff sampling scene.obj --devices cuda:0", "cuda:0"),
    ("tradeoff sampling scene.obj ./scene.obj --devices cpu:1", "sampling-scene.svg"),
    ("tradeoff layout scene.obj --devices cpu:1", "name a graphics card"),
    ("tradeoff precision scene.obj --devices cpu:1@3", "speed"),
    ("tradeoff precision scene.obj --out scene.obj", "--out"),
    ("tradeoff nonsense --size 8", "--size"),
    ("verify --devices cpu:0", "cpu:0"),
    ("verify --case nonsense", "nonsense"),
    ("verify --quick --full", "--full"),
    ("verify nothing --case ties", "yard, car"),
    ("bench scene.obj --devices cpu:0", "cpu:0"),
    ("bench scene.obj --quick --repeat 3", "--repeat"),
    ("bench scene.obj --out .", "--out"),
    ("bench scene.obj --out scene.obj", "the scene"),
    ("bench scene.obj --out cameras.tsv", "the cameras"),
    ("bench nothing --quick --devices cpu:1", "yard, car"),
    ("devices --devices cpu:1", "--devices"),
    ("scenes yard", "yard"),
];

// Mutant: any one of these errors made without `usage` or `or_usage`.
#[test]
fn wrong_usage_is_2_and_says_what_is_wrong() {
    let folder = Folder::new();
    std::fs::write(folder.at("cameras.tsv"), "").unwrap();
    let before = folder.names();
    for (words, part) in WRONG {
        let ended = folder.run(words);
        assert!(ended.code == Some(2) && ended.err.contains(part), "`{part}` is to be in {words}: {ended:?}");
        assert!(ended.err.starts_with("error: ") && ended.out.is_empty(), "{words}: {ended:?}");
        assert_eq!(folder.names(), before, "{words}");
    }
    assert_eq!(std::fs::read_to_string(folder.at("scene.obj")).unwrap(), folder::SCENE);
}

/// The central queue takes any policy that puts all tasks in an order: that is what it needs (`QueueMaker::needs`), and
/// `lpt` over the mean device is the paper's central queue with costs. It was wrong usage while queues named their
/// policies; `none`, which has no order, still is (above).
// Mutants: a central queue that needs nothing, so that a policy is refused; one that forgets the policy.
#[test]
fn a_policy_goes_with_every_queue_that_can_use_it() {
    let folder = Folder::new();
    for policy in ["lpt", "block"] {
        let ended = folder.run(&format!("render scene.obj {} --queue central --policy {policy}", SMALL.join(" ")));
        assert_eq!(ended.code, Some(0), "{ended:?}");
        let report: serde_json::Value =
            serde_json::from_slice(&std::fs::read(folder.at("out/report.json")).unwrap()).unwrap();
        assert_eq!((&report["queue"], &report["policy"]), (&"central".into(), &policy.into()));
    }
}

/// What switches something on in a backend: 1 or 0. Whatever the command, and whether it uses the backend or not.
// Mutants: `check_environment` not called; one of the backends left out of it.
#[test]
fn environment_variables_are_right_or_refused_by_name() {
    let folder = Folder::new();
    for variable in ["RAYBALANCE_WGPU_TRUSTED", "RAYBALANCE_VULKAN_VALIDATION"] {
        for (value, code) in [("yes", 2), ("2", 2), (" 1", 2), ("on", 2), ("", 0), ("0", 0)] {
            for words in ["scenes", "render scene.obj --size 8x8 --spp 1 --bounces 0 --devices cpu:1"] {
                let mut command = folder.raybalance();
                let ended = command.args(words.split_whitespace()).env(variable, value).output().unwrap();
                let ended = folder::Ended::of(ended);
                assert_eq!(ended.code, Some(code), "{variable}={value} {words}: {ended:?}");
                let is_named = ended.err.contains(variable) && ended.err.contains(&format!("`{value}`"));
                assert_eq!(is_named, code == 2, "{variable}={value} {words}: {ended:?}");
            }
        }
    }
}

/// Whether the command has them is the build's choice; what it says is the peers' own.
// Mutant: lists that know no peers.
#[test]
fn peers_are_had_or_said_how() {
    let folder = Folder::new();
    for backend in backend_peers::backends() {
        for (which, code) in [("1", 1), ("0", 2)] {
            let ended = folder.run(&format!("bench missing.obj --devices {}:{which}", backend.name()));
            match backend.check(Some(which)) {
                Ok(()) => assert_eq!(ended.code, Some(code), "{ended:?}"),
                Err(why) => assert!(ended.code == Some(2) && ended.err.contains(&why.to_string()), "{why}: {ended:?}"),
            }
        }
    }
}

/// Right as words, but not to be had here: the command fails, it was not used wrongly.
#[test]
fn what_is_not_to_be_had_is_1() {
    let folder = Folder::new();
    std::fs::write(folder.at("empty.npy"), "").unwrap();
    for (words, part) in [
        ("render missing.obj", "missing.obj"),
        ("render .", "directory"),
        ("render scene.obj --size 8x8 --devices vulkan:999", "--devices"),
        ("trace scene.obj --rays missing.npy --hits hits.npy", "missing.npy"),
        ("trace scene.obj --rays . --hits hits.npy", "directory"),
        ("trace scene.obj --rays empty.npy --hits hits.npy", "np.save"),
        ("trace scene.obj --rays scene.obj --hits hits.npy", "np.save"),
        ("verify missing.obj", "missing.obj"),
        ("bench missing.obj --devices cpu:1", "missing.obj"),
        ("compare missing.obj --quick --devices cpu:1", "missing.obj"),
        ("compare scene.obj --quick --devices cpu:1,vulkan:999", "--devices"),
        ("diff missing.json scene.obj", "missing.json"),
        ("figure1 missing.obj --quick --devices cpu:1", "missing.obj"),
        ("simulate missing.obj --devices 2", "missing.obj"),
        ("simulate --from missing.json", "missing.json"),
        ("simulate --from scene.obj", "scene.obj is no report.json"),
        ("tradeoff build missing.obj --quick", "missing.obj"),
    ] {
        let ended = folder.run(words);
        assert!(ended.code == Some(1) && ended.err.contains(part), "`{part}` is to be in {words}: {ended:?}");
    }
    assert_eq!(folder.names(), ["empty.npy", "rays.npy", "scene.obj"]);
}

#[test]
fn help_lists_the_exit_codes() {
    let folder = Folder::new();
    for words in ["--help", "-h", "verify --help"] {
        let ended = folder.run(words);
        assert!(ended.code == Some(0) && ended.out.contains("2 wrong usage"), "{words}: {ended:?}");
    }
}
