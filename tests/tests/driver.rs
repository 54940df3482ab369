//! The driver: whatever the devices, the queue and the estimate, every task is traced exactly once and the bits are
//! those of one device; and devices may fail at any point.

use backend_cpu::CpuDevice;
use rt_balance::estimators::{History, Sampled, Uniform};
use rt_balance::middleware::{Failure, Fault, Faulty, FaultyCall, Record, Recorded, Throttled};
use rt_balance::policies::{Block, RoundRobin};
use rt_balance::report::ActivityKind;
use rt_balance::{
    BalanceError, Balancer, Control, CostEstimator, Device, Hit, QueueKind, RaySource, Scene, Scheduling, Stream,
    StreamKind, StreamSpec, TestCounts,
};
use rt_bvh::Builder;
use rt_core::{
    Capabilities, Clock, Counted, CountedTree, DeviceError, DeviceErrorKind, DeviceInfo, Query, ReducedWalk, Tracer,
    Walk,
};
use rt_sched::sample::Fraction;
use rt_tests::fake::{FakeDevice, Flaw};
use rt_verify::rays::RayMaker;
use rt_verify::{shapes, tree};
use std::num::NonZero;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

const QUEUES: [QueueKind; 3] = [QueueKind::Static, QueueKind::Central, QueueKind::Hybrid];

/// What outputs hold before a run: no device reports it.
const UNTOUCHED: Hit = Hit { t: -1.0, u: -1.0, v: -1.0, primitive: 0xdead };

/// A scene, a stream of rays on it, and the bits that one device makes of it.
struct Fixture {
    scene: Arc<Scene>,
    stream: Stream,
    hits: Vec<Hit>,
    counts: Vec<TestCounts>,
}

fn fixture() -> &'static Fixture {
    static FIXTURE: OnceLock<Fixture> = OnceLock::new();
    FIXTURE.get_or_init(|| {
        let triangles = [shapes::grid(24, 0.2, 1), shapes::soup(300, 0.2, 2)].concat();
        let rays = RayMaker::new(&triangles, 5).mixed(6_001);
        let scene = tree::build(&triangles, Builder::Sah).expect("a scene");
        let spec = StreamSpec { counts: true, counted: CountedTree::Scene, ..StreamSpec::default() };
        let (hits, counts) = tree::trace(&scene, spec, &rays);
        let (rays, origins): (Vec<_>, Vec<_>) = rays.into_iter().unzip();
        let source = RaySource::Explicit { rays: rays.into(), origins: Some(origins.into()) };
        let stream = Stream::new(source, StreamKind::Custom, spec).with_task_size(97);
        Fixture { scene, stream, hits, counts }
    })
}

fn cpus(threads: &[usize]) -> Vec<Arc<dyn Device>> {
    let devices = CpuDevice::open_all(threads).expect("threads");
    devices.into_iter().map(|device| Arc::new(device) as Arc<dyn Device>).collect()
}

fn honest() -> Arc<dyn Device> {
    Arc::new(FakeDevice::honest())
}

fn sampled(walk: Walk, fraction: f64) -> Sampled {
    Sampled::new(walk, Fraction::new(fraction).expect("a fraction"))
}

fn scheduling(queue: QueueKind, estimator: Box<dyn CostEstimator>) -> Scheduling {
    Scheduling { queue: Box::new(queue), estimator, ..Scheduling::default() }
}

/// Traces the fixture's stream and checks every bit, and that the report accounts for every task once.
fn trace_and_check(what: &str, balancer: &mut Balancer, scheduling: &mut Scheduling) -> rt_balance::report::StreamRun {
    let Fixture { stream, hits, counts, .. } = fixture();
    let mut found = vec![UNTOUCHED; hits.len()];
    let mut counted = vec![TestCounts { boxes: 9, triangles: 9 }; hits.len()];
    let run = balancer
        .trace(stream, scheduling, &mut found, Some(&mut counted), Control::default())
        .unwrap_or_else(|e| panic!("{what}: {e}"));
    assert_eq!(bytes(&found), bytes(hits), "{what}: other hits than on one device");
    assert_eq!(&counted, counts, "{what}: other counts than on one device");

    let mut traced = vec![0; stream.tasks.len()];
    for activity in run.activities.iter().filter(|a| a.kind == ActivityKind::Launch) {
        assert!(activity.start_s <= activity.end_s, "{what}: {activity:?}");
        for &task in &activity.tasks {
            traced[task as usize] += 1;
            assert_eq!(run.device_of[task as usize] as usize, activity.device, "{what}: task {task}");
        }
    }
    assert!(traced.iter().all(|&n| n == 1), "{what}: tasks traced {traced:?} times");
    let finished: u32 = run.report.devices.iter().map(|d| d.tasks).sum();
    assert_eq!((finished, run.report.tasks), (stream.tasks.len() as u32, stream.tasks.len() as u32), "{what}");
    run
}

