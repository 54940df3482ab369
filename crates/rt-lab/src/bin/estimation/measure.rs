//! Runs one estimator once, and judges it.

use super::LIMIT;
use super::options::Options;
use super::truth::Truth;
use anyhow::Result;
use rt_balance::Scheduling;
use rt_balance::catalogue::{Entry, Make};
use rt_balance::replay::{Observed, Replay};
use rt_core::{
    CostEstimator, Hit, Launch, LaunchRecord, Observation, RayMask, RaySource, RayStream, Span, Step, StreamKind,
    StreamRecord, Task, TaskOutcome, TestCounts, Tracer, Walk, Work,
};
use rt_lab::contenders::MACHINES;
use rt_lab::estimators;
use rt_report::usage::usage;
use rt_sched::calibrate::cross_predicted;
use rt_sched::estimate::interval_95;
use rt_sched::metrics::{self, EstimateErrors};
use std::sync::Arc;
use std::time::Instant;

/// An estimator with its parameters.
#[derive(Debug)]
pub(crate) struct Case {
    pub(crate) name: String,
    estimator: Box<dyn CostEstimator>,
}

/// What one repetition of a case showed. Seconds.
#[derive(Clone, Debug)]
pub(crate) struct Outcome {
    pub(crate) seed: u32,
    pub(crate) chosen: &'static str,
    pub(crate) walked: u64,
    pub(crate) plain: Seconds,
    pub(crate) estimate: Seconds,
    pub(crate) remaining: Seconds,
    /// Wall seconds of the walks alone.
    pub(crate) walk_s: f64,
    pub(crate) counts: Option<EstimateErrors>,
    pub(crate) time: Option<EstimateErrors>,
    /// Excess over the lower bound of a hybrid queue on each of [`MACHINES`], estimation included.
    pub(crate) excess: [f64; MACHINES.len()],
    /// Share of the tasks whose 95% interval holds their exact tests; `None` where no task has one.
    pub(crate) coverage: Option<f64>,
}

/// Seconds of a launch beside its tasks: about what handing one over to a thread takes.
const HAND_OVER_S: f64 = 1e-5;

/// Excess of a hybrid queue on [`MACHINES`] that is started by `walked`, or knows nothing if that made no samples.
///
/// Prices are fitted to the even passes and to other tasks than those they predict; the virtual devices take as long as
/// in the odd passes.
fn excess(walked: &Walked, tasks: &[Task], truth: &Truth) -> [f64; MACHINES.len()] {
    let [fitted, task_s] = &truth.halves;
    let kept = |task: &Task| walked.mask.as_ref().map_or(0, |mask| mask.count_in(task.range()));
    let left: Vec<f64> = tasks.iter().map(|task| 1.0 - f64::from(kept(task)) / f64::from(task.rays.max(1))).collect();
    let predicted = cross_predicted(&walked.work, fitted);
    let seen = Observed {
        predicted_s: predicted.iter().zip(&left).map(|(seconds, left)| seconds * left).collect(),
        left,
        walks_s: walked.walk_s,
        planning_s: (walked.wall_s - walked.walk_s).max(0.0),
        launch_s: 0.0,
    };
    let rays: Vec<u32> = tasks.iter().map(|task| task.rays).collect();
    MACHINES.map(|(_, speeds)| {
        let replay = Replay { speeds, task_s, launch_s: 0.0, hand_over_s: HAND_OVER_S };
        let (run, estimate_s) = if walked.knows {
            replay.cost_initialised(&Scheduling::default(), &seen)
        } else {
            (replay.regular(&Scheduling::default(), &rays), 0.0)
        };
        let total = estimate_s + run.makespan_s;
        metrics::excess(total, replay.lower_bound()).unwrap_or(f64::NAN)
    })
}

impl Outcome {
    /// (estimate + remaining − plain) / plain.
    pub(crate) fn net(&self, of: fn(&Seconds) -> f64) -> f64 {
        (of(&self.estimate) + of(&self.remaining)) / of(&self.plain) - 1.0
    }
}

/// What something took.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Seconds {
    pub(crate) wall: f64,
    /// Processor time of all threads of this process.
    pub(crate) cpu: f64,
}

