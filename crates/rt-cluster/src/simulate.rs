//! Deals on a virtual clock: the decisions of [`Server`] and [`Worker`], with messages and tiles that take as long as a
//! scenario says. For tests of what may happen in what order, and for clusters that nobody has.

use crate::{ClusterError, End, Lease, Ledger, Machine, Patience, Server, ToServer, ToWorker, Worker};
use rt_core::random;
use std::collections::BinaryHeap;
use std::time::Duration;

/// What is simulated.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// Seconds that each tile takes on a rank of speed 1.
    pub tiles: Vec<f32>,
    /// What the tiles are expected to cost; empty where nothing is known.
    pub prices: Vec<f32>,
    /// The ranks, number 0 first.
    pub ranks: Vec<SimulatedRank>,
    /// Least seconds that a message takes.
    pub latency_s: f64,
    /// Seconds that a message may take longer, by chance.
    pub jitter_s: f64,
    /// Seconds that rank 0 is busy with each message of another rank.
    pub message_s: f64,
    /// Seconds between two looks of a rank at the time.
    pub tick_s: f64,
    /// How long ranks wait for each other.
    pub patience: Patience,
    /// Seed of chance.
    pub seed: u32,
}

/// A rank of a scenario.
#[derive(Clone, Copy, Debug)]
pub struct SimulatedRank {
    /// How many times faster it is than a rank of speed 1.
    pub speed: f64,
    /// When it dies.
    pub dies_s: f64,
    /// From when to when it neither computes nor speaks nor listens.
    pub stalls_s: [f64; 2],
}

impl Default for SimulatedRank {
    fn default() -> Self {
        Self { speed: 1.0, dies_s: f64::INFINITY, stalls_s: [f64::INFINITY; 2] }
    }
}

/// What came of a scenario.
#[derive(Debug)]
pub struct Simulated {
    /// How often each tile was counted.
    pub counted: Vec<u32>,
    /// How the deal ended for rank 0.
    pub outcome: Result<(), ClusterError>,
    /// How it ended for each rank; `None` for those that died.
    pub ends: Vec<Option<End>>,
    /// Seconds until rank 0 had all tiles.
    pub makespan_s: f64,
    /// Messages between rank 0 and others.
    pub messages: u64,
    /// Seconds that rank 0 was busy with them.
    pub server_s: f64,
}

/// Something that happens to a rank.
#[derive(Debug)]
enum Event {
    Tick,
    Finished,
    Heard(u32, ToServer),
    Told(ToWorker),
}

/// Ordered by time, the earliest greatest, then by the order in which they were planned.
#[derive(Debug)]
struct Planned {
    at: f64,
    number: u64,
    rank: u32,
    event: Event,
}

impl PartialEq for Planned {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Planned {}

impl PartialOrd for Planned {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Planned {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        other.at.total_cmp(&self.at).then(other.number.cmp(&self.number))
    }
}

/// A deal that has no end is given up after so many seconds on the virtual clock: about three hours.
const ENDLESS_S: f64 = 10_000.0;

/// Runs a scenario to its end, which comes for every rank that lives.
#[must_use]
pub fn simulate(scenario: &Scenario) -> Simulated {
    Simulation::new(scenario).run()
}

struct Simulation<'a> {
    scenario: &'a Scenario,
    server: Server,
    workers: Vec<Worker>,
    events: BinaryHeap<Planned>,
    planned: u64,
    /// When the last message from and to each rank arrives.
    last: Vec<[f64; 2]>,
    /// When rank 0 has time for the next message.
    server_free: f64,
    result: Simulated,
}

fn time(seconds: f64) -> Duration {
    Duration::from_secs_f64(seconds)
}

impl<'a> Simulation<'a> {
    fn new(scenario: &'a Scenario) -> Self {
        let count = scenario.ranks.len();
        let ledger = Ledger::new(scenario.tiles.len() as u32);
        let mut simulation = Self {
            scenario,
            server: Server::new(ledger, count as u32, 0, scenario.patience, Duration::ZERO),
            workers: Vec::with_capacity(count),
            events: BinaryHeap::new(),
            planned: 0,
            last: vec![[0.0; 2]; count],
            server_free: 0.0,
            result: Simulated {
                counted: vec![0; scenario.tiles.len()],
                outcome: Ok(()),
                ends: vec![None; count],
                makespan_s: 0.0,
                messages: 0,
                server_s: 0.0,
            },
        };
        for rank in 0..count as u32 {
            let mut said = Vec::new();
            let mut worker = Worker::new(scenario.patience, 0, Machine::default(), Duration::ZERO, &mut said);
            let priced = (0..).zip(&scenario.prices).map(|(tile, &cost)| Lease { tile, cost });
            let share = priced.skip(rank as usize).step_by(count).collect();
            worker.priced(Duration::ZERO, share, &mut said);
            simulation.workers.push(worker);
            simulation.say(0.0, rank, said);
            simulation.plan(scenario.tick_s, rank, Event::Tick);
        }
        simulation
    }

