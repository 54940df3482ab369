//! What was measured of a stream: of a scene on one core, or as a report tells it.

use super::Check;
use crate::contenders::CENTRAL_COST;
use crate::subject::Subject;
use anyhow::{Context, Result, bail};
use rt_balance::catalogue::{ESTIMATORS, POLICIES, QUEUES, find};
use rt_balance::replay::{Observed, Replay};
use rt_balance::report::TaskTimes;
use rt_balance::{Scheduling, Stream};
use rt_core::{StreamKind, Task};
use rt_sched::cut::finer;
use serde::Deserialize;
use std::fs;
use std::ops::Range;
use std::path::Path;

/// The tasks of a stream, on the device that speeds are relative to.
#[derive(Clone, Debug)]
pub(super) struct Recording {
    pub(super) kind: StreamKind,
    pub(super) frame: u32,
    /// Rays of each task.
    pub(super) rays: Vec<u32>,
    /// Seconds of each task, traced alone.
    pub(super) task_s: Vec<f64>,
    /// Seconds of a launch on the device beside its tasks.
    pub(super) launch_s: f64,
    /// What samples of this stream told of its costs; `None` where none were walked.
    pub(super) samples: Option<Observed>,
    /// What another run of the same tasks told; `None` where a device only knows the time of whole launches.
    pub(super) past: Option<Observed>,
    /// The run that this is from, on several devices.
    real: Option<Real>,
}

/// A real run.
#[derive(Clone, Debug)]
struct Real {
    devices: Vec<String>,
    /// Relative to the first device's.
    speeds: Vec<f64>,
    makespan_s: f64,
    estimate_s: f64,
    are_speeds_known: bool,
    queue: String,
    policy: Option<String>,
}

/// An estimate that costs nothing.
fn for_nothing(predicted_s: Vec<f64>, launch_s: f64) -> Observed {
    Observed { left: vec![1.0; predicted_s.len()], predicted_s, walks_s: 0.0, planning_s: 0.0, launch_s }
}

/// Seconds of whole tasks, of which the estimation had found the hits of some rays.
fn of_whole(seconds: impl Iterator<Item = Option<f64>>, left: &[f64]) -> Option<Vec<f64>> {
    let whole = |(seconds, left): (Option<f64>, &f64)| seconds.map(|s| if *left > 0.0 { s / left } else { 0.0 });
    seconds.zip(left).map(whole).collect()
}

impl Recording {
    /// Measures a stream on the subject's only device: a run with two samples of each task, as the default makes them,
    /// and a pass in which every task runs alone. The first run calibrates the device.
    pub(super) fn measure(subject: &mut Subject<'_>, stream: &Stream) -> Result<Self> {
        let asked = ESTIMATORS[0].usual();
        // The question is what an estimate gives, not whether it pays.
        let scheduling = || Scheduling { uninformed_excess: Some(1.0), ..CENTRAL_COST.scheduling(&asked) };
        subject.trace(stream, &mut scheduling())?;
        let run = subject.trace(stream, &mut scheduling())?;
        let reference = subject.reference(stream)?;
        let samples = Observed::of(&run);
        let measured = run.measured_s.iter().map(|&s| s.is_finite().then_some(s));
        let past = of_whole(measured, &samples.left).map(|past| for_nothing(past, samples.launch_s));
        Ok(Self {
            kind: stream.kind,
            frame: stream.frame,
            rays: stream.tasks.iter().map(|task| task.rays).collect(),
            task_s: reference.seconds.into_iter().next().filter(|s| !s.is_empty()).context("the core failed")?,
            launch_s: samples.launch_s,
            samples: Some(samples),
            past,
            real: None,
        })
    }

    /// A stream of which all is known.
    #[cfg(test)]
    pub(super) fn known(kind: StreamKind, rays: Vec<u32>, task_s: Vec<f64>) -> Self {
        let seen = Some(for_nothing(task_s.clone(), 0.0));
        Self { kind, frame: 0, rays, task_s, launch_s: 0.0, samples: seen.clone(), past: seen, real: None }
    }

    pub(super) fn tasks(&self) -> Vec<Task> {
        let mut first = 0;
        let task = |&rays: &u32| {
            first += rays;
            Task { first: first - rays, rays }
        };
        self.rays.iter().map(task).collect()
    }

