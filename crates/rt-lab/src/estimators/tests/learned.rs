//! The map of costs.

use super::*;
use glam::Vec3;
use rt_core::{Ray, RaySource};

/// Rays that start on a square, in Z-curve order of a 128 × 128 grid with `per_cell` rays each, in random directions.
fn bounced(per_cell: u32) -> RaySource {
    bounced_in(per_cell, |cell| cell)
}

/// The same in an order in which `block` cells, a power of two, follow upon others that lie elsewhere: neighbours in
/// the stream know nothing of each other.
fn scattered(per_cell: u32, block: u32) -> RaySource {
    bounced_in(per_cell, |cell| (cell / block * 101) % (128 * 128 / block) * block + cell % block)
}

fn bounced_in(per_cell: u32, cell: impl Fn(u32) -> u32) -> RaySource {
    let ray = |i: u32| {
        let (x, y) = rt_core::morton::decode(cell(i / per_cell));
        let [a, b] = random::pair(21, i, 0);
        let [c, _] = random::pair(21, i, 1);
        let direction = Vec3::new(2.0 * a - 1.0, 2.0 * b - 1.0, c + 0.01);
        Ray::new(Vec3::new(x as f32, y as f32, 0.0), direction)
    };
    RaySource::Explicit { rays: (0..128 * 128 * per_cell).map(ray).collect(), origins: None }
}

/// Expensive where the square is cluttered, and in directions that look towards the clutter; noisy.
fn cost(source: &RaySource, ray: u32) -> TestCounts {
    let (r, _) = source.ray(ray);
    let place = 40.0 * (r.origin.x / 20.0).sin() * (r.origin.y / 14.0).sin();
    let looks = 30.0 * r.direction.normalize().x;
    let [noise, _] = random::pair(22, ray, 0);
    TestCounts { boxes: (90.0 + place + looks + 20.0 * noise) as u32, triangles: (8.0 + 4.0 * noise) as u32 }
}

/// Mean of `|ĉ − c| / c` over the tasks.
fn error(work: &[Work], tasks: &[Task], counts: &dyn Fn(u32) -> TestCounts) -> f64 {
    let off = |(work, task): (&Work, &Task)| {
        let truth = truth(*task, counts);
        (f64::from(work.tests()) - truth).abs() / truth
    };
    work.iter().zip(tasks).map(off).sum::<f64>() / tasks.len() as f64
}

/// The map knows from neighbours what a task's own samples cannot tell.
///
/// Mutants: no lookup (the mean alone); residuals that are added, not subtracted, level by level; one level only; the
/// task's own residual always believed.
#[test]
fn small_diffuse_tasks_are_rescued() {
    for (size, better) in [(64, 0.6), (1_024, 1.05)] {
        let source = scattered(4, size / 4);
        let counts = |ray| cost(&source, ray);
        let tasks = tasks_of(source.len(), size);
        let stream = RayStream { source: Some(&source), ..super::stream(StreamKind::Diffuse(0), &tasks, 3) };
        let fraction = Fraction::SIXTY_FOURTH;
        let (plain, _) = estimate(&mut *exact(fraction), stream, &counts);
        let mut field = Field::new(fraction);
        let (first, walked) = estimate(&mut field, stream, &counts);
        assert_eq!(walked as u32, fraction.of(source.len()));
        let [plain, first] = [&plain, &first].map(|work| error(work, &tasks, &counts));
        assert!(first < better * plain, "{size}: {first} against {plain}");
        let mut last = f64::NAN;
        for seed in 4..8 {
            let (next, _) = estimate(&mut field, RayStream { seed, ..stream }, &counts);
            last = error(&next, &tasks, &counts);
        }
        assert!(last < first, "{size}: it learns from stream to stream: {last} after {first}");
    }
}

/// Standard errors of the map hold on average over tasks.
///
/// Mutants: `own_variance` without `within`; residuals of rays that the map has seen.
#[test]
fn standard_errors_of_the_map_hold() {
    let source = bounced(8);
    let counts = |ray| cost(&source, ray);
    for (size, one_in) in [(128, 64.0), (1_024, 64.0), (1_024, 16.0)] {
        let tasks = tasks_of(source.len(), size);
        let stream = RayStream { source: Some(&source), ..super::stream(StreamKind::Diffuse(0), &tasks, 5) };
        let mut field = Field::new(Fraction::new(1.0 / one_in).expect("valid"));
        let (work, _) = estimate(&mut field, stream, &counts);
        let holds = |(work, task): &(&Work, &Task)| {
            let half = 1.96 * f64::from(work.std_error().expect("enough samples"));
            (f64::from(work.tests()) - truth(**task, &counts)).abs() <= half
        };
        let coverage = work.iter().zip(&tasks).filter(holds).count() as f64 / tasks.len() as f64;
        assert!(coverage >= 0.93, "{size}, 1/{one_in}: {coverage}");
        let typical =
            work.iter().map(|w| f64::from(w.std_error().unwrap_or(0.0) / w.tests())).sum::<f64>() / work.len() as f64;
        assert!(typical < 2.5 * error(&work, &tasks, &counts), "and they are no larger than that takes: {typical}");
    }
}