/// The bits of hits: `==` would take −0 for 0.
fn bytes(hits: &[Hit]) -> Vec<[u32; 4]> {
    hits.iter().map(|h| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.primitive]).collect()
}

/// Mutants: streams without an estimate that teach no prices; a past that is kept of estimates only.
#[test]
fn every_stream_teaches_the_next() {
    let mut balancer = Balancer::new(Arc::clone(&fixture().scene), &cpus(&[1, 1])).expect("devices");
    let mut default = Scheduling::default();
    let chosen: Vec<String> = (0..2)
        .map(|_| {
            let estimate = trace_and_check("default", &mut balancer, &mut default).report.estimate;
            assert!(estimate.reason.is_some(), "it has a choice: {estimate:?}");
            estimate.chosen
        })
        .collect();
    assert!(chosen[0] != "history" && chosen[1] == "history", "{chosen:?}");
    let mut uniform = scheduling(QueueKind::Static, Box::new(Uniform));
    let run = trace_and_check("uniform", &mut balancer, &mut uniform);
    assert_eq!(run.report.estimate.reason, None);
    assert!(run.report.devices.iter().all(|device| device.model.is_some()), "{:?}", run.report.devices);
}

// Guards against: a task handed out twice or never, results copied to another task's place, hits of masked rays
// overwritten by the misses that stand for them.
#[test]
fn any_devices_queue_and_estimate_give_the_bits_of_one_device() {
    let slow = || Arc::new(Throttled::new(honest(), 0.5).expect("a speed")) as Arc<dyn Device>;
    let sets: [(&str, Vec<Arc<dyn Device>>); 5] = [
        ("one core", cpus(&[1])),
        ("two cores", cpus(&[1, 1])),
        ("three threads and one", cpus(&[3, 1])),
        ("fake and slow", vec![honest(), slow()]),
        ("five", [cpus(&[1, 2]), vec![honest(), slow(), honest()]].concat()),
    ];
    type MakeEstimator = fn() -> Box<dyn CostEstimator>;
    let estimators: [MakeEstimator; 5] = [
        || Box::new(Uniform),
        || Box::new(sampled(Walk::Full, 1.0 / 16.0)),
        || Box::new(sampled(Walk::Full, 1.0)),
        || Box::new(sampled(Walk::Reduced(ReducedWalk::LeafAsHit), 0.1)),
        || Box::new(History::default()),
    ];
    for (name, devices) in sets {
        let mut balancer = Balancer::new(Arc::clone(&fixture().scene), &devices).expect("a balancer");
        for queue in QUEUES {
            for make in estimators {
                let mut scheduling = scheduling(queue, make());
                let what = format!("{name}, {queue:?}, {:?}", scheduling.estimator);
                trace_and_check(&what, &mut balancer, &mut scheduling);
                // Again, with what was learned.
                trace_and_check(&what, &mut balancer, &mut scheduling);
            }
        }
        for policy in [Box::new(Block) as Box<dyn rt_balance::policies::Policy>, Box::new(RoundRobin)] {
            let what = format!("{name}, {policy:?}");
            let mut scheduling =
                Scheduling { policy: Some(policy), ..scheduling(QueueKind::Static, Box::new(Uniform)) };
            trace_and_check(&what, &mut balancer, &mut scheduling);
        }
    }
}

