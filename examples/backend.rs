//! A backend of one's own: brute force over all triangles, on the caller's thread. It implements `Device` and
//! `Tracer`, so a balancer mixes it with any other, and `Backend`, so that lists of devices name it: `brute,cpu:1`.
//! `tools/outsider` tests it with the suite of `rt-conformance`.
//!
//! `cargo run --release -p rt-balance --example backend`

use rt_balance::arguments::check_spec;
use rt_balance::devices::Opener;
use rt_balance::intersect::Shear;
use rt_balance::{
    Backend, Balancer, Capabilities, Clock, Device, DeviceError, DeviceErrorKind, DeviceInfo, Hit, Launch, Query, Ray,
    RayMask, RaySource, Scene, Span, StreamSpec, Task, TestCounts, Ticket, Tracer, Walk,
};
use std::collections::VecDeque;
use std::io::{Write, stdout};
use std::sync::Arc;
use std::time::Duration;

/// Launches that may be in flight.
const IN_FLIGHT: u32 = 2;

/// What it can do. Counts are its own, since there is no tree, and so there are no reduced walks either. Hits are the
/// defined ones.
fn capabilities() -> Capabilities {
    Capabilities::UNKNOWN.with_reduced_walks(&[]).with_defined_bits()
}

/// The device: here nothing but its description.
#[derive(Debug)]
pub struct BruteForce(DeviceInfo);

impl BruteForce {
    /// Opens it.
    #[must_use]
    pub fn open() -> Self {
        let info = DeviceInfo::new("brute force", "example").with_in_flight(IN_FLIGHT);
        Self(info.with_capabilities(capabilities()))
    }
}

impl Device for BruteForce {
    fn info(&self) -> &DeviceInfo {
        &self.0
    }

    fn tracer(&self, scene: Arc<Scene>, clock: Clock) -> Result<Box<dyn Tracer>, DeviceError> {
        let rays = RaySource::Explicit { rays: [].into(), origins: None };
        let spec = StreamSpec::default();
        Ok(Box::new(BruteTracer { scene, clock, rays, spec, launches: VecDeque::new(), next: 0 }))
    }
}

/// Its name in lists of devices.
#[derive(Debug)]
pub struct BruteForces;

impl Backend for BruteForces {
    fn name(&self) -> &str {
        "brute"
    }

    fn form(&self) -> &str {
        "brute"
    }

    fn check(&self, which: Option<&str>) -> Result<(), DeviceError> {
        which.map_or(Ok(()), |_| Err(wrong("there is but one: name it without a number")))
    }

    fn open(&self, which: Option<&str>) -> Result<Arc<dyn Device>, DeviceError> {
        self.check(which)?;
        Ok(Arc::new(BruteForce::open()))
    }
}

/// A scene on the device, and the rays that were loaded.
#[derive(Debug)]
struct BruteTracer {
    scene: Arc<Scene>,
    clock: Clock,
    rays: RaySource,
    spec: StreamSpec,
    launches: VecDeque<(Ticket, Launch)>,
    next: u64,
}

/// The call was wrong: the balancer keeps the device.
fn wrong(message: &str) -> DeviceError {
    DeviceError::new(DeviceErrorKind::InvalidArgument, message)
}

impl BruteTracer {
    /// The hit of a loaded ray, and how many triangles were tested for it. Boxes there are none.
    fn trace(&self, index: u32) -> (Hit, TestCounts) {
        let (ray, origin) = self.rays.ray(index);
        let mut counts = TestCounts::default();
        let mut nearest = Hit::MISS;
        if !ray.is_valid() {
            return (nearest, counts);
        }
        // The definition of a hit, in the coordinates in which a scene holds its triangles.
        let shear = Shear::new(&ray, self.scene.scale_exponent(), f64::INFINITY);
        for (slot, triangle) in self.scene.triangles().iter().enumerate() {
            let id = self.scene.primitives().get(slot);
            counts.triangles += 1;
            let hit = shear.hit(triangle, [ray.tmin, ray.tmax], id).filter(|_| id != origin);
            if let Some(hit) = hit.filter(|hit| hit.is_before(&nearest)) {
                nearest = hit;
                if self.spec.query == Query::Any {
                    break;
                }
            }
        }
        (nearest, counts)
    }