    fn run(mut self) -> Simulated {
        while let Some(Planned { at, rank, event, .. }) = self.events.pop() {
            if at > ENDLESS_S {
                break;
            }
            let about = self.scenario.ranks[rank as usize];
            if at >= about.dies_s || self.result.ends[rank as usize].is_some() {
                if rank == 0 && at >= about.dies_s {
                    // The others find out.
                    self.result.outcome = Err(ClusterError::ServerLost("it died".to_owned()));
                }
                continue;
            }
            if about.stalls_s[0] <= at && at < about.stalls_s[1] {
                // In the same order, since what is planned later has a higher number.
                self.plan(about.stalls_s[1], rank, event);
                continue;
            }
            self.happen(at, rank, event);
        }
        self.result
    }

    fn happen(&mut self, at: f64, rank: u32, event: Event) {
        let mut said = Vec::new();
        match event {
            Event::Tick => {
                self.workers[rank as usize].tick(time(at), &mut said);
                self.plan(at + self.scenario.tick_s, rank, Event::Tick);
                if rank == 0 {
                    let mut out = Vec::new();
                    self.server.tick(time(at), &mut out);
                    self.tell(at, out);
                }
            }
            Event::Finished => self.workers[rank as usize].done(time(at), &mut said),
            Event::Told(message) => self.workers[rank as usize].receive(time(at), message, &mut said),
            Event::Heard(from, message) => self.hear(at, from, message),
        }
        self.say(at, rank, said);
        self.begin(at, rank);
        self.end(at, rank);
    }

    /// Rank 0 hears a message.
    fn hear(&mut self, at: f64, from: u32, message: ToServer) {
        if from > 0 {
            if self.server_free > at {
                let later = self.server_free;
                self.server_free += self.scenario.message_s;
                self.result.server_s += self.scenario.message_s;
                return self.serve(later, from, message);
            }
            self.server_free = at + self.scenario.message_s;
            self.result.server_s += self.scenario.message_s;
        }
        self.serve(at, from, message);
    }

    fn serve(&mut self, at: f64, from: u32, message: ToServer) {
        let tile = if let ToServer::Done { tile, .. } = message { tile as usize } else { 0 };
        let mut out = Vec::new();
        if self.server.receive(time(at), from, message, &mut out) {
            self.result.counted[tile] += 1;
            self.result.makespan_s = at;
        }
        self.tell(at, out);
    }

    /// A rank computes what it has, if it does nothing.
    fn begin(&mut self, at: f64, rank: u32) {
        let worker = &mut self.workers[rank as usize];
        if !worker.is_computing()
            && let Some(tile) = worker.take(time(at))
        {
            let seconds = f64::from(self.scenario.tiles[tile as usize]) / self.scenario.ranks[rank as usize].speed;
            self.plan(at + seconds, rank, Event::Finished);
        }
    }

    fn end(&mut self, at: f64, rank: u32) {
        if rank == 0 && self.result.ends[0].is_none() {
            let mut out = Vec::new();
            if let Some(error) = self.server.nobody_left() {
                self.server.stop(time(at), "nobody is left", &mut out);
                self.result.outcome = Err(error);
            } else if self.server.is_finished() {
                self.server.finish(time(at), &mut out);
            }
            self.tell(at, out);
        }
        self.result.ends[rank as usize] = self.workers[rank as usize].end().cloned();
    }

    fn say(&mut self, at: f64, rank: u32, said: Vec<ToServer>) {
        for message in said {
            let arrives = self.arrival(at, rank, 0);
            self.plan(arrives, 0, Event::Heard(rank, message));
        }
    }

    fn tell(&mut self, at: f64, out: Vec<(u32, ToWorker)>) {
        for (rank, message) in out {
            let arrives = self.arrival(at, rank, 1);
            self.plan(arrives, rank, Event::Told(message));
        }
    }

    /// When a message arrives, which does not overtake those before it.
    fn arrival(&mut self, at: f64, rank: u32, direction: usize) -> f64 {
        if rank == 0 {
            return at;
        }
        self.result.messages += 1;
        let [share, _] = random::pair(self.scenario.seed, self.planned as u32, direction as u32);
        let last = &mut self.last[rank as usize][direction];
        *last = (at + self.scenario.latency_s + f64::from(share) * self.scenario.jitter_s).max(*last);
        *last
    }

