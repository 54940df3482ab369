//! `trace.json`: a run as Chrome trace events, which Perfetto (<https://ui.perfetto.dev>) opens.
//!
//! Format: *Trace Event Format* (Google, 2016), complete events `"X"` and metadata events `"M"`. One process per node,
//! one thread per device, and one more for the frames, in which the streams are.

use super::bars;
use crate::output::write_atomically;
use crate::{Provenance, ReportError};
use rt_balance::report::{ActivityKind, StreamRun};
use rt_cluster::Heard;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::path::Path;

/// What one process did, on its own clock: events of the format, which can be sent as they are.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Timeline(Vec<Value>);

impl Timeline {
    /// Of the process of a rank, 0 where there is one alone, whose devices' clock showed `begin_s` seconds when its
    /// balancer was made.
    #[must_use]
    pub fn of(rank: u32, runs: &[StreamRun], begin_s: f64) -> Self {
        let mut timeline = Self(events(rank, runs).collect());
        timeline.shift(begin_s);
        timeline
    }

    /// What several processes did, on the clock of rank 0 from when its own began: `own` with what others said, each
    /// made by [`Timeline::of`] as JSON. What is something else is left out.
    #[must_use]
    pub fn together(own: Self, begin_s: f64, heard: &[Heard]) -> Vec<Self> {
        let read = |heard: &Heard| {
            let mut timeline: Self = serde_json::from_slice(&heard.bytes).ok()?;
            timeline.shift(-heard.clock_ahead_s);
            Some(timeline)
        };
        let mut timelines: Vec<Self> = std::iter::once(own).chain(heard.iter().filter_map(read)).collect();
        timelines.iter_mut().for_each(|timeline| timeline.shift(-begin_s));
        timelines
    }

    /// Moves everything by so many seconds.
    fn shift(&mut self, seconds: f64) {
        for event in &mut self.0 {
            if let Some(at) = event.get("ts").and_then(Value::as_f64) {
                event["ts"] = json!(at + seconds * 1e6);
            }
        }
    }
}

/// Writes the run's activities, one event a line.
///
/// # Errors
/// When the file cannot be written.
pub fn write_json(path: &Path, runs: &[StreamRun], provenance: &Provenance) -> Result<(), ReportError> {
    write_timelines(path, &[Timeline::of(0, runs, 0.0)], provenance)
}

/// Writes what several processes did on one clock.
///
/// # Errors
/// When the file cannot be written.
pub fn write_timelines(path: &Path, timelines: &[Timeline], provenance: &Provenance) -> Result<(), ReportError> {
    write_atomically(path, |out| {
        // What the format does not know viewers keep as it is.
        let provenance = serde_json::to_string(provenance)?;
        write!(out, "{{\"displayTimeUnit\":\"ms\",\"otherData\":{{\"provenance\":{provenance}}},\"traceEvents\":[")?;
        for (index, event) in timelines.iter().flat_map(|timeline| &timeline.0).enumerate() {
            out.write_all(if index == 0 { b"\n" } else { b",\n" })?;
            serde_json::to_writer(&mut *out, event)?;
        }
        out.write_all(b"\n]}\n")
    })
}

fn events(rank: u32, runs: &[StreamRun]) -> impl Iterator<Item = Value> {
    let devices = runs.iter().map(|run| bars::rows(run).len()).max().unwrap_or(0);
    let spans = spans(runs);
    let frames: Vec<Value> = spans
        .chunk_by(|a, b| a.2.report.frame == b.2.report.frame)
        .map(|frame| {
            let (first, last) = (&frame[0], &frame[frame.len() - 1]);
            let number = first.2.report.frame;
            complete(&format!("frame {number}"), "frame", devices, first.0, last.1, json!({"frame": number}))
        })
        .collect();
    let streams = spans.into_iter().flat_map(move |(start, end, run)| {
        let report = &run.report;
        let args = json!({
            "frame": report.frame, "wave": report.wave, "rays": report.rays, "tasks": report.tasks,
            "makespan_s": report.makespan_s, "imbalance": report.imbalance, "excess": report.excess,
            "estimator": report.estimate.estimator, "estimate_s": report.estimate.seconds,
        });
        std::iter::once(complete(&report.kind, "stream", devices, start, end, args)).chain(activities(run))
    });
    names(rank, runs, devices).into_iter().chain(frames).chain(streams).map(move |mut event| {
        event["pid"] = json!(rank);
        event
    })
}

/// When each stream began and ended. None begins before the last one has ended: viewers nest what overlaps.
fn spans(runs: &[StreamRun]) -> Vec<(f64, f64, &StreamRun)> {
    let mut reached = f64::NEG_INFINITY;
    let span = |run| {
        let (start, end) = bars::extent(run);
        let start = start.max(reached);
        reached = end.max(start);
        (start, reached, run)
    };
    runs.iter().map(span).collect()
}

