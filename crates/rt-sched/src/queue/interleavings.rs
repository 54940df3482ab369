//! Every interleaving of two or three devices on small queues, by loom (its `AUTHORS`: an implementation of B. Norris
//! and B. Demsky, *CDSChecker: Checking Concurrent Data Structures Written with C/C++ Atomics*, 2013).

use super::{CentralQueue, HybridQueue, Pop, StaticQueue, TaskQueue};
use crate::policy::{Block, Policy};
use alloc::boxed::Box;
use alloc::vec::Vec;
use loom::sync::Arc;
use rt_core::{CostModel, TaskId, Work};

/// Preemptions of a thread that are tried: with two, most defects of lock-free code show, and the search ends.
const PREEMPTIONS: usize = 2;

/// Pops a device makes at most; one that is told to wait gives up, since loom has no patience.
const POPS: usize = 4;

type Make = fn(&[Work], &[CostModel]) -> Box<dyn TaskQueue>;

fn central(work: &[Work], devices: &[CostModel]) -> Box<dyn TaskQueue> {
    Box::new(CentralQueue::new(work, devices))
}

fn fixed(work: &[Work], devices: &[CostModel]) -> Box<dyn TaskQueue> {
    Box::new(StaticQueue::new(&Block.schedule(work, devices)))
}

fn hybrid(work: &[Work], devices: &[CostModel]) -> Box<dyn TaskQueue> {
    Box::new(HybridQueue::new(&Block.schedule(work, devices), work, devices))
}

/// Pops until told to stop and finishes what it got, or is lost with its first launch; returns what it finished.
fn device(queue: &dyn TaskQueue, device: usize, lost: bool) -> Vec<TaskId> {
    let (mut out, mut finished) = (Vec::new(), Vec::new());
    for _ in 0..POPS {
        match queue.pop(device, &mut out) {
            Pop::Done | Pop::Wait => break,
            Pop::Launch if lost => {
                queue.retire(device, &out);
                queue.finish(device, &out);
                break;
            }
            Pop::Launch => {
                queue.finish(device, &out);
                finished.extend_from_slice(&out);
            }
        }
    }
    finished
}

/// Runs `devices` devices on `tasks` equal tasks in every order, then lets the first do what is left.
fn explore(make: Make, tasks: usize, devices: usize, lost: Option<usize>) {
    let mut model = loom::model::Builder::new();
    model.preemption_bound = Some(PREEMPTIONS);
    model.check(move || {
        let work = alloc::vec![Work::new(1.0, 8.0, 2.0); tasks];
        let models = alloc::vec![CostModel::UNIT; devices];
        let queue: Arc<Box<dyn TaskQueue>> = Arc::new(make(&work, &models));
        let threads: Vec<_> = (1..devices)
            .map(|d| {
                let queue = queue.clone();
                loom::thread::spawn(move || device(&**queue, d, lost == Some(d)))
            })
            .collect();
        let mut finished = device(&**queue, 0, lost == Some(0));
        finished.extend(threads.into_iter().flat_map(|thread| thread.join().expect("no panic")));
        // Whoever is left does the rest: what a lost device, or one that gave up waiting, left behind. All are asked,
        // as queues are promised: one may wait for another.
        let last = usize::from(lost == Some(0));
        for _ in 0..=tasks {
            (0..devices).for_each(|d| finished.extend(device(&**queue, d, false)));
        }
        finished.sort_unstable();
        assert!(finished.iter().copied().eq(0..tasks as TaskId), "finished: {finished:?}");
        assert!(queue.unfinished_tasks().is_empty());
        assert_eq!(queue.pop(last, &mut Vec::new()), Pop::Done);
    });
}

/// Mutants: `CentralQueue::pop` that loads and stores `next`; `Ledger::idle` that always says `Done`.
#[test]
fn loom_central() {
    explore(central, 3, 2, None);
    explore(central, 2, 2, Some(1));
}

/// Mutants: `StaticQueue::retire` that forgets the slot; `adopt` that lowers the count before it clears bits.
#[test]
fn loom_static() {
    explore(fixed, 3, 2, None);
    explore(fixed, 4, 2, Some(1));
}

/// Mutants: `Slots::take_front` that loads and stores the range; `Slots::take_back` that stores instead of comparing;
/// `HybridQueue::claim` that drops the rest.
#[test]
fn loom_hybrid() {
    explore(hybrid, 4, 2, None);
    explore(hybrid, 3, 2, Some(0));
}

/// Two thieves and a victim that is lost.
#[test]
fn loom_thieves() {
    explore(hybrid, 3, 3, Some(2));
}
