//! The separate pass that makes excess and estimation errors known.

use crate::balancer::Balancer;
use crate::device_state::{DeviceState, all_lost, cancelled};
use crate::device_thread::{Answer, Call, Done};
use crate::limits::{Heard, earlier, hear};
use crate::measure::tests_of;
use crate::report::{ErrorReport, StreamRun, TaskTimes};
use crate::stats::median;
use crate::{Audit, BalanceError, Control, Limits, Stream, clock};
use rt_core::{Launch, TestCounts};
use rt_sched::calibrate::cross_predicted;
use rt_sched::metrics::EstimateErrors;
use rt_sched::{bound, metrics};
use std::sync::mpsc::channel;
use std::time::Instant;

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
    /// When the stream's tasks do not cover its rays, the caller cancels, or every device failed.
    pub fn reference(
        &mut self,
        stream: &Stream,
        passes: usize,
        limits: &Limits,
        control: Control<'_>,
    ) -> Result<Reference, BalanceError> {
        stream.check()?;
        let _environment = rt_fenv::Environment::enter();
        let begin = clock::now();
        let untouched = |error: BalanceError| error.with_unfinished(stream.tasks.len());
        self.members().iter_mut().for_each(DeviceState::begin);
        self.load(stream, limits, Audit::OFF, control).map_err(untouched)?;
        let passes = passes.max(1);
        let mut seconds: Vec<Vec<Vec<f64>>> =
            self.members().iter().map(|_| vec![Vec::new(); stream.tasks.len()]).collect();
        let all = |_: &DeviceState| true;
        one_by_one(self.members(), stream, passes, all, limits, control, |member, task, launch| {
            seconds[member.index][task].push(match launch.task_seconds.first() {
                Some(&seconds) => f64::from(seconds),
                None => (launch.span.in_kernel.as_secs_f64() - member.models.per_launch()).max(0.0),
            });
        })
        .map_err(untouched)?;

        let mut counted = stream.clone();
        counted.spec.counts = true;
        self.load(&counted, limits, Audit::OFF, control).map_err(untouched)?;
        let mut counts = vec![TestCounts::default(); stream.source.len() as usize];
        // Counts do not depend on the device: the first that can be had.
        while let Some(first) = self.members().iter().find(|member| member.is_ready()).map(|member| member.index) {
            let only = |member: &DeviceState| member.index == first;
            let left = one_by_one(self.members(), &counted, 1, only, limits, control, |_, task, launch| {
                let task = stream.tasks[task];
                counts[task.first as usize..(task.first + task.rays) as usize].copy_from_slice(&launch.counts);
            });
            if left.map_err(untouched)? == 0 {
                break;
            }
        }
        if !self.members().iter().any(DeviceState::is_ready) {
            return Err(all_lost(self.members(), stream.tasks.len()));
        }
        let whole = |seconds: &[Vec<f64>]| seconds.iter().all(|seconds| seconds.len() == passes);
        let of = |seconds: Vec<Vec<f64>>| {
            if whole(&seconds) { seconds.iter().map(|s| median(s)).collect() } else { Vec::new() }
        };
        let seconds: Vec<Vec<f64>> = seconds.into_iter().map(of).collect();
        let tests = tests_of(stream, &counts);
        let lower_bound_s = lower_bound(&seconds);
        let wall_s = clock::now().saturating_sub(begin).as_secs_f64();
        Ok(Reference { seconds, tests, lower_bound_s, wall_s })
    }
}

/// Has each device that is ready and `chosen` trace every task by itself, `passes` times, and hands each launch to
/// `sink`. Returns the number of launches that came to nothing, since devices failed.
fn one_by_one(
    members: &mut [DeviceState],
    stream: &Stream,
    passes: usize,
    chosen: impl Fn(&DeviceState) -> bool,
    limits: &Limits,
    control: Control<'_>,
    mut sink: impl FnMut(&DeviceState, usize, &Launch),
) -> Result<usize, BalanceError> {
    let (to, answers) = channel();
    let all = stream.tasks.len() * passes;
    let ask = |member: &mut DeviceState, number: usize| {
        member.tell(Call::Submit { tasks: vec![stream.tasks[number % stream.tasks.len()]], done: None });
        let buffers = std::mem::take(&mut member.buffers);
        member.ask(Call::Wait { buffers }, &to);
    };
    let mut done = vec![all; members.len()];
    for member in members.iter_mut().filter(|member| all > 0 && member.is_ready() && chosen(member)) {
        done[member.index] = 0;
        ask(member, 0);
    }
    loop {
        let busy = || done.iter().enumerate().filter(|(_, done)| **done < all).map(|(index, _)| index);
        let busy: Vec<usize> = busy().filter(|&index| members[index].is_alive()).collect();
        if busy.is_empty() {
            return Ok(done.iter().map(|done| all - done).sum());
        }
        let lost_at = busy.iter().fold(None, |at, &index| earlier(at, members[index].lost_at(limits)));
        match hear(&answers, lost_at, control) {
            Heard::Answer(Answer { member: index, result, status }) => {
                let member = &mut members[index];
                member.answered(&status);
                match result {
                    Ok(Done::Launched(launch, _)) => {
                        sink(member, done[index] % stream.tasks.len(), &launch);
                        member.buffers = launch;
                        done[index] += 1;
                        if done[index] < all {
                            ask(member, done[index]);
                        }
                    }
                    // Nothing else was asked for.
                    Ok(_) => {}
                    Err(error) => member.fail(error),
                }
            }
            Heard::Late => {
                let now = Instant::now();
                for index in busy {
                    if members[index].lost_at(limits).is_some_and(|at| at <= now) {
                        members[index].give_up(limits);
                    }
                }
            }
            Heard::Cancelled => return Err(cancelled()),
        }
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

    /// Fills in what only a reference pass knows: lower bound, excess, both estimation errors, and each task's times.
    pub fn judge(&self, run: &mut StreamRun) {
        run.reference_s = Some(self.wall_s);
        let known = |seconds: &Vec<f64>| seconds.iter().map(|&s| s.is_finite().then_some(s)).collect::<Vec<_>>();
        let report = &mut run.report;
        report.task_times = Some(TaskTimes {
            rays: run.tasks.iter().map(|task| task.rays).collect(),
            kept: run.kept.clone(),
            alone_s: self.seconds.iter().map(known).collect(),
            device: run.device_of.clone(),
            predicted_s: known(&run.predicted_s),
            measured_s: known(&run.measured_s),
        });
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
