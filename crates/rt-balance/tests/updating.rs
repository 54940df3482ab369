//! Scenes that move under a balancer.

use rt_balance::cpu::CpuDevice;
use rt_balance::estimators::{History, Sampled};
use rt_balance::middleware::{Failure, Fault, Faulty, FaultyCall};
use rt_balance::sample::Fraction;
use rt_balance::{BalanceError, Balancer, Cause, Device, DeviceErrorKind, Hit, MOST_GROWTH, Ray, Updated, Walk};
use std::sync::Arc;

const SIDE: u32 = 40;

fn devices() -> Vec<Arc<dyn Device>> {
    let devices = CpuDevice::open_all(&[1, 1]).expect("two CPU devices");
    devices.into_iter().map(|device| Arc::new(device) as _).collect()
}

/// A sheet that waves.
fn sheet(time: f32) -> Vec<[f32; 3]> {
    let at = |i: u32| i as f32 / (SIDE - 1) as f32;
    let point = |i: u32| [at(i % SIDE), at(i / SIDE), 0.1 * (10.0 * at(i % SIDE) + time).sin()];
    (0..SIDE * SIDE).map(point).collect()
}

fn faces() -> Vec<[u32; 3]> {
    let corners = (0..SIDE * SIDE).filter(|i| i % SIDE < SIDE - 1 && i / SIDE < SIDE - 1);
    corners.flat_map(|i| [[i, i + 1, i + SIDE], [i + 1, i + SIDE + 1, i + SIDE]]).collect()
}

fn hits(balancer: &mut Balancer) -> Vec<Hit> {
    let ray =
        |i: u32| Ray::new([(i % 100) as f32 / 95.0, (i / 100) as f32 / 95.0, 1.0].into(), [0.2, 0.1, -1.0].into());
    let rays: Vec<Ray> = (0..10_000).map(ray).collect();
    let mut hits = vec![Hit::MISS; rays.len()];
    balancer.trace_rays(&rays, &mut hits).expect("hits");
    hits
}

/// Mutants: devices that keep the old scene; a tree that is built anew whatever moved.
#[test]
fn hits_are_those_of_a_balancer_made_anew() {
    let (devices, faces) = (devices(), faces());
    let mut balancer = Balancer::for_mesh(&sheet(0.0), &faces, &devices).unwrap();
    let before = hits(&mut balancer);
    for time in [0.1, 0.5, 2.0] {
        let moved = sheet(time);
        assert_eq!(balancer.update(&moved, &faces).unwrap().tree, Updated::Fitted);
        let found = hits(&mut balancer);
        assert!(found != before);
        assert_eq!(found, hits(&mut Balancer::for_mesh(&moved, &faces, &devices).unwrap()));
    }
}

/// Mutants: a tree that is fitted to whatever comes; a cost that is compared with the last fitted tree's, so that small
/// steps lead anywhere.
#[test]
fn what_does_not_fit_is_built_anew() {
    let (devices, faces, positions) = (devices(), faces(), sheet(0.0));
    let mut balancer = Balancer::for_mesh(&positions, &faces, &devices).unwrap();
    let torn = |by: usize| (0..positions.len()).map(|i| positions[i * by % positions.len()]).collect::<Vec<_>>();
    for (positions, cause) in [(positions.clone(), Cause::OtherTriangles), (torn(331), Cause::TooExpensive)] {
        let faces = faces[7..].to_vec();
        let update = balancer.update(&positions, &faces).unwrap();
        assert_eq!(update.tree, Updated::Rebuilt(cause));
        assert_eq!(update.growth.is_some_and(|growth| growth > MOST_GROWTH), cause == Cause::TooExpensive);
        assert!(update.fit_s > 0.0 && update.build_s > 0.0 && update.bring_s > 0.0, "{update:?}");
        let found = hits(&mut balancer);
        assert_eq!(found, hits(&mut Balancer::for_mesh(&positions, &faces, &devices).unwrap()));
    }
    // The new tree is the one to be compared with.
    let update = balancer.update(&torn(331), &faces[7..]).unwrap();
    assert_eq!((update.tree, update.growth, update.build_s), (Updated::Fitted, Some(1.0), 0.0));
}

/// Mutants: a new estimator, or devices without prices, after an update.
#[test]
fn what_was_learnt_is_kept() {
    let faces = faces();
    let mut balancer = Balancer::for_mesh(&sheet(0.0), &faces, &devices()).unwrap();
    let first = Box::new(Sampled::new(Walk::Full, Fraction::SIXTY_FOURTH));
    balancer.scheduling().estimator = Box::new(History::new(first));
    let rays = vec![Ray::new([0.4, 0.6, 1.0].into(), [0.0, 0.0, -1.0].into()); 10_000];
    let mut hits = vec![Hit::MISS; rays.len()];
    balancer.trace_rays(&rays, &mut hits).unwrap();
    balancer.update(&sheet(0.2), &faces).unwrap();
    let report = balancer.trace_rays(&rays, &mut hits).unwrap().report;
    assert_eq!(report.estimate.fraction, 0.0);
    assert!(balancer.devices().all(|device| device.name.contains("CPU")));
}

/// Mutant: the old tree given up before the new one is there.
#[test]
fn a_bad_update_leaves_the_scene_as_it_was() {
    let faces = faces();
    let mut balancer = Balancer::for_mesh(&sheet(0.0), &faces, &devices()).unwrap();
    let before = hits(&mut balancer);
    let mut bad = sheet(0.3);
    bad[5][1] = f32::NAN;
    assert!(matches!(balancer.update(&bad, &faces), Err(BalanceError::Build(_))));
    assert!(matches!(balancer.update(&sheet(0.3), &[[0, 1, u32::MAX]]), Err(BalanceError::Build(_))));
    assert_eq!(hits(&mut balancer), before);
}

/// Mutants: a device that cannot follow a scene given up, or left with the old one; one that fails while it follows
/// believed; prices of another device after it.
#[test]
fn devices_that_do_not_follow_take_the_scene_anew_or_are_named() {
    let faces = faces();
    for (failure, survives) in [
        (Failure::Error(DeviceErrorKind::Unsupported), true),
        (Failure::Error(DeviceErrorKind::InvalidArgument), true),
        (Failure::Error(DeviceErrorKind::Lost), false),
        (Failure::Panic, false),
    ] {
        let [first, second] = <[_; 2]>::try_from(devices()).expect("two");
        let bad = Arc::new(Faulty::new(first, Fault::new(FaultyCall::Move, 0, failure)));
        let mut balancer = Balancer::for_mesh(&sheet(0.0), &faces, &[bad, second]).unwrap();
        for time in [0.4, 0.8] {
            let moved = sheet(time);
            assert_eq!(balancer.update(&moved, &faces).unwrap().tree, Updated::Fitted);
            let found = hits(&mut balancer);
            assert_eq!(found, hits(&mut Balancer::for_mesh(&moved, &faces, &devices()).unwrap()));
        }
        let rays = [Ray::new([0.4, 0.6, 1.0].into(), [0.0, 0.0, -1.0].into()); 4];
        let report = balancer.trace_rays(&rays, &mut [Hit::MISS; 4]).unwrap().report;
        let error = report.devices[0].error.as_deref();
        assert_eq!(error.is_none(), survives, "{failure:?}: {error:?}");
        assert!(survives || error.is_some_and(|error| error.contains("injected fault")), "{error:?}");
    }
}
