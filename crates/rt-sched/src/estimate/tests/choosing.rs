//! How much to sample, and whom to believe.

use super::*;
use crate::policy::{Lpt, Policy};
use crate::queue::StaticQueue;
use crate::simulate::Simulation;
use rt_core::StreamRecord;

/// A stream of 256 tasks, most of which cost little and alike; a tenth of it is expensive and noisy.
fn patchy(ray: u32) -> TestCounts {
    let task = ray / 1_024;
    let [a, b] = random::pair(31, ray, 0);
    let tests = if task % 10 == 3 { 40.0 + 700.0 * a * b } else { 30.0 + 4.0 * a };
    TestCounts { boxes: tests as u32, triangles: 2 }
}

/// Tests on the latest of `devices` devices, sampling included, where a walked ray costs `price` times a traced one.
fn makespan(estimator: &mut dyn CostEstimator, devices: u32, price: f64, seed: u32) -> f64 {
    let tasks = tasks_of(256 * 1_024, 1_024);
    let stream = RayStream { devices, ..super::stream(StreamKind::Diffuse(0), &tasks, seed) };
    let (work, walked) = estimate(estimator, stream, &patchy);
    estimator.finish(&StreamRecord {
        stream,
        walked_rays: walked as u64,
        walk_s: walked as f64 * price,
        host_s: 0.0,
        traced_rays: u64::from(stream.rays()),
        trace_s: f64::from(stream.rays()),
    });
    let truths: Vec<f64> = tasks.iter().map(|&task| truth(task, &patchy)).collect();
    let models = vec![CostModel::UNIT; devices as usize];
    let queue = StaticQueue::new(&Lpt.schedule(&work, &models));
    let simulation = Simulation { hand_over_s: 0.0, pop_s: 0.0, ..Simulation::default() };
    let run = simulation.run(&queue, devices as usize, &|_, task| truths[task as usize]);
    let of_ray = truths.iter().sum::<f64>() / f64::from(stream.rays());
    run.makespan_s + walked as f64 * (price - 1.0) * of_ray / f64::from(devices)
}

/// Devices, what a walked ray costs beside a traced one, and by how much the adaptive makespan may exceed that of the
/// best of four fixed fractions, which is known only afterwards. Over 128 seeds it does so by 0.2, 0.7, 0.4 and 1.5 ±
/// 0.3%: in the last case the first sample, one ray in 256, would have been enough, and a second that seems worth its
/// price is not.
const WORTH: [(u32, f64, f64); 4] = [(4, 1.1, 1.01), (4, 3.0, 1.01), (16, 1.1, 1.01), (16, 6.0, 1.02)];

/// On the simulator, sampling as long as it pays comes as near to the best fixed fraction as [`WORTH`] says, whatever a
/// walk costs, and no fixed fraction does so for every price.
///
/// Mutants: an allocation in proportion to the tasks' rays; `best` without the price; a gain that is never enough.
#[test]
fn adaptive_samples_are_worth_their_price() {
    let seeds: Vec<u32> = (1..=16).collect();
    let mean = |make: &dyn Fn() -> Box<dyn CostEstimator>, devices, price| {
        let one = |&seed: &u32| {
            let mut estimator = make();
            // The first stream teaches the price.
            makespan(&mut *estimator, devices, price, seed + 100);
            makespan(&mut *estimator, devices, price, seed)
        };
        seeds.iter().map(one).sum::<f64>() / seeds.len() as f64
    };
    let mut fixed_will_do = [true; 4];
    for (devices, price, bound) in WORTH {
        let adaptive = mean(&|| Box::new(Adaptive::default()), devices, price);
        let fixed = [1.0 / 256.0, 1.0 / 64.0, 1.0 / 16.0, 1.0 / 4.0].map(|f| {
            let fraction = Fraction::new(f).expect("valid");
            mean(&|| Box::new(Sampled::new(Walk::Full, fraction)), devices, price)
        });
        let best = fixed.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(adaptive < bound * best, "{devices} devices, price {price}: {adaptive} against {fixed:?}");
        for (will_do, own) in fixed_will_do.iter_mut().zip(fixed) {
            *will_do &= own < bound * best;
        }
    }
    assert_eq!(fixed_will_do, [false; 4]);
}

