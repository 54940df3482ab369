//! Replays the corpus: seeds, and every input that once broke something.

use fuzz_cases::CASES;
use std::collections::BTreeSet;
use std::path::Path;

#[test]
fn the_corpus_breaks_nothing() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus");
    for (name, case) in CASES {
        let folder = corpus.join(name);
        let entries = std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
        let mut inputs = 0;
        for entry in entries {
            let path = entry.expect("readable").path();
            // Shown by the test runner if the case panics.
            println!("{}", path.display());
            case(&std::fs::read(&path).expect("readable"));
            inputs += 1;
        }
        assert!(inputs > 0, "{} is empty", folder.display());
    }
}

/// Mutant: a case without its program, or a program that cargo does not build.
#[test]
fn every_case_has_its_program() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz");
    let cases: BTreeSet<String> = CASES.iter().map(|&(name, _)| name.to_owned()).collect();
    let files = std::fs::read_dir(folder.join("fuzz_targets")).expect("the programs");
    let stem = |path: &Path| path.file_stem().expect("a name").to_string_lossy().into_owned();
    assert_eq!(cases, files.map(|file| stem(&file.expect("readable").path())).collect());
    let manifest = std::fs::read_to_string(folder.join("Cargo.toml")).expect("the manifest");
    let paths = manifest.lines().filter_map(|line| line.strip_prefix("path = \"fuzz_targets/"));
    assert_eq!(cases, paths.map(|path| path.trim_end_matches(".rs\"").to_owned()).collect());
}
