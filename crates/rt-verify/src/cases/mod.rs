//! The cases of the suite.
//!
//! A case traces on the device under trial, or builds, and adds lines to the report. It must not assume which tree the
//! device walks or that it counts tests: other tracers than ours are tried as well.

mod agreement;
mod degenerate;
mod garbage;
mod layout;
mod limits;
mod magnitudes;
mod many;
mod scale;
mod spawn;
mod trees;
mod watertight;

use crate::report::Row;
use crate::suite::{Exam, Stopped};
use crate::tally::Tally;
use crate::trial::{Refusal, Trial};
use rt_core::Query;

/// One group of demands.
#[derive(Clone, Copy)]
pub(crate) struct Case {
    /// Its name in reports.
    pub(crate) name: &'static str,
    /// How long it takes relative to the others; no unit.
    pub(crate) weight: f64,
    /// Tries it and adds lines.
    pub(crate) run: fn(&Trial<'_>, &mut Vec<Row>) -> Result<(), Stopped>,
}

/// Every case, in the order in which they run.
pub(crate) const ALL: [Case; 16] = [
    Case { name: watertight::SOLIDS, weight: 20.0, run: watertight::solids },
    Case { name: watertight::PARTS, weight: 4.0, run: watertight::parts },
    Case { name: agreement::NAME, weight: 6.0, run: agreement::run },
    Case { name: scale::SWEEP, weight: 2.0, run: scale::sweep },
    Case { name: scale::POWERS, weight: 1.0, run: scale::powers_of_two },
    Case { name: scale::LENGTHS, weight: 1.0, run: scale::direction_lengths },
    Case { name: magnitudes::NAME, weight: 1.0, run: magnitudes::run },
    Case { name: degenerate::THIN, weight: 1.0, run: degenerate::thin },
    Case { name: degenerate::TIES, weight: 1.0, run: degenerate::ties },
    Case { name: limits::INVALID, weight: 1.0, run: limits::invalid },
    Case { name: limits::LIMITS, weight: 1.0, run: limits::ends },
    Case { name: spawn::NAME, weight: 5.0, run: spawn::run },
    Case { name: garbage::NAME, weight: 3.0, run: garbage::run },
    Case { name: trees::NAME, weight: 6.0, run: trees::run },
    Case { name: many::NAME, weight: 1.0, run: many::run },
    Case { name: layout::NAME, weight: 2.0, run: layout::run },
];

/// Traces an exam and counts the nearest hits that are not right; of tracers that do not promise exact ones, those that
/// the reference does not admit, whatever their distance.
fn judge_nearest(trial: &Trial<'_>, exam: &Exam, tally: &mut Tally) {
    match trial.trace(&exam.scene, &exam.rays, Query::Closest) {
        Ok(hits) => {
            for ((hit, verdict), (ray, _)) in hits.iter().zip(&exam.verdicts).zip(&exam.rays) {
                let right = if trial.exact { verdict.is_right(hit) } else { verdict.admits_primitive(hit.primitive) };
                tally.check(right, || format!("{}: {ray:?}: {hit:?}, but {verdict}", exam.name));
            }
        }
        Err(refusal) => tally.refuse(&refusal, exam.rays.len()),
    }
}

/// A scene that could not be built counts as one failure of the line.
fn built<T>(result: Result<T, String>, tally: &mut Tally) -> Option<T> {
    result.map_err(|error| tally.refuse(&Refusal::Broken(error), 1)).ok()
}