// Guards against: tasks of a failed launch dropped, or given back though they were finished.
#[test]
fn a_device_may_fail_anywhere() {
    for queue in QUEUES {
        for n in [0, 1, 3] {
            let faults = [
                (FaultyCall::Submit, DeviceErrorKind::Lost),
                (FaultyCall::Wait, DeviceErrorKind::Lost),
                (FaultyCall::Wait, DeviceErrorKind::Hung),
                (FaultyCall::Walk, DeviceErrorKind::Lost),
            ];
            for (call, kind) in faults {
                let fault = Fault::new(call, n, Failure::Error(kind));
                let devices = [Arc::new(Faulty::new(honest(), fault)) as Arc<dyn Device>, honest()];
                let mut balancer = Balancer::new(Arc::clone(&fixture().scene), &devices).expect("a balancer");
                let what = format!("{queue:?}, {fault:?}");
                let mut scheduling = scheduling(queue, Box::new(sampled(Walk::Full, 1.0 / 16.0)));
                let mut run = || trace_and_check(&what, &mut balancer, &mut scheduling).report.devices[0].error.clone();
                let errors = [run(), run()];
                if n == 0 {
                    // On a busy machine the other device may do all the work of a run, so that nothing fails in it.
                    let later = std::iter::repeat_with(&mut run).take(100);
                    let told = errors.iter().cloned().chain(later).find_map(|error| error);
                    let told = told.unwrap_or_else(|| panic!("{what}: the report never tells"));
                    assert!(told.contains("injected fault"), "{what}: the report tells {told}");
                }
                assert!(errors[0].is_none() || errors[1].is_some(), "{what}: a failed device came back");
            }
        }
    }
}

// A device that answers with too few hits, or refuses good tasks, must not spoil the others' results.
#[test]
fn a_device_that_answers_wrongly_drops_out() {
    for queue in QUEUES {
        for flaw in [Flaw::Appends, Flaw::AcceptsAnyTask] {
            let devices = [Arc::new(FakeDevice::flawed(flaw)) as Arc<dyn Device>, honest()];
            let mut balancer = Balancer::new(Arc::clone(&fixture().scene), &devices).expect("a balancer");
            let mut scheduling = scheduling(queue, Box::new(Uniform));
            trace_and_check(&format!("{queue:?}, {flaw:?}"), &mut balancer, &mut scheduling);
        }
    }
}

/// What a device does not say it can is not asked of it: it is left out, with a word on what to do. Mutants: it is
/// asked all the same; it is left out where nothing is hidden; hits of a ray out of order are believed.
#[test]
fn several_hits_and_masks_are_for_those_who_claim_them() {
    let Fixture { scene, stream, .. } = fixture();
    let masks = (0..scene.primitive_count()).map(|id| if id % 2 == 0 { 0b01 } else { 0b10 }).collect();
    let masked = Arc::new(Scene::clone(scene).with_masks(masks).expect("one for each"));
    let unable = || -> Arc<dyn Device> {
        Arc::new(FakeDevice::honest().saying(Capabilities::UNKNOWN.with_counts(Counted::SceneTree).with_defined_bits()))
    };
    let unsorted: Arc<dyn Device> = Arc::new(FakeDevice::flawed(Flaw::Unsorted));
    let all = Query::All { most: NonZero::new(4).expect("a place") };
    let cases =
        [(all, u32::MAX, "one hit of each ray"), (Query::Closest, 0b01, "knows no masks"), (all, 0b10, "masks")];
    for (query, mask, said) in cases {
        let spec = StreamSpec { query, mask, ..StreamSpec::default() };
        let stream = Stream { spec, ..stream.clone() };
        let mut right = Vec::new();
        let rays = (0..stream.source.len()).map(|ray| stream.source.ray(ray));
        let mut stack = rt_bvh::Stack::for_scene(&masked);
        rt_bvh::trace_several(&masked, &mut stack, spec, rays, |hits, _| right.extend_from_slice(hits));
        let trace = |devices: &[Arc<dyn Device>]| {
            let mut balancer = Balancer::new(Arc::clone(&masked), devices).expect("a balancer");
            let mut found = vec![UNTOUCHED; right.len()];
            let mut scheduling = Scheduling::default();
            let run = balancer.trace(&stream, &mut scheduling, &mut found, None, Control::default());
            run.map(|run| (run.report.devices, found))
        };
        let (devices, found) = trace(&[unable(), honest()]).expect("one device can");
        assert_eq!(bytes(&found), bytes(&right), "{query:?}, mask {mask:b}");
        let reason = devices[0].error.as_ref().or(devices[0].note.as_ref()).expect("a reason");
        assert!(reason.contains(said) && reason.contains("choose a CPU device") && devices[0].tasks == 0, "{reason}");
        let refused = rt_core::with_causes(&trace(&[unable()]).expect_err("nobody can"));
        assert!(refused.contains(said) && refused.contains("choose a CPU device"), "{refused}");
        if query == all {
            let (devices, found) = trace(&[Arc::clone(&unsorted), honest()]).expect("one device is right");
            assert_eq!(bytes(&found), bytes(&right), "{query:?}, mask {mask:b}");
            let error = devices[0].error.as_ref();
            assert!(devices[0].tasks == 0 && error.is_none_or(|error| error.contains("in order")), "{error:?}");
        }
        // Nothing is hidden from rays of both bits.
        if query == Query::Closest {
            let stream = Stream { spec: StreamSpec { mask: 0b11, ..spec }, ..stream.clone() };
            let mut balancer = Balancer::new(Arc::clone(&masked), &[unable()]).expect("a balancer");
            let mut found = vec![UNTOUCHED; right.len()];
            let mut scheduling = Scheduling::default();
            balancer.trace(&stream, &mut scheduling, &mut found, None, Control::default()).expect("it sees all");
            assert_eq!(bytes(&found), bytes(&fixture().hits));
        }
    }
}

