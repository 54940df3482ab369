//! What graphics cards do when they fail: each failure is truly provoked, is told by its kind, and costs no result. And
//! that it is the card that traces: a poisoned kernel changes the hits, and every ray is traced once.
//!
//! A backend takes part with one function that opens its devices with a [`FaultInjection`]. `RT_REQUIRE=vulkan` makes a
//! missing one a failure.

use backend_cpu::CpuDevice;
use backend_vulkan::{GpuDevice, OpenError, Options, VulkanDevice};
use backend_wgpu::WgpuDevice;
use glam::Vec3;
use libtest_mimic::{Arguments, Completion, Failed, Trial, run};
use rt_balance::estimators::{Sampled, Uniform};
use rt_balance::middleware::{Failure, Fault, Faulty, FaultyCall};
use rt_balance::report::StreamRun;
use rt_balance::{Audit, BalanceError, Balancer, Control, CostEstimator, Limits, QueueKind, Scheduling, Stream};
use rt_bvh::Builder;
use rt_core::{
    CountedTree, Device, DeviceErrorKind, Hit, Launch, Ray, RaySource, ReducedWalk, Scene, StreamKind, StreamSpec,
    TestCounts, Walk,
};
use rt_gpu::{Card, FaultInjection};
use rt_sched::sample::Fraction;
use rt_shaders::{FloatControls, Purpose};
use rt_tests::cards::are_copies;
use rt_verify::clock;
use rt_verify::rays::RayMaker;
use rt_verify::{shapes, tree};
use std::process::{Command, Stdio};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// The longest that a launch of an honest device may take; a software rasteriser on a loaded machine is slow.
const LIMIT: Duration = Duration::from_secs(120);

/// The longest that a launch may take where one is to hang: far below the second that [`Purpose::Slow`] takes, far
/// above the milliseconds of a processor.
const SHORT_LIMIT: Duration = Duration::from_millis(300);

/// Runs after which a device has certainly got a launch: on a busy machine the others may be done before.
const TRIES: usize = 100;

/// What a device is opened with.
#[derive(Clone, Copy, Default)]
struct Opening {
    memory: Option<u64>,
    fault: Option<FaultInjection>,
}

