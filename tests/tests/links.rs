//! What backends link.

use std::process::Command;

/// Names of the packages that are linked into `package`.
fn linked(package: &str) -> Vec<String> {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["tree", "--offline", "--edges", "normal", "--prefix", "none", "--format", "{p}", "--package", package]);
    let output = cargo.current_dir(env!("CARGO_MANIFEST_DIR")).output().expect("cargo runs the tests");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    text.lines().filter_map(|line| line.split_whitespace().next()).map(str::to_owned).collect()
}

/// Vulkan devices are not wgpu's in disguise. Fails when backend-vulkan gets wgpu as a dependency, also through another.
#[test]
fn the_vulkan_backend_links_no_wgpu() {
    let has = |package: &str, prefix: &str| linked(package).iter().any(|name| name.starts_with(prefix));
    assert!(has("backend-vulkan", "ash") && !has("backend-vulkan", "wgpu") && !has("backend-vulkan", "naga"));
    // The question can be answered with yes.
    assert!(has("backend-wgpu", "wgpu"));
}
