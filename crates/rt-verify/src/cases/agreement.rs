//! Hits equal the exact reference's: the triangle, the distance, and whether there is any.

use super::count_primitives;
use crate::Promise;
use crate::report::Row;
use crate::suite::Stopped;
use crate::tally::Tally;
use crate::trial::{Refusal, Trial};
use rt_core::Query;

pub(super) const NAME: &str = "agreement";

pub(super) fn run(trial: &Trial<'_>, rows: &mut Vec<Row>) -> Result<(), Stopped> {
    let mut distances = Tally::new(NAME, "distances, all scenes", Promise::Agreement);
    let mut presence = Tally::new(NAME, "any hit, all scenes", Promise::Agreement);
    let exams = match trial.suite.exams() {
        Ok(exams) => exams,
        Err(error) => {
            distances.refuse(&Refusal::Broken(error), 1);
            rows.push(distances.row());
            return Ok(());
        }
    };
    for (i, exam) in exams.iter().enumerate() {
        trial.advance(i as f64 / exams.len() as f64)?;
        let mut primitives = Tally::new(NAME, format!("triangles, {}", exam.name), Promise::Agreement);
        let ambiguous = exam.verdicts.iter().filter(|verdict| verdict.is_ambiguous()).count();
        primitives.note(format!("{ambiguous} rays are ambiguous"));
        match trial.trace(&exam.scene, &exam.rays, Query::Closest) {
            Ok(hits) => {
                count_primitives(exam, &hits, &mut primitives);
                for ((hit, verdict), (ray, _)) in hits.iter().zip(&exam.verdicts).zip(&exam.rays) {
                    // A wrong triangle is counted above.
                    if verdict.admits_primitive(hit.primitive) {
                        let right = verdict.admits(hit.primitive, hit.t);
                        distances.check(right, || format!("{}: {ray:?}: {hit:?}, but {verdict}", exam.name));
                    }
                }
            }
            Err(refusal) => primitives.refuse(&refusal, exam.rays.len()),
        }
        rows.push(primitives.row());
        match trial.trace(&exam.scene, &exam.rays, Query::Any) {
            Ok(hits) => {
                for ((hit, verdict), (ray, _)) in hits.iter().zip(&exam.verdicts).zip(&exam.rays) {
                    let right = verdict.admits_presence(hit.is_hit());
                    presence.check(right, || format!("{}: {ray:?}: {hit:?}, but {verdict}", exam.name));
                }
            }
            Err(refusal) => presence.refuse(&refusal, exam.rays.len()),
        }
    }
    rows.extend([distances.row(), presence.row()]);
    Ok(())
}
