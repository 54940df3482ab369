//! What ARCHITECTURE.md says of the crates: its diagram, its table and its three prohibitions, as cargo sees them.
//!
//! The diagram is the one list of levels: a line that begins with `L3` names the crates of level 3. Dependencies of
//! tests may lead anywhere.

use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Packages that serve the workspace and are nobody's dependency but each other's: tests, benchmarks, automation.
const SERVANTS: [&str; 5] = ["fuzz-cases", "real-scenes", "rt-benches", "rt-tests", "xtask"];

/// A package of the workspace.
#[derive(Debug)]
struct Package {
    /// Relative to the repository.
    folder: String,
    /// The packages of the workspace that it is built from, optional ones too.
    uses: BTreeSet<String>,
    /// The same of others.
    others: BTreeSet<String>,
    /// Whether somebody else may build on it.
    is_public: bool,
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("this package lies in the repository's root")
}

fn cargo(arguments: &[&str]) -> Vec<u8> {
    let output =
        Command::new(env!("CARGO")).args(arguments).current_dir(root()).output().expect("cargo runs the tests");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output.stdout
}

fn workspace() -> BTreeMap<String, Package> {
    let metadata = cargo(&["metadata", "--offline", "--no-deps", "--format-version", "1"]);
    let metadata: Value = serde_json::from_slice(&metadata).expect("cargo writes JSON");
    let packages = metadata["packages"].as_array().expect("packages");
    let text = |value: &Value| value.as_str().expect("a string").to_owned();
    let package = |package: &Value| {
        let manifest = text(&package["manifest_path"]);
        let folder = Path::new(&manifest).parent().and_then(|folder| folder.strip_prefix(root()).ok());
        let dependencies = package["dependencies"].as_array().expect("dependencies").iter();
        let built_from = dependencies.filter(|used| used["kind"] != "dev");
        let (ours, others): (Vec<&Value>, Vec<&Value>) = built_from.partition(|used| !used["path"].is_null());
        let names = |used: Vec<&Value>| used.into_iter().map(|used| text(&used["name"])).collect();
        let folder = folder.expect("below the root").to_string_lossy().into_owned();
        let is_public = package["publish"].is_null();
        (text(&package["name"]), Package { folder, uses: names(ours), others: names(others), is_public })
    };
    packages.iter().map(package).collect()
}

/// All that a package is built from.
fn closure<'a>(packages: &'a BTreeMap<String, Package>, name: &str) -> BTreeSet<&'a str> {
    let mut all = BTreeSet::new();
    let mut open: Vec<&str> = packages[name].uses.iter().map(String::as_str).collect();
    while let Some(used) = open.pop() {
        if all.insert(used) {
            open.extend(packages[used].uses.iter().map(String::as_str));
        }
    }
    all
}

/// The crates of the diagram with their levels.
fn levels(page: &str, packages: &BTreeMap<String, Package>) -> BTreeMap<String, u32> {
    let mut levels = BTreeMap::new();
    for line in page.lines() {
        let mut words = line.split_whitespace();
        let Some(level) = words.next().and_then(|word| word.strip_prefix('L')?.parse().ok()) else { continue };
        for name in words.take_while(|word| packages.contains_key(*word)) {
            assert_eq!(levels.insert(name.to_owned(), level), None, "{name} is in the diagram twice");
        }
    }
    levels
}

fn page() -> String {
    read(&root().join("ARCHITECTURE.md"))
}

/// Every crate is in the diagram, and uses only crates of lower levels. Fails when a crate gets a dependency on its own
/// level or above, or is forgotten in the diagram.
#[test]
fn the_diagram_is_true() {
    let packages = workspace();
    let levels = levels(&page(), &packages);
    let servant = |name: &str| SERVANTS.contains(&name);
    for (name, package) in packages.iter().filter(|(name, _)| !servant(name)) {
        let level = *levels.get(name).unwrap_or_else(|| panic!("the diagram does not name {name}"));
        for used in &package.uses {
            assert!(!servant(used), "{name} is built from {used}, which is for tests");
            assert!(levels[used] < level, "{name} of L{level} uses {used} of L{}", levels[used]);
        }
    }
    assert!(SERVANTS.iter().all(|name| packages.contains_key(*name) && !levels.contains_key(*name)));
}

/// Fails when a package is added without a word on what it is for.
#[test]
fn the_table_names_every_folder() {
    let page = page();
    for (name, Package { folder, .. }) in workspace() {
        let named = page.lines().any(|line| line.starts_with('|') && line.contains(&format!("`{folder}`")));
        assert!(named, "the table does not name {name} in `{folder}`");
    }
}

/// Fails when one of the three is given a dependency that it must not have, also through another crate.
#[test]
fn the_prohibitions_hold() {
    let packages = workspace();
    assert_eq!(closure(&packages, "rt-core"), BTreeSet::new(), "rt-core knows nobody");
    assert_eq!(closure(&packages, "rt-sched"), BTreeSet::from(["rt-core"]), "rt-sched knows no device");
    let devices: Vec<&str> = packages.keys().map(String::as_str).filter(|name| name.starts_with("backend-")).collect();
    assert!(devices.len() >= 3, "{devices:?}");
    for device in devices.into_iter().chain(["rt-gpu", "rt-shaders"]) {
        let known = closure(&packages, device);
        assert!(!known.contains("rt-sched") && !known.contains("rt-balance"), "{device} knows a scheduler: {known:?}");
    }
}

