//! What every queue promises, tried on every queue.

use super::*;
use crate::Schedule;
use crate::policy::{Block, Lpt, Policy, RoundRobin};
use alloc::boxed::Box;
use alloc::vec;
use core::sync::atomic::{AtomicU32, Ordering};
use proptest::prelude::*;
use rt_core::{CostModel, Work};
use std::format;
use std::string::String;
use std::sync::Barrier;
use std::thread;
use std::time::Instant;

/// Every queue over every policy that it can start from.
fn queues(work: &[Work], devices: &[CostModel]) -> Vec<(String, Box<dyn TaskQueue>)> {
    let mut all: Vec<(String, Box<dyn TaskQueue>)> =
        vec![("central".into(), Box::new(CentralQueue::new(work, devices)))];
    let policies: [&dyn Policy; 3] = [&Block, &RoundRobin, &Lpt];
    for policy in policies {
        let schedule = policy.schedule(work, devices);
        all.push((format!("static, {}", policy.name()), Box::new(StaticQueue::new(&schedule))));
        all.push((format!("hybrid, {}", policy.name()), Box::new(HybridQueue::new(&schedule, work, devices))));
    }
    all
}

fn works(costs: &[f32]) -> Vec<Work> {
    costs.iter().map(|&c| Work::new(1.0, c, c / 4.0)).collect()
}

/// Devices of the given relative speeds, which need 10 µs per launch.
fn models(speeds: &[f64]) -> Vec<CostModel> {
    speeds.iter().map(|s| CostModel::new(1e-5, 1e-9 / s, 1e-9 / s, 2e-9 / s).expect("valid")).collect()
}

/// What a driver knows: the launches in flight of each device, and how often each task was finished.
struct Run<'a> {
    queue: &'a dyn TaskQueue,
    in_flight: Vec<Vec<Vec<TaskId>>>,
    lost: Vec<bool>,
    held: Vec<bool>,
    finished: Vec<u32>,
}

impl<'a> Run<'a> {
    fn new(queue: &'a dyn TaskQueue, tasks: usize, devices: usize) -> Self {
        Self {
            queue,
            in_flight: vec![Vec::new(); devices],
            lost: vec![false; devices],
            held: vec![false; tasks],
            finished: vec![0; tasks],
        }
    }

    fn pop(&mut self, device: usize) -> Pop {
        let mut out = vec![TaskId::MAX];
        let pop = self.queue.pop(device, &mut out);
        assert_eq!(pop == Pop::Launch, !out.is_empty());
        for &task in &out {
            assert!(!self.lost[device], "a lost device was given task {task}");
            assert!(!core::mem::replace(&mut self.held[task as usize], true), "task {task} is in two launches");
            assert_eq!(self.finished[task as usize], 0, "task {task} was finished before");
        }
        if pop == Pop::Launch {
            self.in_flight[device].push(out);
        }
        let all_finished = self.finished.iter().all(|&times| times == 1);
        assert_eq!(pop == Pop::Done, self.lost[device] || all_finished);
        pop
    }

    fn finish(&mut self, device: usize) {
        if self.in_flight[device].is_empty() {
            return;
        }
        let tasks = self.in_flight[device].remove(0);
        self.queue.finish(device, &tasks);
        for task in tasks {
            self.held[task as usize] = false;
            self.finished[task as usize] += 1;
        }
    }

    fn retire(&mut self, device: usize) {
        let tasks: Vec<TaskId> = self.in_flight[device].drain(..).flatten().collect();
        self.queue.retire(device, &tasks);
        self.lost[device] = true;
        for &task in &tasks {
            self.held[task as usize] = false;
        }
        // A hung device that comes back must change nothing.
        self.queue.finish(device, &tasks);
    }