/// Runs `work` and says what it took.
fn timed<T>(work: impl FnOnce() -> T) -> (T, Seconds) {
    let (start, busy) = (Instant::now(), processor_s());
    let result = work();
    (result, Seconds { wall: start.elapsed().as_secs_f64(), cpu: processor_s() - busy })
}

#[cfg(unix)]
fn processor_s() -> f64 {
    let t = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    t.tv_sec as f64 + 1e-9 * t.tv_nsec as f64
}

/// The wall's time, where the system does not tell.
#[cfg(not(unix))]
fn processor_s() -> f64 {
    rt_balance::clock().as_secs_f64()
}

impl Case {
    /// Whether every name that is asked for is one.
    pub(crate) fn check(options: &Options) -> Result<()> {
        let names: Vec<String> =
            Self::list(&Options { only: Vec::new(), ..options.clone() }).into_iter().map(|case| case.name).collect();
        let family = |name: &str| name.split(' ').next().unwrap_or_default().to_owned();
        match options.only.iter().find(|only| !names.iter().any(|name| *only == name || **only == family(name))) {
            Some(unknown) => Err(usage(format!("--only {unknown}: there are {}", names.join(", "))).into()),
            None => Ok(()),
        }
    }

    /// All cases asked for.
    pub(crate) fn list(options: &Options) -> Vec<Self> {
        /// One ray in so many; where the ray is not traced, fewer do not pay.
        const ONE_IN: [u32; 4] = [8, 64, 128, 256];
        let sampling = |entry: &'static Entry<Make>| {
            let reduced = matches!(entry.usual().make().walk(), Some(Walk::Reduced(_)));
            let (every, most) = if reduced { (Some(1), 64) } else { (None, u32::MAX) };
            let one_in = ONE_IN.into_iter().filter(move |&n| n <= most).chain(every);
            one_in.filter_map(|n| entry.with(1.0 / f64::from(n))).collect::<Vec<_>>()
        };
        let chosen = estimators::all().iter().flat_map(|entry| match entry.make {
            Make::Sampling(..) => sampling(entry),
            _ => vec![entry.usual()],
        });
        let cases = chosen.map(|chosen| Self { name: chosen.label().to_owned(), estimator: chosen.make() });
        let asked = |case: &Self| {
            let family = case.name.split(' ').next().unwrap_or_default();
            options.only.is_empty() || options.only.iter().any(|only| only == family || *only == case.name)
        };
        cases.filter(asked).collect()
    }

    /// A plain trace of all rays, then the estimate and the trace of what is left.
    pub(crate) fn run(
        &mut self,
        tracer: &mut dyn Tracer,
        source: &RaySource,
        kind: StreamKind,
        tasks: &[Task],
        seed: u32,
        truth: &Truth,
    ) -> Result<Outcome> {
        let mut launch = Launch::default();
        let (result, plain) = timed(|| trace(tracer, tasks, None, &mut launch));
        result?;
        let stream = RayStream { seed, source: Some(source), devices: 2, ..RayStream::new(kind, tasks) };
        let (result, estimate) = timed(|| walk(&mut *self.estimator, stream, tracer));
        let walked = result?;
        let (result, remaining) = timed(|| trace(tracer, tasks, walked.mask.as_ref(), &mut launch));
        let span = result?;
        self.teach(stream, &walked, &launch, span);
        let estimated: Vec<f64> = walked.work.iter().map(|w| f64::from(w.tests())).collect();
        Ok(Outcome {
            seed,
            chosen: self.estimator.chosen(),
            walked: walked.rays.len() as u64,
            plain,
            estimate,
            remaining,
            walk_s: walked.walk_s,
            counts: EstimateErrors::new(&estimated, &truth.tests),
            time: EstimateErrors::new(&cross_predicted(&walked.work, &truth.seconds), &truth.seconds),
            excess: excess(&walked, tasks, truth),
            coverage: coverage(&walked, tasks, &truth.tests),
        })
    }

    /// What a driver tells an estimator.
    fn teach(&mut self, stream: RayStream<'_>, walked: &Walked, launch: &Launch, span: Span) {
        let tests: f64 = walked.work.iter().map(|w| f64::from(w.tests())).sum();
        let busy: f64 = launch.task_seconds.iter().copied().map(f64::from).sum();
        let outcome = |(task, (work, &seconds)): (u32, (&Work, &f32))| TaskOutcome {
            task,
            predicted_s: f64::from(work.tests()) * busy / tests,
            measured_s: f64::from(seconds),
        };
        let outcomes: Vec<TaskOutcome> = (0..).zip(walked.work.iter().zip(&launch.task_seconds)).map(outcome).collect();
        let work = &walked.work;
        self.estimator.learn(&LaunchRecord { stream, work, device: 0, outcomes: &outcomes, per_task: true });
        let kept = walked.mask.as_ref().map_or(0, |mask| u64::from(mask.count()));
        self.estimator.finish(&StreamRecord {
            stream,
            walked_rays: walked.rays.len() as u64,
            walk_s: walked.walk_s,
            host_s: (walked.wall_s - walked.walk_s).max(0.0),
            traced_rays: u64::from(stream.rays()) - kept,
            trace_s: span.in_kernel.as_secs_f64(),
        });
    }
}