    /// The same, cut as queues do it that cut tasks that are too large for so many devices, whose rays are taken to be
    /// alike; `None` if none is.
    pub(super) fn finer(&self, devices: usize) -> Option<Self> {
        let tasks = self.tasks();
        let cut = finer(&tasks, devices)?;
        // The task that each is a part of, and the share.
        let part = |part: &Task| {
            let of = tasks.partition_point(|task| task.first <= part.first) - 1;
            (of, f64::from(part.rays) / f64::from(tasks[of].rays.max(1)))
        };
        let parts: Vec<(usize, f64)> = cut.iter().map(part).collect();
        let shared = |seconds: &[f64]| parts.iter().map(|&(of, share)| seconds[of] * share).collect();
        let seen = |seen: &Observed| Observed {
            predicted_s: shared(&seen.predicted_s),
            left: parts.iter().map(|&(of, _)| seen.left[of]).collect(),
            ..seen.clone()
        };
        Some(Self {
            rays: cut.iter().map(|part| part.rays).collect(),
            task_s: shared(&self.task_s),
            samples: self.samples.as_ref().map(seen),
            past: self.past.as_ref().map(seen),
            real: None,
            ..*self
        })
    }

    /// Some of its tasks, as a stream of their own.
    pub(super) fn part(&self, tasks: Range<usize>) -> Self {
        let share = tasks.len() as f64 / self.rays.len().max(1) as f64;
        let part = |seen: &Observed| Observed {
            predicted_s: seen.predicted_s[tasks.clone()].to_vec(),
            left: seen.left[tasks.clone()].to_vec(),
            walks_s: seen.walks_s * share,
            planning_s: seen.planning_s * share,
            launch_s: seen.launch_s,
        };
        Self {
            rays: self.rays[tasks.clone()].to_vec(),
            task_s: self.task_s[tasks.clone()].to_vec(),
            samples: self.samples.as_ref().map(part),
            past: self.past.as_ref().map(part),
            real: None,
            ..*self
        }
    }

    /// Plays the run that this is from, and says how far off that is; `None` where there is none, or where its queue,
    /// policy or estimate cannot be played.
    pub(super) fn check(&self, claim_s: f64) -> Option<Check> {
        let real = self.real.as_ref()?;
        let queue = find(QUEUES, &real.queue)?.make;
        let policy = match &real.policy {
            Some(policy) => Some((find(POLICIES, policy)?.make)()),
            None => None,
        };
        let scheduling = Scheduling { queue: Box::new(queue), policy, ..Scheduling::default() };
        let replay =
            Replay { speeds: &real.speeds, task_s: &self.task_s, launch_s: self.launch_s, hand_over_s: claim_s };
        let run = match &self.samples {
            Some(samples) => replay.cost_initialised(&scheduling, samples).0,
            None if real.are_speeds_known => replay.speeds_known(&scheduling, &self.rays),
            None => replay.regular(&scheduling, &self.rays),
        };
        let simulated_s = real.estimate_s + run.makespan_s;
        Some(Check {
            stream: self.kind.to_string(),
            frame: self.frame,
            devices: real.devices.clone(),
            real_s: real.makespan_s,
            simulated_s,
            error: simulated_s / real.makespan_s - 1.0,
        })
    }
}

/// What is read of report.json.
#[derive(Debug, Deserialize)]
struct File {
    schema: u32,
    scene: Scene,
    queue: String,
    policy: Option<String>,
    streams: Vec<FileStream>,
}

#[derive(Debug, Deserialize)]
struct Scene {
    source: String,
}

#[derive(Debug, Deserialize)]
struct FileStream {
    kind: String,
    frame: u32,
    makespan_s: f64,
    estimate: FileEstimate,
    devices: Vec<FileDevice>,
    task_times: Option<TaskTimes>,
}

#[derive(Debug, Deserialize)]
struct FileEstimate {
    chosen: String,
    seconds: f64,
    #[serde(default)]
    are_speeds_known: bool,
}

#[derive(Debug, Deserialize)]
struct FileDevice {
    name: String,
    model: Option<Model>,
}

#[derive(Debug, Deserialize)]
struct Model {
    per_launch_s: f64,
}

