//! A policy of one's own: two thirds of the tasks to the first device, whatever they cost: first what it
//! would take, then in a balancer.
//!
//! `cargo run --release -p rt-balance --example policy`

use rt_balance::cpu::CpuDevice;
use rt_balance::policies::{Lpt, Policy};
use rt_balance::{Balancer, Control, CostModel, Device, Hit, QueueKind, Ray, RaySource, Schedule, Scheduling, Stream};
use rt_balance::{StreamKind, StreamSpec, TaskId, Work};
use std::sync::Arc;

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

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let work: Vec<Work> = (0..300_u16).map(|i| Work::new(1024.0, f32::from(i % 17) * 1e4, 1e4)).collect();
    let models = [CostModel::UNIT; 2];
    for policy in [&TwoThirds as &dyn Policy, &Lpt] {
        let schedule = policy.schedule(&work, &models);
        println!("{:10} predicted makespan {:.2} ms", policy.name(), schedule.makespan() * 1e3);
    }

    let devices: Vec<Arc<dyn Device>> =
        CpuDevice::open_all(&[1, 1])?.into_iter().map(|device| Arc::new(device) as _).collect();
    let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mut balancer = Balancer::for_mesh(&positions, &[[0, 1, 2]], &devices)?;
    let rays = vec![Ray::new([0.2, 0.2, 1.0].into(), [0.0, 0.0, -1.0].into()); 90 * 1024];
    let mut hits = vec![Hit::MISS; rays.len()];
    let source = RaySource::Explicit { rays: rays.into(), origins: None };
    let stream = Stream::new(source, StreamKind::Custom, StreamSpec::default());
    let policy: Option<Box<dyn Policy>> = Some(Box::new(TwoThirds));
    let mut scheduling = Scheduling { policy, queue: Box::new(QueueKind::Static), ..Scheduling::default() };
    let run = balancer.trace(&stream, &mut scheduling, &mut hits, None, Control::default())?;
    for device in &run.report.devices {
        println!("{}: {} tasks", device.name, device.tasks);
    }
    assert!(hits.iter().all(|hit| hit.primitive == 0));
    Ok(())
}

#[cfg(test)]
#[test]
fn runs() -> Result<(), Box<dyn std::error::Error>> {
    main()
}