    fn plan(&mut self, at: f64, rank: u32, event: Event) {
        self.events.push(Planned { at, number: self.planned, rank, event });
        self.planned += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rank() -> impl Strategy<Value = SimulatedRank> {
        let dies = prop_oneof![2 => Just(f64::INFINITY), 1 => 0.0..3.0_f64];
        let stalls =
            prop_oneof![3 => Just([f64::INFINITY; 2]), 1 => (0.0..2.0_f64, 0.0..2.0_f64).prop_map(|(a, b)| [a, a + b])];
        (0.2..4.0_f64, dies, stalls).prop_map(|(speed, dies_s, stalls_s)| SimulatedRank { speed, dies_s, stalls_s })
    }

    fn scenario() -> impl Strategy<Value = Scenario> {
        let tiles = prop::collection::vec(prop_oneof![Just(0.0_f32), 0.001..0.5_f32], 0..40);
        let ranks = prop::collection::vec(rank(), 1..6);
        (tiles, ranks, 0.0..0.05_f64, 0.0..0.3_f64, any::<bool>(), any::<u32>()).prop_map(
            |(tiles, mut ranks, latency_s, jitter_s, is_priced, seed)| {
                // Rank 0 cannot be replaced.
                ranks[0].dies_s = f64::INFINITY;
                let prices = if is_priced { tiles.iter().map(|t| 3.0 * t).collect() } else { Vec::new() };
                Scenario {
                    tiles,
                    prices,
                    ranks,
                    latency_s,
                    jitter_s,
                    message_s: 1e-4,
                    tick_s: 0.01,
                    patience: Patience {
                        heartbeat: Duration::from_millis(100),
                        rank: Duration::from_millis(900),
                        server: Duration::from_secs(4),
                        welcome: Duration::from_secs(8),
                    },
                    seed,
                }
            },
        )
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2_000))]

        /// Guards: whatever dies, stalls or is late, every tile is counted once and every rank that lives hears the
        /// end. Fails when a lost rank's tiles are not freed, when its return makes them count twice, when what it
        /// asked for is forgotten while it is taken for lost, or when ranks that wait for tiles are not given those
        /// that become free.
        #[test]
        fn every_tile_is_counted_once_whatever_is_delayed_or_lost(scenario in scenario()) {
            let done = simulate(&scenario);
            prop_assert!(done.outcome.is_ok(), "{:?}", done.outcome);
            prop_assert!(done.counted.iter().all(|&count| count == 1), "{:?}", done.counted);
            for (rank, end) in scenario.ranks.iter().zip(&done.ends) {
                let is_over = matches!(end, Some(End::Finished { .. }));
                prop_assert!(is_over || rank.dies_s.is_finite(), "{end:?}");
            }
        }

        /// Guards: the others notice that rank 0 is dead, and no tile is counted twice on the way. Fails without a
        /// limit for rank 0's silence.
        #[test]
        fn when_rank_0_dies_all_ranks_end(scenario in scenario(), dies_s in 0.0..2.0_f64) {
            let mut scenario = scenario;
            scenario.ranks[0].dies_s = dies_s;
            let done = simulate(&scenario);
            prop_assert!(done.counted.iter().all(|&count| count <= 1));
            for (rank, end) in scenario.ranks.iter().zip(&done.ends).skip(1) {
                prop_assert!(end.is_some() || rank.dies_s.is_finite(), "{end:?}");
            }
        }
    }

    fn calm(tiles: Vec<f32>, ranks: usize) -> Scenario {
        Scenario {
            prices: tiles.clone(),
            tiles,
            ranks: vec![SimulatedRank::default(); ranks],
            latency_s: 0.001,
            jitter_s: 0.0,
            message_s: 1e-6,
            tick_s: 0.001,
            patience: Patience::default(),
            seed: 1,
        }
    }

    /// Fails when ranks ask only once they have nothing left: then each of the 64 tiles waits two milliseconds.
    #[test]
    fn questions_that_take_a_millisecond_cost_next_to_nothing() {
        let tiles: Vec<f32> = (0..64 * 64).map(|tile| 0.01 + 0.02 * random::pair(3, tile, 0)[0]).collect();
        let ideal = tiles.iter().map(|&s| f64::from(s)).sum::<f64>() / 64.0;
        let done = simulate(&calm(tiles, 64));
        assert!(done.makespan_s < 1.015 * ideal, "{} above {ideal}", done.makespan_s);
    }

    /// Fails when tiles are let in the order of their numbers: the last one, the most expensive, then ends alone.
    #[test]
    fn the_most_expensive_tile_does_not_end_alone() {
        let tiles: Vec<f32> = (0..200).map(|tile| if tile == 199 { 2.0 } else { 0.05 }).collect();
        let ideal = tiles.iter().map(|&s| f64::from(s)).sum::<f64>() / 4.0;
        let done = simulate(&calm(tiles, 4));
        assert!(done.makespan_s < 1.03 * ideal, "{} above {ideal}", done.makespan_s);
    }
}
