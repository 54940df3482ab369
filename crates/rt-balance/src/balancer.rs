//! The balancer: one scene, several devices, and what was learned about them.

use crate::device_state::{DeviceState, all_lost, ask_all, dismiss, settle};
use crate::device_thread::Call;
use crate::estimate::{Estimate, Estimated, estimate};
use crate::measure::{Times, learn_launches, learn_walks, measure};
use crate::models::{Key, regime};
use crate::output::Output;
use crate::plan::plan_of;
use crate::report::StreamRun;
use crate::run::{Ran, run};
use crate::{Audit, BalanceError, Control, Limits, Scheduling, Stream, clock};
use rt_bvh::{BuildOptions, Mesh};
use rt_core::arguments::check_spec;
use rt_core::{
    CostEstimator, Counted, CountedTree, Device, DeviceInfo, Hit, LaunchRecord, Ray, RaySource, RayStream, Scene,
    StreamKind, StreamRecord, StreamSpec, TestCounts,
};
use rt_sched::cut::finer;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::time::Duration;

/// A scene on several devices, ready to trace streams of rays.
///
/// It learns while it works: the seconds each device needs per ray, box test and triangle test are fitted from its
/// launches, so later streams are scheduled by better models.
///
/// A device that fails is dropped and its tasks go to the others: whether it says so, panics, does not answer within
/// the [`Limits`], or answers what is not true ([`Audit`](crate::Audit)). Each device has a thread of its own as long
/// as the balancer lives. One that does not answer is left behind with what it holds: threads cannot be killed.
///
/// The calling thread's floating-point environment (rounding, subnormal numbers) changes no bit of a hit; the caller's
/// own code that is called meanwhile finds the default one.
///
/// One stream is traced at a time: `&mut self` says so. A second thread that wants to trace has a balancer of its own,
/// on other devices or the same, or waits behind the caller's own lock.
#[derive(Debug)]
pub struct Balancer {
    pub(crate) scene: Arc<Scene>,
    pub(crate) members: Vec<DeviceState>,
    /// One for each member.
    pub(crate) opened: Vec<Arc<dyn Device>>,
    /// What a ray was expected to cost in the tree that was built; `None` until it is asked for.
    pub(crate) built_cost: Option<f32>,
    /// Of [`Balancer::update`].
    pub(crate) building: BuildOptions,
    origin: Duration,
    /// Of [`Balancer::trace_rays`].
    scheduling: Scheduling,
}

impl Balancer {
    /// Brings `scene` to every device. One that cannot take it is left out of every stream, and reports say why.
    ///
    /// # Errors
    /// When there is no device, none of them can take the scene (then the first one's error), or the system cannot
    /// start a thread for each.
    pub fn new(scene: Arc<Scene>, devices: &[Arc<dyn Device>]) -> Result<Self, BalanceError> {
        Self::open(scene, devices, &Limits::default(), Control::default())
    }

    /// [`Balancer::new`] for devices that may take so long, and for a caller who may cancel. A device that is not ready
    /// in time joins later.
    ///
    /// # Errors
    /// As for [`Balancer::new`], and when the caller cancels.
    pub fn open(
        scene: Arc<Scene>,
        devices: &[Arc<dyn Device>],
        limits: &Limits,
        control: Control<'_>,
    ) -> Result<Self, BalanceError> {
        if devices.is_empty() {
            return Err(BalanceError::NoDevices);
        }
        let (members, scheduling) = (Vec::with_capacity(devices.len()), Scheduling::default());
        let opened = devices.to_vec();
        let (building, origin) = (BuildOptions::default(), clock::now());
        let mut balancer = Self { scene, members, opened, built_cost: None, building, origin, scheduling };
        for (index, device) in devices.iter().enumerate() {
            let member = DeviceState::open(index, device, &balancer.scene);
            balancer
                .members
                .push(member.map_err(|source| BalanceError::Thread { device: format!("device {index}"), source })?);
        }
        settle(&mut balancer.members, limits, control)?;
        if balancer.members.iter().any(DeviceState::is_alive) {
            return Ok(balancer);
        }
        // None is alive, so each has failed.
        let failed = std::mem::take(&mut balancer.members).into_iter();
        let first = failed.filter_map(|member| Some((member.info.name.clone(), member.into_error()?))).next();
        Err(first.map_or(BalanceError::NoDevices, |(device, source)| BalanceError::Open { device, source }))
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
        let built = rt_bvh::build(rt_bvh::Mesh::of_arrays(positions, indices), &BuildOptions::default())?;
        Self::new(built.scene, devices)
    }

