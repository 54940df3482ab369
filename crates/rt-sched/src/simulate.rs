//! Runs of the very same queues on a virtual clock: what would have happened.
//!
//! A discrete-event simulation in the manner of a driver with one host thread per device. It decides nothing itself:
//! [`TaskQueue`] objects say who runs what, so what is learnt here holds for the code that runs on real devices.

use crate::queue::{Pop, TaskQueue};
use alloc::collections::BTreeSet;
use alloc::collections::VecDeque;
use alloc::vec;
use alloc::vec::Vec;
use rt_core::TaskId;

/// What a simulated run costs beside the tasks.
#[derive(Clone, Debug, PartialEq)]
pub struct Simulation {
    /// Seconds from submitting a launch until it can start. With one launch in flight the device idles meanwhile; with
    /// two this is hidden behind the launch before.
    pub hand_over_s: f64,
    /// Seconds that every launch costs on the device beside its tasks, while it ramps up and drains: nothing hides
    /// them. What [`CostModel::per_launch`](rt_core::CostModel::per_launch) predicts.
    pub launch_s: f64,
    /// Seconds a host thread needs for one queue operation.
    pub pop_s: f64,
    /// How many launches each device has in flight; 0 counts as 1.
    pub in_flight: usize,
    /// Devices that stop working, and when, in seconds. Launches that have not ended by then are lost.
    pub failures: Vec<(usize, f64)>,
    /// How the speeds of devices change while they run, in the order of time: heat, or other programs on their cores.
    pub changes: Vec<SpeedChange>,
}

/// A device that goes on at another speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedChange {
    /// The device.
    pub device: usize,
    /// When, in seconds.
    pub at_s: f64,
    /// Its speed from then on, over that for which its tasks' seconds are given; greater than 0.
    pub speed: f64,
}

impl Default for Simulation {
    /// 10 µs to hand a launch over, which costs nothing beside its tasks, 0.2 µs per queue operation, two launches in
    /// flight, no failure: a graphics card's order of magnitude.
    fn default() -> Self {
        Self { hand_over_s: 1e-5, launch_s: 0.0, pop_s: 2e-7, in_flight: 2, failures: Vec::new(), changes: Vec::new() }
    }
}

/// A simulated launch.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedLaunch {
    /// The device.
    pub device: usize,
    /// When the device begins with it, in seconds.
    pub start_s: f64,
    /// End of the last task, in seconds; the time of failure if the launch was lost.
    pub end_s: f64,
    /// The tasks.
    pub tasks: Vec<TaskId>,
    /// Whether the hits came back.
    pub finished: bool,
}

/// What happened in a simulated run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SimulatedRun {
    /// Seconds until the last launch ended.
    pub makespan_s: f64,
    /// Seconds each device spent in launches, lost ones included.
    pub busy_s: Vec<f64>,
    /// Number of launches of each device.
    pub launches: Vec<usize>,
    /// All launches, in the order in which they ended.
    pub timeline: Vec<SimulatedLaunch>,
    /// Tasks that no device finished; not empty only when all devices were lost.
    pub unfinished: Vec<TaskId>,
}

/// One simulated device.
#[derive(Clone, Debug, Default)]
struct State {
    /// When its last launch ends.
    free_s: f64,
    in_flight: VecDeque<SimulatedLaunch>,
    lost: bool,
}

impl Simulation {
    /// Runs a fresh `queue` on `devices` devices, on which a task takes `seconds(device, task)`.
    ///
    /// Values of `seconds` that are negative or not finite count as 0.
    #[must_use]
    pub fn run(&self, queue: &dyn TaskQueue, devices: usize, seconds: &dyn Fn(usize, TaskId) -> f64) -> SimulatedRun {
        let mut run = Running {
            plan: self,
            queue,
            seconds,
            devices: vec![State::default(); devices],
            idle: BTreeSet::new(),
            events: BTreeSet::new(),
            result: SimulatedRun { busy_s: vec![0.0; devices], launches: vec![0; devices], ..Default::default() },
        };
        for &(device, at_s) in &self.failures {
            if device < devices {
                run.events.insert(Event { at: order(at_s), what: What::Failure, device });
            }
        }
        // Every device takes its first launch before any takes its second, as the driver sees to.
        for depth in 1..=self.in_flight.max(1) {
            (0..devices).for_each(|device| run.fill(device, depth, 0.0));
        }
        while let Some(event) = run.events.pop_first() {
            run.happen(event);
        }
        run.result.unfinished = queue.unfinished_tasks();
        run.result
    }
}