    /// Lets the devices that are left do all that is left.
    fn drain(&mut self) {
        loop {
            let mut progress = false;
            for device in 0..self.lost.len() {
                progress |= self.pop(device) == Pop::Launch;
                progress |= !self.in_flight[device].is_empty();
                self.finish(device);
            }
            if !progress {
                break;
            }
        }
        let left: Vec<TaskId> = (0..).zip(&self.finished).filter(|(_, n)| **n == 0).map(|(t, _)| t).collect();
        assert_eq!(self.queue.unfinished_tasks(), left);
        assert!(left.is_empty() || self.lost.iter().all(|&lost| lost), "tasks {left:?} were lost");
    }
}

#[derive(Clone, Copy, Debug)]
enum Call {
    Pop(usize),
    Finish(usize),
    Retire(usize),
}

fn calls(devices: usize) -> impl Strategy<Value = Vec<Call>> {
    let call = (0..20_u32, 0..devices).prop_map(|(what, device)| match what {
        0..11 => Call::Pop(device),
        11..19 => Call::Finish(device),
        _ => Call::Retire(device),
    });
    prop::collection::vec(call, 0..80)
}

fn runs() -> impl Strategy<Value = (Vec<f32>, Vec<f64>, Vec<Call>)> {
    (1_usize..6).prop_flat_map(|devices| {
        let costs = prop::collection::vec(prop_oneof![0.0_f32..1e4, Just(0.0), Just(100.0)], 0..90);
        let speeds = prop::collection::vec(prop_oneof![Just(1.0), 0.05..20.0], devices);
        (costs, speeds, calls(devices))
    })
}

proptest! {
    /// Exactly once under random interleavings of pops, finishes, steals and losses; nothing lost with a device;
    /// `Done` neither early nor late; late finishes ignored.
    ///
    /// Mutants: `StaticQueue::retire` that forgets the slot; `Ledger::retire` that makes no orphans;
    /// `Ledger::leave` that swaps without comparing; `Ledger::idle` that always says `Done`; `Slots::take_back` that
    /// returns `seen.start..cut`; `HybridQueue::claim` that drops the rest instead of refilling; `adopt` that does
    /// not clear its bits.
    #[test]
    fn every_task_runs_exactly_once((costs, speeds, calls) in runs()) {
        let (work, devices) = (works(&costs), models(&speeds));
        for (name, queue) in queues(&work, &devices) {
            let mut run = Run::new(&*queue, work.len(), devices.len());
            for &call in &calls {
                match call {
                    Call::Pop(device) if run.in_flight[device].len() < 2 => { run.pop(device); }
                    Call::Pop(_) => {}
                    Call::Finish(device) => run.finish(device),
                    Call::Retire(device) => run.retire(device),
                }
            }
            run.drain();
            prop_assert!(run.finished.iter().all(|&times| times <= 1), "{}", name);
        }
    }

    /// A device lost at any launch loses no task, with another launch of it in flight or not.
    ///
    /// Mutants: `HybridQueue::loot` that returns 0 for a retired victim; `Ledger::retire` that takes only the first.
    #[test]
    fn a_device_lost_at_any_launch_loses_no_task(
        costs in prop::collection::vec(0.0_f32..1e4, 1..60), launch in 0_usize..40, in_flight in 1_usize..3,
    ) {
        let (work, devices) = (works(&costs), models(&[1.0, 3.0, 1.0]));
        for (name, queue) in queues(&work, &devices) {
            let mut run = Run::new(&*queue, work.len(), devices.len());
            let mut launches = 0;
            for step in 0..1_000 {
                let device = step % 3;
                if run.lost[device] {
                    continue;
                }
                while run.in_flight[device].len() < in_flight && run.pop(device) == Pop::Launch {
                    launches += usize::from(device == 1);
                }
                if device == 1 && launches > launch {
                    run.retire(device);
                } else {
                    run.finish(device);
                }
            }
            run.drain();
            prop_assert!(run.finished.iter().all(|&times| times == 1), "{}", name);
        }
    }
}

/// Lets others run; fails a test that would hang. A minute is a thousand times what these runs take.
fn wait(since: Instant) {
    assert!(since.elapsed().as_secs() < 60, "a task was lost: everyone waits");
    thread::yield_now();
}

