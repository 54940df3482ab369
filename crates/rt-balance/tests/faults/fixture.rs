//! A scene, a stream of rays on it, the bits that are right, and devices.

use rt_balance::cpu::CpuDevice;
use rt_balance::estimators::{Sampled, Uniform};
use rt_balance::middleware::{Fault, Faulty};
use rt_balance::report::StreamRun;
use rt_balance::{
    BalanceError, Balancer, Control, CountedTree, Device, Hit, Limits, QueueKind, RaySource, Scene, Scheduling, Stream,
    StreamKind, StreamSpec, TestCounts, Walk,
};
use rt_bvh::Builder;
use rt_sched::sample::Fraction;
use rt_verify::rays::RayMaker;
use rt_verify::{shapes, tree};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

pub(crate) const QUEUES: [QueueKind; 3] = [QueueKind::Static, QueueKind::Central, QueueKind::Hybrid];

/// What outputs hold before a run: no device reports it.
pub(crate) const UNTOUCHED: Hit = Hit { t: -1.0, u: -1.0, v: -1.0, primitive: 0xdead };

/// Runs after which a device has certainly got something to do: on a busy machine the others may be done before.
pub(crate) const TRIES: usize = 100;

/// Far longer than a test may take: who waits so long fails it.
pub(crate) const FOR_EVER: Duration = Duration::from_secs(100_000);

pub(crate) struct Fixture {
    pub(crate) scene: Arc<Scene>,
    pub(crate) stream: Stream,
    pub(crate) hits: Vec<Hit>,
    pub(crate) counts: Vec<TestCounts>,
}

pub(crate) fn fixture() -> &'static Fixture {
    static FIXTURE: OnceLock<Fixture> = OnceLock::new();
    FIXTURE.get_or_init(|| {
        let triangles = [shapes::grid(24, 0.2, 1), shapes::soup(300, 0.2, 2)].concat();
        let rays = RayMaker::new(&triangles, 5).mixed(3_001);
        let scene = tree::build(&triangles, Builder::Sah).expect("a scene");
        let spec = StreamSpec { counts: true, counted: CountedTree::Scene, ..StreamSpec::default() };
        let (hits, counts) = tree::trace(&scene, spec, &rays);
        let (rays, origins): (Vec<_>, Vec<_>) = rays.into_iter().unzip();
        let source = RaySource::Explicit { rays: rays.into(), origins: Some(origins.into()) };
        let stream = Stream::new(source, StreamKind::Custom, spec).with_task_size(61);
        Fixture { scene, stream, hits, counts }
    })
}

/// Processors of one thread each, the same ones for all tests.
pub(crate) fn cpus(number: usize) -> Vec<Arc<dyn Device>> {
    static DEVICES: OnceLock<Vec<Arc<dyn Device>>> = OnceLock::new();
    let open = || {
        let devices = CpuDevice::open_all(&[1; 4]).expect("threads");
        devices.into_iter().map(|device| Arc::new(device) as Arc<dyn Device>).collect()
    };
    DEVICES.get_or_init(open)[..number].to_vec()
}

pub(crate) fn cpu() -> Arc<dyn Device> {
    cpus(1).remove(0)
}

pub(crate) fn faulty(fault: Fault) -> Arc<Faulty> {
    Arc::new(Faulty::new(cpu(), fault))
}

/// A device that has the fault, and one that has none.
pub(crate) fn beside_a_good_one(fault: Fault) -> (Arc<Faulty>, Balancer) {
    let bad = faulty(fault);
    let balancer = balancer(&[Arc::clone(&bad) as Arc<dyn Device>, cpus(2).remove(1)]);
    (bad, balancer)
}

pub(crate) fn balancer(devices: &[Arc<dyn Device>]) -> Balancer {
    Balancer::new(Arc::clone(&fixture().scene), devices).expect("a balancer")
}

/// Limits within which a device is late soon, but never lost.
pub(crate) fn impatient() -> Limits {
    let soon = Duration::from_millis(20);
    Limits { ready: soon, late: soon, lost: FOR_EVER }
}

/// Nobody is late.
pub(crate) fn patient() -> Limits {
    Limits { ready: FOR_EVER, late: FOR_EVER, lost: FOR_EVER }
}

/// Samples a sixteenth of the rays in full, so that every call of a device is made.
pub(crate) fn sampling(queue: QueueKind, limits: Limits) -> Scheduling {
    let sixteenth = Fraction::new(1.0 / 16.0).expect("a fraction");
    Scheduling {
        queue: Box::new(queue),
        limits,
        estimator: Box::new(Sampled::new(Walk::Full, sixteenth)),
        ..Scheduling::default()
    }
}

/// Asks for no sample.
pub(crate) fn uniform(queue: QueueKind, limits: Limits) -> Scheduling {
    Scheduling { queue: Box::new(queue), limits, estimator: Box::new(Uniform), ..Scheduling::default() }
}

/// Traces the stream and checks every bit of a run that says it went well, and every finished task of one that does
/// not.
pub(crate) fn trace(
    what: &str,
    balancer: &mut Balancer,
    scheduling: &mut Scheduling,
    control: Control<'_>,
) -> Result<StreamRun, BalanceError> {
    let Fixture { stream, hits, counts, .. } = fixture();
    let mut found = vec![UNTOUCHED; hits.len()];
    let mut counted = vec![TestCounts::default(); hits.len()];
    let answer = balancer.trace(stream, scheduling, &mut found, Some(&mut counted), control);
    match &answer {
        Ok(run) => {
            assert_eq!(bits(&found), bits(hits), "{what}: other hits than on one device");
            assert_eq!(&counted, counts, "{what}: other counts than on one device");
            let finished: u32 = run.report.devices.iter().map(|device| device.tasks).sum();
            assert_eq!(finished, run.report.tasks, "{what}: tasks are told of twice, or not at all");
        }
        Err(_) => {
            for (found, right) in found.iter().zip(hits) {
                let is_right = bits(&[*found]) == bits(&[*right]);
                assert!(*found == UNTOUCHED || is_right, "{what}: {found:?} where {right:?} is right");
            }
        }
    }
    answer
}

/// [`trace`] where nothing may go wrong.
pub(crate) fn trace_well(what: &str, balancer: &mut Balancer, scheduling: &mut Scheduling) -> StreamRun {
    trace(what, balancer, scheduling, Control::default()).unwrap_or_else(|error| panic!("{what}: {error}"))
}

/// Traces until the first device has failed, and returns the reason. Every run has to be right.
pub(crate) fn until_it_fails(what: &str, balancer: &mut Balancer, scheduling: &mut Scheduling) -> String {
    let mut run = || trace_well(what, balancer, scheduling).report.devices[0].error.clone();
    let told = std::iter::repeat_with(&mut run).take(TRIES).find_map(|error| error);
    told.unwrap_or_else(|| panic!("{what}: the report never names the device"))
}

/// The bits of hits: `==` would take −0 for 0.
pub(crate) fn bits(hits: &[Hit]) -> Vec<[u32; 4]> {
    hits.iter().map(|h| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.primitive]).collect()
}
