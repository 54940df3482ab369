//! What tasks really cost.

use super::LIMIT;
use anyhow::{Context, Result};
use rt_balance::stats::median;
use rt_core::{Launch, RaySource, StreamSpec, Task, TestCounts, Tracer, Work};
use rt_sched::calibrate::cross_predicted;
use rt_sched::metrics::EstimateErrors;

/// Exact counts and measured seconds of each task.
#[derive(Debug)]
pub(crate) struct Truth {
    /// Box and triangle tests of each task.
    pub(crate) tests: Vec<f64>,
    /// Thread seconds of each task, alone in its launch: the median of the passes.
    pub(crate) seconds: Vec<f64>,
    /// The same from the even passes alone, to which prices are fitted, and from the odd ones, which drive replays.
    pub(crate) halves: [Vec<f64>; 2],
    /// Errors of the even passes' medians against the odd ones'.
    pub(crate) repeatability: Option<EstimateErrors>,
    /// Errors of exact counts with fitted prices against seconds: what no estimate of counts can undercut.
    pub(crate) counts_as_time: Option<EstimateErrors>,
    /// The same with the price of divergence.
    pub(crate) with_divergence: Option<EstimateErrors>,
}

impl Truth {
    pub(crate) fn measure(tracer: &mut dyn Tracer, source: &RaySource, tasks: &[Task], passes: usize) -> Result<Self> {
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
                samples.push(f64::from(launch.task_seconds.first().copied().context("the device times no tasks")?));
            }
        }
        let of = |task: &Task| &counts[task.first as usize..(task.first + task.rays) as usize];
        let work: Vec<Work> = tasks.iter().map(|task| exact(of(task))).collect();
        let seconds: Vec<f64> = samples.iter().map(|s| median(s)).collect();
        let half = |parity: usize| -> Vec<f64> {
            let of = |s: &Vec<f64>| median(&s.iter().copied().skip(parity).step_by(2).collect::<Vec<_>>());
            samples.iter().map(of).collect()
        };
        let alike: Vec<Work> = work.iter().map(|w| w.with_divergence(0.0)).collect();
        Ok(Self {
            tests: work.iter().map(|w| f64::from(w.tests())).collect(),
            repeatability: EstimateErrors::new(&half(0), &half(1)),
            halves: [half(0), half(1)],
            counts_as_time: EstimateErrors::new(&cross_predicted(&alike, &seconds), &seconds),
            with_divergence: EstimateErrors::new(&cross_predicted(&work, &seconds), &seconds),
            seconds,
        })
    }
}

fn exact(counts: &[TestCounts]) -> Work {
    let sum = |of: fn(&TestCounts) -> u32| counts.iter().map(|c| u64::from(of(c))).sum::<u64>() as f32;
    let steps: f64 = counts.windows(2).map(|pair| f64::from(pair[0].boxes.abs_diff(pair[1].boxes))).sum();
    Work::new(counts.len() as f32, sum(|c| c.boxes), sum(|c| c.triangles)).with_divergence(steps as f32)
}