/// Exactly once under real threads, some of which are lost on the way.
///
/// Mutants: `adopt` that does not clear its bits; `Ledger::leave` that swaps without comparing; `Ledger::retire` that
/// makes no orphans.
#[test]
fn every_task_runs_exactly_once_on_threads() {
    const TASKS: usize = 3_000;
    const DEVICES: usize = 6;
    for seed in 0..12_u32 {
        let random = |index: u32, bound: u32| rt_core::random::below(bound, seed, index, 1);
        let costs: Vec<f32> = (0..TASKS as u32).map(|t| random(t, 1_000) as f32).collect();
        let (work, devices) = (works(&costs), models(&[1.0, 1.0, 2.0, 4.0, 1.0, 0.5]));
        for (name, queue) in queues(&work, &devices) {
            let finished: Vec<AtomicU32> = (0..TASKS).map(|_| AtomicU32::new(0)).collect();
            thread::scope(|scope| {
                for device in 0..DEVICES {
                    let (queue, finished) = (&*queue, &finished);
                    // Devices 0 to 2 survive; the others are lost at some launch.
                    let mut launches_left = if device < 3 { u32::MAX } else { random(10_000 + device as u32, 20) };
                    scope.spawn(move || {
                        let mut out = Vec::new();
                        let since = Instant::now();
                        loop {
                            match queue.pop(device, &mut out) {
                                Pop::Done => break,
                                Pop::Wait => wait(since),
                                Pop::Launch if launches_left == 0 => {
                                    queue.retire(device, &out);
                                    queue.finish(device, &out);
                                }
                                Pop::Launch => {
                                    launches_left -= 1;
                                    if out.len() % 3 == 0 {
                                        thread::yield_now();
                                    }
                                    for &task in &out {
                                        finished[task as usize].fetch_add(1, Ordering::Relaxed);
                                    }
                                    queue.finish(device, &out);
                                }
                            }
                        }
                    });
                }
            });
            assert!(finished.iter().all(|times| times.load(Ordering::Relaxed) == 1), "{name}, seed {seed}");
            assert!(queue.unfinished_tasks().is_empty(), "{name}, seed {seed}");
        }
    }
}

/// Threads that pop with nothing else to do meet in the same words as often as can be: in one long central queue, and
/// in lists that everybody steals from one device.
///
/// Mutants, which need two processors to show: `CentralQueue::pop` that loads and stores `next`; `Slots::take_front`
/// that loads and stores the range.
#[test]
fn threads_that_pop_at_once_share_no_task() {
    const DEVICES: usize = 4;
    let devices = models(&[1.0; DEVICES]);
    let central = works(&vec![3.0; 400_000]);
    let stolen = works(&[3.0; 500]);
    let mut lists = vec![Vec::new(); DEVICES];
    lists[0].extend(0..stolen.len() as TaskId);
    let schedule = Schedule::new(lists, &stolen, &devices).expect("each task once");
    let mut all: Vec<(usize, Box<dyn TaskQueue>)> =
        vec![(central.len(), Box::new(CentralQueue::new(&central, &devices)))];
    for _ in 0..200 {
        all.push((stolen.len(), Box::new(HybridQueue::new(&schedule, &stolen, &devices))));
    }
    for (tasks, queue) in &all {
        let start = Barrier::new(DEVICES);
        let pop_all = |device| {
            let (mut out, mut mine) = (Vec::new(), Vec::with_capacity(*tasks));
            start.wait();
            let since = Instant::now();
            loop {
                match queue.pop(device, &mut out) {
                    Pop::Done => return mine,
                    Pop::Wait => wait(since),
                    Pop::Launch => {
                        queue.finish(device, &out);
                        mine.extend_from_slice(&out);
                    }
                }
            }
        };
        let popped: Vec<Vec<TaskId>> = thread::scope(|scope| {
            let pop_all = &pop_all;
            let threads: Vec<_> = (0..DEVICES).map(|device| scope.spawn(move || pop_all(device))).collect();
            threads.into_iter().map(|thread| thread.join().expect("no thread panics")).collect()
        });
        let mut popped: Vec<TaskId> = popped.into_iter().flatten().collect();
        popped.sort_unstable();
        assert!(popped.iter().copied().eq(0..*tasks as TaskId), "{} of {tasks} popped", popped.len());
    }
}