/// What a report tells of its streams.
pub(super) struct Recorded {
    /// The scene.
    pub(super) scene: String,
    /// Names of the devices.
    pub(super) devices: Vec<String>,
    /// The streams that have task times.
    pub(super) recordings: Vec<Recording>,
}

/// Reads a report of a run with a reference pass.
pub(super) fn read(path: &Path) -> Result<Recorded> {
    let shown = path.display();
    let text = fs::read_to_string(path).with_context(|| format!("cannot read {shown}"))?;
    parse(&text, &shown.to_string())
}

fn parse(text: &str, shown: &str) -> Result<Recorded> {
    let file: File = serde_json::from_str(text)
        .with_context(|| format!("{shown} is no report.json as raybalance render writes it"))?;
    if file.schema != rt_report::report::SCHEMA {
        bail!("{shown} has schema {}, not {}: render it again", file.schema, rt_report::report::SCHEMA);
    }
    let mut recordings = Vec::new();
    for stream in &file.streams {
        let Some(times) = &stream.task_times else { continue };
        let what = || format!("{shown}, frame {}, {} rays: its task times", stream.frame, stream.kind);
        recordings.push(recording(&file, stream, times).with_context(what)?);
    }
    if recordings.is_empty() {
        bail!("{shown} has no task times: render again with --reference");
    }
    let devices = file.streams.iter().flat_map(|stream| &stream.devices).map(|device| device.name.clone());
    let mut devices: Vec<String> = devices.collect();
    devices.dedup();
    Ok(Recorded { scene: file.scene.source, devices, recordings })
}

fn recording(file: &File, stream: &FileStream, times: &TaskTimes) -> Result<Recording> {
    let TaskTimes { rays, kept, alone_s, device, predicted_s, measured_s } = times;
    let tasks = rays.len();
    if [kept.len(), device.len(), predicted_s.len(), measured_s.len()].iter().any(|&len| len != tasks)
        || alone_s.iter().any(|row| !row.is_empty() && row.len() != tasks)
        || alone_s.len() != stream.devices.len()
    {
        bail!("are not one for each of {tasks} tasks and {} devices", stream.devices.len());
    }
    let rows: Option<Vec<Vec<f64>>> =
        alone_s.iter().map(|row| row.iter().map(|s| s.filter(|s| *s >= 0.0)).collect()).collect();
    let rows = rows.context("are not all known")?;
    let totals: Vec<f64> = rows.iter().map(|row| row.iter().sum()).collect();
    let is_living = |total: &f64| *total > 0.0;
    let base = totals.iter().position(is_living).context("are of no device")?;
    let speeds: Vec<f64> = totals.iter().map(|total| totals[base] / total).collect();
    let launch_s = stream.devices[base].model.as_ref().map_or(0.0, |model| model.per_launch_s).max(0.0);
    let left: Vec<f64> = rays.iter().zip(kept).map(|(&n, &kept)| 1.0 - f64::from(kept) / f64::from(n.max(1))).collect();
    // What a task takes, or was to take, on the device that speeds are relative to.
    let on_base = |seconds: &[Option<f64>]| -> Vec<Option<f64>> {
        let speed = |device: u32| speeds.get(device as usize).copied().filter(|speed| speed.is_finite());
        seconds.iter().zip(device).map(|(s, &device)| Some((*s)? * speed(device)?)).collect()
    };
    let predicted: Option<Vec<f64>> = on_base(predicted_s).into_iter().collect();
    let samples = predicted.filter(|_| stream.estimate.chosen != "uniform").map(|predicted_s| Observed {
        predicted_s,
        left: left.clone(),
        walks_s: 0.0,
        planning_s: 0.0,
        launch_s,
    });
    let past = of_whole(on_base(measured_s).into_iter(), &left).map(|past| for_nothing(past, launch_s));
    let real = totals.iter().all(is_living).then(|| Real {
        devices: stream.devices.iter().map(|device| device.name.clone()).collect(),
        speeds: speeds.clone(),
        makespan_s: stream.makespan_s,
        estimate_s: stream.estimate.seconds,
        are_speeds_known: stream.estimate.are_speeds_known,
        queue: file.queue.clone(),
        policy: file.policy.clone(),
    });
    let task_s = rows.into_iter().nth(base).unwrap_or_default();
    Ok(Recording {
        kind: kind(&stream.kind),
        frame: stream.frame,
        rays: rays.clone(),
        task_s,
        launch_s,
        samples,
        past,
        real,
    })
}