/// Samples go where intervals are wide, and nowhere when there is nothing to balance.
///
/// Mutants: an allocation in proportion to the tasks' rays; `late` of one device that is not 0.
#[test]
fn adaptive_samples_go_where_they_are_needed() {
    let tasks = tasks_of(256 * 1_024, 1_024);
    let walked_in = |devices: u32| {
        let stream = RayStream { devices, ..super::stream(StreamKind::Diffuse(0), &tasks, 9) };
        let mut walked = vec![0_u32; tasks.len()];
        let mut estimator = Adaptive::default();
        let (mut rays, mut counts) = (Vec::new(), Vec::new());
        loop {
            match estimator.next(stream, Observation { rays: &rays, counts: &counts }) {
                Step::Done(work) => return (walked, work),
                Step::Sample { rays: asked, .. } => {
                    asked.iter().for_each(|ray| walked[*ray as usize / 1_024] += 1);
                    counts = asked.iter().map(|&ray| patchy(ray)).collect();
                    rays = asked;
                }
            }
        }
    };
    let (walked, work) = walked_in(16);
    let mean = |noisy: bool| {
        let own: Vec<u32> = (0..256).filter(|t| (t % 10 == 3) == noisy).map(|t| walked[t]).collect();
        f64::from(own.iter().sum::<u32>()) / own.len() as f64
    };
    assert!(mean(true) > 4.0 * mean(false), "{} {}", mean(true), mean(false));
    assert!(work.iter().all(|w| w.std_error().is_some()));
    assert_eq!(walked_in(1).0, [4; 256]);
}

/// A launch of all tasks that took what their exact tests say, and the end of the stream.
fn run(auto: &mut Auto, stream: RayStream<'_>, work: &[Work], counts: &dyn Fn(u32) -> TestCounts, walked: usize) {
    let outcome = |(id, task): (u32, &Task)| TaskOutcome {
        task: id,
        predicted_s: f64::from(work[id as usize].tests()),
        measured_s: truth(*task, counts),
    };
    let outcomes: Vec<TaskOutcome> = (0..).zip(stream.tasks).map(outcome).collect();
    auto.learn(&LaunchRecord { stream, work, device: 0, outcomes: &outcomes, per_task: true });
    let trace_s = f64::from(stream.rays());
    let walk_s = 2.0 * walked as f64;
    auto.finish(&StreamRecord {
        stream,
        walked_rays: walked as u64,
        walk_s,
        host_s: 0.0,
        traced_rays: stream.rays().into(),
        trace_s,
    });
}

/// Mutants: a past that is never believed; one that is never put to the test; a price that is not learned; trials in
/// every stream.
#[test]
fn auto_keeps_to_its_budget_and_to_what_predicts_best() {
    let tasks = tasks_of(64 * 256, 256);
    let mut auto = Auto::default();
    let mut walks = Vec::new();
    for seed in 0..17 {
        let stream = super::stream(StreamKind::Primary, &tasks, seed);
        let (work, walked) = estimate(&mut auto, stream, &primary);
        walks.push((auto.chosen(), walked));
        run(&mut auto, stream, &work, &primary, walked);
    }
    // A price of 3 is assumed, and 2 measured.
    assert_eq!(walks[0], ("exact", 64));
    let fraction = auto.fraction(super::stream(StreamKind::Primary, &tasks, 1)).expect("much to gain");
    assert!((fraction.value() - 0.005).abs() < 2e-3);
    // Streams repeat exactly here: nothing predicts them better than the past.
    assert!(walks[1..].iter().all(|walk| walk.0 == "history"));
    let tried: Vec<usize> = (0..17).filter(|&seed| walks[seed].1 > 0).collect();
    assert_eq!(tried, [0, 1, 9], "every eighth stream is a trial");
    // Another kind of stream has a past of its own.
    let diffuse_stream = super::stream(StreamKind::Diffuse(0), &tasks, 1);
    assert!(estimate(&mut auto, diffuse_stream, &diffuse).1 > 0);
    assert_eq!(auto.name(), "auto");
}

