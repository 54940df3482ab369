//! Virtual devices driven by task times that were measured on a real one.
//!
//! The queues and policies are those of real runs, on the virtual clock of [`rt_sched::simulate`]. What is taken from
//! measurement: each task's own time, what a launch costs the device beside its tasks, and the walks and the planning
//! of an estimation. What is assumed: that devices do not slow each other down and share the walks of the estimation
//! evenly, and that devices have two launches in flight, as on real ones.

use crate::Scheduling;
use crate::report::{ActivityKind, StreamRun};
use rt_core::{CostModel, TaskId, Work};
use rt_sched::bound;
use rt_sched::policy::Lpt;
use rt_sched::queue::Dealt;
use rt_sched::simulate::{SimulatedRun, Simulation};

/// What a run with an estimate on one real device tells of the estimate.
#[derive(Clone, Debug)]
pub struct Observed {
    /// Predicted seconds of what is left of each task, by prices fitted to earlier runs.
    pub predicted_s: Vec<f64>,
    /// Share of each task's rays that is left, from 0 to 1: the others' hits were kept.
    pub left: Vec<f64>,
    /// Device seconds of the estimation's walks.
    pub walks_s: f64,
    /// The rest of the estimation: host seconds of choosing samples and planning.
    pub planning_s: f64,
    /// Seconds of a launch on the device beside its tasks: the least of all launches, since what other programs of the
    /// machine took in between is no part of it.
    pub launch_s: f64,
}

impl Observed {
    /// Reads a run over one device.
    #[must_use]
    pub fn of(run: &StreamRun) -> Self {
        let walks = run.activities.iter().filter(|activity| activity.kind == ActivityKind::Estimate);
        let walks_s: f64 = walks.map(|walk| walk.end_s - walk.start_s).sum();
        let launches = run.activities.iter().filter(|activity| activity.kind == ActivityKind::Launch);
        let beside = launches.map(|launch| {
            let tasks: f64 = launch.tasks.iter().filter_map(|&task| run.measured_s.get(task as usize)).sum();
            (launch.end_s - launch.start_s - tasks).max(0.0)
        });
        // NaN where a device only knows the time of whole launches: `min` passes over it.
        let launch_s = beside.fold(f64::INFINITY, f64::min);
        let left = |(task, kept): (&rt_core::Task, &u32)| 1.0 - f64::from(*kept) / f64::from(task.rays.max(1));
        Self {
            predicted_s: run.predicted_s.clone(),
            left: run.tasks.iter().zip(&run.kept).map(left).collect(),
            walks_s,
            planning_s: (run.report.estimate.seconds - walks_s).max(0.0),
            launch_s: if launch_s.is_finite() { launch_s } else { 0.0 },
        }
    }
}

/// Virtual devices of given speeds, 1 being that of the measured one.
#[derive(Clone, Copy, Debug)]
pub struct Replay<'a> {
    /// The speed of each device.
    pub speeds: &'a [f64],
    /// Seconds of each task, all its rays, on the measured device.
    pub task_s: &'a [f64],
    /// Seconds of a launch on the device beside its tasks.
    pub launch_s: f64,
    /// Seconds that the host takes to hand a launch over, which another one in flight hides.
    pub hand_over_s: f64,
}