impl Simulation {
    /// When a launch ends that begins at `start_s` and would take `seconds` at the device's given speed.
    fn end_of(&self, device: usize, start_s: f64, seconds: f64) -> f64 {
        let (mut now, mut left, mut speed) = (start_s, seconds, 1.0);
        for change in self.changes.iter().filter(|change| change.device == device) {
            let until = (change.at_s - now).max(0.0);
            if left <= until * speed {
                break;
            }
            left -= until * speed;
            now = now.max(change.at_s);
            speed = change.speed;
        }
        now + left / speed
    }
}

/// A time ≥ 0 as an integer of the same order; anything else counts as 0.
fn order(seconds: f64) -> u64 {
    if seconds > 0.0 { seconds.to_bits() } else { 0 }
}

/// Something that happens; sorted by time, then ends before failures, then device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Event {
    at: u64,
    what: What,
    device: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum What {
    End,
    Failure,
}

struct Running<'a> {
    plan: &'a Simulation,
    queue: &'a dyn TaskQueue,
    seconds: &'a dyn Fn(usize, TaskId) -> f64,
    devices: Vec<State>,
    /// Devices that were told to wait.
    idle: BTreeSet<usize>,
    /// Failures, and for each busy device the end of its first launch in flight.
    events: BTreeSet<Event>,
    result: SimulatedRun,
}

impl Running<'_> {
    fn happen(&mut self, event: Event) {
        let now = f64::from_bits(event.at);
        let device = event.device;
        match event.what {
            What::End => {
                let Some(launch) = self.devices[device].in_flight.pop_front() else { return };
                self.queue.took(device, &launch.tasks, launch.end_s - launch.start_s);
                self.queue.finish(device, &launch.tasks);
                self.result.busy_s[device] += launch.end_s - launch.start_s;
                self.result.makespan_s = self.result.makespan_s.max(launch.end_s);
                self.result.timeline.push(launch);
                self.await_first(device);
                self.fill(device, self.plan.in_flight, now);
            }
            What::Failure => self.lose(device, now),
        }
        // As a driver wakes its waiting threads whenever something was finished or given up.
        for waiting in core::mem::take(&mut self.idle) {
            self.fill(waiting, self.plan.in_flight, now);
        }
    }

    /// Lets a device pop until `depth` launches are in flight, at least one.
    fn fill(&mut self, device: usize, depth: usize, now: f64) {
        if self.devices[device].lost {
            return;
        }
        let mut now = now;
        while self.devices[device].in_flight.len() < depth.max(1) {
            let mut tasks = Vec::new();
            match self.queue.pop(device, &mut tasks) {
                Pop::Done => return,
                Pop::Wait => {
                    self.idle.insert(device);
                    return;
                }
                Pop::Launch => {}
            }
            now += self.plan.pop_s;
            let cost = |&task: &TaskId| {
                Some((self.seconds)(device, task)).filter(|s| s.is_finite()).map_or(0.0, |s| s.max(0.0))
            };
            let took = self.plan.launch_s + tasks.iter().map(cost).sum::<f64>();
            let state = &mut self.devices[device];
            let start_s = state.free_s.max(now + self.plan.hand_over_s);
            state.free_s = self.plan.end_of(device, start_s, took);
            let launch = SimulatedLaunch { device, start_s, end_s: state.free_s, tasks, finished: true };
            state.in_flight.push_back(launch);
            self.result.launches[device] += 1;
            if self.devices[device].in_flight.len() == 1 {
                self.await_first(device);
            }
        }
    }

    /// Enters the end of the device's first launch in flight.
    fn await_first(&mut self, device: usize) {
        if let Some(first) = self.devices[device].in_flight.front() {
            self.events.insert(Event { at: order(first.end_s), what: What::End, device });
        }
    }

    fn lose(&mut self, device: usize, now: f64) {
        let state = &mut self.devices[device];
        state.lost = true;
        if let Some(first) = state.in_flight.front() {
            self.events.remove(&Event { at: order(first.end_s), what: What::End, device });
        }
        let mut unfinished = Vec::new();
        for mut launch in state.in_flight.drain(..) {
            launch.end_s = now.max(launch.start_s);
            launch.finished = false;
            unfinished.extend_from_slice(&launch.tasks);
            self.result.busy_s[device] += launch.end_s - launch.start_s;
            self.result.timeline.push(launch);
        }
        self.queue.retire(device, &unfinished);
    }
}

#[cfg(test)]
mod large_tasks;
#[cfg(test)]
mod regimes;
#[cfg(test)]
mod tests;
