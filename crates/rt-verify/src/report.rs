//! What a run of the suite found.

use crate::Promise;
use crate::stats::clopper_pearson;
use serde::Serialize;

/// How a line ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// Something was tried and nothing failed.
    Pass,
    /// Something failed.
    Fail,
    /// Nothing was tried, for the reason in [`Row::note`].
    Skipped,
}

/// One line of a report: one demand, and how often it was not met.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The group of demands, such as `watertight`.
    pub case: &'static str,
    /// What about it, such as `edges, offset 1e6`.
    pub what: String,
    /// What it stands for.
    pub promise: Promise,
    /// Rays, meshes or boxes tried.
    pub trials: u64,
    /// Those on which the demand was not met.
    pub failures: u64,
    /// Failures per trial; 0 without trials.
    pub rate: f64,
    /// Clopper–Pearson 95% bounds of the rate.
    pub bounds: [f64; 2],
    /// How it ended.
    pub verdict: Verdict,
    /// The first failure, why the line was skipped, or a figure worth knowing; empty if nothing is to be said.
    pub note: String,
    /// Seconds it took, the reference's included.
    pub seconds: f64,
}

impl Row {
    pub(crate) fn new(
        (case, what): (&'static str, String),
        promise: Promise,
        (failures, trials): (u64, u64),
        note: String,
        seconds: f64,
    ) -> Self {
        let verdict = match (failures, trials) {
            (_, 0) => Verdict::Skipped,
            (0, _) => Verdict::Pass,
            _ => Verdict::Fail,
        };
        let rate = if trials == 0 { 0.0 } else { failures as f64 / trials as f64 };
        Self {
            case,
            what,
            promise,
            trials,
            failures,
            rate,
            bounds: clopper_pearson(failures, trials),
            verdict,
            note,
            seconds,
        }
    }
}

/// What one device did.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DeviceReport {
    /// The device's own name.
    pub device: String,
    /// Its backend.
    pub backend: &'static str,
    /// The precision it was asked for: `robust`, `fast` or `f64`.
    pub precision: &'static str,
    /// Every line, in the order in which they were tried.
    pub rows: Vec<Row>,
}

impl DeviceReport {
    /// Number of lines that ended so.
    #[must_use]
    pub fn count(&self, verdict: Verdict) -> usize {
        self.rows.iter().filter(|row| row.verdict == verdict).count()
    }

    /// Failures and trials of all lines that stand for a promise.
    #[must_use]
    pub fn of(&self, promise: Promise) -> (u64, u64) {
        self.rows
            .iter()
            .filter(|row| row.promise == promise)
            .fold((0, 0), |(f, t), row| (f + row.failures, t + row.trials))
    }
}