/// One sample a task cannot tell how far its task is off: no error is claimed.
///
/// Mutant: all of their spread taken for that of rays, by which errors are 0 and 95% intervals hold in a fifth of the
/// tasks.
#[test]
fn one_sample_a_task_claims_no_error() {
    let source = bounced(4);
    let tasks = tasks_of(source.len(), 64);
    let stream = RayStream { source: Some(&source), ..super::stream(StreamKind::Diffuse(0), &tasks, 3) };
    let (work, walked) = estimate(&mut Field::default(), stream, &|ray| cost(&source, ray));
    assert_eq!(walked, tasks.len());
    assert!(work.iter().all(|w| w.std_error().is_none() && w.tests() > 0.0));
}

/// Mutants: the map asked wherever there are rays; own samples scaled up where some tasks have none.
#[test]
fn coherent_tasks_speak_for_themselves() {
    let source = bounced(1);
    let counts = |ray| cost(&source, ray);
    let estimates = |size| {
        let tasks = tasks_of(source.len(), size);
        let stream = RayStream { source: Some(&source), ..super::stream(StreamKind::Primary, &tasks, 3) };
        let (plain, _) = estimate(&mut *exact(Fraction::SIXTY_FOURTH), stream, &counts);
        (estimate(&mut Field::default(), stream, &counts).0, plain)
    };
    let (map, plain) = estimates(64);
    assert_eq!(map, plain);
    let (map, _) = estimates(16);
    assert!(map.iter().all(|w| w.tests() > 0.0), "three in four tasks have no sample");
}

#[test]
fn tasks_smaller_than_a_sample_share_samples() {
    let source = bounced(1);
    let tasks = tasks_of(source.len(), 4);
    let stream = RayStream { source: Some(&source), ..super::stream(StreamKind::Diffuse(0), &tasks, 3) };
    let (work, walked) = estimate(&mut Field::default(), stream, &|ray| cost(&source, ray));
    assert_eq!((work.len(), walked), (tasks.len(), source.len() as usize / 64));
    assert!(work.iter().all(|w| w.rays() == 4.0 && w.tests() > 0.0));
}

#[test]
fn without_rays_the_map_is_a_plain_sample() {
    let tasks = tasks_of(4_096, 256);
    let stream = super::stream(StreamKind::Diffuse(0), &tasks, 3);
    let plain = estimate(&mut *exact(Fraction::SIXTY_FOURTH), stream, &diffuse);
    assert_eq!(estimate(&mut Field::default(), stream, &diffuse), plain);
}

proptest! {
    /// Whatever the rays, estimates are numbers, and every ray walked gives exact sums.
    ///
    /// Mutants: `Cells::around` without its test for a box without extent; a division by no samples.
    #[test]
    fn any_rays_are_mapped(
        rays in prop::collection::vec((prop::array::uniform3(-1e30_f32..1e30), prop::array::uniform3(-1.0_f32..1.0)), 1..200),
        size in 1_u32..50, invalid: bool, coherent: bool,
    ) {
        let mut rays: Vec<Ray> =
            rays.into_iter().map(|(origin, direction)| Ray::new(origin.into(), direction.into())).collect();
        if invalid {
            rays[0] = Ray::new(Vec3::splat(f32::NAN), Vec3::INFINITY);
        }
        let source = RaySource::Explicit { rays: rays.into(), origins: None };
        let tasks = tasks_of(source.len(), size);
        let kind = if coherent { StreamKind::Primary } else { StreamKind::Diffuse(0) };
        let stream = RayStream { source: Some(&source), ..super::stream(kind, &tasks, 3) };
        let (work, _) = estimate(&mut Field::default(), stream, &diffuse);
        prop_assert!(work.iter().all(|w| w.tests().is_finite() && w.rays() >= 1.0));
        let (exact, _) = estimate(&mut Field::new(Fraction::ONE), stream, &diffuse);
        for (work, task) in exact.iter().zip(&tasks) {
            prop_assert!((f64::from(work.tests()) / truth(*task, &diffuse) - 1.0).abs() < 1e-6);
            prop_assert_eq!(work.std_error(), Some(0.0));
        }
    }
}
