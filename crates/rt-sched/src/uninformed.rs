//! What a schedule loses when nothing is known of its tasks' costs: what an estimate can gain at most.
//!
//! Shares of the makespan beyond the best one, for equal devices and tasks whose costs vary as much as those of
//! pictures do: a coefficient of variation of about 1, alike for neighbours. Constants are fitted to
//! [`crate::simulate`], within a factor of 3 from 2 devices and 16 tasks to 64 devices and 65,536 tasks, at least 8
//! tasks for each device (see the tests). Nothing exact can be said before anything was measured.

/// Tasks dealt once, in turn, to static queues.
///
/// Sums of n/m random costs on m devices: the latest device is late by some √(2 ln m) standard deviations (H. Cramér,
/// *Mathematical Methods of Statistics*, 1946, 28.6). Dealing in turn spreads every part of the picture over all
/// devices, which takes two thirds of that away.
#[must_use]
pub fn fixed_excess(tasks: usize, devices: usize) -> f64 {
    let (n, m) = (tasks as f64, devices as f64);
    if devices < 2 || tasks == 0 { 0.0 } else { 0.35 * libm::sqrt(2.0 * libm::log(m) * m / n) }
}

/// Tasks taken one by one from a central queue: every device but the last waits for the end of one task.
#[must_use]
pub fn central_excess(tasks: usize, devices: usize) -> f64 {
    if devices < 2 || tasks == 0 { 0.0 } else { 0.9 * (devices - 1) as f64 / tasks as f64 }
}

/// Static shares that are corrected by stealing, in launches that begin small: hardly more than a central queue loses.
#[must_use]
pub fn hybrid_excess(tasks: usize, devices: usize) -> f64 {
    central_excess(tasks, devices) + 0.05 * fixed_excess(tasks, devices)
}

/// What stealing adds where it is not known how fast devices are, and they may differ: the first task of a slow one may
/// last until after the end. With 8, 32, 64 and 128 tasks a device between a fifth and ten times the makespan, 2 to 90,
/// 1 to 12 and 0.6 to 3% (docs/results/scheduling.md).
#[must_use]
pub fn unlike_excess(tasks: usize, devices: usize) -> f64 {
    let tasks_a_device = tasks as f64 / devices as f64;
    if devices < 2 || tasks == 0 { 0.0 } else { (100.0 / (tasks_a_device * tasks_a_device)).min(1.0) }
}

/// What is known of a run before anything is estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Regime {
    /// Number of tasks.
    pub tasks: usize,
    /// Number of devices.
    pub devices: usize,
    /// Whether it was measured how fast they are.
    pub are_speeds_known: bool,
    /// Whether they are of one kind, as far as they tell: then they are probably equally fast.
    pub are_alike: bool,
    /// What a launch costs a device beside its rays, as a share of its part of the stream: in the mean over the stream.
    pub launch: f64,
}

impl Regime {
    /// What lists lose that are dealt once.
    #[must_use]
    pub fn of_lists(&self) -> f64 {
        if self.are_speeds_known || self.devices < 2 { fixed_excess(self.tasks, self.devices) } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bound;
    use crate::policy::{Lpt, Policy};
    use crate::queue::{CentralQueue, HybridQueue, StaticQueue, TaskQueue};
    use crate::simulate::Simulation;
    use alloc::boxed::Box;
    use alloc::vec;
    use alloc::vec::Vec;
    use rt_core::{CostModel, Work, random};

    /// Costs of a picture's tasks in Z-curve order: smooth waves and noise, log-normal.
    fn picture(tasks: u32, seed: u32) -> Vec<f64> {
        let side = f64::from(tasks).sqrt();
        let unit = |i: u32, dimension: u32| random::pair(seed, i, dimension).map(f64::from);
        let waves: Vec<[f64; 4]> = (0..6)
            .map(|k| {
                let ([a, b], [c, d]) = (unit(k, 0), unit(k, 1));
                [a * 6.0 / side, b * 6.0 / side, c * core::f64::consts::TAU, 0.3 + 0.5 * d]
            })
            .collect();
        let cost = |i: u32| {
            let (x, y) = rt_core::morton::decode(i);
            let smooth: f64 =
                waves.iter().map(|w| w[3] * (w[0] * f64::from(x) + w[1] * f64::from(y) + w[2]).sin()).sum();
            let [a, b] = unit(i, 2);
            let normal = (-2.0 * (1.0 - a).ln()).sqrt() * (core::f64::consts::TAU * b).cos();
            (smooth + 0.3 * normal).exp()
        };
        (0..tasks).map(cost).collect()
    }

    /// Mean excess over the lower bound of a static, a central and a hybrid queue that know nothing.
    fn simulated(tasks: u32, devices: usize) -> [f64; 3] {
        const SEEDS: u32 = 12;
        let mut mean = [0.0; 3];
        for seed in 0..SEEDS {
            let costs = picture(tasks, seed);
            let best = bound::related(&costs, &vec![1.0; devices]);
            let work = vec![Work::new(1.0, 1.0, 0.0); tasks as usize];
            let models = vec![CostModel::UNIT; devices];
            let schedule = Lpt.schedule(&work, &models);
            let queues: [(Box<dyn TaskQueue>, usize); 3] = [
                (Box::new(StaticQueue::new(&schedule)), 1),
                (Box::new(CentralQueue::new(&work, &models)), 2),
                (Box::new(HybridQueue::new(&schedule, &work, &models)), 2),
            ];
            for (mean, (queue, in_flight)) in mean.iter_mut().zip(queues) {
                let simulation = Simulation { hand_over_s: 0.0, pop_s: 0.0, in_flight, ..Simulation::default() };
                let run = simulation.run(&*queue, devices, &|_, task| costs[task as usize]);
                *mean += (run.makespan_s / best - 1.0) / f64::from(SEEDS);
            }
        }
        mean
    }

    /// Mutants: `devices` instead of `devices - 1`, and tasks and devices exchanged; `Timed::price` without the
    /// shortest launch, which makes a price up.
    #[test]
    fn uninformed_queues_lose_about_as_much_as_simulated() {
        for (tasks, devices) in
            [(16, 2), (64, 2), (1024, 2), (64, 3), (1024, 3), (64, 8), (1024, 8), (1024, 64), (65_536, 64)]
        {
            let expected = [fixed_excess, central_excess, hybrid_excess].map(|of| of(tasks as usize, devices));
            for (found, expected) in simulated(tasks, devices).into_iter().zip(expected) {
                let ratio = found / expected;
                assert!((1.0 / 3.0..3.0).contains(&ratio), "{tasks} tasks, {devices} devices: {found} {expected}");
            }
        }
    }

    #[test]
    fn one_device_has_nothing_to_lose() {
        for of in [fixed_excess, central_excess, hybrid_excess, unlike_excess] {
            assert_eq!([of(100, 1), of(100, 0), of(0, 5)], [0.0; 3]);
        }
    }
}
