//! `cargo xtask test`: every check that a change must pass.

use crate::command::cargo;
use crate::deny::{self, Availability};
use crate::setup::{Setup, is_ci, setup};
use crate::steps::{Step, run_all};
use crate::workspace::{FACADE, Packages};
use crate::{embree, no_std, python, unsafe_code, vulkan, width};
use anyhow::Result;
use std::ffi::OsString;
use std::process::Command;
use std::time::Instant;

/// How much to check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Extent {
    /// All of it.
    Everything,
    /// What goes wrong most often: formatting, lints, tests.
    Quick,
}

/// Rays of each line of the suite `verify` on a GPU device: software ones trace a tenth of what the CPU itself does.
const SOFTWARE_RAYS: &str = "40000";

/// The feature that needs an MPI library to build.
const MPI: &str = "mpi";

/// Sets up, runs the steps in rounds and stops at the first that fails.
pub(crate) fn test(extent: Extent) -> Result<()> {
    let begin = Instant::now();
    let setup = setup()?;
    run_all(rounds(extent, &setup)?, begin)
}

fn rounds(extent: Extent, setup: &Setup) -> Result<Vec<Vec<Step>>> {
    let packages = Packages::read()?;
    let features = match setup.mpi {
        true => "--all-features".to_owned(),
        false => format!("--features {}", packages.features_without(MPI)),
    };
    let lints = cargo(&format!("clippy --workspace --all-targets {features} -- -D warnings"));
    let mut rounds = vec![
        vec![Step::command("formatting", cargo("fmt --all --check"))],
        vec![Step::function("width of lines", width::check)],
        vec![Step::command("lints", lints)],
        vec![match deny::availability() {
            Availability::Present => Step::function("licences and sources", deny::check),
            Availability::Missing => Step::impossible("licences and sources", "cargo-deny was left out"),
            Availability::Unsupported => {
                Step::impossible("licences and sources", "needs cargo-deny: `cargo install cargo-deny`")
            }
        }],
    ];
    if extent == Extent::Everything {
        rounds.push(parts(&packages, &features)?);
    }
    // The examples on the facade alone, and the suite on the backend among them.
    let outside = cargo("test --manifest-path tools/outsider/Cargo.toml --target-dir target");
    let mut outside = vec![Step::command("a crate of somebody else's", outside)];
    match python::is_set_up() {
        true => outside.push(Step::function("wheel of the Python package", python::install_wheel)),
        false if python::SUPPORTED => outside.push(Step::impossible("Python package", "its environment was left out")),
        false => outside.push(Step::impossible("Python package", "only for Linux on x86-64")),
    }
    rounds.push(outside);
    let tests = Tests::new(setup)?;
    rounds.push(vec![Step::command("building the tests", tests.command("--no-run"))]);
    rounds.push(tests.all(setup, &packages));
    Ok(rounds)
}

/// What is built with other features, or for other ends, than everything else.
fn parts(packages: &Packages, features: &str) -> Result<Vec<Step>> {
    let mut documentation = cargo(&format!("doc --workspace --no-deps {features}"));
    documentation.env("RUSTDOCFLAGS", "-D warnings");
    // These two build in folders of their own, beside the others.
    let mut steps = vec![
        Step::command("documentation", documentation),
        Step::command("loom", unsafe_code::loom()),
        match no_std::SUPPORTED {
            true => Step::function("no_std proof", no_std::prove),
            false => Step::impossible("no_std proof", "needs Linux on x86-64"),
        },
    ];
    let facade = |name: &str, features: &str| {
        Step::command(name, cargo(&format!("check -p {FACADE} --no-default-features {features}")))
    };
    steps.push(facade("facade alone", ""));
    for feature in packages.facade_features()? {
        steps.push(facade(&format!("facade with {feature}"), &format!("--features {feature}")));
    }
    // Not built: that would be everything once more. The crate outside the workspace builds them by their paths.
    let mut package = cargo("package --quiet --no-verify --allow-dirty");
    package.args(packages.public().flat_map(|name| ["--package", name]));
    steps.push(Step::command("packaging", package));
    Ok(steps)
}

/// How cargo runs the tests of the workspace.
struct Tests {
    /// With MPI the command's tests over several processes too. Peers are built for other tests in any case.
    features: &'static str,
    variables: Vec<(&'static str, OsString)>,
    /// Where the software Vulkan drivers are; empty where someone names others.
    drivers: Vec<(&'static str, OsString)>,
    /// Someone who names drivers wants those tested: a real GPU's, say.
    drivers_are_named: bool,
}

impl Tests {
    fn new(setup: &Setup) -> Result<Self> {
        let mut variables = Vec::new();
        if let Some(folders) = &setup.scenes {
            variables.push((real_scenes::VARIABLE, folders.unpacked()?.into()));
        }
        let drivers_are_named = vulkan::DRIVER_VARIABLES.iter().any(|name| std::env::var_os(name).is_some());
        let drivers = if setup.software_vulkan && !drivers_are_named { vulkan::environment()? } else { Vec::new() };
        variables.extend(drivers.iter().cloned());
        variables.extend(setup.embree.as_ref().map(|library| (embree::VARIABLE, library.into())));
        if is_ci() && std::env::var_os("RT_REQUIRE").is_none() {
            variables.push(("RT_REQUIRE", setup.provided.join(",").into()));
        }
        let features = if setup.mpi { "rt-cli/peers,rt-cli/mpi" } else { "rt-cli/peers" };
        Ok(Self { features, variables, drivers, drivers_are_named })
    }

    /// The tests that `arguments` choose, split at spaces.
    fn command(&self, arguments: &str) -> Command {
        let mut command = cargo(&format!("test --workspace --features {} {arguments}", self.features));
        command.env_remove(real_scenes::VARIABLE).envs(self.variables.iter().cloned());
        command
    }

    /// All that there is to run, the longest first.
    fn all(&self, setup: &Setup, packages: &Packages) -> Vec<Step> {
        let mut steps = vec![
            Step::command("tests of crates from outside", self.command("--test *")),
            Step::command("tests inside crates", self.command("--lib --bins")),
            Step::command("tests in documentation", self.command("--doc")),
        ];
        if python::is_set_up() {
            steps.push(Step::command("tests of the Python package", python::tests()));
        }
        let promises = |name: &str, arguments: &[&str]| {
            let mut verify = packages.built("raybalance");
            verify.args(["verify", "--quick"]).args(arguments).envs(self.drivers.iter().cloned());
            Step::command(&format!("promises, {name}"), verify)
        };
        steps.push(promises("CPU", &[]));
        if setup.software_vulkan || self.drivers_are_named {
            for (name, backend) in [("Vulkan", "vulkan:0"), ("wgpu", "wgpu:0")] {
                steps.push(promises(name, &["--devices", backend, "--rays", SOFTWARE_RAYS]));
            }
        }
        if !setup.mpi {
            steps.push(Step::impossible("several processes", "MPI was left out"));
        }
        steps
    }
}