#[test]
fn when_all_devices_fail_finished_tasks_stay_and_others_are_untouched() {
    let Fixture { scene, stream, hits, .. } = fixture();
    for queue in QUEUES {
        for n in [0, 2] {
            let faulty = || {
                Arc::new(Faulty::new(honest(), Fault::new(FaultyCall::Wait, n, Failure::Error(DeviceErrorKind::Lost))))
                    as Arc<dyn Device>
            };
            let mut balancer = Balancer::new(Arc::clone(scene), &[faulty(), faulty()]).expect("a balancer");
            let mut found = vec![UNTOUCHED; hits.len()];
            let mut scheduling = scheduling(queue, Box::new(Uniform));
            let answer = balancer.trace(stream, &mut scheduling, &mut found, None, Control::default());
            let Err(BalanceError::AllDevicesLost { unfinished, failures }) = answer else {
                // One launch may be all that a device gets.
                assert!(n > 0 && answer.is_ok(), "{queue:?}, {n}: {answer:?}");
                continue;
            };
            assert_eq!(failures.len(), 2);
            let open = unfinished_tasks(&found, hits);
            assert_eq!(open, unfinished, "{queue:?}, {n}");
            assert!(n > 0 || open == stream.tasks.len());
        }
    }
}

/// Checks that every task is either wholly right or wholly untouched, and returns how many are untouched.
fn unfinished_tasks(found: &[Hit], right: &[Hit]) -> usize {
    let mut open = 0;
    for task in &fixture().stream.tasks {
        let range = task.first as usize..(task.first + task.rays) as usize;
        let (found, right) = (&found[range.clone()], &right[range]);
        if found[0] == UNTOUCHED {
            open += 1;
            assert!(found.iter().all(|hit| *hit == UNTOUCHED), "{task:?} is written in part");
        } else {
            assert_eq!(bytes(found), bytes(right), "{task:?}");
        }
    }
    open
}

#[test]
fn cancelling_stops_early_and_leaves_whole_tasks() {
    let Fixture { scene, stream, hits, .. } = fixture();
    for queue in [QueueKind::Central, QueueKind::Hybrid] {
        let cancel = AtomicBool::new(false);
        let most = AtomicU64::new(0);
        let progress = |done: u64, total: u64| {
            assert_eq!(total, hits.len() as u64);
            most.fetch_max(done, Ordering::Relaxed);
            cancel.store(true, Ordering::Relaxed);
        };
        let control = Control { cancel: Some(&cancel), progress: Some(&progress), ..Control::default() };
        let mut balancer = Balancer::new(Arc::clone(scene), &[honest(), honest()]).expect("a balancer");
        let mut found = vec![UNTOUCHED; hits.len()];
        let mut scheduling = scheduling(queue, Box::new(Uniform));
        let answer = balancer.trace(stream, &mut scheduling, &mut found, None, control);
        let Err(BalanceError::Cancelled { unfinished }) = answer else { panic!("{queue:?}: {answer:?}") };
        assert!(most.load(Ordering::Relaxed) > 0 && unfinished < stream.tasks.len());
        assert_eq!(unfinished_tasks(&found, hits), unfinished, "{queue:?}");
        // The devices are as good as before.
        trace_and_check("after a cancelled run", &mut balancer, &mut scheduling);
    }
}

