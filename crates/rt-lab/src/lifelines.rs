//! A rival: work stealing with lifelines.

use rt_balance::queues::{Dealt, Needs, Pop, QueueMaker, TaskQueue};
use rt_core::TaskId;
use rt_sched::uninformed::Regime;
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Lists of equal length, of which a device has a third in flight at a time, and who has none left steals half of what
/// one of its lifelines has.
///
/// After V. Saraswat, P. Kambadur, S. Kodali, D. Grove and S. Krishnamoorthy, *Lifeline-based Global Load Balancing*
/// (PPoPP 2011), by which OSPRay's ranks share out tiles (W. Usher, I. Wald and others, *Scalable Ray Tracing Using the
/// Distributed FrameBuffer*, 2019). The lifelines of a device are its neighbours on a hypercube, the numbers that
/// differ from its own in one digit of two. Here a thief sees all of them for nothing and takes from the one that has
/// most, so no first round of random thefts is needed, and nothing is sent in vain: what is lost to messages is not
/// held against this rival. It knows neither costs nor speeds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lifelines;

impl QueueMaker for Lifelines {
    fn name(&self) -> &'static str {
        "lifelines"
    }

    fn needs(&self) -> Needs {
        Needs::Lists
    }

    fn make(&self, dealt: Dealt<'_>) -> Box<dyn TaskQueue> {
        let lists = dealt.schedule.lists();
        Box::new(Lifeline(Mutex::new(State {
            lists: lists.iter().map(|list| list.iter().copied().collect()).collect(),
            holders: vec![Holder::Nobody; dealt.work.len()],
            retired: vec![false; lists.len()],
        })))
    }

    fn moves(&self, _: &Regime) -> bool {
        true
    }
}

/// Share of its list that a device launches, two of which are in flight, and that a thief takes of another's, without a
/// unit.
const LAUNCHED: usize = 6;
const STOLEN: usize = 2;

/// The queue of one stream.
#[derive(Debug)]
struct Lifeline(Mutex<State>);

#[derive(Debug)]
struct State {
    lists: Vec<VecDeque<TaskId>>,
    /// Of each task.
    holders: Vec<Holder>,
    retired: Vec<bool>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Holder {
    Nobody,
    Device(usize),
    Finished,
}

impl Lifeline {
    fn state(&self) -> MutexGuard<'_, State> {
        // Nothing below panics half way.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// Half of what the fullest list among `victims` has, from its end.
    fn steal(&mut self, victims: impl Iterator<Item = usize>) -> VecDeque<TaskId> {
        let victim = victims.filter(|&victim| !self.lists[victim].is_empty()).max_by_key(|&v| self.lists[v].len());
        victim.map_or_else(VecDeque::new, |victim| {
            let list = &mut self.lists[victim];
            list.split_off(list.len() - list.len().div_ceil(STOLEN))
        })
    }
}

impl TaskQueue for Lifeline {
    fn pop(&self, device: usize, out: &mut Vec<TaskId>) -> Pop {
        out.clear();
        let state = &mut *self.state();
        if state.retired.get(device) != Some(&false) {
            return Pop::Done;
        }
        let count = state.lists.len();
        if state.lists[device].is_empty() {
            let lifelines = (0..usize::BITS).map(|digit| device ^ (1 << digit));
            let stolen = state.steal(lifelines.filter(|&other| other < count));
            // Work comes along several lifelines in the end, which takes a step for each.
            state.lists[device] = if stolen.is_empty() { state.steal(0..count) } else { stolen };
        }
        let list = &mut state.lists[device];
        let launched = list.len().div_ceil(LAUNCHED);
        out.extend(list.drain(..launched));
        if out.is_empty() {
            let is_done = state.holders.iter().all(|holder| *holder == Holder::Finished);
            return if is_done { Pop::Done } else { Pop::Wait };
        }
        out.iter().for_each(|&task| state.holders[task as usize] = Holder::Device(device));
        Pop::Launch
    }

    fn finish(&self, device: usize, tasks: &[TaskId]) {
        let holders = &mut self.state().holders;
        for &task in tasks {
            if let Some(holder) = holders.get_mut(task as usize).filter(|holder| **holder == Holder::Device(device)) {
                *holder = Holder::Finished;
            }
        }
    }

    fn retire(&self, device: usize, unfinished: &[TaskId]) {
        let state = &mut *self.state();
        if let Some(retired) = state.retired.get_mut(device) {
            *retired = true;
            for &task in unfinished {
                let held = state.holders.get_mut(task as usize).filter(|holder| **holder == Holder::Device(device));
                if let Some(holder) = held {
                    *holder = Holder::Nobody;
                    // Others steal it from there.
                    state.lists[device].push_back(task);
                }
            }
        }
    }

    fn readmit(&self, device: usize) {
        if let Some(retired) = self.state().retired.get_mut(device) {
            *retired = false;
        }
    }

    fn unfinished_tasks(&self) -> Vec<TaskId> {
        let state = self.state();
        let open = |(_, holder): &(TaskId, &Holder)| **holder != Holder::Finished;
        (0..).zip(&state.holders).filter(open).map(|(task, _)| task).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_balance::catalogue::{POLICIES, find};
    use rt_core::{CostModel, Work};
    use rt_sched::bound;
    use rt_sched::simulate::Simulation;

    fn queue(tasks: usize, devices: usize) -> Box<dyn TaskQueue> {
        let (work, models) = (vec![Work::new(1.0, 1.0, 0.0); tasks], vec![CostModel::UNIT; devices]);
        let block = (find(POLICIES, "block").expect("the catalogue has it").make)();
        Lifelines.make(Dealt { schedule: &block.schedule(&work, &models), work: &work, devices: &models })
    }

    /// Mutants: launches of a third; a theft of all; a theft from the front; only lifelines that are stolen from, which
    /// leaves device 2 without work where 3 and 0 have none.
    #[test]
    fn a_sixth_is_launched_and_half_is_stolen() {
        let queue = queue(48, 4);
        let mut out = Vec::new();
        let mut popped = |device| (queue.pop(device, &mut out), out.clone()).1;
        assert_eq!(popped(0), [0, 1]);
        for _ in 0..9 {
            popped(3);
        }
        assert_eq!(popped(3), [18], "of half of what device 1 has a sixth");
        assert_eq!(popped(3), [19]);
    }

    /// Every task runs once, on the devices that are left, and stealing mends what blocks are off by.
    ///
    /// Mutants: `finish` of whoever says so; `retire` that forgets what was in flight.
    #[test]
    fn every_task_runs_once_and_devices_end_together() {
        let costs: Vec<f64> = (0..4096).map(|task| 1e-4 * (1.0 + f64::from(task % 64 + task / 64))).collect();
        let seconds = |_: usize, task: TaskId| costs[task as usize];
        for failures in [Vec::new(), vec![(1, 0.05), (4, 0.3)]] {
            let is_whole = failures.is_empty();
            let run = Simulation { failures, ..Simulation::default() }.run(&*queue(4096, 6), 6, &seconds);
            let ended = run.timeline.iter().filter(|launch| launch.finished);
            let mut tasks: Vec<TaskId> = ended.flat_map(|launch| launch.tasks.clone()).collect();
            tasks.sort_unstable();
            assert!(tasks.into_iter().eq(0..4096) && run.unfinished.is_empty());
            let excess = run.makespan_s / bound::related(&costs, &[1.0; 6]) - 1.0;
            assert!(!is_whole || (0.0..0.1).contains(&excess), "{excess}");
        }
    }
}