fn activities(run: &StreamRun) -> impl Iterator<Item = Value> {
    bars::rows(run).into_iter().flatten().map(|bar| {
        let activity = bar.activity;
        let category = match activity.kind {
            ActivityKind::Estimate => "estimate",
            ActivityKind::Launch => "launch",
        };
        let args = json!({
            "stream": run.report.kind, "frame": run.report.frame, "wave": run.report.wave,
            "tasks": activity.tasks.len(), "first_task": activity.tasks.first(), "rays": activity.rays,
            "predicted_s": activity.predicted_s, "measured_s": activity.end_s - activity.start_s,
        });
        let name = format!("{category}, {}", run.report.kind);
        complete(&name, category, activity.device, bar.start_s, bar.end_s, args)
    })
}

/// A complete event; the format counts in microseconds.
fn complete(name: &str, category: &str, thread: usize, start_s: f64, end_s: f64, args: Value) -> Value {
    json!({
        "name": name, "cat": category, "ph": "X", "tid": thread,
        "ts": start_s * 1e6, "dur": (end_s - start_s) * 1e6, "args": args,
    })
}

/// What the viewer writes beside the rows, and their order.
fn names(rank: u32, runs: &[StreamRun], devices: usize) -> Vec<Value> {
    let metadata =
        |what: &str, thread: usize, args: Value| json!({"name": what, "ph": "M", "tid": thread, "args": args});
    let mut names = vec![metadata("process_name", 0, json!({"name": format!("node {rank}")}))];
    for device in 0..devices {
        let report = runs.iter().find_map(|run| run.report.devices.get(device));
        let name = report.map_or(String::new(), |report| format!(": {} ({})", report.name, report.backend));
        names.push(metadata("thread_name", device, json!({"name": format!("device {device}{name}")})));
        names.push(metadata("thread_sort_index", device, json!({"sort_index": device + 1})));
    }
    names.push(metadata("thread_name", devices, json!({"name": "streams"})));
    names.push(metadata("thread_sort_index", devices, json!({"sort_index": 0})));
    names
}

#[cfg(test)]
mod tests {
    use super::super::samples::{launch, run};
    use super::*;

    #[test]
    fn every_activity_is_an_event_in_microseconds() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("trace.json");
        let provenance = Provenance::now(1, ["cpu:1"]);
        write_json(&path, &[run(2, vec![launch(1, 0.5, 2.0), launch(0, 0.0, 1.0)])], &provenance).unwrap();
        let trace: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        assert_eq!(trace["otherData"]["provenance"]["commit"], provenance.commit);
        let events = trace["traceEvents"].as_array().unwrap();
        let launches: Vec<&Value> = events.iter().filter(|event| event["cat"] == "launch").collect();
        assert_eq!(launches.len(), 2);
        assert_eq!(launches[1]["ts"], 500_000.0);
        assert_eq!(launches[1]["dur"], 1_500_000.0);
        assert_eq!((&launches[1]["tid"], &launches[1]["ph"]), (&json!(1), &json!("X")));
        assert_eq!(launches[1]["args"]["measured_s"], 1.5);
        let threads = events.iter().filter(|event| event["name"] == "thread_name").count();
        assert_eq!(threads, 3, "two devices and the streams");
    }

    /// Mutants: a stream that begins while the one before it is still shown; a frame that ends before its last stream.
    #[test]
    fn streams_follow_each_other_within_their_frames() {
        let early = |frame: u32, start: f64, end: f64| {
            let mut run = run(1, vec![launch(0, start, end)]);
            run.report.frame = frame;
            // More than its launches: the makespan counts from before the estimation.
            run.report.makespan_s = end - start + 0.5;
            run
        };
        let runs = [early(0, 1.0, 2.0), early(0, 2.1, 3.0), early(1, 3.1, 4.0)];
        let events: Vec<Value> = events(0, &runs).collect();
        let slices = |category: &str| {
            let of = events.iter().filter(|event| event["cat"] == category);
            of.map(|event| [&event["ts"], &event["dur"]].map(|us| us.as_f64().unwrap() / 1e6)).collect::<Vec<_>>()
        };
        let streams = slices("stream");
        assert_eq!(streams[0], [0.5, 1.5]);
        assert!(streams.windows(2).all(|pair| pair[1][0] >= pair[0][0] + pair[0][1]), "{streams:?}");
        assert_eq!(slices("frame").len(), 2);
        assert_eq!(slices("frame")[0], [0.5, 2.5]);
    }

    #[test]
    fn no_run_is_an_empty_trace() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("trace.json");
        write_json(&path, &[], &Provenance::now(None, ["cpu:1"])).unwrap();
        assert!(serde_json::from_slice::<Value>(&std::fs::read(&path).unwrap()).is_ok());
    }
}
