//! A cost estimator of one's own: it samples one ray in the middle of every task, and believes it.
//!
//! `cargo run --release -p rt-balance --example estimator`

use rt_balance::cpu::CpuDevice;
use rt_balance::{Balancer, Control, CostEstimator, Device, Hit, Ray, RaySource, Scheduling, Stream, StreamKind};
use rt_balance::{Observation, RayStream, Step, StreamSpec, Walk, Work};
use std::io::{Write, stdout};
use std::sync::Arc;

/// One ray per task, walked in full, so its hit is kept.
#[derive(Debug)]
struct MiddleRay;

impl CostEstimator for MiddleRay {
    fn name(&self) -> &'static str {
        "middle ray"
    }

    fn next(&mut self, stream: RayStream<'_>, seen: Observation<'_>) -> Step {
        if seen.counts.is_empty() {
            let middle = |task: &rt_balance::Task| task.first + task.rays / 2;
            return Step::Sample { rays: stream.tasks.iter().map(middle).collect(), walk: Walk::Full };
        }
        let work = stream.tasks.iter().zip(seen.counts).map(|(task, counts)| {
            let rays = task.rays as f32;
            Work::new(rays, rays * counts.boxes as f32, rays * counts.triangles as f32)
        });
        Step::Done(work.collect())
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let positions = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
    let devices: Vec<Arc<dyn Device>> =
        CpuDevice::open_all(&[1, 1])?.into_iter().map(|device| Arc::new(device) as _).collect();
    let mut balancer = Balancer::for_mesh(&positions, &[[0, 1, 2]], &devices)?;
    let rays = (0..100_000).map(|i| Ray::new([i as f32 * 4e-5 - 2.0, 0.0, 1.0].into(), [0.0, 0.0, -1.0].into()));
    let source = RaySource::Explicit { rays: rays.collect(), origins: None };
    let stream = Stream::new(source, StreamKind::Custom, StreamSpec::default());
    let mut hits = vec![Hit::MISS; 100_000];
    let mut scheduling = Scheduling { estimator: Box::new(MiddleRay), ..Scheduling::default() };
    let run = balancer.trace(&stream, &mut scheduling, &mut hits, None, Control::default())?;
    writeln!(
        stdout(),
        "{} sampled {:.2}% of the rays; traced in {:.1} ms",
        run.report.estimate.estimator,
        100.0 * run.report.estimate.fraction,
        1e3 * run.report.makespan_s
    )?;
    assert_eq!(run.work.len(), run.tasks.len());
    Ok(())
}

#[cfg(test)]
#[test]
fn runs() -> Result<(), Box<dyn std::error::Error>> {
    main()
}