/// A stream's kind by its name in reports.
fn kind(name: &str) -> StreamKind {
    let bounce = || name.rsplit(' ').next().and_then(|bounce| bounce.parse().ok()).unwrap_or(0);
    match name.split(' ').next() {
        Some("primary") => StreamKind::Primary,
        Some("shadow") => StreamKind::Shadow(bounce()),
        Some("diffuse") => StreamKind::Diffuse(bounce()),
        _ => StreamKind::Custom,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    /// A run of three tasks of 4, 4 and 1 seconds on a device and one of half its speed.
    fn report() -> Value {
        let device = |name| json!({ "name": name, "model": { "per_launch_s": 0.5 } });
        json!({
            "schema": rt_report::report::SCHEMA, "scene": { "source": "builtin:yard" },
            "queue": "static", "policy": "round-robin",
            "streams": [{
                "kind": "diffuse 1", "frame": 2, "makespan_s": 10.0,
                "estimate": { "chosen": "uniform", "seconds": 0.25, "are_speeds_known": false },
                "devices": [device("fast"), device("slow")],
                "task_times": {
                    "rays": [8, 8, 8], "kept": [0, 0, 4], "alone_s": [[4.0, 4.0, 1.0], [8.0, 8.0, 2.0]],
                    "device": [0, 1, 0], "predicted_s": [1e-8, 1e-8, 1e-8], "measured_s": [4.2, 8.4, 0.5],
                },
            }, {
                "kind": "shadow 0", "frame": 0, "makespan_s": 1.0, "devices": [], "task_times": null,
                "estimate": { "chosen": "uniform", "seconds": 0.0 },
            }],
        })
    }

    fn read(report: &Value) -> Result<Recorded> {
        parse(&report.to_string(), "r.json")
    }

    /// Mutants: speeds turned over; seconds of the slow device taken for the fast one's; kept rays not made up for; the
    /// estimation, or a launch, left out of the run that is played again.
    #[test]
    fn a_report_is_played_again() {
        let recorded = read(&report()).expect("a report");
        assert_eq!((recorded.recordings.len(), recorded.scene.as_str()), (1, "builtin:yard"));
        assert_eq!(recorded.devices, ["fast", "slow"]);
        let recording = &recorded.recordings[0];
        assert_eq!((recording.kind, recording.frame), (StreamKind::Diffuse(1), 2));
        assert_eq!((&recording.task_s[..], recording.launch_s), (&[4.0, 4.0, 1.0][..], 0.5));
        assert!(recording.samples.is_none(), "nothing was estimated");
        let past = recording.past.as_ref().expect("all was measured");
        assert_eq!(past.predicted_s, [4.2, 4.2, 1.0]);
        // In turn: the slow device has the second task, and its launch.
        let check = recording.check(1e-9).expect("it can be played");
        assert!((check.simulated_s - (0.25 + 0.5 + 8.0)).abs() < 1e-5, "{check:?}");
        assert!((check.error - (8.75 / 10.0 - 1.0)).abs() < 1e-5, "{check:?}");
    }

    /// Mutants: lengths that are not compared; a schema that is not looked at; streams without times that count.
    #[test]
    fn what_is_no_such_report_is_explained() {
        let refused = |path: &str, value: Value, says: &str| {
            let mut report = report();
            *report.pointer_mut(path).expect("it is there") = value;
            let error = format!("{:#}", read(&report).err().expect(path));
            assert!(error.contains("r.json") && error.contains(says), "{error}");
        };
        refused("/schema", json!(1), "schema 1");
        refused("/streams/0/task_times", Value::Null, "--reference");
        refused("/streams/0/task_times/kept", json!([0, 0]), "each of 3 tasks");
        refused("/streams/0/task_times/alone_s/1", json!([1.0]), "2 devices");
        refused("/streams/0/task_times/alone_s/1/0", Value::Null, "all known");
        refused("/streams/0/task_times/alone_s", json!([[], []]), "of no device");
        refused("/queue", json!(3), "no report.json");
    }
}