/// Device seconds of estimates beyond what tracing their rays would have taken, as a share of the trace of `streams`
/// streams; and the share of rays walked in each. A traced ray takes a second, a walked one `price`, the host `host`
/// for each.
fn spent(
    auto: &mut Auto,
    stream: &dyn Fn(u32) -> RayStream<'static>,
    streams: u32,
    price: f64,
    host: f64,
) -> (f64, Vec<f64>) {
    let (mut cost, mut all, mut shares) = (0.0, 0.0, Vec::new());
    for seed in 0..streams {
        let stream = stream(seed);
        let (work, walked) = estimate(auto, stream, &primary);
        let rays = f64::from(stream.rays());
        let walked = walked as f64;
        let outcome = |(id, task): (u32, &Task)| TaskOutcome {
            task: id,
            predicted_s: f64::from(work[id as usize].tests()),
            measured_s: truth(*task, &primary),
        };
        let outcomes: Vec<TaskOutcome> = (0..).zip(stream.tasks).map(outcome).collect();
        auto.learn(&LaunchRecord { stream, work: &work, device: 0, outcomes: &outcomes, per_task: true });
        let host_s = host * walked;
        auto.finish(&StreamRecord {
            stream,
            walked_rays: walked as u64,
            walk_s: price * walked,
            host_s,
            traced_rays: (rays - walked) as u64,
            trace_s: rays - walked,
        });
        cost += (price - 1.0) * walked + host_s;
        all += rays;
        shares.push(walked / rays);
    }
    (cost / all, shares)
}

/// Whatever samples cost, all estimates together cost what the budget allows, but for the first one, of which nothing
/// is known, and the least samples of streams without a past. Trials are of a quarter of the tasks.
///
/// Mutants: a host that costs nothing; a past that has to wait for its trial; trials of all tasks.
#[test]
fn auto_pays_its_debts() {
    let tasks: &'static [Task] = Vec::leak(tasks_of(256 * 1_024, 1_024));
    let repeated = |seed| super::stream(StreamKind::Primary, tasks, seed);
    for (price, host) in [(1.5, 0.0), (3.0, 0.5), (2.0, 9.0), (9.0, 4.0)] {
        let (cost, shares) = spent(&mut Auto::default(), &repeated, 32, price, host);
        assert!(cost <= 0.005, "{price} {host}: {cost}");
        let trials: Vec<f64> = shares[1..].iter().copied().filter(|share| *share > 0.0).collect();
        assert!((2..=4).contains(&trials.len()), "{price} {host}: {shares:?}");
        for share in trials {
            assert!(share * (price - 1.0 + host) <= 0.005, "{price} {host}: {shares:?}");
            assert!(share < 0.3 * 0.005 / (price - 1.0 + host) || share < 0.3 / 1_024.0, "{price} {host}: {shares:?}");
        }
        // Every stream is another part of the picture: no past, and samples in each of them.
        let parts = |seed| RayStream { wave: seed, ..repeated(seed) };
        let (cost, shares) = spent(&mut Auto::default(), &parts, 32, price, host);
        assert!(cost <= 0.0055_f64.max(1.1 * (price - 1.0 + host) / 1_024.0), "{price} {host}: {cost}");
        assert!(shares.iter().all(|share| *share > 0.0));
    }
}

/// Prices that change from stream to stream are believed too late, and cost more than is saved when they fall.
///
/// Mutant: debts that are forgotten.
#[test]
fn auto_pays_for_prices_it_believed() {
    let tasks: &'static [Task] = Vec::leak(tasks_of(256 * 1_024, 1_024));
    let parts = |seed| RayStream { wave: seed, ..super::stream(StreamKind::Primary, tasks, seed) };
    let mut auto = Auto::default();
    let [cheap, expensive] = [1.5, 4.0];
    let cost: f64 =
        (0..32).map(|i| spent(&mut auto, &|_| parts(i), 1, if i % 2 == 0 { cheap } else { expensive }, 0.0).0).sum();
    assert!(cost / 32.0 <= 0.0055, "{}", cost / 32.0);
}

