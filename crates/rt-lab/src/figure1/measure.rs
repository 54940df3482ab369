//! The measurements: every configuration in turn, round after round.

use crate::contenders::{self, Contender, Estimate};
use crate::subject::Subject;
use anyhow::{Context, Result};
use rt_balance::catalogue::Estimator;
use rt_balance::replay::{Observed, Replay};
use rt_balance::stats::Summary;
use rt_balance::{Scheduling, Stream};
use serde::Serialize;

/// One scene and kind of rays.
#[derive(Debug, Serialize)]
pub(crate) struct Panel {
    pub(crate) scene: String,
    pub(crate) stream: String,
    pub(crate) rays: u32,
    pub(crate) sizes: Vec<Size>,
}

/// All times at one task size.
#[derive(Debug, Serialize)]
pub(crate) struct Size {
    /// Rays per task.
    pub(crate) task_rays: u32,
    pub(crate) tasks: usize,
    /// Seed of the samples of each round.
    pub(crate) seeds: Vec<u32>,
    /// In the order of [`CONFIGS`].
    pub(crate) series: Vec<Series>,
}

/// The times of one configuration, one for each round.
#[derive(Debug, Serialize)]
pub(crate) struct Series {
    pub(crate) queue: &'static str,
    pub(crate) policy: Option<&'static str>,
    pub(crate) cost_initialised: bool,
    /// Wall or virtual seconds from before the estimation until the last hit.
    pub(crate) total_s: Vec<f64>,
    /// The part of it before the first launch: estimation and planning.
    pub(crate) estimate_s: Vec<f64>,
    pub(crate) total: Summary,
    pub(crate) estimate: Summary,
    /// Total over that of the regular configurations of the same queue, round by round; empty for those themselves.
    pub(crate) ratios: Vec<Ratio>,
}

/// How a configuration compares with another, in pairs.
#[derive(Debug, Serialize)]
pub(crate) struct Ratio {
    /// Name of the other.
    pub(crate) over: &'static str,
    pub(crate) ratio: Summary,
}

pub(crate) const BLOCKS: usize = 0;
pub(crate) const ROUND_ROBIN: usize = 1;
pub(crate) const STATIC_COST: usize = 2;
pub(crate) const CENTRAL: usize = 3;
pub(crate) const CENTRAL_COST: usize = 4;
pub(crate) const HYBRID: usize = 5;
pub(crate) const HYBRID_COST: usize = 6;
pub(crate) const PERMUTED: usize = 7;
pub(crate) const LIFELINES: usize = 8;

/// The bars of the figure.
pub(crate) const CONFIGS: [Contender; 9] = [
    contenders::BLOCKS,
    contenders::ROUND_ROBIN,
    contenders::STATIC_COST,
    contenders::CENTRAL,
    contenders::CENTRAL_COST,
    contenders::HYBRID,
    contenders::HYBRID_COST,
    contenders::PERMUTED,
    contenders::LIFELINES,
];

/// The regular configurations that each one is compared with.
const AGAINST: [&[usize]; CONFIGS.len()] =
    [&[], &[], &[BLOCKS, ROUND_ROBIN], &[], &[CENTRAL], &[], &[HYBRID], &[], &[]];

/// Where tasks run.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Devices {
    /// On the balancer's devices.
    Real,
    /// On so many virtual ones, with the task times of the balancer's only device.
    Virtual(usize),
}

/// What to measure of a stream.
pub(crate) struct Plan<'a> {
    pub(crate) where_to: Devices,
    pub(crate) estimate: &'a Estimator,
    pub(crate) task_sizes: &'a [u32],
    pub(crate) repetitions: u32,
    pub(crate) seed: u32,
}

/// Total and estimation seconds of one run.
type Times = (f64, f64);

