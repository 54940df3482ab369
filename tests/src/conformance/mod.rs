//! What every device must do, as a list of cases to be run against a list of devices.
//!
//! A backend, inside this workspace or not, makes a test without harness of it:
//!
//! ```no_run
//! use rt_tests::conformance::{Subject, trials};
//! use rt_tests::fake::FakeDevice;
//! # use std::sync::Arc;
//!
//! let subjects = vec![Subject::new("fake", "honest", Ok(Arc::new(FakeDevice::honest())))];
//! libtest_mimic::run(&libtest_mimic::Arguments::from_args(), trials(subjects)).exit();
//! ```
//!
//! A device that is missing is reported as ignored, with its reason, unless the environment variable `RT_REQUIRE` (a
//! list of backends, separated by commas) names its backend: then it fails.

mod counts;
mod fixtures;
mod hits;
mod launches;
mod numbers;
mod session;
mod streams;

pub use session::clock;

use crate::is_required;
use libtest_mimic::{Completion, Failed, Trial};
use rt_core::Device;
use std::fmt;
use std::sync::Arc;

/// One demand on devices.
#[derive(Clone, Copy)]
pub struct Case {
    /// What is demanded, as a test's name.
    pub name: &'static str,
    /// Tries it; the error says what the device did instead.
    pub run: fn(&dyn Device) -> Result<(), String>,
}

impl fmt::Debug for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Case").field("name", &self.name).finish_non_exhaustive()
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
    [hits::CASES, numbers::CASES, streams::CASES, counts::CASES, launches::CASES].concat()
}

/// Every case for every device; devices that `RT_REQUIRE` names must be there.
#[must_use]
pub fn trials(subjects: Vec<Subject>) -> Vec<Trial> {
    let mut trials = Vec::new();
    for Subject { backend, label, device } in subjects {
        let must = is_required(&backend);
        for case in cases() {
            let device = device.clone();
            let trial = Trial::ignorable_test(case.name, move || conclude(case, device, must));
            trials.push(trial.with_kind(format!("{backend}/{label}")));
        }
    }
    trials
}

/// Runs a case, or says why it was not run: a failure where the device `must` be there.
fn conclude(case: Case, device: Result<Arc<dyn Device>, String>, must: bool) -> Result<Completion, Failed> {
    match device {
        Ok(device) => Ok((case.run)(&*device).map(|()| Completion::Completed)?),
        Err(reason) if must => Err(format!("required by RT_REQUIRE, but missing: {reason}").into()),
        Err(reason) => Ok(Completion::ignored_with(reason)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::is_listed;

    #[test]
    fn a_missing_device_is_ignored_with_its_reason_unless_required() {
        let missing = || Err("no beads".to_owned());
        let case = cases()[0];
        let ignored = conclude(case, missing(), false);
        assert!(matches!(ignored, Ok(Completion::Ignored { reason: Some(reason) }) if reason == "no beads"));
        assert!(conclude(case, missing(), true).is_err_and(|e| e.message().is_some_and(|m| m.contains("no beads"))));
        assert!(is_listed("cpu", "wgpu, cpu") && !is_listed("cpu", "cpux") && !is_listed("cpu", ""));
    }

    #[test]
    fn case_names_are_unique() {
        let mut names: Vec<_> = cases().iter().map(|case| case.name).collect();
        names.sort_unstable();
        assert!(names.windows(2).all(|pair| pair[0] != pair[1]));
    }
}