impl Replay<'_> {
    /// A run without any estimate: every ray counts the same, and every device.
    #[must_use]
    pub fn regular(&self, scheduling: &Scheduling, rays: &[u32]) -> SimulatedRun {
        let work: Vec<Work> = rays.iter().map(|&n| Work::new(n as f32, n as f32, 0.0)).collect();
        self.run(scheduling, &work, &vec![CostModel::UNIT; self.speeds.len()], |_| 1.0)
    }

    /// A run without any estimate on devices whose speeds are known.
    #[must_use]
    pub fn speeds_known(&self, scheduling: &Scheduling, rays: &[u32]) -> SimulatedRun {
        let all: f64 = rays.iter().copied().map(f64::from).sum();
        let of_ray = self.task_s.iter().sum::<f64>() / all;
        let work: Vec<Work> = rays.iter().map(|&n| Work::new(0.0, (f64::from(n) * of_ray * 1e9) as f32, 0.0)).collect();
        self.run(scheduling, &work, &self.models(), |_| 1.0)
    }

    /// Devices for which a predicted nanosecond counts as a box test: of speed s, they do s of them in a nanosecond.
    fn models(&self) -> Vec<CostModel> {
        let model = |&speed: &f64| CostModel::new(self.launch_s, 1e-9 / speed, 1e-9 / speed, 1e-9 / speed);
        self.speeds.iter().map(|s| model(s).unwrap_or_default()).collect()
    }

    /// A run with an estimate, and the seconds before it that the estimation took.
    #[must_use]
    pub fn cost_initialised(&self, scheduling: &Scheduling, seen: &Observed) -> (SimulatedRun, f64) {
        let work: Vec<Work> = seen.predicted_s.iter().map(|s| Work::new(0.0, (s * 1e9) as f32, 0.0)).collect();
        let estimate_s = seen.walks_s / self.speeds.iter().sum::<f64>() + seen.planning_s;
        let left = |task: TaskId| seen.left.get(task as usize).copied().unwrap_or(1.0);
        (self.run(scheduling, &work, &self.models(), left), estimate_s)
    }

    /// Least makespan that any schedule of all rays has, in seconds.
    #[must_use]
    pub fn lower_bound(&self) -> f64 {
        bound::related(self.task_s, self.speeds)
    }

    fn run(
        &self,
        scheduling: &Scheduling,
        work: &[Work],
        models: &[CostModel],
        left: impl Fn(TaskId) -> f64,
    ) -> SimulatedRun {
        let maker = &*scheduling.queue;
        // Of a policy that deals otherwise than it is asked, or is none for this queue, nothing is left.
        let policy = scheduling.policy().unwrap_or(&Lpt);
        let schedule = maker.deal(policy, work, models).unwrap_or_default();
        let queue = maker.make(Dealt { schedule: &schedule, work, devices: models });
        let seconds = |device: usize, task: TaskId| {
            self.task_s[task as usize] * left(task) / self.speeds.get(device).copied().unwrap_or(1.0)
        };
        let simulation = Simulation { launch_s: self.launch_s, hand_over_s: self.hand_over_s, ..Simulation::default() };
        simulation.run(&*queue, self.speeds.len(), &seconds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_sched::policy::{Block, Policy, RoundRobin};
    use rt_sched::queue::QueueKind;

    fn with(queue: QueueKind, policy: Option<Box<dyn Policy>>) -> Scheduling {
        Scheduling { queue: Box::new(queue), policy, ..Scheduling::default() }
    }

    fn seen(predicted_s: &[f64], left: f64) -> Observed {
        Observed {
            predicted_s: predicted_s.to_vec(),
            left: vec![left; predicted_s.len()],
            walks_s: 0.6,
            planning_s: 0.01,
            launch_s: 0.0,
        }
    }

    /// Mutants: kept rays traced again (`left` ignored); the walks not shared; speeds ignored by the clock.
    #[test]
    fn devices_share_walks_and_leave_out_kept_rays() {
        let task_s = [4.0, 1.0, 1.0, 1.0, 1.0];
        let replay = Replay { speeds: &[1.0, 1.0], task_s: &task_s, launch_s: 0.0, hand_over_s: 0.0 };
        let (run, estimate) =
            replay.cost_initialised(&with(QueueKind::Static, Some(Box::new(Lpt))), &seen(&task_s, 0.5));
        assert!((estimate - 0.31).abs() < 1e-9, "{estimate}");
        // Half of every task is left, and LPT deals 4 against 1 + 1 + 1 + 1.
        assert!((run.makespan_s - 2.0).abs() < 1e-3, "{run:?}");
        let fast = Replay { speeds: &[1.0, 3.0], ..replay };
        assert!(
            (fast.cost_initialised(&with(QueueKind::Static, Some(Box::new(Lpt))), &seen(&task_s, 1.0)).1 - 0.16).abs()
                < 1e-9
        );
        assert_eq!(fast.lower_bound(), 2.0);
    }

    /// Mutants: launches that cost nothing on the device; blocks dealt in turn.
    #[test]
    fn queues_differ_as_they_should() {
        let task_s = [3.0, 3.0, 1.0, 1.0];
        let replay = Replay { speeds: &[1.0, 1.0], task_s: &task_s, launch_s: 0.5, hand_over_s: 0.0 };
        let rays = [64; 4];
        let near = |a: f64, b: f64| (a - b).abs() < 1e-3;
        let blocks = replay.regular(&with(QueueKind::Static, Some(Box::new(Block))), &rays).makespan_s;
        assert!(near(blocks, 6.5), "{blocks}");
        let turns = replay.regular(&with(QueueKind::Static, Some(Box::new(RoundRobin))), &rays).makespan_s;
        assert!(near(turns, 4.5), "{turns}");
        // Two tasks on each device, each with its launch.
        let central = replay.regular(&with(QueueKind::Central, None), &rays).makespan_s;
        assert!(near(central, 5.0), "{central}");
    }
}