/// A device that is retired by one thread while another pops for it: what was popped can still be finished, and
/// nothing that was reserved for it is lost.
///
/// Mutant: `StaticQueue::retire` that reads the slot instead of taking it.
#[test]
fn a_pop_that_overlaps_a_retire_loses_nothing() {
    const TASKS: usize = 200;
    for seed in 0..100_u32 {
        let (work, devices) = (works(&[3.0; TASKS]), models(&[1.0; 3]));
        for (name, queue) in queues(&work, &devices) {
            let finished: Vec<AtomicU32> = (0..TASKS).map(|_| AtomicU32::new(0)).collect();
            let work_as = |device: usize| {
                let mut out = Vec::new();
                let since = Instant::now();
                loop {
                    match queue.pop(device, &mut out) {
                        Pop::Done => break,
                        Pop::Wait => wait(since),
                        Pop::Launch => {
                            for &task in &out {
                                finished[task as usize].fetch_add(1, Ordering::Relaxed);
                            }
                            queue.finish(device, &out);
                        }
                    }
                }
            };
            thread::scope(|scope| {
                for device in [0, 0, 1, 2] {
                    scope.spawn(move || work_as(device));
                }
                scope.spawn(|| {
                    (0..seed % 8).for_each(|_| thread::yield_now());
                    queue.retire(0, &[]);
                });
            });
            assert!(finished.iter().all(|times| times.load(Ordering::Relaxed) == 1), "{name}, seed {seed}");
        }
    }
}

/// Nothing that is asked of a queue makes it panic.
#[test]
fn strange_calls_are_harmless() {
    for devices in [0, 2] {
        let (work, devices) = (works(&[1.0, 2.0, 3.0]), models(&vec![1.0; devices]));
        for (name, queue) in queues(&work, &devices) {
            let mut out = vec![9];
            assert_eq!(queue.pop(2, &mut out), Pop::Done, "{name}");
            assert!(out.is_empty());
            queue.finish(0, &[0, 1, 77]);
            queue.finish(5, &[0]);
            queue.retire(5, &[0, 1, 2, 3]);
            queue.finish(u32::MAX as usize, &[0]);
            assert_eq!(queue.unfinished_tasks(), [0, 1, 2], "{name}: nothing was popped");
        }
    }
    let huge = vec![Work::new(f32::MAX, f32::MAX, f32::MAX); 9];
    let expensive = vec![CostModel::new(f64::MAX, f64::MAX, f64::MAX, f64::MAX).expect("valid"); 2];
    for (_, queue) in queues(&huge, &expensive) {
        Run::new(&*queue, huge.len(), expensive.len()).drain();
    }
}