/// A device, and its own account of what it traced.
struct Opened {
    device: Arc<dyn Device>,
    card: Card,
    counters: Box<dyn Fn() -> Counted>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Counted {
    rays: u64,
    on_host: u64,
}

/// A backend of graphics cards.
#[derive(Clone, Copy)]
struct Backend {
    name: &'static str,
    /// Every usable device, anew; or why there is none.
    open: fn(Opening) -> Result<Vec<Opened>, String>,
    /// Whether its devices can be opened with less memory than they have.
    limits_memory: bool,
}

const BACKENDS: [Backend; 2] = [
    Backend { name: "vulkan", open: vulkan, limits_memory: true },
    Backend { name: "wgpu", open: wgpu, limits_memory: false },
];

type Case = fn(Backend, usize) -> Result<(), Failed>;

const CASES: [(&str, Case); 8] = [
    ("a_scene_beyond_the_memory_is_refused_with_both_sizes", large_scene),
    ("a_stream_beyond_the_memory_goes_to_the_others", large_stream),
    ("a_kernel_that_does_not_compile_costs_nothing", no_compilation),
    ("a_hang_ends_at_the_limit_and_costs_nothing", hang),
    ("a_lost_device_costs_nothing", loss),
    ("a_device_killed_by_the_middleware_costs_nothing", killed),
    ("a_poisoned_kernel_changes_hits", poison),
    ("every_ray_is_traced_once", once),
];

fn main() {
    let arguments = Arguments::from_args();
    // One after the other: where devices hang, are lost and come and go at the same time, software drivers have crashed
    // (twice in some twenty runs of all tests, a call of nothing within one of their threads).
    let arguments = Arguments { test_threads: arguments.test_threads.or(Some(1)), ..arguments };
    let mut all: Vec<Trial> = BACKENDS.into_iter().flat_map(trials).collect();
    all.extend([
        Trial::ignorable_test("races_are_seen_by_the_validation_layer", races).with_kind("vulkan"),
        Trial::ignorable_test("kernels_ask_for_the_float_controls_there_are", float_controls).with_kind("vulkan"),
        Trial::ignorable_test("spirv_val_has_nothing_to_object_to", spirv_val).with_kind("vulkan"),
    ]);
    run(&arguments, all).exit();
}

fn trials(backend: Backend) -> Vec<Trial> {
    let found = match (backend.open)(Opening::default()) {
        Ok(found) => found,
        Err(reason) => {
            let test = move || missing(backend.name, reason.clone());
            return vec![Trial::ignorable_test("devices_fail_without_harm", test).with_kind(backend.name)];
        }
    };
    let mut all = Vec::new();
    let are_copies = are_copies(&found.iter().map(|opened| &opened.card).collect::<Vec<_>>());
    for (index, opened) in found.iter().enumerate().filter(|(index, _)| !are_copies[*index]) {
        let name = opened.device.info().name.to_lowercase();
        let kind = format!("{}/{}/{index}", backend.name, name.split([' ', '(']).next().unwrap_or("device"));
        for (name, case) in CASES {
            // Seconds of a whole core: once is enough.
            let is_left_out =
                index > 0 && name.contains("hang_ends") || name.contains("memory") && !backend.limits_memory;
            if !is_left_out {
                all.push(Trial::test(name, move || case(backend, index)).with_kind(&kind));
            }
        }
    }
    all
}

/// A failure where `RT_REQUIRE` names the backend, otherwise the reason for doing nothing.
fn missing(backend: &str, reason: String) -> Result<Completion, Failed> {
    let required = std::env::var("RT_REQUIRE").is_ok_and(|list| list.split(',').any(|name| name.trim() == backend));
    if required {
        return Err(format!("required by RT_REQUIRE, but missing: {reason}").into());
    }
    Ok(Completion::ignored_with(reason))
}

fn vulkan(opening: Opening) -> Result<Vec<Opened>, String> {
    let Opening { memory, fault } = opening;
    let options = Options { validation: true, memory, fault, ..Options::default() };
    let found = match VulkanDevice::enumerate(options) {
        Err(OpenError::NoValidation) => VulkanDevice::enumerate(Options { validation: false, ..options }),
        found => found,
    };
    all(found.map_err(|e| e.to_string())?.into_iter().flatten())
}

fn wgpu(Opening { memory, fault }: Opening) -> Result<Vec<Opened>, String> {
    if memory.is_some() {
        return Err("wgpu does not limit memory".to_owned());
    }
    let found = WgpuDevice::enumerate(backend_wgpu::Options { fault, ..Default::default() });
    all(found.map_err(|e| e.to_string())?.into_iter().flatten())
}

fn all<T: GpuDevice + 'static>(devices: impl Iterator<Item = T>) -> Result<Vec<Opened>, String> {
    let opened = |device| {
        let device = Arc::new(device);
        let of: Arc<T> = Arc::clone(&device);
        let counters = move || Counted { rays: of.counters().rays(), on_host: of.counters().on_host() };
        Opened { card: device.card().clone(), device, counters: Box::new(counters) }
    };
    let found: Vec<Opened> = devices.map(opened).collect();
    if found.is_empty() { Err("no device can be used".to_owned()) } else { Ok(found) }
}

impl Backend {
    fn all(self) -> Result<Vec<Opened>, Failed> {
        Ok((self.open)(Opening::default())?)
    }

    fn one(self, index: usize, opening: Opening) -> Result<Opened, Failed> {
        Ok((self.open)(opening)?.into_iter().nth(index).ok_or("the device is gone")?)
    }

    fn with(self, index: usize, fault: FaultInjection) -> Result<Opened, Failed> {
        self.one(index, Opening { fault: Some(fault), ..Opening::default() })
    }

    /// Every device but one, and a thread of the processor.
    fn others(self, index: usize) -> Result<Vec<Arc<dyn Device>>, Failed> {
        let cards = self.all()?.into_iter().enumerate().filter(|(i, _)| *i != index);
        let cards = cards.map(|(_, opened)| opened.device);
        Ok(cards.chain(processor()?).collect())
    }
}

/// One thread of it.
fn processor() -> Result<Vec<Arc<dyn Device>>, Failed> {
    Ok(CpuDevice::open_all(&[1])?.into_iter().map(|cpu| Arc::new(cpu) as Arc<dyn Device>).collect())
}

