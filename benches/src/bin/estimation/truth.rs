//! What tasks really cost.

use super::LIMIT;
use rt_balance::stats::median;
use rt_core::{Launch, RaySource, StreamSpec, Task, TestCounts, Tracer, Work};
use rt_sched::calibrate::{Calibration, Measured, cross_predicted};
use rt_sched::metrics::EstimateErrors;
use std::error::Error;

/// Exact counts and measured seconds of each task.
#[derive(Debug)]
pub(crate) struct Truth {
    /// Box and triangle tests of each task.
    pub(crate) tests: Vec<f64>,
    /// Thread seconds of each task, alone in its launch: the median of the passes.
    pub(crate) seconds: Vec<f64>,
    /// Errors of the even passes' medians against the odd ones'.
    pub(crate) repeatability: Option<EstimateErrors>,
    /// Errors of exact counts with fitted prices against seconds: what no estimate of counts can undercut.
    pub(crate) counts_as_time: Option<EstimateErrors>,
    /// The same with a fifth price, for how much neighbouring rays differ: a measure of what caches do not share.
    pub(crate) with_cache_term: Option<EstimateErrors>,
}

impl Truth {
    pub(crate) fn measure(
        tracer: &mut dyn Tracer,
        source: &RaySource,
        tasks: &[Task],
        passes: usize,
    ) -> Result<Self, Box<dyn Error>> {
        let mut launch = Launch::default();
        tracer.load_rays(source.clone(), StreamSpec { counts: true, ..StreamSpec::default() })?;
        let ticket = tracer.submit(tasks, None)?;
        tracer.wait(ticket, LIMIT, &mut launch)?;
        let counts = launch.counts.clone();
        tracer.load_rays(source.clone(), StreamSpec::default())?;
        let mut samples = vec![Vec::with_capacity(passes); tasks.len()];
        for _ in 0..passes {
            for (task, samples) in tasks.iter().zip(&mut samples) {
                let ticket = tracer.submit(&[*task], None)?;
                tracer.wait(ticket, LIMIT, &mut launch)?;
                samples.push(f64::from(launch.task_seconds.first().copied().ok_or("the device times no tasks")?));
            }
        }
        let of = |task: &Task| &counts[task.first as usize..(task.first + task.rays) as usize];
        let work: Vec<Work> = tasks.iter().map(|task| exact(of(task))).collect();
        let seconds: Vec<f64> = samples.iter().map(|s| median(s)).collect();
        let half = |parity: usize| -> Vec<f64> {
            let of = |s: &Vec<f64>| median(&s.iter().copied().skip(parity).step_by(2).collect::<Vec<_>>());
            samples.iter().map(of).collect()
        };
        let steps: Vec<f64> = tasks.iter().map(|task| unlike(of(task))).collect();
        Ok(Self {
            tests: work.iter().map(|w| f64::from(w.tests())).collect(),
            repeatability: EstimateErrors::new(&half(0), &half(1)),
            counts_as_time: EstimateErrors::new(&cross_predicted(&work, &seconds), &seconds),
            with_cache_term: EstimateErrors::new(&cross_predicted_with(&work, &steps, &seconds), &seconds),
            seconds,
        })
    }
}

fn exact(counts: &[TestCounts]) -> Work {
    let sum = |of: fn(&TestCounts) -> u32| counts.iter().map(|c| u64::from(of(c))).sum::<u64>() as f32;
    Work::new(counts.len() as f32, sum(|c| c.boxes), sum(|c| c.triangles))
}

/// How much neighbouring rays' box tests differ, summed over a task: rays on different ways share no cache lines.
fn unlike(counts: &[TestCounts]) -> f64 {
    counts.windows(2).map(|pair| f64::from(pair[0].boxes.abs_diff(pair[1].boxes))).sum()
}

/// As [`cross_predicted`], with a price for `extra`. The calibration has four columns; tasks are measured without their
/// launch, so the launches' column is free for it.
fn cross_predicted_with(work: &[Work], extra: &[f64], seconds: &[f64]) -> Vec<f64> {
    let measured = |task: usize| Measured { launches: extra[task], ..Measured::of(&work[task], seconds[task]) };
    let fits = [0, 1].map(|parity| {
        let mut calibration = Calibration::new(f64::INFINITY);
        (parity..work.len()).step_by(2).for_each(|task| calibration.observe(measured(task)));
        calibration.fit()
    });
    let predict = |task: usize| {
        let of = |fit: &rt_sched::calibrate::Fit| fit.model.per_launch() * extra[task] + fit.model.seconds(&work[task]);
        fits[1 - task % 2].as_ref().map_or(f64::NAN, of)
    };
    (0..work.len()).map(predict).collect()
}