/// The forms of a launch that the queues are named for.
///
/// Mutants: `launches` that always says `(f64::INFINITY, 0.0)`; `first` of the whole stream.
#[test]
fn launches_have_the_promised_sizes() {
    let (work, devices) = (works(&[8.0, 1.0, 8.0, 2.0, 8.0, 1.0]), vec![CostModel::UNIT; 2]);
    let mut out = Vec::new();
    let central = CentralQueue::new(&work, &devices);
    let order = core::iter::from_fn(|| {
        let launch = central.pop(0, &mut out) == Pop::Launch;
        central.finish(0, &out);
        launch.then(|| out[0])
    });
    assert_eq!(order.collect::<Vec<_>>(), [0, 2, 4, 3, 1, 5], "most expensive first, ties by number");

    let schedule = Lpt.schedule(&work, &devices);
    let fixed = StaticQueue::new(&schedule);
    assert_eq!(fixed.pop(1, &mut out), Pop::Launch);
    assert_eq!(out, schedule.lists()[1]);
    assert_eq!(fixed.pop(1, &mut out), Pop::Wait, "nothing moves");

    let uniform = works(&[4.0; 4096]);
    let hybrid = HybridQueue::new(&Block.schedule(&uniform, &devices), &uniform, &devices);
    let sizes: Vec<usize> = core::iter::from_fn(|| {
        let launch = hybrid.pop(0, &mut out) == Pop::Launch;
        hybrid.finish(0, &out);
        launch.then_some(out.len())
    })
    .collect();
    let most = sizes.iter().copied().max().expect("a launch");
    assert_eq!(sizes[0], 8, "a 256th of the list");
    assert!((60..=2048 / 12).contains(&most), "half of what is surely finished, then a twelfth of the list: {most}");
    assert_eq!(sizes.last(), Some(&1));
    assert_eq!(sizes.iter().sum::<usize>(), 4096, "in the end all is stolen");

    // Tasks of 10 µs, of which nothing is known but that. A list takes 20 ms, and its tasks deviate by some 0.2 ms
    // together.
    let first = |launch_s: f64| {
        let priced = vec![CostModel::new(launch_s, 1e-5, 0.0, 0.0).expect("valid"); 2];
        let hybrid = HybridQueue::new(&Block.schedule(&uniform, &priced), &uniform, &priced);
        let mut out = Vec::new();
        hybrid.pop(0, &mut out);
        out.len()
    };
    assert_eq!(first(1e-3), 2048, "no second launch would mend more than it costs");
    assert!(first(1e-6) < 40, "where launches cost little they begin small");
}

/// Mutant: `loot` without what a launch costs the thief.
#[test]
fn a_theft_that_takes_longer_than_it_mends_is_left() {
    let work = works(&[1.0; 2]);
    let models = [5.0, 0.0].map(|launch_s| CostModel::new(launch_s, 1.0, 1.0, 1.0).expect("a model"));
    let schedule = Schedule::new(vec![vec![], vec![0, 1]], &work, &models).expect("each task once");
    let queue = HybridQueue::new(&schedule, &work, &models);
    let mut out = Vec::new();
    assert_eq!(queue.pop(0, &mut out), Pop::Wait, "the other one ends both before");
    assert_eq!(queue.pop(1, &mut out), Pop::Launch);
}

/// A slow device leaves the last task to a much faster one that lives, and takes it from one that is lost.
///
/// Mutants: `loot` that compares no ends; `steal` that does not ask whether the victim is retired; `do_all_wait` that
/// is always true.
#[test]
fn a_slow_device_takes_the_last_task_only_from_the_lost() {
    let (work, devices) = (works(&[5.0; 2]), models(&[0.05, 1.0]));
    let schedule = Schedule::new(vec![vec![], vec![0, 1]], &work, &devices).expect("each task once");
    let queue = HybridQueue::new(&schedule, &work, &devices);
    let mut out = Vec::new();
    assert_eq!(queue.pop(0, &mut out), Pop::Wait);
    queue.retire(1, &[]);
    assert_eq!(queue.pop(0, &mut out), Pop::Launch);
}

/// Mutants: `NEIGHBOURS` of 1; groups in their own order.
#[test]
fn neighbours_stay_together_and_groups_are_spread() {
    let (work, models) = (vec![Work::new(64.0, 0.0, 0.0); 64], [CostModel::UNIT]);
    let queue = HybridQueue::new(&Lpt.schedule(&work, &models), &work, &models);
    let (mut order, mut out) = (Vec::new(), Vec::new());
    while queue.pop(0, &mut out) == Pop::Launch {
        queue.finish(0, &out);
        order.extend_from_slice(&out);
    }
    assert!(order.iter().copied().eq((0..16).chain(32..48).chain(16..32).chain(48..64)), "{order:?}");
}
