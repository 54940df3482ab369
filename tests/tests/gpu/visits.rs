//! Kernels count for themselves how often they visit each ray: once each that was asked for, and no other.

use crate::{Backend, Found, LIMIT};
use libtest_mimic::{Failed, Trial};
use rt_balance::estimators::{Sampled, Uniform};
use rt_balance::{Balancer, Control, CostEstimator, Limits, QueueKind, Scheduling, Stream};
use rt_bvh::Builder;
use rt_core::{
    Clock, Device, DeviceError, DeviceInfo, Hit, Launch, Ray, RayMask, RaySource, ReducedWalk, Scene, Span, StreamKind,
    StreamSpec, Task, TestCounts, Ticket, Tracer, Walk,
};
use rt_gpu::{FaultInjection, GpuDevice, Tuning};
use rt_sched::sample::Fraction;
use rt_verify::clock;
use rt_verify::rays::RayMaker;
use rt_verify::{shapes, tree};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Rays of a stream.
const RAYS: u32 = 6_000;

/// The walk that brings visits back from devices opened with [`FaultInjection::CountVisits`].
const TELLING: Walk = Walk::Reduced(ReducedWalk::LeafAsHit);

/// The tests of a backend, given its devices.
pub(crate) fn trials(backend: Backend, devices: &[Found]) -> Vec<Trial> {
    let Some(first) = devices.first() else { return Vec::new() };
    vec![
        first.trial("kernels_visit_each_ray_that_is_asked_for_once", kernels_visit_each_ray_that_is_asked_for_once),
        first.trial("all_devices_together_visit_each_ray_once", move |_| each_ray_once_over_all_devices(backend)),
    ]
}

/// Rays and the primitives they start on.
type Rays = Vec<(Ray, u32)>;

fn scene_and_rays() -> Result<(Arc<Scene>, Rays), Failed> {
    let triangles = shapes::grid(40, 0.2, 1);
    Ok((tree::build(&triangles, Builder::Sah)?, RayMaker::new(&triangles, 9).mixed(RAYS)))
}

fn source_of(rays: &[(Ray, u32)]) -> RaySource {
    let (rays, origins): (Vec<Ray>, Vec<u32>) = rays.iter().copied().unzip();
    RaySource::Explicit { rays: rays.into(), origins: Some(origins.into()) }
}

/// How often each ray was visited since it was loaded.
fn visits(tracer: &mut dyn Tracer, rays: u32) -> Result<Vec<u32>, DeviceError> {
    let mut counts = vec![TestCounts::default(); rays as usize];
    tracer.walk(&(0..rays).collect::<Vec<_>>(), TELLING, &mut counts, None)?;
    Ok(counts.iter().map(|counts| counts.boxes).collect())
}

fn check(visits: &[u32], asked: impl Fn(u32) -> u32) -> Result<(), String> {
    match (0..).zip(visits).find(|&(ray, &visits)| visits != asked(ray)) {
        Some((ray, visits)) => Err(format!("ray {ray} was visited {visits} times, not {}", asked(ray))),
        None => Ok(()),
    }
}

/// Some tasks in three launches, two of them in flight at once, with rays left out: in one window and in several, a
/// lane for each ray and persistent ones, with and without counts. What must be seen, is: a task submitted twice, and
/// rays that should have been left out.
fn kernels_visit_each_ray_that_is_asked_for_once(found: &Found) -> Result<(), Failed> {
    let (scene, rays) = scene_and_rays()?;
    let tasks = [(100, 900), (1_000, 64), (3_000, 1), (2_000, 700), (4_000, 1_500)];
    let tasks = tasks.map(|(first, rays)| Task { first, rays });
    let mut mask = RayMask::new(RAYS);
    (0..RAYS).filter(|ray| ray % 7 == 3 || (4_200..4_700).contains(ray)).for_each(|ray| mask.insert(ray));
    let mask = Arc::new(mask);
    let in_tasks = |ray: u32| tasks.iter().any(|task| task.range().contains(&ray));
    let asked = |ray: u32| u32::from(in_tasks(ray) && !mask.contains(ray));
    let split = Tuning { window: Some(700), persistent_lanes: Some(64), ..Tuning::default() };
    for (tuning, counts) in [(Tuning::default(), false), (split, false), (Tuning::default(), true), (split, true)] {
        let device = found.backend.enumerate_with(Some(FaultInjection::CountVisits), tuning)?;
        let device = device.into_iter().nth(found.position).ok_or("the device is gone")??;
        let mut tracer = device.tracer(Arc::clone(&scene), clock)?;
        let spec = StreamSpec { counts, ..StreamSpec::default() };
        tracer.load_rays(source_of(&rays), spec)?;
        // Kernels that only get ready visit nothing.
        tracer.prepare(&source_of(&rays), spec, Some(Walk::Full));
        check(&visits(&mut *tracer, RAYS)?, |_| 0)?;

        let (expected, _) = tree::trace(&scene, spec, &rays);
        let mut launch = Launch::default();
        let tickets = [tracer.submit(&tasks[..2], Some(&mask))?, tracer.submit(&tasks[2..4], Some(&mask))?];
        tracer.wait(tickets[0], LIMIT, &mut launch)?;
        let last = tracer.submit(&tasks[4..], Some(&mask))?;
        tracer.wait(tickets[1], LIMIT, &mut launch)?;
        tracer.wait(last, LIMIT, &mut launch)?;
        let hit = |ray: u32| if mask.contains(ray) { Hit::MISS } else { expected[ray as usize] };
        if !launch.hits.iter().copied().eq(tasks[4].range().map(hit)) {
            return Err("kernels that count visits find other hits".into());
        }
        check(&visits(&mut *tracer, RAYS)?, asked)?;

        // A walk visits its rays.
        let mut walked = [TestCounts::default(); 5];
        tracer.walk(&[5, 50, 500, 5_000, 500], Walk::Full, &mut walked, None)?;
        let again = |ray: u32| [5, 50, 500, 5_000, 500].iter().filter(|&&walked| walked == ray).count() as u32;
        check(&visits(&mut *tracer, RAYS)?, |ray| asked(ray) + again(ray))?;

        // What would go wrong if the host did, is seen.
        tracer.load_rays(source_of(&rays), spec)?;
        check(&visits(&mut *tracer, RAYS)?, |_| 0)?;
        for (wrong, done) in [(&tasks[..], None), (&tasks[1..2], Some(&mask))] {
            let ticket = tracer.submit(wrong, done)?;
            tracer.wait(ticket, LIMIT, &mut launch)?;
            if check(&visits(&mut *tracer, RAYS)?, asked).is_ok() {
                return Err(format!("{wrong:?} once more, or with all rays, was not seen").into());
            }
        }
    }
    Ok(())
}

