//! How much to sample, and whom to believe.

use super::*;
use rt_core::StreamRecord;

/// A launch of each half of the tasks on a device of its own, the second of which is half as fast, by which task `t`
/// took `factor(t)` times what was predicted; and the end of the stream.
fn run(auto: &mut Auto, stream: RayStream<'_>, work: &[Work], factor: &dyn Fn(u32) -> f64, walk_price: f64) {
    let half = work.len() / 2;
    for (device, tasks) in [0..half, half..work.len()].into_iter().enumerate() {
        let outcome = |task: usize| {
            let predicted_s = f64::from(work[task].tests());
            let speed = 1.0 / (device + 1) as f64;
            TaskOutcome { task: task as u32, predicted_s, measured_s: predicted_s * factor(task as u32) / speed }
        };
        let outcomes: Vec<TaskOutcome> = tasks.map(outcome).collect();
        auto.learn(&LaunchRecord { stream, work, device, outcomes: &outcomes, per_task: true });
    }
    let (walked_rays, traced_rays) = (100, u64::from(stream.rays()));
    auto.finish(&StreamRecord {
        stream,
        walked_rays,
        walk_s: walk_price * walked_rays as f64,
        host_s: 0.0,
        traced_rays,
        trace_s: traced_rays as f64,
    });
}

/// A stream of so many tasks of 1,024 rays on two devices.
fn regime(tasks: &[Task], moves: bool, uninformed_excess: f64) -> RayStream<'_> {
    RayStream { moves, uninformed_excess, ..super::stream(StreamKind::Primary, tasks, 1) }
}

/// Samples are made where they win more than they cost, two for each task, and nowhere else.
///
/// Mutants: `left` of no error; `STAKE` of 2; `SAMPLES` of 4.
#[test]
fn auto_samples_only_where_that_wins() {
    for (each, moves, loss, sampled) in [
        (2, true, 0.5, true),
        (15, true, 0.05, true),
        (512, false, 0.05, true),
        // At the assumed price of 7, and two devices that wait for the host, two samples a task cost 1.37%, and leave
        // 0.36% lost.
        (512, true, 0.024, true),
        (512, true, 0.023, false),
        // With 15 tasks a device they leave 2.1%.
        (15, true, 0.042, true),
        (15, true, 0.04, false),
    ] {
        let tasks = tasks_of(2 * each * 1_024, 1_024);
        let mut auto = Auto::default();
        let (work, walked) = estimate(&mut auto, regime(&tasks, moves, loss), &primary);
        assert_eq!(walked, if sampled { 2 * tasks.len() } else { 0 }, "{each} {moves} {loss}");
        assert_eq!(auto.chosen(), if sampled { "exact" } else { "uniform" });
        assert_eq!((work.len(), auto.counts_tests()), (tasks.len(), sampled));
        let reason = auto.reason().expect("it has a choice");
        let number = std::format!("{each} tasks a device");
        assert!(reason.contains(&number), "{reason}");
    }
}

/// Mutant: one device told what its tasks would lose, and that knowing better does not pay.
#[test]
fn one_device_has_nothing_to_balance() {
    let tasks = tasks_of(1 << 16, 1_024);
    let mut auto = Auto::default();
    let (_, walked) = estimate(&mut auto, RayStream { devices: 1, ..regime(&tasks, true, 0.0) }, &primary);
    assert_eq!((walked, auto.chosen()), (0, "uniform"));
    assert!(auto.reason().expect("it has a choice").starts_with("there is one device"), "{:?}", auto.reason());
}

/// Mutants: samples asked for that nobody walks; the reason of streams that have some.
#[test]
fn where_nobody_walks_there_are_no_samples() {
    let tasks = tasks_of(4 << 10, 1_024);
    let mut auto = Auto::default();
    let stream = RayStream { has_walks: false, ..regime(&tasks, true, 0.5) };
    let (work, walked) = estimate(&mut auto, stream, &primary);
    assert_eq!((work.len(), walked, auto.chosen()), (tasks.len(), 0, "uniform"));
    assert!(auto.reason().is_some_and(|reason| reason.starts_with("no device counts")), "{:?}", auto.reason());
    // What was measured is a past all the same.
    run(&mut auto, stream, &work, &|_| 1.0, 1.0);
    assert_eq!((estimate(&mut auto, stream, &primary).1, auto.chosen()), (0, "history"));
}

