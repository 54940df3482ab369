//! `cargo xtask test`: every check that a change must pass.

use crate::command::{cargo, run, say};
use crate::deny::{self, Availability};
use crate::setup::{Setup, is_ci, setup};
use crate::workspace::{FACADE, Packages};
use crate::{embree, no_std, python, unsafe_code, vulkan, width};
use anyhow::Result;
use std::time::{Duration, Instant};

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

struct Step {
    name: String,
    check: Check,
}

enum Check {
    /// A program that must succeed.
    Command(Box<std::process::Command>),
    /// A check of our own.
    Function(fn() -> Result<()>),
    /// Cannot be done here, for this reason.
    Impossible(&'static str),
}

/// How a step ended.
enum Outcome {
    Passed(Duration),
    Failed(Duration),
    NotRun(&'static str),
}

/// Sets up, runs the steps in order and stops at the first that fails.
pub(crate) fn test(extent: Extent) -> Result<()> {
    let begin = Instant::now();
    let setup = setup()?;
    let steps = steps(extent, &setup)?;
    let total = steps.len();
    let mut outcomes = Vec::new();
    let mut failure = None;
    for (index, Step { name, check }) in steps.into_iter().enumerate() {
        say(format_args!("\n[{}/{total}] {name}", index + 1));
        let start = Instant::now();
        let result = match check {
            Check::Command(mut command) => run(&mut command),
            Check::Function(function) => function(),
            Check::Impossible(reason) => {
                say(format_args!("not run: {reason}"));
                outcomes.push((name, Outcome::NotRun(reason)));
                continue;
            }
        };
        let spent = start.elapsed();
        say(format_args!("[{}/{total}] {name}: {:.1} s", index + 1, spent.as_secs_f64()));
        match result {
            Ok(()) => outcomes.push((name, Outcome::Passed(spent))),
            Err(error) => {
                failure = Some(error.context(name.clone()));
                outcomes.push((name, Outcome::Failed(spent)));
                break;
            }
        }
    }
    summarise(&outcomes, total, begin.elapsed());
    failure.map_or(Ok(()), Err)
}

fn steps(extent: Extent, setup: &Setup) -> Result<Vec<Step>> {
    let command = |name: &str, command| Step { name: name.to_owned(), check: Check::Command(Box::new(command)) };
    let packages = Packages::read()?;
    let features = match setup.mpi {
        true => "--all-features".to_owned(),
        false => format!("--features {}", packages.features_without(MPI)),
    };
    let mut steps = vec![
        command("formatting", cargo("fmt --all --check")),
        Step { name: "width of lines".to_owned(), check: Check::Function(width::check) },
        command("lints", cargo(&format!("clippy --workspace --all-targets {features} -- -D warnings"))),
    ];
    let deny = match deny::availability() {
        Availability::Present => Check::Function(deny::check),
        Availability::Missing => Check::Impossible("cargo-deny was left out"),
        Availability::Unsupported => Check::Impossible("needs cargo-deny: `cargo install cargo-deny`"),
    };
    steps.push(Step { name: "licences and sources".to_owned(), check: deny });
    if extent == Extent::Everything {
        let mut documentation = cargo(&format!("doc --workspace --no-deps {features}"));
        documentation.env("RUSTDOCFLAGS", "-D warnings");
        steps.push(command("documentation", documentation));
        steps.push(command("facade alone", cargo(&format!("check -p {FACADE} --no-default-features"))));
        for feature in packages.facade_features()? {
            let check = cargo(&format!("check -p {FACADE} --no-default-features --features {feature}"));
            steps.push(command(&format!("facade with {feature}"), check));
        }
        // Not built: that would be everything once more. The crate outside the workspace builds them by their paths.
        let mut package = cargo("package --quiet --no-verify --allow-dirty");
        package.args(packages.public().flat_map(|name| ["--package", name]));
        steps.push(command("packaging", package));
        let check =
            if no_std::SUPPORTED { Check::Function(no_std::prove) } else { Check::Impossible("needs Linux on x86-64") };
        steps.push(Step { name: "no_std proof".to_owned(), check });
        steps.push(Step { name: "loom".to_owned(), check: Check::Function(unsafe_code::loom) });
    }
    // The examples on the facade alone, and the suite on the backend among them.
    let outside = "--manifest-path tools/outsider/Cargo.toml --target-dir target";
    steps.push(command("a crate of somebody else's", cargo(&format!("test {outside}"))));
    let python = match python::is_set_up() {
        true => Check::Function(python::test),
        false if python::SUPPORTED => Check::Impossible("its environment was left out"),
        false => Check::Impossible("only for Linux on x86-64"),
    };
    steps.push(Step { name: "Python package".to_owned(), check: python });
    // Documentation tests are among these: cargo runs them after a library's own.
    // With MPI the command's tests over several processes too. Peers are built for other tests in any case.
    let features = if setup.mpi { "rt-cli/peers,rt-cli/mpi" } else { "rt-cli/peers" };
    let mut tests = cargo(&format!("test --workspace --features {features}"));
    match &setup.scenes {
        Some(folders) => tests.env(real_scenes::VARIABLE, folders.unpacked()?),
        None => tests.env_remove(real_scenes::VARIABLE),
    };
    // Someone who names drivers wants those tested: a real GPU's, say.
    let named = vulkan::DRIVER_VARIABLES.iter().any(|name| std::env::var_os(name).is_some());
    let drivers = if setup.software_vulkan && !named { vulkan::environment()? } else { Vec::new() };
    tests.envs(drivers.iter().cloned());
    if let Some(library) = &setup.embree {
        tests.env(embree::VARIABLE, library);
    }
    if is_ci() && std::env::var_os("RT_REQUIRE").is_none() {
        tests.env("RT_REQUIRE", setup.provided.join(","));
    }
    steps.push(command("tests", tests));
    if !setup.mpi {
        let check = Check::Impossible("MPI was left out");
        steps.push(Step { name: "several processes".to_owned(), check });
    }
    let verify = |arguments: &[&str]| {
        let mut verify = packages.built("raybalance");
        verify.args(["verify", "--quick"]).args(arguments);
        verify
    };
    steps.push(command("promises, CPU", verify(&[])));
    if setup.software_vulkan || named {
        for (name, backend) in [("Vulkan", "vulkan:0"), ("wgpu", "wgpu:0")] {
            let mut verify = verify(&["--devices", backend, "--rays", SOFTWARE_RAYS]);
            verify.envs(drivers.iter().cloned());
            steps.push(command(&format!("promises, {name}"), verify));
        }
    }
    Ok(steps)
}

fn summarise(outcomes: &[(String, Outcome)], total: usize, spent: Duration) {
    say("\nsummary");
    for (name, outcome) in outcomes {
        match outcome {
            Outcome::Passed(spent) => say(format_args!("  passed   {:7.1} s  {name}", spent.as_secs_f64())),
            Outcome::Failed(spent) => say(format_args!("  FAILED   {:7.1} s  {name}", spent.as_secs_f64())),
            Outcome::NotRun(reason) => say(format_args!("  not run             {name}: {reason}")),
        }
    }
    let left = total - outcomes.len();
    if left > 0 {
        say(format_args!("  {left} later steps were not reached"));
    }
    say(format_args!("  total    {:7.1} s", spent.as_secs_f64()));
}
