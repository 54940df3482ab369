//! Turns what happened into a report, and teaches the cost models.

use crate::device_state::DeviceState;
use crate::estimate::Estimated;
use crate::models::Key;
use crate::plan::Plan;
use crate::report::{Activity, DeviceReport, EstimateReport, ModelReport, StreamReport, StreamRun};
use crate::run::Ran;
use crate::stats::union;
use crate::{Scheduling, Stream};
use rt_core::{CostModel, TaskId, TestCounts, Work};
use rt_sched::metrics;
use std::time::Duration;

/// When devices began to get ready for a stream, and when it began, was loaded, was planned and ended, on the clock of
/// all devices.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Times {
    pub(crate) origin: Duration,
    pub(crate) setup: Duration,
    pub(crate) begin: Duration,
    pub(crate) loaded: Duration,
    pub(crate) planned: Duration,
    pub(crate) end: Duration,
}

/// Makes the record of one stream.
pub(crate) fn measure(
    members: &[DeviceState],
    stream: &Stream,
    scheduling: &Scheduling,
    estimated: &Estimated,
    plan: &Plan,
    ran: &Ran,
    times: Times,
) -> StreamRun {
    let tasks = stream.tasks.len();
    let (mut predicted, mut measured) = (vec![f64::NAN; tasks], vec![f64::NAN; tasks]);
    let mut device_of = vec![u32::MAX; tasks];
    for launch in &ran.launches {
        for outcome in &launch.outcomes {
            let id = outcome.task as usize;
            predicted[id] = outcome.predicted_s;
            device_of[id] = launch.member as u32;
            if launch.per_task {
                measured[id] = outcome.measured_s;
            }
        }
    }
    let mut activities: Vec<Activity> = estimated.walks.iter().map(|walk| walk.activity(times.origin)).collect();
    activities.extend(ran.walks.iter().map(|walk| walk.activity(times.origin)));
    activities.extend(ran.launches.iter().map(|launch| launch.activity(times.origin)));

    let key = Key::of(&*scheduling.estimator, stream);
    let devices: Vec<DeviceReport> = members
        .iter()
        .enumerate()
        .map(|(index, member)| DeviceReport {
            model: member.models.fit(key).map(ModelReport::from),
            ..device_report(index, member, &activities, estimated, ran)
        })
        .collect();
    let makespan_s = times.end.saturating_sub(times.begin).as_secs_f64();
    let estimate_s = times.planned.saturating_sub(times.loaded).as_secs_f64();
    let report = StreamReport {
        kind: stream.kind.to_string(),
        frame: stream.frame,
        wave: stream.wave,
        rays: stream.source.len(),
        tasks: tasks as u32,
        estimate: EstimateReport {
            estimator: scheduling.estimator.name().to_owned(),
            chosen: scheduling.estimator.chosen().to_owned(),
            reason: scheduling.estimator.reason(),
            fraction: share(estimated.walked as f64, f64::from(stream.source.len())),
            are_speeds_known: plan.models.iter().any(|model| *model != CostModel::UNIT),
            uninformed_excess: estimated.uninformed_excess,
            seconds: estimate_s,
            overhead: metrics::overhead(estimate_s, makespan_s),
            mre_counts: None,
            mre_time: None,
            std_error: typical_error(&estimated.work),
            errors_counts: None,
            errors_time: None,
            unused: None,
        },
        setup_s: times.begin.saturating_sub(times.setup).as_secs_f64(),
        makespan_s,
        imbalance: imbalance(plan, &devices, makespan_s),
        lower_bound_s: None,
        excess: None,
        devices,
        task_times: None,
    };
    StreamRun {
        report,
        kind: stream.kind,
        tasks: stream.tasks.clone(),
        work: estimated.work.clone(),
        kept: stream.tasks.iter().map(|task| estimated.kept.as_ref().map_or(0, |k| k.count_in(task.range()))).collect(),
        predicted_s: predicted,
        measured_s: measured,
        device_of,
        activities,
        reference_s: None,
        unused: None,
    }
}