/// Of tasks of many rays as many samples are taken as samplers take at least, and paid for.
///
/// Mutants: two samples of each, which is no share of rays that there is; their price that of two.
#[test]
fn large_tasks_have_more_samples() {
    let tasks = tasks_of(8 << 16, 1 << 16);
    for (loss, walked) in [(0.045, 8 * 16), (0.043, 0)] {
        assert_eq!(estimate(&mut Auto::default(), regime(&tasks, true, loss), &primary).1, walked, "{loss}");
    }
}

/// The price of samples is measured.
///
/// Mutant: a price that is not learned.
#[test]
fn auto_learns_what_samples_cost() {
    let tasks = tasks_of(24 * 1_024, 1_024);
    let samples = |walk_price| {
        let mut auto = Auto::default();
        let stream = regime(&tasks, true, 0.045);
        let (work, walked) = estimate(&mut auto, stream, &primary);
        assert_eq!(walked, 48);
        (0..9).for_each(|_| run(&mut auto, stream, &work, &|_| 1.0, walk_price));
        estimate(&mut auto, RayStream { wave: 1, ..stream }, &primary).1
    };
    assert_eq!([samples(1.1), samples(9.9)], [48, 0]);
}

/// Every stream leaves a past, one without an estimate too, and that tells tasks apart however fast the device was.
///
/// Mutants: a past that is kept of estimates only; `typical` of all devices together; corrections of a factor of 4 at
/// most where nothing was known; work that is not scaled back.
#[test]
fn auto_learns_from_every_stream() {
    let tasks = tasks_of(256 * 1_024, 1_024);
    let stream = regime(&tasks, true, 0.01);
    let mut auto = Auto::default();
    let (work, _) = estimate(&mut auto, stream, &primary);
    assert_eq!(auto.chosen(), "uniform");
    let factor = |task: u32| if task % 10 == 3 { 12.0 } else { 1.0 + 0.1 * f64::from(task % 7) };
    let token = auto.counts();
    assert_eq!(token, Uniform.counts(), "its prices are those of rays");
    run(&mut auto, stream, &work, &factor, 1.0);
    let (past, walked) = estimate(&mut auto, stream, &primary);
    assert_eq!((auto.chosen(), walked, auto.counts()), ("history", 0, token));
    let scale = past[0].tests() / work[0].tests() / factor(0) as f32;
    let near = |(task, (new, old)): (u32, (&Work, &Work))| {
        let ratio = new.tests() / old.tests() / factor(task) as f32 / scale;
        // The two devices' typical factors may be neighbours among seven.
        (0.85..1.18).contains(&ratio)
    };
    assert!((0..).zip(past.iter().zip(&work)).all(near));
    let tests = |work: &[Work]| work.iter().map(|work| f64::from(work.tests())).sum::<f64>();
    assert!((tests(&past) / tests(&work) - 1.0).abs() < 1e-4);
    assert!(past.iter().all(|work| work.std_error().is_none()), "it was not put to the test yet");
    // From then on corrections are small, and errors known.
    run(&mut auto, stream, &past, &|task| 1.0 + 0.1 * f64::from(task % 2), 1.0);
    let (past, _) = estimate(&mut auto, stream, &primary);
    let error = past[7].std_error().expect("measured") / past[7].tests();
    assert!((0.02..0.1).contains(&error), "{error}");
    // Another kind has no past.
    let other = RayStream { kind: StreamKind::Diffuse(0), ..stream };
    estimate(&mut auto, other, &diffuse);
    assert_eq!((auto.name(), auto.chosen()), ("auto", "uniform"));
}

/// Mutant: a past of no tasks, from which the next stream is thought to be known.
#[test]
fn a_stream_without_tasks_leaves_no_past() {
    let tasks = tasks_of(256 * 1_024, 1_024);
    for mut estimator in [Box::new(Auto::default()) as Box<dyn CostEstimator>, Box::new(History::default())] {
        estimate(&mut *estimator, super::stream(StreamKind::Custom, &[], 1), &diffuse);
        let (after, walked) = estimate(&mut *estimator, super::stream(StreamKind::Custom, &tasks, 2), &diffuse);
        let mut fresh: Box<dyn CostEstimator> = match estimator.name() {
            "auto" => Box::new(Auto::default()),
            _ => Box::new(History::default()),
        };
        let expected = estimate(&mut *fresh, super::stream(StreamKind::Custom, &tasks, 2), &diffuse);
        assert_eq!((after, walked, estimator.chosen()), (expected.0, expected.1, fresh.chosen()));
    }
}
