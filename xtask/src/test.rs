//! `cargo xtask test`: every check that a change must pass.

use crate::command::{cargo, run};
use crate::no_std;
use crate::setup::{PROVIDED, Setup, setup};
use anyhow::{Context, Result, bail};
use std::time::{Duration, Instant};

/// How much to check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Extent {
    /// All of it.
    Everything,
    /// What goes wrong most often: formatting, lints, tests.
    Quick,
}

/// Package of the facade, whose features choose the backends.
const FACADE: &str = "rt-balance";

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
        println!("\n[{}/{total}] {name}", index + 1);
        let start = Instant::now();
        let result = match check {
            Check::Command(mut command) => run(&mut command),
            Check::Function(function) => function(),
            Check::Impossible(reason) => {
                println!("not run: {reason}");
                outcomes.push((name, Outcome::NotRun(reason)));
                continue;
            }
        };
        let spent = start.elapsed();
        println!("[{}/{total}] {name}: {:.1} s", index + 1, spent.as_secs_f64());
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
    let mut steps = vec![
        command("formatting", cargo("fmt --all --check")),
        command("lints", cargo("clippy --workspace --all-targets --all-features -- -D warnings")),
    ];
    if extent == Extent::Everything {
        let mut documentation = cargo("doc --workspace --no-deps --all-features");
        documentation.env("RUSTDOCFLAGS", "-D warnings");
        steps.push(command("documentation", documentation));
        steps.push(command("facade alone", cargo(&format!("check -p {FACADE} --no-default-features"))));
        for feature in facade_features()? {
            let check = cargo(&format!("check -p {FACADE} --no-default-features --features {feature}"));
            steps.push(command(&format!("facade with {feature}"), check));
        }
        let check =
            if no_std::SUPPORTED { Check::Function(no_std::prove) } else { Check::Impossible("needs Linux on x86-64") };
        steps.push(Step { name: "no_std proof".to_owned(), check });
    }
    // Documentation tests are among these: cargo runs them after a library's own.
    let mut tests = cargo("test --workspace");
    match &setup.scenes {
        Some(folder) => tests.env("RAYBALANCE_SCENES", folder),
        None => tests.env_remove("RAYBALANCE_SCENES"),
    };
    if is_ci() && std::env::var_os("RT_REQUIRE").is_none() {
        tests.env("RT_REQUIRE", PROVIDED.join(","));
    }
    steps.push(command("tests", tests));
    Ok(steps)
}

/// The features of the facade, as its manifest says them, so that a new one cannot be forgotten here.
fn facade_features() -> Result<Vec<String>> {
    let output = cargo("metadata --no-deps --format-version 1").output().context("cannot start cargo metadata")?;
    if !output.status.success() {
        bail!("cargo metadata failed:\n{}", String::from_utf8_lossy(&output.stderr));
    }
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).context("cargo metadata wrote no JSON")?;
    let packages = metadata["packages"].as_array().context("cargo metadata names no packages")?;
    let facade = packages.iter().find(|package| package["name"] == FACADE);
    let features = facade.and_then(|package| package["features"].as_object());
    let features = features.with_context(|| format!("cargo metadata does not name the features of {FACADE}"))?;
    Ok(features.keys().filter(|&name| name != "default").cloned().collect())
}

fn is_ci() -> bool {
    std::env::var_os("CI").is_some_and(|value| value == "true")
}

fn summarise(outcomes: &[(String, Outcome)], total: usize, spent: Duration) {
    println!("\nsummary");
    for (name, outcome) in outcomes {
        match outcome {
            Outcome::Passed(spent) => println!("  passed   {:7.1} s  {name}", spent.as_secs_f64()),
            Outcome::Failed(spent) => println!("  FAILED   {:7.1} s  {name}", spent.as_secs_f64()),
            Outcome::NotRun(reason) => println!("  not run             {name}: {reason}"),
        }
    }
    let left = total - outcomes.len();
    if left > 0 {
        println!("  {left} later steps were not reached");
    }
    println!("  total    {:7.1} s", spent.as_secs_f64());
}