/// The largest share that one crate may have of the workspace's lines of Rust.
const LARGEST_SHARE: f64 = 0.15;

/// Most lines of the command, without its tests: it holds arguments, and calls of what is below.
const COMMAND_LINES: usize = 2_500;

/// The files below a folder of the repository that end so, but for what is built or set up.
fn files(folder: &Path, endings: &[&str]) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("the repository can be read") {
        let path = entry.expect("the repository can be read").path();
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        if path.is_dir() {
            if !name.starts_with('.') && !["target", "out"].contains(&name) {
                found.extend(files(&path, endings));
            }
        } else if endings.iter().any(|ending| name.ends_with(ending)) {
            found.push(path);
        }
    }
    found
}

fn read(file: &Path) -> String {
    fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()))
}

fn lines(folder: &Path) -> usize {
    files(folder, &[".rs"]).iter().map(|file| read(file).lines().count()).sum()
}

/// Fails when one crate grows into the room that holds everything, or the command gets what libraries should have.
#[test]
fn no_crate_outgrows_the_others() {
    let sizes: BTreeMap<String, usize> =
        workspace().into_iter().map(|(name, Package { folder, .. })| (name, lines(&root().join(folder)))).collect();
    // A package that lies in another's folder is counted twice, which makes shares smaller by next to nothing.
    let total: usize = sizes.values().sum();
    for (name, size) in &sizes {
        let share = *size as f64 / total as f64;
        assert!(share <= LARGEST_SHARE, "{name} has {size} of {total} lines, {:.1}%", 100.0 * share);
    }
    let command = lines(&root().join("crates/rt-cli/src"));
    assert!(command < COMMAND_LINES, "the command has {command} lines");
}

/// Whoever builds on a crate can match its errors. Fails when a public crate is given errors without a type, or uses a
/// package that is not public.
#[test]
fn public_crates_have_errors_of_their_own_types() {
    let packages = workspace();
    let public: Vec<(&String, &Package)> = packages.iter().filter(|(_, package)| package.is_public).collect();
    assert!(public.len() >= 10 && public.iter().any(|(name, _)| *name == "rt-balance"), "{public:?}");
    for (name, Package { uses, others, .. }) in public {
        assert!(!others.contains("anyhow"), "{name} uses anyhow");
        assert!(uses.iter().all(|used| packages[used].is_public), "{name} uses what is not public: {uses:?}");
    }
}

/// The crates that a package is built from, itself among them, by such edges of cargo's: names and versions.
fn linked(package: &str, edges: &str) -> BTreeSet<String> {
    let arguments =
        ["tree", "--offline", "--package", package, "--edges", edges, "--prefix", "none", "--format", "{p}"];
    let text = String::from_utf8_lossy(&cargo(&arguments)).into_owned();
    let crates = text.lines().filter(|line| !line.is_empty());
    crates.map(|line| line.split_whitespace().take(2).collect::<Vec<_>>().join(" ")).collect()
}

/// Whoever embeds the default facade builds few crates, what their builds need among them.
#[test]
fn the_facade_is_small() {
    const MOST: usize = 35;
    let crates = linked("rt-balance", "normal,build");
    assert!((10..=MOST).contains(&crates.len()), "{} crates: {crates:?}", crates.len());
}

/// Vulkan devices are not wgpu's in disguise. Fails when backend-vulkan gets wgpu as a dependency, also through
/// another.
#[test]
fn the_vulkan_backend_links_no_wgpu() {
    let has = |package: &str, prefix: &str| linked(package, "normal").iter().any(|name| name.starts_with(prefix));
    assert!(has("backend-vulkan", "ash") && !has("backend-vulkan", "wgpu") && !has("backend-vulkan", "naga"));
    // The question can be answered with yes.
    assert!(has("backend-wgpu", "wgpu"));
}

/// What measures chooses estimators, policies and queues from the catalogue, and reads the driver's clock. Fails when
/// an experiment makes one by itself: that is how second lists begin.
#[test]
fn measuring_code_has_no_list_of_its_own() {
    for file in
        ["crates/rt-lab/src", "crates/rt-cli/src", "xtask/src"].iter().flat_map(|f| files(&root().join(f), &[".rs"]))
    {
        let text = read(&file);
        for line in text.lines() {
            for module in ["estimate", "policy", "queue"] {
                let named = line.split_once(&format!("rt_sched::{module}::")).map(|(_, name)| name);
                // Functions are free: what is estimated may be judged by whatever is there.
                let is_free = named.is_none_or(|name| name.starts_with(|c: char| c.is_ascii_lowercase()));
                assert!(is_free, "{}: `{line}`: choose it from rt_balance::catalogue", file.display());
            }
            assert!(!line.contains("rt_verify::clock"), "{}: `{line}`: there is rt_balance::clock", file.display());
        }
    }
}
