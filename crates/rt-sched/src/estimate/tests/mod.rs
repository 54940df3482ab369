//! Estimators against counts that are known.

mod choosing;

use super::*;
use crate::sample::{Fraction, RaySampler};
use crate::test_support::{diffuse, estimate, stream, truth};
use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;
use proptest::prelude::*;
use rt_core::{
    LaunchRecord, ReducedWalk, StreamKind, StreamRecord, Task, TaskOutcome, TestCounts, Walk, random, tasks_of,
};

/// Counts that change slowly along the stream, with some noise, as primary rays have.
fn primary(ray: u32) -> TestCounts {
    let slow = libm::sinf(ray as f32 / 150.0) + libm::sinf(ray as f32 / 37.0);
    let [a, _] = random::pair(4, ray, 0);
    TestCounts { boxes: (60.0 + 20.0 * slow + 20.0 * a) as u32, triangles: 5 }
}

/// Mutant: rays that have a price beside their test's, which would make half of every difference vanish.
#[test]
fn uniform_work_is_a_test_for_each_ray() {
    let tasks = tasks_of(10, 4);
    let (work, walked) = estimate(&mut Uniform, stream(StreamKind::Custom, &tasks, 0), &diffuse);
    assert_eq!(work.iter().map(Work::boxes).collect::<Vec<_>>(), [4.0, 4.0, 2.0]);
    assert!(work.iter().all(|work| work.rays() == 0.0));
    assert_eq!(walked, 0);
}

#[test]
fn names_tell_the_walk() {
    assert_eq!(Sampled::new(Walk::Full, Fraction::ONE).name(), "exact");
    for (reading, name) in [(ReducedWalk::LeafAsHit, "reduced"), (ReducedWalk::Unshortened, "reduced-unshortened")] {
        let mut reduced = Sampled::new(Walk::Reduced(reading), Fraction::EIGHTH);
        assert_eq!(reduced.name(), name);
        let tasks = tasks_of(64, 64);
        match reduced.next(stream(StreamKind::Primary, &tasks, 1), Observation::default()) {
            Step::Sample { rays, walk } => assert_eq!((rays.len(), walk), (8, Walk::Reduced(reading))),
            Step::Done(_) => panic!("nothing was walked yet"),
        }
    }
}

#[test]
fn a_stream_that_was_abandoned_is_begun_anew() {
    let mut estimator = Sampled::new(Walk::Full, Fraction::EIGHTH);
    let tasks = tasks_of(640, 64);
    let stream = stream(StreamKind::Primary, &tasks, 1);
    let first = estimator.next(stream, Observation::default());
    assert_eq!(estimator.next(stream, Observation::default()), first);
    let (rays, counts) = ([1, 2, 3], [TestCounts::default(); 3]);
    assert_eq!(estimator.next(stream, Observation { rays: &rays, counts: &counts }), first, "an answer to nothing");
    assert_eq!(estimate(&mut estimator, stream, &primary).0.len(), 10);
    assert_eq!(estimate(&mut estimator, stream, &primary).1, 80, "the same estimator serves the next stream");
    for tasks in [vec![], vec![Task { first: 0, rays: 0 }]] {
        let empty = RayStream { tasks: &tasks, ..stream };
        assert_eq!(estimate(&mut estimator, empty, &primary), (vec![Work::default(); tasks.len()], 0));
    }
}

/// Share of 4,000 trials in which the 95% interval holds the truth.
fn coverage(kind: StreamKind, fraction: f64, counts: &dyn Fn(u32) -> TestCounts) -> f64 {
    const SEEDS: u32 = 4;
    let fraction = Fraction::new(fraction).expect("valid");
    let tasks = tasks_of(1_024 * 1_000, 1_024);
    let truths: Vec<f64> = tasks.iter().map(|task| truth(*task, counts)).collect();
    let held = (0..SEEDS).map(|seed| {
        let mut estimator = Sampled::new(Walk::Full, fraction);
        let (work, _) = estimate(&mut estimator, stream(kind, &tasks, seed), counts);
        let holds = |(truth, work): &(&f64, &Work)| {
            let half = interval_95(work, fraction.of(1_024)).expect("enough samples");
            (f64::from(work.tests()) - **truth).abs() <= half
        };
        truths.iter().zip(&work).filter(holds).count()
    });
    held.sum::<usize>() as f64 / (tasks.len() * SEEDS as usize) as f64
}

