//! The balancer: one scene, several devices, and what was learned about them.

use crate::estimate::{Estimated, estimate};
use crate::measure::{Times, learn_launches, learn_walks, measure};
use crate::member::{Member, Outputs, all_lost};
use crate::models::{Key, Models, blind_excess};
use crate::plan::plan_of;
use crate::report::StreamRun;
use crate::run::{Ran, run};
use crate::{BalanceError, Control, Scheduling, Stream, clock};
use rt_core::{
    CostEstimator, Device, DeviceInfo, Hit, Launch, LaunchRecord, Ray, RaySource, RayStream, Scene, StreamKind,
    StreamRecord, StreamSpec, TestCounts, Traffic,
};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// A scene on several devices, ready to trace streams of rays.
///
/// It learns while it works: the seconds each device needs per ray, box test and triangle test are fitted from its
/// launches, so later streams are scheduled by better models. A device that fails is dropped and its tasks go to the
/// others.
#[derive(Debug)]
pub struct Balancer {
    scene: Arc<Scene>,
    members: Vec<Member>,
    origin: Duration,
}

impl Balancer {
    /// Brings `scene` to every device. One that cannot take it is left out of every stream, and reports say why.
    ///
    /// # Errors
    /// When there is no device, or none of them can take the scene: then the first one's error.
    pub fn new(scene: Arc<Scene>, devices: &[Arc<dyn Device>]) -> Result<Self, BalanceError> {
        if devices.is_empty() {
            return Err(BalanceError::NoDevices);
        }
        let origin = clock::now();
        let mut refused = None;
        let mut open = |device: &Arc<dyn Device>| {
            let mut member = Member {
                info: device.info().clone(),
                tracer: None,
                models: Models::default(),
                failure: None,
                buffers: Launch::default(),
                before: Traffic::default(),
            };
            match device.tracer(Arc::clone(&scene), clock::now) {
                Ok(tracer) => member.tracer = Some(tracer),
                Err(source) => {
                    member.fail(&source);
                    refused.get_or_insert(BalanceError::Open { device: member.info.name.clone(), source });
                }
            }
            member
        };
        let members: Vec<Member> = devices.iter().map(&mut open).collect();
        match refused {
            Some(error) if members.iter().all(|member| member.tracer.is_none()) => Err(error),
            _ => Ok(Self { scene, members, origin }),
        }
    }

    /// Builds a tree over the caller's triangles with the default options and brings it to every device.
    ///
    /// A hit's `primitive` is a position in `indices`.
    ///
    /// # Errors
    /// When an index or a coordinate is invalid, there is no device, or none of them can take the scene.
    pub fn for_mesh(
        positions: &[[f32; 3]],
        indices: &[[u32; 3]],
        devices: &[Arc<dyn Device>],
    ) -> Result<Self, BalanceError> {
        let positions: Vec<glam::Vec3> = positions.iter().copied().map(glam::Vec3::from_array).collect();
        let mesh = rt_bvh::Mesh { positions: &positions, indices };
        let built = rt_bvh::build(mesh, &rt_bvh::BuildOptions::default())?;
        Self::new(built.scene, devices)
    }

    /// The scene.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Every device of the run, failed ones included, in the order they were given.
    pub fn devices(&self) -> impl Iterator<Item = &DeviceInfo> {
        self.members.iter().map(|member| &member.info)
    }

    pub(crate) fn members(&mut self) -> &mut [Member] {
        &mut self.members
    }

    /// Traces the caller's rays with the default scheduling: `hits[i]` is the nearest hit of `rays[i]`.
    ///
    /// # Errors
    /// As for [`Balancer::trace`].
    pub fn trace_rays(&mut self, rays: &[Ray], hits: &mut [Hit]) -> Result<StreamRun, BalanceError> {
        let source = RaySource::Explicit { rays: rays.into(), origins: None };
        let stream = Stream::new(source, StreamKind::Custom, StreamSpec::default());
        self.trace(&stream, &mut Scheduling::default(), hits, None, Control::default())
    }