/// A scene, a stream of rays on it, and the processor's bits.
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
        let rays = RayMaker::new(&triangles, 6).mixed(6_001);
        let scene = tree::build(&triangles, Builder::Sah).expect("a scene");
        let spec = StreamSpec { counts: true, counted: CountedTree::Scene, ..StreamSpec::default() };
        let (hits, counts) = tree::trace(&scene, spec, &rays);
        let (rays, origins): (Vec<_>, Vec<_>) = rays.into_iter().unzip();
        let source = RaySource::Explicit { rays: rays.into(), origins: Some(origins.into()) };
        Fixture { scene, stream: Stream::new(source, StreamKind::Custom, spec).with_task_size(97), hits, counts }
    })
}

fn bits(hits: &[Hit]) -> Vec<[u32; 4]> {
    hits.iter().map(|h| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.primitive]).collect()
}

fn scheduling(queue: QueueKind, limit: Duration) -> Scheduling {
    // What is late is told by the device, not done by others.
    let limits = Limits { late: LIMIT, lost: limit, ..Limits::default() };
    Scheduling { estimator: Box::new(Uniform), queue: Box::new(queue), limits, ..Scheduling::default() }
}

/// Traces the stream and checks every bit of hits and counts.
fn trace(balancer: &mut Balancer, scheduling: &mut Scheduling) -> Result<StreamRun, Failed> {
    let Fixture { stream, hits, counts, .. } = fixture();
    // What no device reports.
    let mut found = vec![Hit { t: -1.0, u: -1.0, v: -1.0, primitive: 0xdead }; hits.len()];
    let mut counted = vec![TestCounts { boxes: u32::MAX, triangles: u32::MAX }; hits.len()];
    let run = balancer.trace(stream, scheduling, &mut found, Some(&mut counted), Control::default())?;
    if bits(&found) != bits(hits) {
        return Err("hits are not the processor's".into());
    }
    if &counted != counts {
        return Err("counts are not the processor's".into());
    }
    Ok(run)
}

/// Runs until the first device has failed; each run's results must be whole. Then a new device of the backend works.
fn survives(
    backend: Backend,
    index: usize,
    bad: Arc<dyn Device>,
    queue: QueueKind,
    limit: Duration,
) -> Result<String, Failed> {
    survives_with(backend.others(index)?, backend, index, bad, queue, limit)
}

fn survives_with(
    others: Vec<Arc<dyn Device>>,
    backend: Backend,
    index: usize,
    bad: Arc<dyn Device>,
    queue: QueueKind,
    limit: Duration,
) -> Result<String, Failed> {
    let devices = [vec![bad], others].concat();
    for _ in 0..TRIES {
        // One that knows nothing: a device that was found to be slow, as under load, is given nothing any more.
        let mut balancer = Balancer::new(Arc::clone(&fixture().scene), &devices)?;
        let run = trace(&mut balancer, &mut scheduling(queue, limit))?;
        if let Some(later) = run.report.devices[1..].iter().find_map(|device| device.error.clone()) {
            return Err(format!("another device failed: {later}").into());
        }
        if let Some(reason) = run.report.devices[0].error.clone() {
            drop(balancer);
            let anew = [backend.one(index, Opening::default())?.device];
            let mut balancer = Balancer::new(Arc::clone(&fixture().scene), &anew)?;
            let run = trace(&mut balancer, &mut self::scheduling(queue, LIMIT))?;
            return match &run.report.devices[0].error {
                None => Ok(reason),
                Some(error) => Err(format!("the device opened anew failed: {error}").into()),
            };
        }
    }
    Err("the device never failed".into())
}

fn expect(reason: &str, wanted: &str) -> Result<(), Failed> {
    if reason.contains(wanted) { Ok(()) } else { Err(format!("no {wanted:?} in {reason:?}").into()) }
}

/// Every number in a text.
fn numbers(text: &str) -> Vec<u64> {
    text.split(|c: char| !c.is_ascii_digit()).filter_map(|digits| digits.parse().ok()).collect()
}

