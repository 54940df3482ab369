//! What every device must do, as a list of cases to be run against a list of devices.
//!
//! A backend, inside this workspace or not, makes a test without harness (`harness = false`) of it:
//!
//! ```no_run
//! use rt_conformance::{Subject, run};
//! # use rt_core::Device;
//! # use std::{process::ExitCode, sync::Arc};
//! # fn open() -> Result<Arc<dyn Device>, String> { Err("no device".to_owned()) }
//!
//! fn main() -> ExitCode {
//!     run(vec![Subject::new("mine", "first card", open())])
//! }
//! ```
//!
//! A case names what it needs ([`Need`]); where the device's own [`Capabilities`] lack that, the case is reported as
//! ignored, with the reason: counts are compared only where they are said to be the scene tree's. So is every case of a
//! device that is missing, unless the environment variable `RT_REQUIRE` (a list of backends, separated by commas) names
//! its backend: then they fail.
//!
//! # Current state and limits
//!
//! * A walk or precision that a device does not say it has is not tried: nobody asks for it.
//! * The exact reference tests every ray with every triangle: about 10⁸ tests a second on one core.
#![forbid(unsafe_code)]

mod counts;
mod fixtures;
mod hits;
mod launches;
mod moving;
mod need;
mod numbers;
mod session;
mod several;
mod streams;

pub use need::Need;

use libtest_mimic::{Arguments, Completion, Failed, Trial};
use rt_core::{Capabilities, Device};
use std::fmt;
use std::process::ExitCode;
use std::sync::Arc;

/// One demand on devices.
#[derive(Clone, Copy)]
pub struct Case {
    /// What is demanded, as a test's name.
    pub name: &'static str,
    /// What a device must say of itself for the demand to be made.
    pub needs: &'static [Need],
    run: fn(&dyn Device) -> Result<(), String>,
}

impl Case {
    /// Tries it on a device, whatever that says of itself.
    ///
    /// # Errors
    /// What the device did instead.
    pub fn run(&self, device: &dyn Device) -> Result<(), String> {
        (self.run)(device)
    }

    /// What it needs and a device of these capabilities lacks.
    #[must_use]
    pub fn lacks(&self, capabilities: &Capabilities) -> Vec<Need> {
        self.needs.iter().copied().filter(|need| !need.is_met_by(capabilities)).collect()
    }
}

impl fmt::Debug for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Case").field("name", &self.name).field("needs", &self.needs).finish_non_exhaustive()
    }
}

/// A device to be tried, or why it cannot be.
#[derive(Clone, Debug)]
pub struct Subject {
    backend: String,
    label: String,
    device: Result<Arc<dyn Device>, String>,
}

impl Subject {
    /// A device of `backend`, told from its others by `label`; or the reason why it is missing.
    #[must_use]
    pub fn new(backend: &str, label: &str, device: Result<Arc<dyn Device>, String>) -> Self {
        Self { backend: backend.to_owned(), label: label.to_owned(), device }
    }
}

/// Every case.
#[must_use]
pub fn cases() -> Vec<Case> {
    [hits::CASES, numbers::CASES, streams::CASES, counts::CASES, launches::CASES, moving::CASES, several::CASES]
        .concat()
}

/// Every case for every device; devices that `RT_REQUIRE` names must be there.
#[must_use]
pub fn trials(subjects: Vec<Subject>) -> Vec<Trial> {
    let mut trials = Vec::new();
    for subject in subjects {
        let must = is_required(&subject.backend);
        let kind = format!("{}/{}", subject.backend, subject.label);
        for case in cases() {
            let subject = subject.clone();
            let trial = Trial::ignorable_test(case.name, move || conclude(case, &subject, must));
            trials.push(trial.with_kind(kind.clone()));
        }
    }
    trials
}

/// Runs every case for every device as a test program of its own, with the arguments that `cargo test` gives it.
#[must_use]
pub fn run(subjects: Vec<Subject>) -> ExitCode {
    libtest_mimic::run(&Arguments::from_args(), trials(subjects)).exit_code()
}

/// Runs a case, or says why it was not run: a failure where the device `must` be there.
fn conclude(case: Case, subject: &Subject, must: bool) -> Result<Completion, Failed> {
    match &subject.device {
        Ok(device) => match &case.lacks(&device.info().capabilities)[..] {
            [] => Ok(case.run(&**device).map(|()| Completion::Completed)?),
            lacking => {
                let names: Vec<String> = lacking.iter().map(Need::to_string).collect();
                Ok(Completion::ignored_with(format!("the device does not say it has {}", names.join(", "))))
            }
        },
        Err(reason) if must => Err(format!("required by RT_REQUIRE, but missing: {reason}").into()),
        Err(reason) => Ok(Completion::ignored_with(reason)),
    }
}

/// Whether a list separated by commas, the environment variable `RT_REQUIRE`, names what must not be missing.
#[must_use]
pub fn is_required(name: &str) -> bool {
    std::env::var("RT_REQUIRE").is_ok_and(|list| is_listed(name, &list))
}

/// Whether `name` is in a list separated by commas.
fn is_listed(name: &str, list: &str) -> bool {
    list.split(',').any(|entry| entry.trim() == name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::{Counted, Precision};

    #[test]
    fn a_missing_device_is_ignored_with_its_reason_unless_required() {
        let missing = Subject::new("cpu", "none", Err("no beads".to_owned()));
        let case = cases()[0];
        let ignored = conclude(case, &missing, false);
        assert!(matches!(ignored, Ok(Completion::Ignored { reason: Some(reason) }) if reason == "no beads"));
        assert!(conclude(case, &missing, true).is_err_and(|e| e.message().is_some_and(|m| m.contains("no beads"))));
        assert!(is_listed("cpu", "wgpu, cpu") && !is_listed("cpu", "cpux") && !is_listed("cpu", ""));
    }

    #[test]
    fn case_names_are_unique() {
        let mut names: Vec<_> = cases().iter().map(|case| case.name).collect();
        names.sort_unstable();
        assert!(names.windows(2).all(|pair| pair[0] != pair[1]));
    }

    /// Mutants: a need that nobody meets, so that its cases never run; one that everybody meets.
    #[test]
    fn a_device_that_says_everything_is_spared_nothing() {
        let everything =
            Capabilities::UNKNOWN.with_counts(Counted::SceneTree).with_defined_bits().with_all_hits().with_masks();
        let nothing = Capabilities::UNKNOWN
            .with_counts(Counted::Nothing)
            .with_precisions(&[Precision::Robust])
            .with_reduced_walks(&[]);
        for need in cases().iter().flat_map(|case| case.needs) {
            assert!(need.is_met_by(&everything) && !need.is_met_by(&nothing), "{need}");
        }
        assert!(cases().iter().any(|case| !case.needs.is_empty()));
    }
}
