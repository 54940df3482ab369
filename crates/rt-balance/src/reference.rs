//! The separate pass that makes excess and estimation errors known.

use crate::balancer::Balancer;
use crate::measure::tests_of;
use crate::member::Member;
use crate::report::{ErrorReport, StreamRun};
use crate::stats::median;
use crate::{BalanceError, Stream, clock};
use rt_core::{DeviceError, Launch, TestCounts};
use rt_sched::calibrate::cross_predicted;
use rt_sched::metrics::EstimateErrors;
use rt_sched::{bound, metrics};
use std::time::Duration;

/// Longest wait for one task of the pass.
const LIMIT: Duration = Duration::from_secs(600);

/// What every task of a stream costs, measured by itself.
#[derive(Clone, Debug)]
pub struct Reference {
    /// Seconds of each task on each device (`seconds[device][task]`), one task per launch, the launch's own cost left
    /// out; the median over the passes. Empty for a device that failed.
    pub seconds: Vec<Vec<f64>>,
    /// Exact number of box and triangle tests of each task.
    pub tests: Vec<f64>,
    /// Least seconds that any schedule of these tasks over these devices needs.
    pub lower_bound_s: f64,
    /// Wall seconds that this took.
    pub wall_s: f64,
}

impl Balancer {
    /// Traces every task of `stream` alone, `passes` times on each device, and once more to count its tests.
    ///
    /// All devices work at once, as in a run, so that what they share (memory, power) is shared here too. Nothing is
    /// learned from it, so the runs it judges are not fitted to it.
    ///
    /// # Errors
    /// When the stream's tasks do not cover its rays, or every device failed.
    pub fn reference(&mut self, stream: &Stream, passes: usize) -> Result<Reference, BalanceError> {
        stream.check()?;
        let begin = clock::now();
        self.load(stream)?;
        let mut seconds: Vec<Vec<f64>> = std::thread::scope(|scope| {
            let time = |member| scope.spawn(move || time_tasks(member, stream, passes.max(1)));
            let threads: Vec<_> = self.members().iter_mut().map(time).collect();
            threads.into_iter().map(|thread| thread.join().unwrap_or_default()).collect()
        });
        let mut counted = stream.clone();
        counted.spec.counts = true;
        self.load(&counted)?;
        let mut tests = None;
        for (member, seconds) in self.members().iter_mut().zip(&mut seconds) {
            if member.tracer.is_none() {
                seconds.clear();
            } else if tests.is_none() {
                tests = on_tracer(member, |tracer| count_tasks(tracer, &counted));
            }
        }
        let Some(tests) = tests else {
            return Err(crate::member::all_lost(self.members(), stream.tasks.len()));
        };
        let lower_bound_s = lower_bound(&seconds);
        let wall_s = clock::now().saturating_sub(begin).as_secs_f64();
        Ok(Reference { seconds, tests, lower_bound_s, wall_s })
    }
}

impl Reference {
    /// The median of several passes over one stream, task by task; `None` of none.
    #[must_use]
    pub fn median(passes: &[Self]) -> Option<Self> {
        let first = passes.first()?;
        let median_of = |device: usize, task: usize| {
            let values = passes.iter().filter_map(|pass| pass.seconds.get(device)?.get(task).copied());
            median(&values.collect::<Vec<_>>())
        };
        let seconds: Vec<Vec<f64>> = (0..first.seconds.len())
            .map(|device| (0..first.seconds[device].len()).map(|task| median_of(device, task)).collect())
            .collect();
        let lower_bound_s = lower_bound(&seconds);
        let wall_s = passes.iter().map(|pass| pass.wall_s).sum();
        Some(Self { seconds, tests: first.tests.clone(), lower_bound_s, wall_s })
    }

    /// Fills in what only a reference pass knows: lower bound, excess, and both estimation errors.
    pub fn judge(&self, run: &mut StreamRun) {
        run.reference_s = Some(self.wall_s);
        let report = &mut run.report;
        report.lower_bound_s = Some(self.lower_bound_s);
        report.excess = metrics::excess(report.makespan_s, self.lower_bound_s);
        let estimated: Vec<f64> = run.work.iter().map(|work| f64::from(work.tests())).collect();
        let errors = |estimated: &[f64], truth: &[f64]| EstimateErrors::new(estimated, truth).map(ErrorReport::from);
        report.estimate.errors_counts = errors(&estimated, &self.tests);
        report.estimate.mre_counts = report.estimate.errors_counts.map(|errors| errors.mean);
        let own = |task: usize| {
            let device = run.device_of.get(task).map_or(usize::MAX, |&device| device as usize);
            self.seconds.get(device).and_then(|s| s.get(task)).copied().unwrap_or(f64::NAN)
        };
        let truth: Vec<f64> = (0..run.tasks.len()).map(own).collect();
        report.estimate.errors_time = errors(&cross_predicted(&run.work, &truth), &truth);
        report.estimate.mre_time = report.estimate.errors_time.map(|errors| errors.mean);
    }
}

/// The bound over the devices that did not fail.
fn lower_bound(seconds: &[Vec<f64>]) -> f64 {
    let living: Vec<&[f64]> = seconds.iter().filter(|s| !s.is_empty()).map(Vec::as_slice).collect();
    bound::unrelated(&living)
}

/// Runs something on a member's tracer; a failure drops the member out.
fn on_tracer<T>(
    member: &mut Member,
    work: impl FnOnce(&mut dyn rt_core::Tracer) -> Result<T, DeviceError>,
) -> Option<T> {
    let tracer = member.tracer.as_mut()?;
    match work(&mut **tracer) {
        Ok(value) => Some(value),
        Err(error) => {
            member.fail(&error);
            None
        }
    }
}

/// Median seconds of each task; empty when the device failed.
fn time_tasks(member: &mut Member, stream: &Stream, passes: usize) -> Vec<f64> {
    let mut samples = vec![Vec::with_capacity(passes); stream.tasks.len()];
    let launch_s = member.models.per_launch();
    let done = on_tracer(member, |tracer| {
        let mut launch = Launch::default();
        for _ in 0..passes {
            for (&task, samples) in stream.tasks.iter().zip(&mut samples) {
                let ticket = tracer.submit(&[task], None)?;
                tracer.wait(ticket, LIMIT, &mut launch)?;
                samples.push(match launch.task_seconds.first() {
                    Some(&seconds) => f64::from(seconds),
                    None => (launch.span.in_kernel.as_secs_f64() - launch_s).max(0.0),
                });
            }
        }
        Ok(())
    });
    if done.is_none() {
        return Vec::new();
    }
    samples.iter().map(|s| median(s)).collect()
}

fn count_tasks(tracer: &mut dyn rt_core::Tracer, stream: &Stream) -> Result<Vec<f64>, DeviceError> {
    let mut counts = vec![TestCounts::default(); stream.source.len() as usize];
    let mut launch = Launch::default();
    for &task in &stream.tasks {
        let ticket = tracer.submit(&[task], None)?;
        tracer.wait(ticket, LIMIT, &mut launch)?;
        counts[task.first as usize..(task.first + task.rays) as usize].copy_from_slice(&launch.counts);
    }
    Ok(tests_of(stream, &counts))
}
