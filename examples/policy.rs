//! A policy of one's own: two thirds of the tasks to the first device, whatever they cost. Simulated, not traced.
//!
//! `cargo run --release -p rt-balance --example policy`

use rt_core::{CostModel, TaskId, Work};
use rt_sched::Schedule;
use rt_sched::policy::{Lpt, Policy};

/// The first device gets tasks 0, 1, 3, 4, 6, 7, …
#[derive(Debug)]
struct TwoThirds;

impl Policy for TwoThirds {
    fn name(&self) -> &'static str {
        "two thirds"
    }

    fn schedule(&self, work: &[Work], devices: &[CostModel]) -> Schedule {
        let mut lists = vec![Vec::new(); devices.len()];
        for task in 0..work.len() as TaskId {
            let device = usize::from(task % 3 == 2).min(devices.len().saturating_sub(1));
            if let Some(list) = lists.get_mut(device) {
                list.push(task);
            }
        }
        Schedule::new(lists, work, devices).expect("every task went to one list")
    }
}

fn main() {
    let work: Vec<Work> = (0..300_u16).map(|i| Work::new(1024.0, f32::from(i % 17) * 1e4, 1e4)).collect();
    let devices = [CostModel::UNIT; 2];
    for policy in [&TwoThirds as &dyn Policy, &Lpt] {
        let schedule = policy.schedule(&work, &devices);
        println!("{:10} predicted makespan {:.2} ms", policy.name(), schedule.makespan() * 1e3);
    }
}

#[cfg(test)]
#[test]
fn runs() {
    main();
}