    fn span(&self, start: Duration) -> Span {
        let end = (self.clock)();
        Span { start, end, in_kernel: end.saturating_sub(start) }
    }
}

impl Tracer for BruteTracer {
    fn load_rays(&mut self, source: RaySource, spec: StreamSpec) -> Result<(), DeviceError> {
        if !self.launches.is_empty() {
            return Err(wrong("launches are in flight"));
        }
        if let RaySource::Explicit { rays, origins: Some(origins) } = &source
            && rays.len() != origins.len()
        {
            return Err(wrong("rays and origins differ in number"));
        }
        // Several hits of a ray, and masks, are more than it says it can.
        check_spec(&capabilities(), &self.scene, spec)?;
        (self.rays, self.spec) = (source, spec);
        Ok(())
    }

    fn walk(
        &mut self,
        rays: &[u32],
        walk: Walk,
        counts: &mut [TestCounts],
        mut hits: Option<&mut [Hit]>,
    ) -> Result<Span, DeviceError> {
        if walk != Walk::Full {
            return Err(DeviceError::new(DeviceErrorKind::Unsupported, "without a tree there are no reduced walks"));
        }
        if counts.len() != rays.len() || hits.as_ref().is_some_and(|hits| hits.len() != rays.len()) {
            return Err(wrong("rays, counts and hits differ in number"));
        }
        if rays.iter().any(|&ray| ray >= self.rays.len()) {
            return Err(wrong("a ray that is not loaded"));
        }
        let start = (self.clock)();
        for (i, &ray) in rays.iter().enumerate() {
            let (hit, count) = self.trace(ray);
            counts[i] = count;
            if let Some(hits) = &mut hits {
                hits[i] = hit;
            }
        }
        Ok(self.span(start))
    }

    fn submit(&mut self, tasks: &[Task], done: Option<&Arc<RayMask>>) -> Result<Ticket, DeviceError> {
        if self.launches.len() >= IN_FLIGHT as usize {
            return Err(wrong("too many launches are in flight"));
        }
        let end = |task: &Task| u64::from(task.first) + u64::from(task.rays);
        if tasks.iter().any(|task| end(task) > u64::from(self.rays.len())) {
            return Err(wrong("a task beyond the loaded rays"));
        }
        let start = (self.clock)();
        let mut launch = Launch::default();
        for ray in tasks.iter().flat_map(Task::range) {
            let known = done.is_some_and(|mask| mask.contains(ray));
            let (hit, counts) = if known { (Hit::MISS, TestCounts::default()) } else { self.trace(ray) };
            launch.hits.push(hit);
            if self.spec.counts {
                launch.counts.push(counts);
            }
        }
        launch.span = self.span(start);
        self.next += 1;
        self.launches.push_back((Ticket(self.next), launch));
        Ok(Ticket(self.next))
    }

    fn wait(&mut self, ticket: Ticket, _: Duration, out: &mut Launch) -> Result<(), DeviceError> {
        let position = self.launches.iter().position(|(t, _)| *t == ticket);
        let launch = position.and_then(|at| self.launches.remove(at));
        *out = launch.ok_or_else(|| wrong("no such launch"))?.1;
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let positions = [[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [0.0, 9.0, 0.0]];
    let mut opener = Opener::new().with_backends([Arc::new(BruteForces) as Arc<dyn Backend>]);
    let devices: Vec<Arc<dyn Device>> = opener.open("brute,cpu:1")?.into_iter().map(|opened| opened.device).collect();
    let mut balancer = Balancer::for_mesh(&positions, &[[0, 1, 2]], &devices)?;
    let rays = vec![Ray::new([2.5, 2.5, 0.5].into(), [0.0, 0.0, -1.0].into()); 50_000];
    let mut hits = vec![Hit::MISS; rays.len()];
    let run = balancer.trace_rays(&rays, &mut hits)?;
    for device in &run.report.devices {
        writeln!(stdout(), "{} ({}): {} rays", device.name, device.backend, device.rays)?;
    }
    assert!(hits.iter().all(|hit| hit.t == 0.5 && hit.primitive == 0));
    Ok(())
}

#[cfg(test)]
#[test]
fn runs() -> Result<(), Box<dyn std::error::Error>> {
    main()
}
