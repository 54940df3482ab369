//! Schedules and queues of any work on any devices.

use crate::bytes::Bytes;
use rt_core::{CostModel, TaskId, Work};
use rt_sched::policy::{Block, Lpt, Policy, RoundRobin};
use rt_sched::queue::{CentralQueue, HybridQueue, Pop, StaticQueue, TaskQueue};
use rt_sched::{Schedule, bound};

/// Deals the work by every policy, and lets devices pop, finish and be lost in any order on every queue: each task is
/// finished exactly once, as long as a device is left.
pub fn scheduling(data: &[u8]) {
    let mut bytes = Bytes(data);
    let (devices, tasks) = (1 + usize::from(bytes.byte() % 6), usize::from(bytes.byte()));
    let devices: Vec<CostModel> = (0..devices).map(|_| model(&mut bytes)).collect();
    let work: Vec<Work> = (0..tasks).map(|_| Work::new(bytes.coordinate(), bytes.coordinate(), 1.0)).collect();
    let calls = bytes.0;
    run(&CentralQueue::new(&work, &devices), tasks, devices.len(), calls);
    let policies: [&dyn Policy; 3] = [&Block, &RoundRobin, &Lpt];
    for policy in policies {
        let schedule = policy.schedule(&work, &devices);
        let mut all: Vec<TaskId> = schedule.lists().iter().flatten().copied().collect();
        all.sort_unstable();
        assert!(all.iter().copied().eq(0..tasks as TaskId), "{}: every task in one list", policy.name());
        check_seconds(policy.name(), &schedule, &work, &devices);
        run(&StaticQueue::new(&schedule), tasks, devices.len(), calls);
        run(&HybridQueue::new(&schedule, &work, &devices), tasks, devices.len(), calls);
    }
}

fn model(bytes: &mut Bytes<'_>) -> CostModel {
    let mut seconds = || f64::from(bytes.coordinate().abs());
    CostModel::new(seconds(), seconds(), seconds(), seconds()).unwrap_or_default()
}

/// What a task's cost may be rounded by, in units of the most expensive task's: what LPT says of itself, doubled.
const ROUNDING: f64 = 1.0 / (1 << 18) as f64;

/// The predicted seconds are those of the lists, and no schedule is faster than what no schedule can beat.
fn check_seconds(policy: &str, schedule: &Schedule, work: &[Work], devices: &[CostModel]) {
    let rows: Vec<Vec<f64>> = devices.iter().map(|d| work.iter().map(|w| d.seconds(w)).collect()).collect();
    let mut makespan = 0.0_f64;
    for (device, (list, said)) in schedule.lists().iter().zip(schedule.seconds()).enumerate() {
        let launch = if list.is_empty() { 0.0 } else { devices[device].per_launch() };
        let seconds = launch + list.iter().map(|&task| rows[device][task as usize]).sum::<f64>();
        let highest = rows[device].iter().copied().fold(0.0, f64::max);
        let tolerance = ROUNDING * highest * list.len() as f64 + 1e-9 * seconds;
        assert!((said - seconds).abs() <= tolerance, "{policy}: {said} s said of a list of {seconds} s");
        makespan = makespan.max(seconds);
    }
    let rows: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
    let least = bound::unrelated(&rows);
    // Sums of a few hundred terms in another order.
    assert!(!least.is_finite() || makespan >= least * (1.0 - 1e-9), "{policy}: {makespan} is below the bound {least}");
}

/// Plays the calls, then lets the devices that are left do the rest.
fn run(queue: &dyn TaskQueue, tasks: usize, devices: usize, calls: &[u8]) {
    let mut finished = vec![0_u32; tasks];
    let mut in_flight: Vec<Vec<TaskId>> = vec![Vec::new(); devices];
    let mut lost = vec![false; devices];
    let mut out = Vec::new();
    for &call in calls.iter().take(512) {
        let device = usize::from(call >> 2) % devices;
        match call & 3 {
            0 | 1 => {
                queue.pop(device, &mut out);
                in_flight[device].append(&mut out);
            }
            2 => finish(queue, device, &mut in_flight[device], &mut finished),
            _ => {
                let tasks = std::mem::take(&mut in_flight[device]);
                queue.retire(device, &tasks);
                lost[device] = true;
                // A lost device that comes back changes nothing.
                queue.finish(device, &tasks);
            }
        }
    }
    // Each round finishes what was popped; popping gives at least one task while any is left.
    for _ in 0..=tasks {
        for device in 0..devices {
            let pop = queue.pop(device, &mut out);
            assert_eq!(pop == Pop::Launch, !out.is_empty());
            assert!(out.is_empty() || !lost[device], "a lost device was given tasks");
            in_flight[device].append(&mut out);
            finish(queue, device, &mut in_flight[device], &mut finished);
        }
    }
    let left: Vec<TaskId> = (0..tasks as TaskId).filter(|&task| finished[task as usize] == 0).collect();
    assert_eq!(queue.unfinished_tasks(), left);
    assert!(finished.iter().all(|&times| times <= 1), "a task was finished twice");
    assert!(left.is_empty() || lost.iter().all(|&lost| lost), "tasks {left:?} were lost");
}

fn finish(queue: &dyn TaskQueue, device: usize, tasks: &mut Vec<TaskId>, finished: &mut [u32]) {
    queue.finish(device, tasks);
    for task in tasks.drain(..) {
        finished[task as usize] += 1;
    }
}