    /// Estimates, schedules and traces one stream.
    ///
    /// `hits` has one entry for each ray; so has `counts`, which is filled when `stream.spec.counts` is set. Every
    /// ray is traced exactly once, on whatever device; entries of tasks that were not finished keep their values.
    ///
    /// # Errors
    /// When an argument is wrong, the caller cancelled, or every device failed. Hits of finished tasks are in the
    /// output even then.
    pub fn trace(
        &mut self,
        stream: &Stream,
        scheduling: &mut Scheduling,
        hits: &mut [Hit],
        counts: Option<&mut [TestCounts]>,
        control: Control<'_>,
    ) -> Result<StreamRun, BalanceError> {
        let rays = stream.source.len() as usize;
        check_length("hits", hits.len(), rays)?;
        if let Some(counts) = &counts {
            check_length("counts", counts.len(), rays)?;
        }
        stream.check()?;
        scheduling.policy()?;

        let setup = clock::now();
        self.prepare(stream, &*scheduling.estimator);
        let begin = clock::now();
        let outputs = Mutex::new(Outputs { hits, counts });
        self.members.iter_mut().for_each(Member::begin);
        self.load(stream)?;
        let loaded = clock::now();
        let expected = || blind_excess(&self.members, scheduling.queue, stream.tasks.len());
        let blind = scheduling.blind_excess.unwrap_or_else(expected);
        let estimated = estimate(&mut self.members, stream, &mut *scheduling.estimator, blind, &outputs)?;
        let key = Key::of(&*scheduling.estimator, stream.kind);
        learn_walks(&mut self.members, key, &estimated);
        let plan = plan_of(&self.members, stream, scheduling, &estimated)?;
        let planned = clock::now();
        let ran = run(&mut self.members, stream, &plan, &outputs, control, scheduling.limit)?;
        let end = clock::now();

        teach(&mut *scheduling.estimator, stream.view(plan.lanes.len(), estimated.blind_excess), &estimated, &ran);
        learn_launches(&mut self.members, key, &plan, &ran);
        let times = Times { origin: self.origin, setup, begin, loaded, planned, end };
        Ok(measure(&self.members, stream, scheduling, &estimated, &plan, &ran, times))
    }

    /// Has every living device do beforehand what a stream like this needs once.
    fn prepare(&mut self, stream: &Stream, estimator: &dyn CostEstimator) {
        let walk = estimator.walk();
        std::thread::scope(|scope| {
            for tracer in self.members.iter_mut().filter_map(|member| member.tracer.as_mut()) {
                scope.spawn(move || tracer.prepare(&stream.source, stream.spec, walk));
            }
        });
    }

    /// Gives the rays to every living device; one that cannot take them drops out.
    pub(crate) fn load(&mut self, stream: &Stream) -> Result<(), BalanceError> {
        let spec = stream.spec;
        std::thread::scope(|scope| {
            for member in &mut self.members {
                let source = stream.source.clone();
                scope.spawn(move || {
                    if let Some(tracer) = &mut member.tracer
                        && let Err(error) = tracer.load_rays(source, spec)
                    {
                        member.fail(&error);
                    }
                });
            }
        });
        if self.members.iter().any(|member| member.tracer.is_some()) {
            Ok(())
        } else {
            Err(all_lost(&self.members, stream.tasks.len()))
        }
    }
}

/// Tells the estimator what its stream took.
fn teach(estimator: &mut dyn CostEstimator, stream: RayStream<'_>, estimated: &Estimated, ran: &Ran) {
    for launch in &ran.launches {
        estimator.learn(&LaunchRecord {
            stream,
            work: &estimated.work,
            device: launch.member,
            outcomes: &launch.outcomes,
            per_task: launch.per_task,
        });
    }
    let kept = estimated.kept.as_ref().map_or(0, |mask| u64::from(mask.count()));
    let traced: u64 = ran.launches.iter().map(|launch| u64::from(launch.rays)).sum();
    let walk_s: f64 = estimated.walks.iter().map(|walk| walk.span.in_kernel.as_secs_f64()).sum();
    estimator.finish(&StreamRecord {
        stream,
        walked_rays: estimated.walked,
        walk_s,
        host_s: (estimated.seconds * f64::from(stream.devices) - walk_s).max(0.0),
        traced_rays: traced.saturating_sub(kept),
        trace_s: ran.launches.iter().map(|launch| launch.span.in_kernel.as_secs_f64()).sum(),
    });
}

fn check_length(argument: &'static str, found: usize, rays: usize) -> Result<(), BalanceError> {
    if found == rays { Ok(()) } else { Err(BalanceError::Length { argument, found, rays }) }
}