    /// The same of several meshes: [`Scene::geometry_of`] tells mesh and triangle of a hit's `primitive`.
    ///
    /// # Errors
    /// As for [`Balancer::for_mesh`].
    pub fn for_meshes(meshes: &[Mesh<'_>], devices: &[Arc<dyn Device>]) -> Result<Self, BalanceError> {
        Self::new(rt_bvh::build_meshes(meshes, &BuildOptions::default())?.scene, devices)
    }

    /// The scene.
    #[must_use]
    pub const fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// Every device of the run, failed ones included, in the order they were given.
    pub fn devices(&self) -> impl Iterator<Item = &DeviceInfo> {
        self.members.iter().map(|member| &member.info)
    }

    /// Traces the caller's rays as [`Balancer::scheduling`] says: `hits[i]` is the nearest hit of `rays[i]`. What its
    /// estimator learns serves later calls.
    ///
    /// # Errors
    /// As for [`Balancer::trace`].
    pub fn trace_rays(&mut self, rays: &[Ray], hits: &mut [Hit]) -> Result<StreamRun, BalanceError> {
        self.trace_shared(rays.into(), hits)
    }

    /// [`Balancer::trace_rays`] without a copy of the rays (graphics cards get theirs in any case). They are shared,
    /// not borrowed, since devices that were given up may still read them when this returns.
    ///
    /// # Errors
    /// As for [`Balancer::trace`].
    pub fn trace_shared(&mut self, rays: Arc<[Ray]>, hits: &mut [Hit]) -> Result<StreamRun, BalanceError> {
        let source = RaySource::Explicit { rays, origins: None };
        let stream = Stream::new(source, StreamKind::Custom, StreamSpec::default()).with_tasks_for(self.members.len());
        let mut scheduling = std::mem::take(&mut self.scheduling);
        let run = self.trace(&stream, &mut scheduling, hits, None, Control::default());
        self.scheduling = scheduling;
        run
    }

    /// How [`Balancer::trace_rays`] schedules; the default at first.
    pub const fn scheduling(&mut self) -> &mut Scheduling {
        &mut self.scheduling
    }

    /// Estimates what a stream's tasks will cost, and traces none of them: for a scheduler of the caller's own.
    ///
    /// The estimator learns nothing from it; the balancer learns what the walks of sampled rays took.
    ///
    /// # Errors
    /// As for [`Balancer::trace`].
    ///
    /// # Panics
    /// Where the caller's own estimator does, as [`Balancer::trace`].
    pub fn estimate(
        &mut self,
        stream: &Stream,
        scheduling: &mut Scheduling,
        control: Control<'_>,
    ) -> Result<Estimate, BalanceError> {
        stream.check()?;
        scheduling.check()?;
        // Hits of sampled rays have no place to go.
        let mut output = Output { hits: &mut [], per_ray: 1, counts: None };
        self.guarded(scheduling.limits, control, |balancer| {
            let Begun { estimated, .. } = balancer.begin(stream, scheduling, &mut output, control)?;
            let plan = plan_of(&balancer.members, stream, scheduling, &estimated)?;
            let seconds = |worker| (0..).take(stream.tasks.len()).map(|task| plan.seconds(worker, task)).collect();
            let mut predicted_s = vec![None; balancer.members.len()];
            for (worker, &member) in plan.workers.iter().enumerate() {
                predicted_s[member] = Some(seconds(worker));
            }
            let rays = f64::from(stream.source.len().max(1));
            let (fraction, seconds) = (estimated.walked as f64 / rays, estimated.seconds);
            Ok(Estimate { work: estimated.work, predicted_s, fraction, seconds })
        })
    }

    /// Estimates, schedules and traces one stream.
    ///
    /// `hits` has [`Query::hits_per_ray`](rt_core::Query::hits_per_ray) entries for each ray: one, unless the stream
    /// asks for several. `counts` has one, which is filled when `stream.spec.counts` is set. Every ray is traced
    /// exactly once, on whatever device, unless a device fails or is late; entries of tasks that were not finished keep
    /// their values.
    ///
    /// # Errors
    /// When an argument is wrong, or what the caller's estimator, policy or queue says: that costs no device. When the
    /// caller cancelled, or every device failed. Hits of finished tasks are in the output even then.
    ///
    /// # Panics
    /// Where the caller's own code does: estimator, policy, queue or progress callback. The devices come to rest first,
    /// and are as good as before.
    pub fn trace(
        &mut self,
        stream: &Stream,
        scheduling: &mut Scheduling,
        hits: &mut [Hit],
        counts: Option<&mut [TestCounts]>,
        control: Control<'_>,
    ) -> Result<StreamRun, BalanceError> {
        let rays = stream.source.len() as usize;
        let per_ray = stream.spec.query.hits_per_ray();
        if per_ray > 1 && rays.checked_mul(per_ray) != Some(hits.len()) {
            return Err(BalanceError::Hits { found: hits.len(), rays, most: per_ray });
        }
        check_length("hits", hits.len() / per_ray, rays)?;
        if let Some(counts) = &counts {
            check_length("counts", counts.len(), rays)?;
        }
        stream.check()?;
        scheduling.check()?;
        let mut output = Output { hits, per_ray, counts: counts.filter(|_| stream.spec.counts) };
        let alive = self.members.iter().filter(|member| member.is_alive()).count();
        let finer = if scheduling.queue.cuts() { finer(&stream.tasks, alive) } else { None };
        let cut = finer.map(|tasks| Stream { tasks, ..stream.clone() });
        let stream = cut.as_ref().unwrap_or(stream);
        self.guarded(scheduling.limits, control, |balancer| {
            balancer.trace_into(stream, scheduling, &mut output, control)
        })
    }

    /// Does what needs devices, again as long as some that were late come back; a panic is passed on when they are at
    /// rest.
    fn guarded<T>(
        &mut self,
        limits: Limits,
        control: Control<'_>,
        mut work: impl FnMut(&mut Self) -> Result<T, BalanceError>,
    ) -> Result<T, BalanceError> {
        let _environment = rt_fenv::Environment::enter();
        // Nothing of this is left half done by a panic but what devices are at.
        let done = catch_unwind(AssertUnwindSafe(|| {
            loop {
                match work(self) {
                    // All that began have failed, but some were late. Each time round at least one device fewer is
                    // alive.
                    Err(BalanceError::AllDevicesLost { .. }) if self.members.iter().any(DeviceState::may_come) => {}
                    done => return done,
                }
            }
        }));
        done.unwrap_or_else(|panic| {
            // The panic is what the caller wants to know.
            let _ = settle(&mut self.members, &limits, Control { progress: None, finished: None, ..control });
            resume_unwind(panic)
        })
    }

    fn trace_into(
        &mut self,
        stream: &Stream,
        scheduling: &mut Scheduling,
        output: &mut Output<'_>,
        control: Control<'_>,
    ) -> Result<StreamRun, BalanceError> {
        let Begun { estimated, key, setup, begin, loaded } = self.begin(stream, scheduling, output, control)?;
        let limits = scheduling.limits;
        let plan = plan_of(&self.members, stream, scheduling, &estimated)?;
        let planned = clock::now();
        let ran = run(&mut self.members, stream, &plan, &estimated.finders, output, &limits, control)?;
        let end = clock::now();

        teach(
            &mut *scheduling.estimator,
            stream.view(plan.workers.len(), estimated.uninformed_excess, estimated.moves),
            &estimated,
            &ran,
        );
        learn_launches(&mut self.members, key, &plan, &ran);
        let times = Times { origin: self.origin, setup, begin, loaded, planned, end };
        Ok(measure(&self.members, stream, scheduling, &estimated, &plan, &ran, times))
    }

    /// Gives the rays to the devices, and estimates what they will cost.
    fn begin(
        &mut self,
        stream: &Stream,
        scheduling: &mut Scheduling,
        output: &mut Output<'_>,
        control: Control<'_>,
    ) -> Result<Begun, BalanceError> {
        let (limits, tasks) = (scheduling.limits, stream.tasks.len());
        let setup = clock::now();
        self.members.iter_mut().for_each(DeviceState::begin);
        let untouched = |error: BalanceError| error.with_unfinished(tasks);
        settle(&mut self.members, &limits, control).map_err(untouched)?;
        self.prepare(stream, &*scheduling.estimator, &limits, control).map_err(untouched)?;
        let begin = clock::now();
        self.load(stream, &limits, scheduling.audit, control).map_err(untouched)?;
        let loaded = clock::now();
        let regime = regime(&self.members, stream);
        let expected = || scheduling.queue.uninformed_excess(&regime);
        let uninformed = (scheduling.uninformed_excess.unwrap_or_else(expected), scheduling.queue.moves(&regime));
        let estimator = &mut *scheduling.estimator;
        let estimated = estimate(&mut self.members, stream, estimator, uninformed, output, &limits, control);
        let estimated = estimated.map_err(untouched)?;
        let key = Key::of(&*scheduling.estimator, stream);
        learn_walks(&mut self.members, key, &estimated);
        Ok(Begun { estimated, key, setup, begin, loaded })
    }

    /// Has every device that is ready, or is so in time, do beforehand what a stream like this needs once.
    fn prepare(
        &mut self,
        stream: &Stream,
        estimator: &dyn CostEstimator,
        limits: &Limits,
        control: Control<'_>,
    ) -> Result<(), BalanceError> {
        let (source, spec, walk) = (&stream.source, self.spec_of(stream), estimator.walk());
        ask_all(&mut self.members, |_| Call::Prepare { source: source.clone(), spec, walk }, limits, control)?;
        Ok(())
    }

    /// What is asked of a stream's rays on these devices.
    ///
    /// Counts of one stream are put together whoever counted them. So where devices count otherwise by their own trees,
    /// and all of those that count can count the scene's, they do that.
    fn spec_of(&self, stream: &Stream) -> StreamSpec {
        let counting =
            || self.members.iter().map(|m| &m.info).filter(|info| info.capabilities.counts() != Counted::Nothing);
        let alike = counting().all(|info| info.capabilities.counts() == Counted::SceneTree)
            || counting().zip(counting().skip(1)).all(|(a, b)| a.backend == b.backend);
        let common = counting().all(|info| info.capabilities.counts_scene_tree());
        let counted = if common && !alike { CountedTree::Scene } else { stream.spec.counted };
        StreamSpec { counted, ..stream.spec }
    }

    /// Gives the rays to every device that is ready, or is so in time. One that cannot take them drops out; one that
    /// refuses them is left out of the stream.
    pub(crate) fn load(
        &mut self,
        stream: &Stream,
        limits: &Limits,
        audit: Audit,
        control: Control<'_>,
    ) -> Result<(), BalanceError> {
        settle(&mut self.members, limits, control)?;
        let mut refused = Vec::new();
        let spec = self.spec_of(stream);
        for member in self.members.iter_mut().filter(|member| member.is_ready()) {
            if let Err(error) = check_spec(&member.info.capabilities, &self.scene, spec) {
                member.leave_out(&error);
                refused.push((member.index, error));
            }
        }
        let (source, limit) = (&stream.source, limits.lost);
        let call = |_| Call::Load { source: source.clone(), spec, limit, audit };
        for (index, error) in ask_all(&mut self.members, call, limits, control)? {
            self.members[index].leave_out(&error);
            refused.push((index, error));
        }
        if self.members.iter().any(DeviceState::is_ready) {
            for member in self.members.iter_mut().filter(|member| member.may_come() && !member.is_ready()) {
                member.remark = Some("it was not ready in time: left out of this stream".to_owned());
            }
            return Ok(());
        }
        Err(match refused.pop() {
            Some((index, source)) => BalanceError::Refused { device: self.members[index].info.name.clone(), source },
            None => all_lost(&self.members, stream.tasks.len()),
        })
    }

    /// The devices, and the clock's begin.
    pub(crate) fn members(&mut self) -> &mut [DeviceState] {
        &mut self.members
    }
}

/// A stream that is with the devices, its cost estimated.
struct Begun {
    estimated: Estimated,
    key: Key,
    /// On the clock: before what streams like this need once, before the rays went to the devices, and after.
    setup: Duration,
    begin: Duration,
    loaded: Duration,
}

impl Drop for Balancer {
    fn drop(&mut self) {
        dismiss(&mut self.members);
    }
}

/// Tells the estimator what its stream took.
fn teach(estimator: &mut dyn CostEstimator, stream: RayStream<'_>, estimated: &Estimated, ran: &Ran) {
    for launch in ran.launches.iter().filter(|launch| launch.whole) {
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