/// Adds the estimation's walks to the cost models: before the first launch they are all that is known of speeds.
pub(crate) fn learn_walks(members: &mut [DeviceState], key: Key, estimated: &Estimated) {
    for walk in &estimated.walks {
        members[walk.member].models.walked(key, walk);
    }
}

/// Adds every launch to the cost models.
pub(crate) fn learn_launches(members: &mut [DeviceState], key: Key, plan: &Plan, ran: &Ran) {
    for launch in ran.launches.iter().filter(|launch| launch.whole) {
        let left = |task: TaskId| &plan.left[task as usize];
        members[launch.member].models.launched(key, launch, left);
    }
}

/// Median of the tasks' relative standard errors.
fn typical_error(work: &[Work]) -> Option<f64> {
    let relative = work.iter().filter(|w| w.tests() > 0.0).filter_map(|w| Some(w.std_error()? / w.tests()));
    let mut relative: Vec<f64> = relative.map(f64::from).collect();
    let middle = relative.len() / 2;
    (!relative.is_empty()).then(|| *relative.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// `part / whole`, 0 where nothing was to be done.
fn share(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { part / whole } else { 0.0 }
}

fn device_report(
    index: usize,
    member: &DeviceState,
    activities: &[Activity],
    estimated: &Estimated,
    ran: &Ran,
) -> DeviceReport {
    let own = || ran.launches.iter().filter(|launch| launch.member == index);
    let spans = activities.iter().filter(|a| a.device == index).map(|a| (a.start_s, a.end_s)).collect();
    let busy_s = union(spans);
    let walks = estimated.walks.iter().chain(&ran.walks).filter(|walk| walk.member == index).map(|walk| walk.span);
    // Kernels of one device run one after the other.
    let kernel_s: f64 = walks.chain(own().map(|launch| launch.span)).map(|span| span.in_kernel.as_secs_f64()).sum();
    let traffic = member.traffic();
    DeviceReport {
        name: member.info.name.clone(),
        backend: member.info.backend.to_owned(),
        busy_s,
        // Rounding may take it above.
        kernel_share: (busy_s > 0.0).then(|| (kernel_s / busy_s).min(1.0)),
        on_host: traffic.map(|traffic| traffic.on_host),
        uploaded_bytes: traffic.map(|traffic| traffic.uploaded),
        downloaded_bytes: traffic.map(|traffic| traffic.downloaded),
        launches: own().count() as u32,
        tasks: own().map(|launch| launch.outcomes.len() as u32).sum(),
        rays: own().map(|launch| u64::from(launch.rays)).sum(),
        model: None,
        audited: member.checked.audited,
        refused: member.checked.refused + traffic.map_or(0, |traffic| traffic.refused),
        note: member.note(),
        error: member.failure().map(str::to_owned),
    }
}

/// The imbalance over living devices, whose speeds are those of the plan's cost models.
fn imbalance(plan: &Plan, devices: &[DeviceReport], makespan_s: f64) -> Option<f64> {
    let total = plan.left.iter().fold(Work::default(), |sum, work| sum.plus(work));
    let speeds: Vec<f64> = plan
        .models
        .iter()
        .map(|model| match model.seconds(&total) {
            seconds if seconds > 0.0 => 1.0 / seconds,
            _ => 1.0,
        })
        .collect();
    let busy: Vec<f64> = plan.workers.iter().map(|&member| devices[member].busy_s).collect();
    metrics::imbalance(makespan_s, &busy, &speeds)
}

/// Exact tests of each task, from the counts of its rays.
pub(crate) fn tests_of(stream: &Stream, counts: &[TestCounts]) -> Vec<f64> {
    let tests = |c: &TestCounts| f64::from(c.boxes) + f64::from(c.triangles);
    let sum = |task: &rt_core::Task| {
        let range = task.first as usize..(task.first + task.rays) as usize;
        counts.get(range).map_or(0.0, |counts| counts.iter().map(tests).sum())
    };
    stream.tasks.iter().map(sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlapping_spans_count_once() {
        assert_eq!(union(vec![(3.0, 4.0), (0.0, 2.0), (1.0, 2.5), (1.2, 1.3)]), 3.5);
        assert_eq!(union(Vec::new()), 0.0);
    }
}