/// Tasks are alike here: neighbours say almost all, of which the interval's few degrees of freedom know nothing.
///
/// Mutants: no finite population correction (fails at one half), `n` instead of `n − 1`, successive differences without
/// the 2.
#[test]
fn intervals_hold_what_they_say() {
    for fraction in [1.0 / 128.0, 1.0 / 32.0, 0.125, 0.5] {
        let random = coverage(StreamKind::Diffuse(0), fraction, &diffuse);
        assert!((0.93..=0.98).contains(&random), "random, {fraction}: {random}");
        let strided = coverage(StreamKind::Primary, fraction, &primary);
        assert!(strided >= 0.93, "strided, {fraction}: {strided}");
    }
}

/// What real scenes have: costs that rise across a task, and few expensive rays among many cheap ones, more in some
/// tasks than in others.
///
/// Mutants: strided samples at equal steps; random samples without the floor, or with the narrow window, of their
/// neighbourhood.
#[test]
fn intervals_hold_for_slopes_and_rare_dear_rays() {
    let slope = |ray: u32| TestCounts { boxes: 100 + ray % 1_024 + random::below(40, 3, ray, 0), triangles: 2 };
    let rare = |ray: u32| {
        let one_in = 10 + ray / 1_024 / 100;
        let expensive = random::below(one_in, 4, ray, 0) == 0;
        TestCounts { boxes: if expensive { 200 + random::below(200, 5, ray, 0) } else { 8 }, triangles: 1 }
    };
    for samples in [16.0, 32.0, 128.0] {
        let strided = coverage(StreamKind::Primary, samples / 1_024.0, &slope);
        assert!(strided >= 0.93, "slope, {samples}: {strided}");
        let random = coverage(StreamKind::Diffuse(0), samples / 1_024.0, &rare);
        assert!(random >= 0.93, "rare expensive rays, {samples}: {random}");
    }
}

#[test]
fn errors_of_few_samples_are_pooled_or_not_given() {
    let tasks = tasks_of(100, 100);
    for (fraction, known) in [(0.01, false), (0.02, false), (0.08, false), (0.09, true), (1.0, true)] {
        let fraction = Fraction::new(fraction).expect("valid");
        let mut estimator = Sampled::new(Walk::Full, fraction);
        let (work, _) = estimate(&mut estimator, stream(StreamKind::Diffuse(1), &tasks, 5), &diffuse);
        assert_eq!(work[0].std_error().is_some(), known, "{fraction}");
        assert_eq!(interval_95(&work[0], fraction.of(100)).is_some(), known, "{fraction}");
    }
}

/// Intervals of 1, 2 and 4 samples, whose variance is that of their neighbourhood.
///
/// Mutants: differences without the 2; a window that begins behind the task's own samples on rising noise.
#[test]
fn pooled_intervals_hold_what_they_say() {
    // Sums of eight uniform numbers: near enough to normal that even a mean of one has the interval of one.
    let even = |ray: u32| {
        let sum: f32 = (0..4).flat_map(|d| random::pair(9, ray, d)).sum();
        TestCounts { boxes: (20.0 * sum) as u32 + ray / 20_000, triangles: 3 }
    };
    for samples in [1.0, 2.0, 4.0] {
        for kind in [StreamKind::Diffuse(0), StreamKind::Primary] {
            let coverage = coverage(kind, samples / 1_024.0, &even);
            assert!((0.93..=0.985).contains(&coverage), "{kind}, {samples}: {coverage}");
        }
    }
}

