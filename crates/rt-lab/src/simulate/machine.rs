//! A machine that is not there, and what a strategy makes of a stream on it.

use super::recording::Recording;
use super::strategies::{Knows, Strategy};
use rt_balance::Scheduling;
use rt_balance::catalogue::ESTIMATORS;
use rt_balance::replay::{Observed, Replay};
use rt_cluster::Patience;
use rt_cluster::simulate::{Scenario, SimulatedRank, simulate};
use rt_core::{Observation, RayStream, Step};
use rt_sched::bound;
use rt_sched::uninformed::Regime;
use serde::Serialize;

/// Alike nodes, each of devices of these speeds.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Machine {
    pub(super) nodes: u32,
    /// Of the devices of a node; 1 is the device that was measured.
    pub(super) speeds: Vec<f64>,
    /// Seconds of a launch on a device beside its tasks; null: as measured.
    pub(super) launch_s: Option<f64>,
    /// Seconds until a claim is answered.
    pub(super) claim_s: f64,
}

/// What came of a strategy.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(super) struct Outcome {
    /// Seconds from before the estimation until the last task has ended.
    pub(super) makespan_s: f64,
    /// The part of it that the estimation took.
    pub(super) estimate_s: f64,
    /// Launches of a device in the mean.
    pub(super) launches: f64,
}

impl Outcome {
    /// One stream after the other.
    pub(super) fn plus(&self, next: &Self) -> Self {
        Self {
            makespan_s: self.makespan_s + next.makespan_s,
            estimate_s: self.estimate_s + next.estimate_s,
            launches: self.launches + next.launches,
        }
    }
}

/// Seconds to hand a launch to a device of a node among several, whose claims are messages: a graphics card's order of
/// magnitude.
const HAND_OVER_S: f64 = 1e-5;

/// Seconds that rank 0 takes for a message, to decode, decide and encode; as in docs/scaling.md.
const MESSAGE_S: f64 = 5e-6;

impl Machine {
    /// Least seconds that any schedule of the stream needs.
    pub(super) fn lower_bound(&self, recording: &Recording) -> f64 {
        let speeds = self.speeds.repeat(self.nodes as usize);
        let finer = recording.finer(speeds.len());
        bound::related(&finer.as_ref().unwrap_or(recording).task_s, &speeds)
    }

    /// What a strategy makes of a stream; `None` where what it has to know was not measured.
    pub(super) fn play(&self, recording: &Recording, strategy: &Strategy) -> Option<Outcome> {
        if self.nodes > 1 {
            self.on_nodes(recording, strategy)
        } else {
            self.on_a_node(recording, strategy, self.claim_s)
        }
    }

    fn on_a_node(&self, recording: &Recording, strategy: &Strategy, hand_over_s: f64) -> Option<Outcome> {
        let launch_s = self.launch_s.unwrap_or(recording.launch_s);
        let scheduling = strategy.contender.scheduling(&ESTIMATORS[0].usual());
        let finer = if scheduling.queue.cuts() { recording.finer(self.speeds.len()) } else { None };
        let recording = finer.as_ref().unwrap_or(recording);
        let replay = Replay { speeds: &self.speeds, task_s: &recording.task_s, launch_s, hand_over_s };
        let knows = match strategy.knows {
            Knows::First if self.does_default_sample(recording) => Knows::Samples,
            Knows::First => Knows::Nothing,
            knows => knows,
        };
        let informed = |seen: &Option<Observed>| Some(replay.cost_initialised(&scheduling, seen.as_ref()?));
        let (run, estimate_s) = match knows {
            Knows::Nothing | Knows::First => (replay.regular(&scheduling, &recording.rays), 0.0),
            Knows::Speeds => (replay.speeds_known(&scheduling, &recording.rays), 0.0),
            Knows::Samples => informed(&recording.samples)?,
            Knows::Past => informed(&recording.past)?,
        };
        let launches = run.launches.iter().sum::<usize>() as f64 / self.speeds.len().max(1) as f64;
        Some(Outcome { makespan_s: estimate_s + run.makespan_s, estimate_s, launches })
    }

    /// Whether the default estimator walks samples of such a stream where it is the first, so that neither speeds nor
    /// what launches cost are known.
    fn does_default_sample(&self, recording: &Recording) -> bool {
        let Scheduling { mut estimator, queue, .. } = Scheduling::default();
        let are_alike = self.speeds.windows(2).all(|pair| pair[0] == pair[1]);
        let (tasks, devices) = (recording.tasks(), self.speeds.len());
        let regime = Regime { tasks: tasks.len(), devices, are_speeds_known: false, are_alike, launch: 0.0 };
        let stream = RayStream {
            devices: devices as u32,
            uninformed_excess: queue.uninformed_excess(&regime),
            moves: queue.moves(&regime),
            ..RayStream::new(recording.kind, &tasks)
        };
        matches!(estimator.next(stream, Observation::default()), Step::Sample { .. })
    }