// Guards against: a device asked for tasks that another one has finished, rays loaded more than once per stream.
#[test]
fn devices_are_asked_for_every_task_once_and_for_no_other() {
    for queue in QUEUES {
        let recorded = [Arc::new(Recorded::new(honest())), Arc::new(Recorded::new(honest()))];
        let devices = recorded.clone().map(|device| device as Arc<dyn Device>);
        let mut balancer = Balancer::new(Arc::clone(&fixture().scene), &devices).expect("a balancer");
        trace_and_check("recorded", &mut balancer, &mut scheduling(queue, Box::new(Uniform)));
        let mut asked = Vec::new();
        for device in &recorded {
            let mut loads = 0;
            for record in device.records() {
                match record {
                    Record::Load { rays } => {
                        loads += 1;
                        assert_eq!(rays as usize, fixture().hits.len());
                    }
                    Record::Submit { tasks } => asked.extend(tasks),
                    _ => {}
                }
            }
            assert_eq!(loads, 1, "{queue:?}");
        }
        asked.sort_by_key(|task| task.first);
        assert_eq!(asked, fixture().stream.tasks, "{queue:?}");
    }
}

#[test]
fn nothing_to_trace_and_wrong_arguments_are_no_trouble() {
    let Fixture { scene, stream, .. } = fixture();
    assert!(matches!(Balancer::new(Arc::clone(scene), &[]), Err(BalanceError::NoDevices)));
    let mut balancer = Balancer::new(Arc::clone(scene), &[honest(), honest()]).expect("a balancer");
    let run = balancer.trace_rays(&[], &mut []).expect("no rays");
    assert!(
        run.report.tasks == 0 && run.report.imbalance.is_none_or(f64::is_finite) && run.report.makespan_s.is_finite()
    );
    let mut short = [Hit::MISS; 3];
    let answer = balancer.trace(stream, &mut Scheduling::default(), &mut short, None, Control::default());
    assert!(matches!(answer, Err(BalanceError::Length { argument: "hits", found: 3, .. })), "{answer:?}");
    let mut gap = stream.clone();
    gap.tasks.remove(3);
    let mut hits = vec![UNTOUCHED; stream.source.len() as usize];
    let answer = balancer.trace(&gap, &mut Scheduling::default(), &mut hits, None, Control::default());
    assert!(matches!(answer, Err(BalanceError::Tasks { .. })), "{answer:?}");
    assert!(hits.iter().all(|hit| *hit == UNTOUCHED));
}

/// A device that takes no scene.
#[derive(Debug)]
struct Full(DeviceInfo);

impl Device for Full {
    fn info(&self) -> &DeviceInfo {
        &self.0
    }

    fn tracer(&self, _: Arc<Scene>, _: Clock) -> Result<Box<dyn Tracer>, DeviceError> {
        Err(DeviceError::new(DeviceErrorKind::OutOfMemory, "the scene needs 9 bytes of 8"))
    }
}

/// A device that cannot take the scene costs nothing but itself. Mutants: its error ends the call; it is given tasks.
#[test]
fn a_device_without_room_for_the_scene_is_left_out() {
    let Fixture { scene, stream, hits, .. } = fixture();
    let full = || -> Arc<dyn Device> { Arc::new(Full(honest().info().clone())) };
    let error = Balancer::new(Arc::clone(scene), &[full(), full()]).expect_err("nobody takes it");
    assert!(matches!(error, BalanceError::Open { .. }), "{error:?}");
    let mut balancer = Balancer::new(Arc::clone(scene), &[full(), honest()]).expect("one takes it");
    let mut found = vec![UNTOUCHED; stream.source.len() as usize];
    let mut scheduling = Scheduling::default();
    let mut counts = vec![TestCounts::default(); found.len()];
    let answer = balancer.trace(stream, &mut scheduling, &mut found, Some(&mut counts), Control::default());
    let devices = answer.expect("the other one does it").report.devices;
    assert_eq!(devices[0].error.as_deref(), Some("the scene needs 9 bytes of 8"));
    assert!(devices[0].tasks == 0 && devices[1].error.is_none());
    assert_eq!(bytes(&found), bytes(hits));
}