/// What neighbours know helps where tasks are alike or change slowly, and hurts little where none is like the next.
///
/// Mutants: neighbours always believed; never believed; `t²` without the noise taken off (all but the first case hold
/// then); standard errors without what neighbours took away.
#[test]
fn incoherent_tasks_learn_from_their_neighbours() {
    let noisy = |ray: u32, level: f32| {
        let [a, b] = random::pair(3, ray, 0);
        TestCounts { boxes: (level * (0.2 + 2.0 * a * b)) as u32, triangles: 0 }
    };
    let alike = |ray: u32| noisy(ray, 100.0);
    let slow = |ray: u32| noisy(ray, 100.0 + 60.0 * libm::sinf((ray / 1_024) as f32 / 10.0));
    let unlike = |ray: u32| noisy(ray, if (ray / 1_024).is_multiple_of(5) { 1_000.0 } else { 100.0 });
    let tasks = tasks_of(1_024 * 400, 1_024);
    let fraction = Fraction::SIXTY_FOURTH;
    let counts: [&dyn Fn(u32) -> TestCounts; 3] = [&alike, &slow, &unlike];
    for (case, (counts, most)) in counts.into_iter().zip([0.55, 0.7, 1.05]).enumerate() {
        let (work, _) =
            estimate(&mut Sampled::new(Walk::Full, fraction), stream(StreamKind::Diffuse(0), &tasks, 7), counts);
        let (mut own, mut shrunk, mut claimed) = (0.0, 0.0, 0.0);
        for (task, work) in tasks.iter().zip(&work) {
            let mut rays = Vec::new();
            let n = RaySampler::Random.sample(*task, fraction, 7, &mut rays);
            let truth = truth(*task, counts);
            let sum: f64 = rays.iter().map(|&ray| f64::from(counts(ray).boxes)).sum();
            own += (sum * 1_024.0 / f64::from(n) / truth - 1.0).abs();
            shrunk += (f64::from(work.tests()) / truth - 1.0).abs();
            claimed += f64::from(work.std_error().expect("enough samples")) / truth;
        }
        assert!(shrunk < most * own, "{case}: {shrunk} of {own}");
        // A mean error of 0.8 standard errors, were they normal; where each task is another, all of that counts as
        // noise.
        let least = if case < 2 { 0.4 } else { 0.1 };
        assert!((least..=1.0).contains(&(shrunk / claimed)), "{case}: {shrunk}, {claimed} claimed");
    }
}

#[test]
fn strided_samples_serve_coherent_rays_better() {
    let task = Task { first: 0, rays: 1_024 };
    let error = |sampler: RaySampler| {
        let off = (0..200).map(|seed| {
            let mut rays = Vec::new();
            let n = sampler.sample(task, Fraction::new(1.0 / 32.0).expect("valid"), seed, &mut rays);
            let sum: f64 = rays.iter().map(|&ray| f64::from(primary(ray).boxes + primary(ray).triangles)).sum();
            (sum * 1_024.0 / f64::from(n) - truth(task, &primary)).abs()
        });
        off.sum::<f64>()
    };
    assert!(error(RaySampler::Strided) < 0.6 * error(RaySampler::Random));
}

/// A launch of all tasks in which task `t` took `factor(t)` times what was predicted.
fn learn(history: &mut History, stream: RayStream<'_>, work: &[Work], factor: &dyn Fn(u32) -> f64) {
    let outcome = |(task, w): (u32, &Work)| {
        let predicted_s = f64::from(w.tests()) * 1e-9;
        TaskOutcome { task, predicted_s, measured_s: predicted_s * factor(task) }
    };
    let outcomes: Vec<TaskOutcome> = (0..).zip(work).map(outcome).collect();
    history.learn(&LaunchRecord { stream, work, device: 0, outcomes: &outcomes, per_task: true });
    let [walked_rays, traced_rays] = [0; 2];
    let [walk_s, host_s, trace_s] = [0.0; 3];
    history.finish(&StreamRecord { stream, walked_rays, walk_s, host_s, traced_rays, trace_s });
}