fn large_scene(backend: Backend, index: usize) -> Result<(), Failed> {
    // Room for the backend's own buffers, and for little else.
    const ROOM: u64 = 8 << 20;
    static LARGE: OnceLock<Result<Arc<Scene>, String>> = OnceLock::new();
    let scene = LARGE.get_or_init(|| tree::build(&shapes::grid(300, 0.1, 3), Builder::Sah)).as_ref()?;
    let small = backend.one(index, Opening { memory: Some(ROOM), fault: None })?.device;
    let Err(error) = small.tracer(Arc::clone(scene), clock) else { return Err("it was taken".into()) };
    // Needed: at least what the triangles take; available: at most the room.
    let told = numbers(&error.to_string());
    let least = size_of_val(scene.triangles()) as u64;
    let right = told.iter().any(|n| *n >= least.max(ROOM)) && told.iter().any(|n| (1..=ROOM).contains(n));
    if error.kind() != DeviceErrorKind::OutOfMemory || !right {
        return Err(format!("{:?}: {error}", error.kind()).into());
    }
    let devices = [vec![Arc::clone(&small)], backend.others(index)?].concat();
    match Balancer::new(Arc::clone(scene), &devices[..1]) {
        Err(BalanceError::Open { device, source })
            if device == small.info().name && source.kind() == DeviceErrorKind::OutOfMemory => {}
        other => return Err(format!("{other:?}").into()),
    }
    // The others do it without it, the report says why, and it takes what fits.
    let mut balancer = Balancer::new(Arc::clone(scene), &devices)?;
    let mut hits = [Hit::MISS; 64];
    let run = balancer.trace_rays(&[Ray::new(Vec3::Y * 9.0, Vec3::NEG_Y); 64], &mut hits)?;
    let reason = run.report.devices[0].error.as_deref().unwrap_or_default();
    if !reason.contains("memory") || !hits[0].is_hit() {
        return Err(format!("{reason:?}, {:?}", hits[0]).into());
    }
    trace(&mut Balancer::new(Arc::clone(&fixture().scene), &devices)?, &mut scheduling(QueueKind::Static, LIMIT))?;
    Ok(())
}

fn large_stream(backend: Backend, index: usize) -> Result<(), Failed> {
    // Room for the scene and the backend's own buffers, but not for the rays: 64 bytes each on every backend.
    let least = fixture().scene.bytes();
    let is_taken = |room: u64| {
        let opened = backend.one(index, Opening { memory: Some(room), fault: None });
        opened.is_ok_and(|opened| opened.device.tracer(Arc::clone(&fixture().scene), clock).is_ok())
    };
    let (mut below, mut room) = (0, least);
    while !is_taken(room) && room < 64 << 20 {
        (below, room) = (room, room * 2);
    }
    while room - below > u64::from(fixture().stream.source.len()) * 64 {
        let middle = below.midpoint(room);
        if is_taken(middle) { room = middle } else { below = middle }
    }
    let bad = backend.one(index, Opening { memory: Some(room), fault: None })?.device;
    let reason = survives(backend, index, bad, QueueKind::Static, LIMIT)?;
    expect(&reason, "bytes")?;
    if numbers(&reason).iter().all(|n| *n >= room) { Err(format!("no sizes in {reason:?}").into()) } else { Ok(()) }
}

fn no_compilation(backend: Backend, index: usize) -> Result<(), Failed> {
    let bad = backend.with(index, FaultInjection::Kernel(Purpose::TooWide))?.device;
    expect(&survives(backend, index, Arc::clone(&bad), QueueKind::Static, LIMIT)?, "TooWide")?;
    let mut tracer = bad.tracer(Arc::clone(&fixture().scene), clock)?;
    tracer.load_rays(fixture().stream.source.clone(), StreamSpec::default())?;
    match tracer.submit(&fixture().stream.tasks, None) {
        Err(e) if e.kind() == DeviceErrorKind::Unsupported => Ok(()),
        other => Err(format!("{other:?}").into()),
    }
}