/// An estimate costs no more than half of what can be gained, and none is made where that is too little.
///
/// Mutants: `STAKE` of 2; a host that costs nothing; `counts_tests` that is always true.
#[test]
fn auto_estimates_nothing_where_nothing_pays() {
    let tasks = tasks_of(256 * 1_024, 1_024);
    let stream = |uninformed_excess| RayStream { uninformed_excess, ..super::stream(StreamKind::Primary, &tasks, 1) };
    let mut auto = Auto::default();
    // At the assumed price of 3, and two devices that wait for the host, four samples a task cost 0.86% of the trace.
    for (wave, (excess, walks)) in (0..).zip([(0.05, true), (0.018, true), (0.016, false), (0.0, false)]) {
        let stream = RayStream { wave, ..stream(excess) };
        let (work, walked) = estimate(&mut auto, stream, &primary);
        assert_eq!((walked > 0, auto.counts_tests()), (walks, walks), "{excess}");
        assert_eq!(auto.chosen() == "uniform", !walks);
        assert_eq!(work.len(), tasks.len());
    }
    // Cheaper samples make smaller gains worth them; what the host does makes them more expensive.
    let finish = |auto: &mut Auto, host_s| {
        let (stream, n) = (stream(1.0), 1_000);
        let seconds = StreamRecord { stream, walked_rays: n, walk_s: 1.1, traced_rays: n, trace_s: 1.0, host_s };
        (0..9).for_each(|_| auto.finish(&seconds));
    };
    let near = |found: Option<Fraction>, wanted: f64| (found.expect("pays").value() / wanted - 1.0).abs() < 0.01;
    finish(&mut auto, 0.0);
    assert!(near(auto.fraction(stream(0.002)), 0.001 / 0.1));
    finish(&mut auto, 0.4);
    assert!(auto.fraction(stream(0.002)).is_none());
    // Those streams were half samples, and left a debt.
    let (trace_s, traced_rays) = (1e4, 10_000_000);
    auto.finish(&StreamRecord { stream: stream(1.0), walked_rays: 0, walk_s: 0.0, traced_rays, trace_s, host_s: 0.0 });
    assert!(near(auto.fraction(stream(1.0)), 0.005 / 0.5), "the budget");
}

/// A past that no longer holds is given up after a trial on a quarter of the tasks.
///
/// Mutants: a past that is always believed; a part that is compared with all that was measured.
#[test]
fn auto_leaves_a_past_that_is_wrong() {
    let tasks = tasks_of(256 * 1_024, 1_024);
    let mut auto = Auto::default();
    for seed in 0..12 {
        // Every frame is expensive elsewhere.
        let counts = |ray: u32| TestCounts {
            boxes: (60.0 + 50.0 * libm::sinf((ray + 7_919 * seed) as f32 / 5_000.0)) as u32,
            triangles: 4,
        };
        let stream = super::stream(StreamKind::Primary, &tasks, seed);
        let (work, walked) = estimate(&mut auto, stream, &counts);
        assert!(seed == 1 || walked > 0, "frame {seed}");
        assert_eq!(auto.chosen() == "history", seed == 1, "frame {seed}");
        run(&mut auto, stream, &work, &counts, walked);
    }
}

/// What predicted measured seconds best makes the next estimate: the map, where tasks that follow each other lie in
/// different places.
///
/// Mutants: the worse of the two in `Auto::sampling_arm`; errors of the chosen arm only.
#[test]
fn auto_believes_the_map_where_it_predicts_better() {
    let source = super::learned::scattered(4, 128);
    let counts = |ray| super::learned::cost(&source, ray);
    let tasks = tasks_of(source.len(), 512);
    let mut auto = Auto::default();
    for seed in 0..4 {
        // Every stream is another part of the picture, so none has a past.
        let stream =
            RayStream { source: Some(&source), wave: seed, ..super::stream(StreamKind::Diffuse(0), &tasks, seed) };
        let (work, walked) = estimate(&mut auto, stream, &counts);
        // Nothing is known in the first stream, and the second is the trial.
        assert_eq!(auto.chosen(), if seed < 2 { "exact" } else { "field" }, "stream {seed}");
        run(&mut auto, stream, &work, &counts, walked);
    }
}