#[test]
fn history_asks_once_and_then_remembers_what_was_measured() {
    let tasks = tasks_of(256, 64);
    let stream = stream(StreamKind::Primary, &tasks, 1);
    let mut history = History::new(Box::new(Sampled::new(Walk::Full, Fraction::ONE)));
    let (first, walked) = estimate(&mut history, stream, &primary);
    assert_eq!(walked, 256);
    learn(&mut history, stream, &first, &|task| [1.0, 2.0, 0.5, 1_000.0][task as usize]);
    let (second, walked) = estimate(&mut history, stream, &primary);
    assert_eq!(walked, 0);
    let factors: Vec<f32> = first.iter().zip(&second).map(|(a, b)| b.tests() / a.tests()).collect();
    // The typical factor is 2: half of all work took no more.
    for (factor, wanted) in factors.iter().zip([1.0, 2.0, 0.5, 8.0]) {
        assert!((factor / factors[0] - wanted).abs() < 1e-5, "corrected, but not by a disturbance: {factors:?}");
    }
    let diffuse_stream = RayStream { kind: StreamKind::Diffuse(0), ..stream };
    let other_part = RayStream { wave: 1, ..stream };
    assert_eq!(estimate(&mut history, diffuse_stream, &diffuse).1, 256, "another kind is another history");
    assert_eq!(estimate(&mut history, other_part, &primary).1, 256, "so is another part of the picture");
    learn(&mut history, diffuse_stream, &first, &|_| f64::NAN);
    let (third, walked) = estimate(&mut history, stream, &primary);
    assert_eq!((third, walked), (second, 0), "undisturbed by the other kind");
    assert_eq!(History::default().name(), "history");
}

proptest! {
    /// Every ray walked gives the exact sums.
    ///
    /// Mutants: `scale` inverted; the samples of one task more or less in `split_at`.
    #[test]
    fn walking_every_ray_is_exact(rays in 1_u32..3_000, size in 1_u32..400, seed: u32) {
        let tasks = tasks_of(rays, size);
        for kind in [StreamKind::Primary, StreamKind::Diffuse(0)] {
            let mut estimator = Sampled::new(Walk::Full, Fraction::ONE);
            let (work, walked) = estimate(&mut estimator, stream(kind, &tasks, seed), &diffuse);
            prop_assert_eq!(walked, rays as usize);
            for (work, task) in work.iter().zip(&tasks) {
                prop_assert!((f64::from(work.tests()) / truth(*task, &diffuse) - 1.0).abs() < 1e-6);
                prop_assert_eq!(work.std_error(), Some(0.0));
            }
        }
    }

    /// Cut differently, a stream keeps its cost per ray: the total scales with the rays, a uniform stream stays so.
    ///
    /// Mutants: `ratio` inverted; `left` not reduced; a new task that begins at the next old task.
    #[test]
    fn history_is_resampled_as_a_density(
        rays in 1_u32..5_000, size in 1_u32..700, other_rays in 1_u32..5_000, other_size in 1_u32..700,
    ) {
        let (old, new) = (tasks_of(rays, size), tasks_of(other_rays, other_size));
        let mut history = History::new(Box::new(Sampled::new(Walk::Full, Fraction::ONE)));
        let (before, _) = estimate(&mut history, stream(StreamKind::Custom, &old, 0), &diffuse);
        let (after, walked) = estimate(&mut history, stream(StreamKind::Custom, &new, 0), &diffuse);
        prop_assert_eq!((walked, after.len()), (0, new.len()));
        let per_ray = |work: &[Work], rays: u32| work.iter().map(|w| f64::from(w.tests())).sum::<f64>() / f64::from(rays);
        let [a, b] = [per_ray(&before, rays), per_ray(&after, other_rays)];
        prop_assert!((a / b - 1.0).abs() < 1e-4, "{a} {b}");
        let mut uniform = History::new(Box::new(Uniform));
        estimate(&mut uniform, stream(StreamKind::Custom, &old, 0), &diffuse);
        let (after, _) = estimate(&mut uniform, stream(StreamKind::Custom, &new, 0), &diffuse);
        let of_task = |(w, task): (&Work, &Task)| (w.boxes() / task.rays as f32 - 1.0).abs();
        prop_assert!(after.iter().zip(&new).map(of_task).all(|off| off < 1e-3));
    }
}
