//! What cargo says about this workspace.

use crate::command::{cargo, root};
use anyhow::{Context, Result, bail};
use serde_json::Value;
use std::path::PathBuf;
use std::process::Command;

/// Package of the facade, whose features choose the backends.
pub(crate) const FACADE: &str = "rt-balance";

/// The packages of the workspace.
pub(crate) struct Packages {
    all: Vec<Value>,
    /// Where cargo builds.
    target: PathBuf,
}

impl Packages {
    /// Asks cargo, so that nothing here needs a list of its own that could be forgotten.
    pub(crate) fn read() -> Result<Self> {
        let output = cargo("metadata --no-deps --format-version 1").output().context("cannot start cargo metadata")?;
        if !output.status.success() {
            bail!("cargo metadata failed:\n{}", String::from_utf8_lossy(&output.stderr));
        }
        let mut metadata: Value = serde_json::from_slice(&output.stdout).context("cargo metadata wrote no JSON")?;
        let target = metadata["target_directory"].as_str().context("cargo metadata names no target folder")?.into();
        match metadata["packages"].take() {
            Value::Array(all) => Ok(Self { all, target }),
            _ => bail!("cargo metadata names no packages"),
        }
    }

    /// A program that `cargo test --workspace` builds on its way. `cargo run` would choose features for one package
    /// alone, and build most of the workspace once more.
    pub(crate) fn built(&self, program: &str) -> Command {
        let file = format!("{program}{}", std::env::consts::EXE_SUFFIX);
        let mut command = Command::new(self.target.join("debug").join(file));
        command.current_dir(root());
        command
    }

    /// Whether there is a package of this name.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.all.iter().any(|package| package["name"] == name)
    }

    /// The packages that others build on: all that may be published.
    pub(crate) fn public(&self) -> impl Iterator<Item = &str> {
        let public = self.all.iter().filter(|package| package["publish"].is_null());
        public.filter_map(|package| package["name"].as_str())
    }

    /// Every feature of every package, as cargo's `--features` takes them, but for those of a name: what
    /// `--all-features` is where that one cannot be built.
    pub(crate) fn features_without(&self, left_out: &str) -> String {
        let of = |package: &Value| {
            let name = package["name"].as_str().unwrap_or_default().to_owned();
            let features = package["features"].as_object().into_iter().flat_map(|features| features.keys());
            let wanted = features.filter(|&feature| feature != left_out);
            wanted.map(|feature| format!("{name}/{feature}")).collect::<Vec<_>>()
        };
        self.all.iter().flat_map(of).collect::<Vec<_>>().join(",")
    }

    /// The features of the facade other than `default`.
    pub(crate) fn facade_features(&self) -> Result<Vec<String>> {
        let facade = self.all.iter().find(|package| package["name"] == FACADE);
        let features = facade.and_then(|package| package["features"].as_object());
        let features = features.with_context(|| format!("cargo metadata does not name the features of {FACADE}"))?;
        Ok(features.keys().filter(|&name| name != "default").cloned().collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mutants: the feature is built where it cannot be; others are left out with it.
    #[test]
    fn one_feature_can_be_left_out() {
        let features = Packages::read().unwrap().features_without("mpi");
        let features: Vec<&str> = features.split(',').collect();
        assert!(features.contains(&"rt-balance/vulkan") && features.iter().all(|name| !name.ends_with("/mpi")));
    }

    /// The workflow runs the least compiler that is promised.
    ///
    /// Mutant: a `rust-version` that is raised in Cargo.toml alone.
    #[test]
    fn the_workflow_runs_the_least_rust() {
        let packages = Packages::read().unwrap();
        let facade = packages.all.iter().find(|package| package["name"] == FACADE).unwrap();
        let least = facade["rust_version"].as_str().unwrap();
        let workflow = std::fs::read_to_string(root().join(".github/workflows/test.yml")).unwrap();
        assert!(workflow.contains(&format!("rust:{least}-")), "rust-version is {least}");
    }
}
