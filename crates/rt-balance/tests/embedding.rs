//! What renderers and viewers ask beside tracing: results as they arrive, estimates alone, and that calls learn.

use rt_balance::cpu::CpuDevice;
use rt_balance::estimators::{History, Sampled, Uniform};
use rt_balance::report::ActivityKind;
use rt_balance::sample::Fraction;
use rt_balance::{
    Balancer, Control, Device, Hit, Ray, RaySource, Scheduling, Stream, StreamKind, StreamSpec, TestCounts, Walk,
};
use std::cell::RefCell;
use std::sync::Arc;

/// A wavy sheet over the unit square, on two devices.
fn balancer() -> Balancer {
    const SIDE: u32 = 33;
    let at = |i: u32| i as f32 / (SIDE - 1) as f32;
    let point = |i: u32| [at(i % SIDE), at(i / SIDE), (at(i % SIDE) * 20.0).sin() * 0.1];
    let positions: Vec<[f32; 3]> = (0..SIDE * SIDE).map(point).collect();
    let corner = (0..SIDE * SIDE).filter(|i| i % SIDE < SIDE - 1 && i / SIDE < SIDE - 1);
    let indices: Vec<[u32; 3]> = corner.flat_map(|i| [[i, i + 1, i + SIDE], [i + 1, i + SIDE + 1, i + SIDE]]).collect();
    let devices = CpuDevice::open_all(&[1, 1]).expect("two CPU devices");
    let devices: Vec<Arc<dyn Device>> = devices.into_iter().map(|device| Arc::new(device) as _).collect();
    Balancer::for_mesh(&positions, &indices, &devices).expect("a sheet can be built")
}

/// From above onto the sheet and beside it.
fn rays() -> Vec<Ray> {
    let ray =
        |i: u32| Ray::new([(i % 100) as f32 / 90.0, (i / 100) as f32 / 90.0, 1.0].into(), [0.1, 0.2, -1.0].into());
    (0..10_000).map(ray).collect()
}

fn stream(spec: StreamSpec) -> Stream {
    let source = RaySource::Explicit { rays: rays().into(), origins: None };
    Stream::new(source, StreamKind::Custom, spec).with_task_size(300)
}

fn exact(fraction: f64) -> Scheduling {
    let estimator = Sampled::new(Walk::Full, Fraction::new(fraction).expect("a share"));
    Scheduling { estimator: Box::new(estimator), ..Scheduling::default() }
}

/// Mutants: a task that is told before its hits are written, or with another's; hits that the estimate found left out.
#[test]
fn every_task_is_told_with_its_final_results() {
    let mut balancer = balancer();
    let stream = stream(StreamSpec { counts: true, ..StreamSpec::default() });
    for scheduling in [&mut exact(0.25), &mut Scheduling { estimator: Box::new(Uniform), ..Scheduling::default() }] {
        let told = RefCell::new(Vec::new());
        let finished = |now: rt_balance::Finished<'_>| {
            told.borrow_mut().push((now.task, now.hits.to_vec(), now.counts.unwrap().to_vec()));
        };
        let control = Control { finished: Some(&finished), ..Control::default() };
        let mut hits = vec![Hit::MISS; 10_000];
        let mut counts = vec![TestCounts::default(); 10_000];
        balancer.trace(&stream, scheduling, &mut hits, Some(&mut counts), control).unwrap();
        let mut told = told.into_inner();
        told.sort_by_key(|(task, ..)| task.first);
        assert_eq!(told.iter().map(|(task, ..)| *task).collect::<Vec<_>>(), stream.tasks);
        assert_eq!(told.iter().flat_map(|(_, hits, _)| hits).copied().collect::<Vec<_>>(), hits);
        assert_eq!(told.iter().flat_map(|(_, _, counts)| counts).copied().collect::<Vec<_>>(), counts);
        assert!(hits.iter().any(Hit::is_hit) && hits.iter().any(|hit| !hit.is_hit()));
    }
}

/// Mutants: an estimate of some other stream's tasks; one that traces; predictions in another device's place.
#[test]
fn an_estimate_alone_is_what_tracing_counts() {
    let mut balancer = balancer();
    let stream = stream(StreamSpec { counts: true, ..StreamSpec::default() });
    let estimate = balancer.estimate(&stream, &mut exact(1.0), Control::default()).unwrap();
    assert_eq!((estimate.work.len(), estimate.fraction), (stream.tasks.len(), 1.0));
    let mut hits = vec![Hit::MISS; 10_000];
    let mut counts = vec![TestCounts::default(); 10_000];
    balancer.trace(&stream, &mut exact(0.25), &mut hits, Some(&mut counts), Control::default()).unwrap();
    for (task, work) in stream.tasks.iter().zip(&estimate.work) {
        let counted = &counts[task.first as usize..(task.first + task.rays) as usize];
        let tests: u32 = counted.iter().map(|count| count.boxes + count.triangles).sum();
        assert_eq!(work.tests(), tests as f32);
    }
    let estimate = balancer.estimate(&stream, &mut exact(0.25), Control::default()).unwrap();
    assert_eq!(estimate.predicted_s.len(), 2);
    for predicted in &estimate.predicted_s {
        let predicted = predicted.as_ref().unwrap();
        assert!(predicted.len() == stream.tasks.len() && predicted.iter().all(|&seconds| seconds > 0.0));
    }
}

/// Walks tell how fast devices are, also where all samples would be one chunk.
///
/// Mutant: chunks of 256 rays at least.
#[test]
fn few_samples_are_walked_by_all_devices() {
    let mut balancer = balancer();
    let mut hits = vec![Hit::MISS; 10_000];
    let run = balancer.trace(&stream(StreamSpec::default()), &mut exact(0.01), &mut hits, None, Control::default());
    let walked_by = |device: usize| {
        let walks = run.as_ref().unwrap().activities.iter().filter(|activity| activity.kind == ActivityKind::Estimate);
        walks.filter(|walk| walk.device == device).map(|walk| walk.rays).sum::<u32>()
    };
    let [one, other] = [0, 1].map(walked_by);
    assert!(one + other < 256 && one.min(other) > 0, "{one} {other}");
}

/// Mutant: a new estimator for each call.
#[test]
fn tracing_rays_learns() {
    let mut balancer = balancer();
    let first = Box::new(Sampled::new(Walk::Full, Fraction::SIXTY_FOURTH));
    balancer.scheduling().estimator = Box::new(History::new(first));
    let rays: Arc<[Ray]> = rays().into();
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut fraction = || balancer.trace_shared(Arc::clone(&rays), &mut hits).unwrap().report.estimate.fraction;
    assert!(fraction() > 0.0);
    assert_eq!(fraction(), 0.0);
}
