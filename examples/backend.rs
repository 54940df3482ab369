//! A backend of one's own: brute force over all triangles, on the caller's thread. It implements `Device` and
//! `Tracer`, so a balancer mixes it with any other; `rt-tests` holds the conformance suite to test it with.
//!
//! `cargo run --release -p rt-balance --example backend`

use rt_balance::cpu::CpuDevice;
use rt_balance::{
    Balancer, Clock, Device, DeviceError, DeviceErrorKind, DeviceInfo, Hit, Launch, Ray, RayMask, RaySource, Scene,
    Span, StreamSpec, Task, TestCounts, Ticket, Tracer, Walk, intersect,
};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

#[derive(Debug)]
struct BruteForce(DeviceInfo);

impl Device for BruteForce {
    fn info(&self) -> &DeviceInfo {
        &self.0
    }

    fn tracer(&self, scene: Arc<Scene>, clock: Clock) -> Result<Box<dyn Tracer>, DeviceError> {
        if scene.scale_exponent() != 0 {
            return Err(DeviceError::new(DeviceErrorKind::Unsupported, "this example takes scenes of size 0.5 to 1"));
        }
        Ok(Box::new(BruteTracer { scene, clock, rays: None, launches: VecDeque::new(), next: 0 }))
    }
}

#[derive(Debug)]
struct BruteTracer {
    scene: Arc<Scene>,
    clock: Clock,
    rays: Option<RaySource>,
    launches: VecDeque<(Ticket, Launch)>,
    next: u64,
}

impl BruteTracer {
    fn trace(&self, ray: u32) -> Result<(Hit, TestCounts), DeviceError> {
        let source = self.rays.as_ref().filter(|source| ray < source.len());
        let source = source.ok_or_else(|| DeviceError::new(DeviceErrorKind::InvalidArgument, "no such ray"))?;
        let (ray, origin) = source.ray(ray);
        let triangles = self.scene.triangles();
        let mut nearest = Hit::MISS;
        for (slot, triangle) in triangles.iter().enumerate() {
            let id = self.scene.primitives().get(slot);
            if let Some(hit) = intersect::hit(&ray, triangle, id).filter(|hit| id != origin && hit.is_before(&nearest))
            {
                nearest = hit;
            }
        }
        Ok((nearest, TestCounts { boxes: 0, triangles: triangles.len() as u32 }))
    }
}

impl Tracer for BruteTracer {
    fn load_rays(&mut self, source: RaySource, _: StreamSpec) -> Result<(), DeviceError> {
        self.rays = Some(source);
        Ok(())
    }

    fn walk(
        &mut self,
        rays: &[u32],
        _: Walk,
        counts: &mut [TestCounts],
        mut hits: Option<&mut [Hit]>,
    ) -> Result<Span, DeviceError> {
        let start = (self.clock)();
        for (i, &ray) in rays.iter().enumerate() {
            let (hit, count) = self.trace(ray)?;
            counts[i] = count;
            if let Some(hits) = &mut hits {
                hits[i] = hit;
            }
        }
        let end = (self.clock)();
        Ok(Span { start, end, in_kernel: end - start })
    }

    fn submit(&mut self, tasks: &[Task], done: Option<&Arc<RayMask>>) -> Result<Ticket, DeviceError> {
        let mut launch = Launch::default();
        launch.span.start = (self.clock)();
        for ray in tasks.iter().flat_map(Task::range) {
            let known = done.is_some_and(|mask| mask.contains(ray));
            launch.hits.push(if known { Hit::MISS } else { self.trace(ray)?.0 });
        }
        launch.span.end = (self.clock)();
        launch.span.in_kernel = launch.span.duration();
        self.next += 1;
        self.launches.push_back((Ticket(self.next), launch));
        Ok(Ticket(self.next))
    }

    fn wait(&mut self, ticket: Ticket, _: Duration, out: &mut Launch) -> Result<(), DeviceError> {
        let position = self.launches.iter().position(|(t, _)| *t == ticket);
        let launch = position.and_then(|at| self.launches.remove(at));
        let unknown = || DeviceError::new(DeviceErrorKind::InvalidArgument, "no such launch");
        *out = launch.ok_or_else(unknown)?.1;
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let positions = [[0.0, 0.0, 0.0], [0.9, 0.0, 0.0], [0.0, 0.9, 0.0]];
    let info = DeviceInfo::new("brute force", "example");
    let mut devices: Vec<Arc<dyn Device>> = vec![Arc::new(BruteForce(info))];
    devices.extend(CpuDevice::open_all(&[1])?.into_iter().map(|device| Arc::new(device) as Arc<dyn Device>));
    let mut balancer = Balancer::for_mesh(&positions, &[[0, 1, 2]], &devices)?;
    let rays = vec![Ray::new([0.25, 0.25, 0.5].into(), [0.0, 0.0, -1.0].into()); 50_000];
    let mut hits = vec![Hit::MISS; rays.len()];
    let run = balancer.trace_rays(&rays, &mut hits)?;
    for device in &run.report.devices {
        println!("{} ({}): {} rays", device.name, device.backend, device.rays);
    }
    assert!(hits.iter().all(|hit| hit.t == 0.5 && hit.primitive == 0));
    Ok(())
}

#[cfg(test)]
#[test]
fn runs() -> Result<(), Box<dyn std::error::Error>> {
    main()
}