/// An estimate and how it came about.
struct Walked {
    work: Vec<Work>,
    rays: Vec<u32>,
    mask: Option<Arc<RayMask>>,
    walk_s: f64,
    /// Wall seconds of all of it.
    wall_s: f64,
    /// Whether tasks were told apart.
    knows: bool,
}

fn trace(
    tracer: &mut dyn Tracer,
    tasks: &[Task],
    done: Option<&Arc<RayMask>>,
    launch: &mut Launch,
) -> Result<Span, rt_core::DeviceError> {
    let ticket = tracer.submit(tasks, done)?;
    tracer.wait(ticket, LIMIT, launch)?;
    Ok(launch.span)
}

/// What a driver does with an estimator, on one device.
fn walk(
    estimator: &mut dyn CostEstimator,
    stream: RayStream<'_>,
    tracer: &mut dyn Tracer,
) -> Result<Walked, rt_core::DeviceError> {
    let (mut rays, mut counts, mut all) = (Vec::new(), Vec::new(), Vec::new());
    let mut kept: Option<RayMask> = None;
    let mut walk_s = 0.0;
    let begin = Instant::now();
    loop {
        match estimator.next(stream, Observation { rays: &rays, counts: &counts }) {
            Step::Done(work) => {
                let wall_s = begin.elapsed().as_secs_f64();
                let knows = estimator.counts_tests();
                return Ok(Walked { work, rays: all, mask: kept.map(Arc::new), walk_s, wall_s, knows });
            }
            Step::Sample { rays: asked, walk } => {
                counts = vec![TestCounts::default(); asked.len()];
                let full = walk == Walk::Full;
                let mut hits = vec![Hit::MISS; if full { asked.len() } else { 0 }];
                let span = tracer.walk(&asked, walk, &mut counts, full.then_some(&mut hits[..]))?;
                walk_s += span.in_kernel.as_secs_f64();
                if full {
                    let mask = kept.get_or_insert_with(|| RayMask::new(stream.rays()));
                    asked.iter().for_each(|&ray| mask.insert(ray));
                }
                all.extend_from_slice(&asked);
                rays = asked;
            }
        }
    }
}

/// Share of the tasks whose interval holds.
fn coverage(walked: &Walked, tasks: &[Task], truth: &[f64]) -> Option<f64> {
    let mut samples = vec![0_u32; tasks.len()];
    for ray in &walked.rays {
        samples[tasks.partition_point(|task| task.first + task.rays <= *ray)] += 1;
    }
    let holds = |((work, &n), truth): ((&Work, &u32), &f64)| {
        Some((f64::from(work.tests()) - truth).abs() <= interval_95(work, n)?)
    };
    let known: Vec<bool> = walked.work.iter().zip(&samples).zip(truth).filter_map(holds).collect();
    (!known.is_empty()).then(|| known.iter().filter(|&&holds| holds).count() as f64 / known.len() as f64)
}
