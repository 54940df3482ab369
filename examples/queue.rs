//! A queue of one's own: two tasks a launch, in whatever order the policy says. It needs an order of the tasks and no
//! more, so any policy goes with it.
//!
//! `cargo run --release -p rt-balance --example queue`

use rt_balance::cpu::CpuDevice;
use rt_balance::policies::Block;
use rt_balance::queues::{Dealt, Needs, Pop, QueueMaker, TaskQueue};
use rt_balance::{Balancer, Control, Device, Hit, Ray, RaySource, Scheduling, Stream, StreamKind, StreamSpec, TaskId};
use std::collections::{BTreeMap, VecDeque};
use std::io::{Write, stdout};
use std::sync::{Arc, Mutex, PoisonError};

#[derive(Debug)]
struct Pairs;

impl QueueMaker for Pairs {
    fn name(&self) -> &'static str {
        "pairs"
    }

    fn needs(&self) -> Needs {
        Needs::Order
    }

    fn make(&self, dealt: Dealt<'_>) -> Box<dyn TaskQueue> {
        let waiting = dealt.schedule.lists().iter().flatten().copied().collect();
        let retired = vec![false; dealt.devices.len()];
        Box::new(PairQueue(Mutex::new(State { waiting, held: BTreeMap::new(), retired })))
    }
}

#[derive(Debug)]
struct PairQueue(Mutex<State>);

#[derive(Debug)]
struct State {
    waiting: VecDeque<TaskId>,
    /// Tasks that are handed out and not finished, and to whom.
    held: BTreeMap<TaskId, usize>,
    retired: Vec<bool>,
}

impl PairQueue {
    fn with<R>(&self, work: impl FnOnce(&mut State) -> R) -> R {
        work(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl TaskQueue for PairQueue {
    fn pop(&self, device: usize, out: &mut Vec<TaskId>) -> Pop {
        out.clear();
        self.with(|state| {
            if state.retired.get(device).copied().unwrap_or(true) {
                return Pop::Done;
            }
            out.extend(state.waiting.drain(..2.min(state.waiting.len())));
            state.held.extend(out.iter().map(|&task| (task, device)));
            match (out.is_empty(), state.held.is_empty()) {
                (false, _) => Pop::Launch,
                (true, false) => Pop::Wait,
                (true, true) => Pop::Done,
            }
        })
    }

    fn finish(&self, device: usize, tasks: &[TaskId]) {
        self.with(|state| state.held.retain(|task, holder| *holder != device || !tasks.contains(task)));
    }

    fn retire(&self, device: usize, unfinished: &[TaskId]) {
        self.with(|state| {
            let back = unfinished.iter().filter(|task| state.held.get(task) == Some(&device));
            state.waiting.extend(back);
            state.held.retain(|task, holder| *holder != device || !unfinished.contains(task));
            state.retired.get_mut(device).into_iter().for_each(|retired| *retired = true);
        });
    }

    fn readmit(&self, device: usize) {
        self.with(|state| state.retired.get_mut(device).into_iter().for_each(|retired| *retired = false));
    }

    fn unfinished_tasks(&self) -> Vec<TaskId> {
        self.with(|state| {
            let mut tasks: Vec<TaskId> = state.waiting.iter().chain(state.held.keys()).copied().collect();
            tasks.sort_unstable();
            tasks
        })
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let devices: Vec<Arc<dyn Device>> =
        CpuDevice::open_all(&[1, 1])?.into_iter().map(|device| Arc::new(device) as _).collect();
    let mut balancer = Balancer::for_mesh(&positions, &[[0, 1, 2]], &devices)?;
    let rays = vec![Ray::new([0.2, 0.2, 1.0].into(), [0.0, 0.0, -1.0].into()); 100_000];
    let source = RaySource::Explicit { rays: rays.into(), origins: None };
    let stream = Stream::new(source, StreamKind::Custom, StreamSpec::default());
    let mut hits = vec![Hit::MISS; 100_000];
    let mut scheduling = Scheduling { queue: Box::new(Pairs), policy: Some(Box::new(Block)), ..Scheduling::default() };
    let run = balancer.trace(&stream, &mut scheduling, &mut hits, None, Control::default())?;
    for device in &run.report.devices {
        writeln!(stdout(), "{}: {} tasks in {} launches", device.name, device.tasks, device.launches)?;
        assert!(device.tasks <= 2 * device.launches);
    }
    assert!(hits.iter().all(|hit| hit.primitive == 0));
    Ok(())
}

#[cfg(test)]
#[test]
fn runs() -> Result<(), Box<dyn std::error::Error>> {
    main()
}
