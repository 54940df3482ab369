//! Hits equal the exact reference's: the triangle, the distance, and whether there is any.

use crate::report::Row;
use crate::suite::{Exam, Stopped};
use crate::tally::Tally;
use crate::trial::{Refusal, Trial};
use crate::{Promise, exact};
use rt_core::{Hit, Query, Ray};

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
        primitives.note(exam.ambiguity());
        match trial.trace(&exam.scene, &exam.rays, Query::Closest) {
            Ok(hits) => {
                for ((hit, verdict), (ray, _)) in hits.iter().zip(&exam.verdicts).zip(&exam.rays) {
                    let describe = || format!("{}: {ray:?}: {hit:?}, but {verdict}", exam.name);
                    let [primitive, distance] = if trial.exact {
                        let right = verdict.right().map_or(u32::MAX, |right| right.primitive);
                        [hit.primitive == right, verdict.is_right(hit)]
                    } else {
                        [verdict.admits_primitive(hit.primitive), verdict.admits(hit.primitive, hit.t)]
                    };
                    primitives.check(primitive, describe);
                    // A wrong triangle is counted there.
                    if primitive {
                        distances.check(distance, describe);
                    }
                }
            }
            Err(refusal) => primitives.refuse(&refusal, exam.rays.len()),
        }
        rows.push(primitives.row());
        match trial.trace(&exam.scene, &exam.rays, Query::Any) {
            Ok(hits) => {
                for ((hit, verdict), (ray, _)) in hits.iter().zip(&exam.verdicts).zip(&exam.rays) {
                    let right = if trial.exact {
                        verdict.right().is_some() == hit.is_hit() && is_one(exam, ray, hit)
                    } else {
                        verdict.admits_presence(hit.is_hit())
                    };
                    presence.check(right, || format!("{}: {ray:?}: {hit:?}, but {verdict}", exam.name));
                }
            }
            Err(refusal) => presence.refuse(&refusal, exam.rays.len()),
        }
    }
    rows.extend([distances.row(), presence.row()]);
    Ok(())
}

/// Whether a hit, if it is one, is a hit of the ray at all: that triangle, at that distance.
fn is_one(exam: &Exam, ray: &Ray, hit: &Hit) -> bool {
    !hit.is_hit()
        || exam.triangles.get(hit.primitive as usize).is_some_and(|triangle| {
            let t = exact::hit(ray, triangle);
            t.is_some_and(|t| t.to_bits() == hit.t.to_bits() && ray.tmin <= t && t <= ray.tmax)
        })
}
