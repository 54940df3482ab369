//! Counting what a line of the report is about.

use crate::trial::Refusal;
use crate::{Promise, Row};
use std::time::Instant;

/// A line in the making.
#[derive(Debug)]
pub(crate) struct Tally {
    name: (&'static str, String),
    promise: Promise,
    trials: u64,
    failures: u64,
    note: String,
    first: Option<String>,
    begin: Instant,
}

impl Tally {
    pub(crate) fn new(case: &'static str, what: impl Into<String>, promise: Promise) -> Self {
        let name = (case, what.into());
        Self { name, promise, trials: 0, failures: 0, note: String::new(), first: None, begin: Instant::now() }
    }

    /// Counts one trial; `describe` tells what went wrong, of the first failure only.
    pub(crate) fn check(&mut self, holds: bool, describe: impl FnOnce() -> String) {
        self.trials += 1;
        if !holds {
            self.failures += 1;
            self.first.get_or_insert_with(describe);
        }
    }

    /// Counts `trials` that held.
    pub(crate) fn held(&mut self, trials: u64) {
        self.trials += trials;
    }

    /// Counts `trials` that a device did not answer: failures, unless it said that it cannot do such things at all.
    pub(crate) fn refuse(&mut self, refusal: &Refusal, trials: usize) {
        match refusal {
            Refusal::Unsupported(reason) => self.note.clone_from(reason),
            Refusal::OutOfMemory(reason) | Refusal::Broken(reason) => {
                self.trials += trials as u64;
                self.failures += trials as u64;
                self.first.get_or_insert_with(|| reason.clone());
            }
        }
    }

    /// Something worth knowing beside the counts; without trials, the reason why there are none.
    pub(crate) fn note(&mut self, note: impl Into<String>) {
        self.note = note.into();
    }

    pub(crate) fn row(self) -> Row {
        let note = self.first.unwrap_or(self.note);
        Row::new(self.name, self.promise, (self.failures, self.trials), note, self.begin.elapsed().as_secs_f64())
    }
}