/// Whole runs over all devices of a backend. Fails when rays kept from the estimate are traced again, or a task is
/// given to two devices.
fn each_ray_once_over_all_devices(backend: Backend) -> Result<(), Failed> {
    let (scene, rays) = scene_and_rays()?;
    let eighth = Fraction::new(0.125).ok_or("a fraction")?;
    let opened: Vec<_> =
        backend.enumerate_with(Some(FaultInjection::CountVisits), Tuning::default())?.into_iter().flatten().collect();
    for queue in [QueueKind::Static, QueueKind::Central, QueueKind::Hybrid] {
        let estimators: [Box<dyn CostEstimator>; 2] = [Box::new(Uniform), Box::new(Sampled::new(Walk::Full, eighth))];
        for estimator in estimators {
            let seen = Arc::new(Mutex::new(vec![0; RAYS as usize]));
            let watched = |device: &Arc<dyn GpuDevice>| -> Arc<dyn Device> {
                Arc::new(Watched { inner: Arc::clone(device), seen: Arc::clone(&seen) })
            };
            let devices: Vec<_> = opened.iter().map(watched).collect();
            let mut balancer = Balancer::new(Arc::clone(&scene), &devices)?;
            let stream = Stream::new(source_of(&rays), StreamKind::Custom, StreamSpec::default()).with_task_size(128);
            let limits = Limits { late: LIMIT, lost: LIMIT, ..Limits::default() };
            let mut how = Scheduling { estimator, queue: Box::new(queue), limits, ..Scheduling::default() };
            let mut hits = vec![Hit::MISS; rays.len()];
            balancer.trace(&stream, &mut how, &mut hits, None, Control::default())?;
            drop(balancer);
            let seen = seen.lock().unwrap_or_else(PoisonError::into_inner);
            check(&seen, |_| 1).map_err(|e| format!("{queue:?}, {}: {e}", how.estimator.name()))?;
        }
    }
    Ok(())
}

/// A device whose tracers tell how often they visited each ray when they are dropped.
#[derive(Debug)]
struct Watched {
    inner: Arc<dyn GpuDevice>,
    seen: Arc<Mutex<Vec<u32>>>,
}

#[derive(Debug)]
struct WatchedTracer {
    inner: Box<dyn Tracer>,
    rays: u32,
    seen: Arc<Mutex<Vec<u32>>>,
}

impl Device for Watched {
    fn info(&self) -> &DeviceInfo {
        self.inner.info()
    }

    fn tracer(&self, scene: Arc<Scene>, clock: Clock) -> Result<Box<dyn Tracer>, DeviceError> {
        let inner = self.inner.tracer(scene, clock)?;
        Ok(Box::new(WatchedTracer { inner, rays: 0, seen: Arc::clone(&self.seen) }))
    }
}

impl Tracer for WatchedTracer {
    fn load_rays(&mut self, source: RaySource, spec: StreamSpec) -> Result<(), DeviceError> {
        self.rays = source.len();
        self.inner.load_rays(source, spec)
    }

    fn walk(
        &mut self,
        rays: &[u32],
        walk: Walk,
        counts: &mut [TestCounts],
        hits: Option<&mut [Hit]>,
    ) -> Result<Span, DeviceError> {
        self.inner.walk(rays, walk, counts, hits)
    }

    fn submit(&mut self, tasks: &[Task], done: Option<&Arc<RayMask>>) -> Result<Ticket, DeviceError> {
        self.inner.submit(tasks, done)
    }

    fn wait(&mut self, ticket: Ticket, limit: Duration, out: &mut Launch) -> Result<(), DeviceError> {
        self.inner.wait(ticket, limit, out)
    }
}

impl Drop for WatchedTracer {
    fn drop(&mut self) {
        // A device that fails here leaves rays unseen, which the test tells.
        if let Ok(visits) = visits(&mut *self.inner, self.rays) {
            let mut seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
            seen.iter_mut().zip(visits).for_each(|(seen, visits)| *seen += visits);
        }
    }
}