    /// Tiles of neighbouring tasks are let to nodes as between real ones; within a node the strategy deals each tile's.
    fn on_nodes(&self, recording: &Recording, strategy: &Strategy) -> Option<Outcome> {
        let tasks = recording.rays.len();
        let rays: u64 = recording.rays.iter().copied().map(u64::from).sum();
        let tiles = rt_render::tiles::count(rays, self.nodes).clamp(1, tasks.max(1) as u64) as usize;
        let each = tasks.div_ceil(tiles).max(1);
        let node = Self { nodes: 1, ..self.clone() };
        let mut played = Vec::new();
        let mut prices = Vec::new();
        for begin in (0..tasks).step_by(each) {
            let tile = recording.part(begin..(begin + each).min(tasks));
            played.push(node.on_a_node(&tile, strategy, HAND_OVER_S)?);
            // Real tiles are priced by paths that rank 0's peers sample, whatever the estimator is.
            prices.extend(tile.samples.or(tile.past).map(|seen| seen.predicted_s.iter().sum::<f64>() as f32));
        }
        let all_s: f64 = played.iter().map(|tile| tile.makespan_s).sum();
        let deal = simulate(&Scenario {
            tiles: played.iter().map(|tile| tile.makespan_s as f32).collect(),
            prices: if prices.len() == played.len() { prices } else { Vec::new() },
            ranks: vec![SimulatedRank::default(); self.nodes as usize],
            latency_s: self.claim_s,
            jitter_s: 0.0,
            message_s: MESSAGE_S,
            tick_s: (1e-3 * all_s / f64::from(self.nodes)).max(1e-5),
            patience: Patience::default(),
            seed: 0,
        });
        let estimates_s: f64 = played.iter().map(|tile| tile.estimate_s).sum();
        let launches: f64 = played.iter().map(|tile| tile.launches).sum();
        deal.outcome.ok()?;
        Some(Outcome {
            makespan_s: deal.makespan_s,
            estimate_s: estimates_s / f64::from(self.nodes),
            launches: launches / f64::from(self.nodes),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::StreamKind;

    fn machine(nodes: u32, speeds: &[f64]) -> Machine {
        Machine { nodes, speeds: speeds.to_vec(), launch_s: None, claim_s: 1e-5 }
    }

    /// What every strategy makes of `tasks` tasks of a millisecond each, half of them ten times as expensive.
    fn outcomes(machine: &Machine, tasks: usize) -> Vec<(&'static str, Outcome, f64)> {
        let task_s: Vec<f64> = (0..tasks).map(|task| if task % 7 < 3 { 1e-2 } else { 1e-3 }).collect();
        let recording = Recording::known(StreamKind::Primary, vec![1024; tasks], task_s);
        let bound = machine.lower_bound(&recording);
        let play = |strategy: &Strategy| Some((strategy.name, machine.play(&recording, strategy)?, bound));
        Strategy::ALL.iter().filter_map(play).collect()
    }

    /// Mutants: devices of one node forgotten; the bound of one node; tiles that are left out; a strategy that is given
    /// what it does not know.
    #[test]
    fn no_strategy_beats_the_bound_and_good_ones_come_near() {
        for (machine, tasks) in
            [(machine(1, &[1.0; 4]), 400), (machine(1, &[1.0, 2.0, 4.0]), 400), (machine(4, &[1.0; 2]), 4096)]
        {
            for (name, outcome, bound) in outcomes(&machine, tasks) {
                let excess = outcome.makespan_s / bound - 1.0;
                assert!(excess > -1e-6, "{machine:?}, {name}: {outcome:?} beats {bound}");
                assert!(outcome.launches > 0.0, "{name}");
                let of_equal = ["static round robin", "lifelines"].contains(&name);
                let knows_speeds = !of_equal || machine.speeds[0] == machine.speeds[1];
                let most = if knows_speeds { 0.25 } else { 2.0 };
                assert!(excess < most, "{machine:?}, {name}: {excess}");
                if name == "default, later ones" {
                    assert!(excess < 0.1, "{machine:?}: {excess}");
                }
            }
        }
    }

    /// Tasks that are too large are cut for queues that do so, and no second is lost by that.
    ///
    /// Mutants: `finer` of another number of devices; seconds that are not shared out.
    #[test]
    fn few_large_tasks_are_played_as_they_would_be_cut() {
        let machine = machine(1, &[1.0, 0.2]);
        let recording = Recording::known(StreamKind::Primary, vec![1 << 16; 16], vec![0.01; 16]);
        let finer = recording.finer(2).expect("they are too large");
        assert!((finer.task_s.iter().sum::<f64>() - 0.16).abs() < 1e-9 && finer.rays.len() == 512);
        let bound = machine.lower_bound(&recording);
        for strategy in Strategy::ALL.iter().filter(|strategy| strategy.name.starts_with("default")) {
            let outcome = machine.play(&recording, strategy).expect("all is known");
            let excess = outcome.makespan_s / bound - 1.0;
            assert!((-1e-6..0.02).contains(&excess), "{}: {excess}", strategy.name);
        }
    }
}