impl Plan<'_> {
    /// Measures every task size and configuration in turn, round after round, so that a machine whose speed drifts
    /// slows all alike. One round before the first fills caches and calibrates the devices, and is not counted.
    pub(crate) fn measure(&self, subject: &mut Subject<'_>, stream: &Stream, step: &dyn Fn()) -> Result<Panel> {
        let cut: Vec<Stream> = self.task_sizes.iter().map(|&rays| stream.clone().with_task_size(rays)).collect();
        let mut rounds: Vec<Vec<[Times; CONFIGS.len()]>> = vec![Vec::new(); cut.len()];
        let mut seeds = Vec::new();
        for round in 0..=self.repetitions {
            let seed = self.seed.wrapping_add(round);
            for (stream, times) in cut.iter().zip(&mut rounds) {
                let stream = Stream { seed, ..stream.clone() };
                let measured = match self.where_to {
                    Devices::Real => self.on_devices(subject, &stream, round as usize)?,
                    Devices::Virtual(count) => self.replayed(subject, &stream, count)?,
                };
                if round > 0 {
                    times.push(measured);
                }
                step();
            }
            if round > 0 {
                seeds.push(seed);
            }
        }
        let sizes = cut.iter().zip(&rounds).zip(self.task_sizes).map(|((stream, times), &task_rays)| Size {
            task_rays,
            tasks: stream.tasks.len(),
            seeds: seeds.clone(),
            series: (0..CONFIGS.len()).map(|index| series(index, times)).collect(),
        });
        Ok(Panel {
            scene: subject.name().to_owned(),
            stream: stream.kind.to_string(),
            rays: stream.source.len(),
            sizes: sizes.collect(),
        })
    }

    /// One run of each configuration; every round begins with another one, so that none is always first.
    fn on_devices(&self, subject: &mut Subject<'_>, stream: &Stream, round: usize) -> Result<[Times; CONFIGS.len()]> {
        let mut times = [(0.0, 0.0); CONFIGS.len()];
        for step in 0..CONFIGS.len() {
            let index = (round + step) % CONFIGS.len();
            let report = subject.trace(stream, &mut self.scheduling(&CONFIGS[index]))?.report;
            times[index] = (report.makespan_s, report.estimate.seconds);
        }
        Ok(times)
    }

    /// One run with the estimate, whose predictions are fitted to earlier rounds; one pass for the tasks' own times, to
    /// which nothing is fitted; and a replay of every configuration with both.
    fn replayed(&self, subject: &mut Subject<'_>, stream: &Stream, count: usize) -> Result<[Times; CONFIGS.len()]> {
        // One task per launch, so that the cost of a launch is seen as well.
        let run = subject.trace(stream, &mut self.scheduling(&CONFIGS[CENTRAL_COST]))?;
        let reference = subject.reference(stream)?;
        let task_s = reference.seconds.first().context("the device failed")?;
        let seen = Observed::of(&run);
        let speeds = vec![1.0; count];
        let replay = Replay { speeds: &speeds, task_s, launch_s: seen.launch_s, hand_over_s: 0.0 };
        let rays: Vec<u32> = stream.tasks.iter().map(|task| task.rays).collect();
        Ok(CONFIGS.map(|config| {
            let scheduling = self.scheduling(&config);
            if config.estimate == Estimate::Asked {
                let (run, estimate_s) = replay.cost_initialised(&scheduling, &seen);
                (estimate_s + run.makespan_s, estimate_s)
            } else {
                (replay.regular(&scheduling, &rays).makespan_s, 0.0)
            }
        }))
    }

    fn scheduling(&self, config: &Contender) -> Scheduling {
        // The question is what an estimate gives, not whether it pays.
        Scheduling { uninformed_excess: Some(1.0), ..config.scheduling(self.estimate) }
    }
}

fn series(index: usize, rounds: &[[Times; CONFIGS.len()]]) -> Series {
    let config = &CONFIGS[index];
    let totals = |index: usize| rounds.iter().map(|times| times[index].0).collect::<Vec<f64>>();
    let (total_s, estimate_s) = (totals(index), rounds.iter().map(|times| times[index].1).collect::<Vec<f64>>());
    let ratio =
        |&other: &usize| Ratio { over: CONFIGS[other].name, ratio: Summary::of_ratios(&total_s, &totals(other)) };
    Series {
        queue: (config.queue)().name(),
        policy: config.policy,
        cost_initialised: config.estimate == Estimate::Asked,
        total: Summary::new(&total_s),
        estimate: Summary::new(&estimate_s),
        ratios: AGAINST[index].iter().map(ratio).collect(),
        total_s,
        estimate_s,
    }
}
