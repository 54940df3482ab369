//! A caller's floating-point environment changes no bit.

use crate::fixture::{patient, sampling, trace_well};
use rt_balance::cpu::CpuDevice;
use rt_balance::{Balancer, Device, Hit, QueueKind, Ray};
use rt_fenv::test_support::{ALL, Strange, with};
use std::sync::Arc;

/// A number that is subnormal, unless the thread that asks rounds those to zero.
fn half_of_least() -> f32 {
    std::hint::black_box(f32::MIN_POSITIVE) / std::hint::black_box(2.0)
}

/// Rays at the triangles of [`trace_all`] and past them.
fn rays() -> Vec<Ray> {
    let third = 1.0 / 3.0;
    let ray = |i: u32| {
        let (x, y) = ((i % 64) as f32 * third / 16.0, (i / 64) as f32 * third / 16.0);
        Ray::new([x, y, 2.0].into(), [(third - x) * 0.1, third * 0.1, -third].into())
    };
    (0..4_096).map(ray).collect()
}

/// Builds a mesh, one corner of which is a subnormal number away from an edge, and traces rays on it.
fn trace_all(devices: &[Arc<dyn Device>], rays: &[Ray]) -> Vec<[u32; 4]> {
    let tiny = f32::MIN_POSITIVE / 4.0;
    let positions =
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [tiny, tiny, 0.5], [0.7, tiny, 0.5], [tiny, 0.7, 0.5]];
    let mut balancer = Balancer::for_mesh(&positions, &[[0, 1, 2], [3, 4, 5]], devices).expect("a balancer");
    let mut hits = vec![Hit::MISS; rays.len()];
    balancer.trace_rays(rays, &mut hits).expect("hits");
    crate::fixture::bits(&hits)
}

/// Builds a mesh whose every coordinate is a subnormal number, and traces rays at it.
fn trace_subnormal(devices: &[Arc<dyn Device>]) -> Vec<[u32; 4]> {
    let unit = f32::from_bits(1 << 18);
    let positions = [[0.0; 3], [unit, 0.0, 0.0], [0.0, unit, 0.0]];
    let mut balancer = Balancer::for_mesh(&positions, &[[0, 1, 2]], devices).expect("a balancer");
    let quarter = f32::from_bits(1 << 16);
    let rays = vec![Ray::new([quarter, quarter, unit].into(), [0.0, 0.0, -1.0].into()); 64];
    let mut hits = vec![Hit::MISS; rays.len()];
    balancer.trace_rays(&rays, &mut hits).expect("hits");
    crate::fixture::bits(&hits)
}

/// Devices are opened, the tree is built and rays are traced where numbers are rounded otherwise.
///
/// Mutants: threads of a device, of its pool, or of the driver keep what they inherit; the tree is built in the
/// caller's.
#[test]
fn a_callers_environment_changes_no_bit() {
    let open = |threads: &[usize]| -> Vec<Arc<dyn Device>> {
        let devices = CpuDevice::open_all(threads).expect("threads");
        devices.into_iter().map(|device| Arc::new(device) as _).collect()
    };
    // The caller's own numbers are the caller's.
    let rays = rays();
    let right = trace_all(&open(&[1]), &rays);
    assert!(right.iter().any(|hit| hit[3] == 1) && right.iter().any(|hit| hit[3] == 0));
    let subnormal = trace_subnormal(&open(&[1]));
    assert!(subnormal.iter().all(|hit| hit[3] == 0), "{:?}", subnormal[0]);
    for strange in ALL {
        let found = with(strange, || trace_subnormal(&open(&[1])));
        assert!(found == subnormal, "{strange:?}: other bits of subnormal numbers");
        for threads in [&[1][..], &[1, 1], &[3]] {
            let found = with(strange, || trace_all(&open(threads), &rays));
            assert!(found == right, "{strange:?} on {threads:?}: other bits");
        }
        // The fixture's own bits, too, on devices that were opened in the default.
        let mut balancer = with(strange, || crate::fixture::balancer(&crate::fixture::cpus(2)));
        with(strange, || {
            trace_well("strange", &mut balancer, &mut sampling(QueueKind::Hybrid, patient()));
        });
    }
}

/// A device on a program's own threads, which flush subnormal numbers to zero and go on doing so for the program.
///
/// Mutants: the threads' environment is used, or is lost to the program.
#[test]
fn a_callers_threads_trace_and_stay_as_they_are() {
    let rays = rays();
    let own: Arc<dyn Device> = Arc::new(CpuDevice::open_all(&[1]).expect("a thread").remove(0));
    let (right, subnormal) = (trace_all(&[Arc::clone(&own)], &rays), trace_subnormal(&[own]));
    for threads in [1, 3] {
        let spawn = |thread: rayon::ThreadBuilder| {
            std::thread::spawn(move || with(Strange::FlushToZero, || thread.run()));
            Ok(())
        };
        let builder = rayon::ThreadPoolBuilder::new().num_threads(threads).spawn_handler(spawn);
        let pool = Arc::new(builder.build().expect("threads"));
        let device = CpuDevice::on_pool(Arc::clone(&pool)).expect("a device");
        assert!(device.info().name.contains("pool") && device.info().units == threads as u32);
        let devices: [Arc<dyn Device>; 1] = [Arc::new(device)];
        assert!(trace_all(&devices, &rays) == right, "{threads} threads: other bits");
        assert!(trace_subnormal(&devices) == subnormal, "{threads} threads: other bits of subnormal numbers");
        let flushed = pool.broadcast(|_| half_of_least());
        assert!(cfg!(not(target_arch = "x86_64")) || flushed.iter().all(|&half| half == 0.0), "{flushed:?}");
        assert!(half_of_least() > 0.0);
    }
}
