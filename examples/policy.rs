//! A policy of one's own: two thirds of the tasks to the first device, whatever they cost.
//!
//! `cargo run --release -p rt-balance --example policy`

use rt_balance::cpu::CpuDevice;
use rt_balance::policies::Policy;
use rt_balance::{
    Balancer, Control, CostModel, Device, Hit, QueueKind, Ray, RaySource, Schedule, Scheduling, Stream, StreamKind,
    StreamSpec, TaskId, Work,
};
use std::io::{Write, stdout};
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
    let positions = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
    let devices: Vec<Arc<dyn Device>> =
        CpuDevice::open_all(&[1, 1])?.into_iter().map(|device| Arc::new(device) as _).collect();
    let mut balancer = Balancer::for_mesh(&positions, &[[0, 1, 2]], &devices)?;
    let rays = (0..300 * 1024).map(|i| Ray::new([i as f32 * 1e-5 - 1.5, 0.0, 1.0].into(), [0.0, 0.0, -1.0].into()));
    let source = RaySource::Explicit { rays: rays.collect(), origins: None };
    let stream = Stream::new(source, StreamKind::Custom, StreamSpec::default());
    let mut hits = vec![Hit::MISS; stream.source.len() as usize];
    // The static queue hands every device its list, and nothing else.
    let mut scheduling =
        Scheduling { policy: Some(Box::new(TwoThirds)), queue: Box::new(QueueKind::Static), ..Scheduling::default() };
    let run = balancer.trace(&stream, &mut scheduling, &mut hits, None, Control::default())?;
    for device in &run.report.devices {
        writeln!(stdout(), "{}: {} tasks", device.name, device.tasks)?;
    }
    assert_eq!(run.report.devices.iter().map(|device| device.tasks).collect::<Vec<_>>(), [200, 100]);
    Ok(())
}

#[cfg(test)]
#[test]
fn runs() -> Result<(), Box<dyn std::error::Error>> {
    main()
}