/// Fails when the wait has no limit. When the tracer is dropped the kernel is still running: a backend that frees its
/// buffers then crashes here.
fn hang(backend: Backend, index: usize) -> Result<(), Failed> {
    let bad = backend.with(index, FaultInjection::Kernel(Purpose::Slow))?.device;
    let reason = survives_with(processor()?, backend, index, Arc::clone(&bad), QueueKind::Static, SHORT_LIMIT)?;
    expect(&reason, "within")?;
    // The device's next tracer waits for the kernel to end, and what that used is freed; or the device is lost.
    let mut tracer = match bad.tracer(Arc::clone(&fixture().scene), clock) {
        Err(e) if e.kind() == DeviceErrorKind::Lost => return Ok(()),
        tracer => tracer?,
    };
    tracer.load_rays(fixture().stream.source.clone(), StreamSpec::default())?;
    let ticket = tracer.submit(&fixture().stream.tasks, None)?;
    match tracer.wait(ticket, Duration::ZERO, &mut Launch::default()) {
        Err(e) if e.kind() == DeviceErrorKind::Hung => {}
        other => return Err(format!("{other:?}").into()),
    }
    match tracer.submit(&fixture().stream.tasks, None) {
        Err(e) if e.kind() == DeviceErrorKind::Lost => Ok(()),
        other => Err(format!("a tracer after its hang: {other:?}").into()),
    }
}

fn loss(backend: Backend, index: usize) -> Result<(), Failed> {
    for (queue, launch) in [(QueueKind::Static, 0), (QueueKind::Central, 3), (QueueKind::Hybrid, 1)] {
        let bad = backend.with(index, FaultInjection::LostAtLaunch(launch))?.device;
        expect(&survives(backend, index, Arc::clone(&bad), queue, LIMIT)?.to_lowercase(), "lost")?;
        match bad.tracer(Arc::clone(&fixture().scene), clock) {
            Err(e) if e.kind() == DeviceErrorKind::Lost => {}
            other => return Err(format!("a tracer of a lost device: {other:?}").into()),
        }
    }
    Ok(())
}

fn killed(backend: Backend, index: usize) -> Result<(), Failed> {
    let faults = [
        (QueueKind::Static, FaultyCall::Wait, 0),
        (QueueKind::Hybrid, FaultyCall::Wait, 1),
        (QueueKind::Hybrid, FaultyCall::Submit, 1),
    ];
    for (queue, call, after) in faults {
        let fault = Fault::new(call, after, Failure::Error(DeviceErrorKind::Lost));
        let bad = Arc::new(Faulty::new(backend.one(index, Opening::default())?.device, fault));
        expect(&survives(backend, index, bad, queue, LIMIT)?, "injected fault")?;
    }
    Ok(())
}

/// Fails when the backend answers from the processor: then hits do not depend on the kernel.
fn poison(backend: Backend, index: usize) -> Result<(), Failed> {
    let Fixture { scene, stream, hits, .. } = fixture();
    let bad = backend.with(index, FaultInjection::Kernel(Purpose::Poisoned))?;
    let mut balancer = Balancer::new(Arc::clone(scene), &[bad.device])?;
    let mut found = vec![Hit::MISS; hits.len()];
    // The host would find it out.
    let mut how = Scheduling { audit: Audit::OFF, ..scheduling(QueueKind::Hybrid, LIMIT) };
    balancer.trace(stream, &mut how, &mut found, None, Control::default())?;
    let there = hits.iter().filter(|hit| hit.is_hit()).count();
    let left = found.iter().filter(|hit| hit.is_hit()).count();
    if there < hits.len() / 4 || left > 0 {
        return Err(format!("{left} of {there} hits are there though no kernel found them").into());
    }
    Ok(())
}

