//! The command on graphics cards.
//!
//! Without a device of a backend its tests are ignored, with the reason, unless `RT_REQUIRE` names the backend.

#[cfg(unix)]
mod signals;
mod tradeoff;

use libtest_mimic::{Arguments, Completion, Failed, Trial, run};
use std::process::Command;

type Outcome = Result<(), Failed>;

fn main() {
    let arguments = Arguments::from_args();
    let trials = vec![
        Trial::test("layout_says_what_to_do_without_a_card", tradeoff::layout_says_what_to_do),
        on("vulkan", "layout_is_measured_over_both", tradeoff::layout_is_measured),
        on("vulkan", "sampling_on_a_card_has_every_walk", tradeoff::sampling_has_every_walk),
        on("vulkan", "precision_says_that_there_is_one_kernel", tradeoff::precision_says_so),
    ];
    #[cfg(unix)]
    let trials = trials.into_iter().chain([
        on("vulkan", "a_signal_ends_what_compiles_kernels_for_vulkan", || signals::ends_while_compiling("vulkan:0")),
        on("wgpu", "a_signal_ends_what_compiles_kernels_for_wgpu", || signals::ends_while_compiling("wgpu:0")),
    ]);
    run(&arguments, trials.into_iter().collect()).exit();
}

fn on(backend: &'static str, name: &str, test: fn() -> Outcome) -> Trial {
    Trial::ignorable_test(name, move || {
        let Some(reason) = missing(backend)? else { return test().map(|()| Completion::Completed) };
        let required = std::env::var("RT_REQUIRE").unwrap_or_default();
        if required.split(',').any(|entry| entry.trim() == backend) {
            return Err(format!("required by RT_REQUIRE, but missing: {reason}").into());
        }
        Ok(Completion::ignored_with(reason))
    })
}

/// Why the first device of a backend cannot be used, or nothing.
fn missing(backend: &str) -> Result<Option<String>, Failed> {
    let entry = format!("{backend}:0");
    let output = Command::new(env!("CARGO_BIN_EXE_raybalance")).args(["devices", "--json"]).output()?;
    let devices: serde_json::Value = serde_json::from_slice(&output.stdout)?;
    let first = devices.as_array().and_then(|all| all.iter().find(|device| device["device"] == *entry));
    Ok(match first.map(|device| device["refused"].as_str()) {
        Some(None) => None,
        Some(Some(refused)) => Some(format!("{entry} cannot be used: {refused}")),
        None => Some(format!("there is no {entry}: `cargo xtask test` brings a software one")),
    })
}