/// Fails when rays kept from the estimate are traced again, or a task is given to two devices.
fn once(backend: Backend, _: usize) -> Result<(), Failed> {
    let Fixture { scene, stream, .. } = fixture();
    let cards = backend.all()?;
    let devices: Vec<_> = cards.iter().map(|opened| Arc::clone(&opened.device)).collect();
    let mut balancer = Balancer::new(Arc::clone(scene), &devices)?;
    let total = |of: fn(Counted) -> u64| cards.iter().map(|opened| of((opened.counters)())).sum::<u64>();
    let rays = u64::from(stream.source.len());
    let eighth = Fraction::new(0.125).ok_or("a fraction")?;
    for (walk, is_kept) in [(Walk::Full, true), (Walk::Reduced(ReducedWalk::LeafAsHit), false)] {
        let before = (total(|c| c.rays), total(|c| c.on_host));
        let estimator: Box<dyn CostEstimator> = Box::new(Sampled::new(walk, eighth));
        let mut how = Scheduling { estimator, ..scheduling(QueueKind::Hybrid, LIMIT) };
        let run = trace(&mut balancer, &mut how)?;
        let walked = (run.report.estimate.fraction * rays as f64).round() as u64;
        let wanted = if is_kept { rays } else { rays + walked };
        let traced = (total(|c| c.rays) - before.0, total(|c| c.on_host) - before.1);
        if traced.0 != wanted || walked == 0 {
            return Err(format!("{walk:?}: {} rays traced, not {wanted} ({walked} of them samples)", traced.0).into());
        }
        let reports = &run.report.devices;
        let told: u64 = reports.iter().filter_map(|device| device.on_host).sum();
        let back: u64 = reports.iter().filter_map(|device| device.downloaded_bytes).sum();
        let is_share = |share: Option<f64>| share.is_none_or(|share| share > 0.0 && share <= 1.0);
        // At least a word for each ray.
        if told != traced.1 || back < 4 * wanted || !reports.iter().all(|device| is_share(device.kernel_share)) {
            return Err(format!("{walk:?}: the report does not tell what was done: {reports:?}").into());
        }
        // Edges and vertices are aimed at: some are in doubt, most are not.
        if traced.1 > rays / 2 {
            return Err(format!("{walk:?}: the host traced {} of {rays} rays", traced.1).into());
        }
    }
    Ok(())
}

/// The first Vulkan device, opened with the validation layer; or why there is none.
fn validated() -> Result<VulkanDevice, String> {
    let options = Options { validation: true, ..Options::default() };
    let found = VulkanDevice::enumerate(options).map_err(|e| e.to_string())?;
    found.into_iter().flatten().next().ok_or_else(|| "no device can be used".to_owned())
}

/// Two copies to one place are objected to: else no message in the other tests would say nothing of barriers.
fn races() -> Result<Completion, Failed> {
    let device = match validated() {
        Ok(device) => device,
        Err(reason) => return missing("vulkan", reason),
    };
    match device.provoke_race() {
        Err(e) if e.to_string().contains("SYNC-HAZARD-WRITE-AFTER-WRITE") => Ok(Completion::Completed),
        other => Err(format!("a race was not objected to: {other:?}").into()),
    }
}

/// lavapipe offers two of the three; the other tests run its kernels under the validation layer.
fn float_controls() -> Result<Completion, Failed> {
    let device = match validated() {
        Ok(device) => device,
        Err(reason) => return missing("vulkan", reason),
    };
    let FloatControls { signed_zero_inf_nan, round_to_nearest, .. } = device.float_controls();
    if device.card().software && !(signed_zero_inf_nan && round_to_nearest) {
        return Err(format!("{:?}", device.float_controls()).into());
    }
    Ok(Completion::Completed)
}

/// Every kernel with every float control, whether a device here has it or not. Fails when modes are put before the
/// entry point, or the extension is left out.
fn spirv_val() -> Result<Completion, Failed> {
    use Purpose::{Any, AnyCounted, Arithmetic, Closest, ClosestCounted, LeafAsHit, Unshortened};
    let all = FloatControls { signed_zero_inf_nan: true, denormals: true, round_to_nearest: true };
    for purpose in [Any, AnyCounted, Arithmetic, Closest, ClosestCounted, LeafAsHit, Unshortened] {
        let words = rt_shaders::kernel(rt_shaders::Layout::Two, purpose, 0).ok_or("a kernel")?.spirv_with(all);
        let file = std::env::temp_dir().join(format!("raybalance-{}-{purpose:?}.spv", std::process::id()));
        std::fs::write(&file, words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>())?;
        let mut command = Command::new("spirv-val");
        let answer = command.args(["--target-env", "vulkan1.2"]).arg(&file).stdin(Stdio::null()).output();
        std::fs::remove_file(&file)?;
        match answer {
            Ok(answer) if answer.status.success() => {}
            Ok(answer) => return Err(format!("{purpose:?}: {}", String::from_utf8_lossy(&answer.stderr)).into()),
            Err(e) => return missing("vulkan", format!("spirv-val cannot be started: {e}")),
        }
    }
    Ok(Completion::Completed)
}
