//! Rays that leave surfaces, made on the device.

use crate::{Backend, COUNTED, Opened, car, compare, first, launch};
use backend_vulkan::VulkanDevice;
use backend_wgpu::WgpuDevice;
use libtest_mimic::Failed;
use rt_core::bounce::{Departure, Surfaces};
use rt_core::{BounceRays, Query, Ray, RaySource, StreamSpec, tasks_of};
use rt_gpu::{GpuDevice, Tuning, bounce};
use rt_report::print::note;
use rt_scene::streams::{Paths, Sun, Wave};
use rt_shaders::{Kernel, Purpose};
use rt_verify::clock;
use rt_verify::tree;
use std::sync::Arc;

const ANY: StreamSpec = StreamSpec { query: Query::Any, ..COUNTED };

/// A stream, its rays made by the host, and what is asked of them.
type Twins = (Arc<BounceRays>, Vec<(Ray, u32)>, StreamSpec);

/// The rays that leave where a picture's rays meet the car, and their explicit twins: to the sun, about the normal, and
/// about the normal where those meet it again.
fn bounced() -> Result<Vec<Twins>, Failed> {
    let (scene, view) = car()?;
    let surfaces = Arc::new(Surfaces::new(Arc::clone(&scene)));
    let sun = Sun::new(glam::Vec3::new(0.4, 1.0, 0.3), 0.045).ok_or("a good sun")?;
    let paths = Paths { camera: view.camera()?, size: [64, 40], samples: 2, seed: 5, sun, surfaces };
    // As of the second half of an image.
    let mut front = paths.primary(&Wave { first: 64 * 40, ..Wave::whole(paths.size)? });
    let mut streams = Vec::new();
    for _ in 0..2 {
        let explicit: Vec<(Ray, u32)> = (0..front.source.len()).map(|i| front.source.ray(i)).collect();
        let hits = tree::trace(&scene, COUNTED, &explicit).0;
        let [shadow, diffuse] = paths.follow(&front, &hits);
        for (stream, spec) in [(&shadow, ANY), (&diffuse, COUNTED)] {
            let RaySource::Bounce(made) = &stream.source else { return Err("bounces are made on devices".into()) };
            let explicit = (0..made.len()).map(|i| made.ray(i)).collect();
            streams.push((Arc::clone(made), explicit, spec));
        }
        front = diffuse;
    }
    Ok(streams)
}

/// Hits and counts are those of the same rays made by the host, in one window and in many, and no more bytes are sent
/// than the rays' departures have. Fails when parts of a window are made at its start, or triangles named by their
/// place in the two-wide tree.
pub(crate) fn are_made_there((_, open): Backend) -> Result<(), Failed> {
    for window in [None, Some(700)] {
        for (made, explicit, spec) in bounced()? {
            let Opened { device, .. } = open(Tuning { window, ..Tuning::default() })?;
            if device.card().software
                && let Some(fault) = device.fault_of_bounces(&bounce::trials())?
            {
                return Err(format!("lavapipe rounds as IEEE 754 says, and yet: {fault}").into());
            }
            let mut tracer = device.tracer(car()?.0, clock)?;
            tracer.load_rays(RaySource::Bounce(Arc::clone(&made)), spec)?;
            let count = made.len();
            let found = launch(&mut *tracer, &tasks_of(count, 611), None)?;
            let sent = tracer.traffic().uploaded;
            note(format_args!("{count} rays, {window:?}: {:.2} bytes each", sent as f64 / f64::from(count)));
            if device.card().software && (device.counters().made() != u64::from(count) || sent > 17 * u64::from(count))
            {
                return Err(format!("{} of {count} rays made, {sent} bytes sent", device.counters().made()).into());
            }
            let (hits, counts) = tree::trace(&car()?.0, spec, &explicit);
            if spec == COUNTED {
                compare(&format!("{window:?}"), &found, &hits, &counts)?;
            } else if hits.iter().zip(&found.hits).any(|(a, b)| a.is_hit() != b.is_hit()) || counts != found.counts {
                return Err("other shadows".into());
            }
            if device.counters().on_host() > u64::from(count) / 50 {
                return Err(format!("the host had to trace {} of {count} rays", device.counters().on_host()).into());
            }
        }
    }
    Ok(())
}

/// Triangles and rays of many kinds, extremes among them. Fails with any of [`WRONG`].
pub(crate) fn are_the_hosts_to_the_bit((_, open): Backend) -> Result<(), Failed> {
    let Opened { device, .. } = open(Tuning::default())?;
    let trials = bounce::random_trials(3, 40);
    if trials.len() < 20 {
        return Err(format!("only {} trials", trials.len()).into());
    }
    match device.fault_of_bounces(&trials)? {
        Some(fault) if device.card().software => Err(fault.into()),
        fault => {
            note(format_args!("{} trials: {fault:?}", trials.len()));
            Ok(())
        }
    }
}

/// Changes of the kernel, none of which is invalid.
const WRONG: [(&str, &str); 7] = [
    ("abs(sum.x) * HALF_STEP", "abs(sum.x) * CLEARANCE"),
    ("c + GRID", "c + COARSE"),
    ("for (var i = 0; i < 3; i += 1)", "for (var i = 0; i < 2; i += 1)"),
    ("recipe.dimension, path", "0u, path"),
    ("recipe.first_group + path", "path"),
    ("(item - recipe.words[rows + 2u * low])", "item"),
    ("select(x.value, STEEPEST, none.x)", "x.value"),
];

fn changed<const N: usize>(kernel: &'static Kernel) -> String {
    let (from, to) = WRONG[N];
    assert!(kernel.purpose != Purpose::Bounce || kernel.wgsl.contains(from), "there is no {from} to change");
    if kernel.purpose == Purpose::Bounce { kernel.wgsl.replace(from, to) } else { kernel.wgsl.to_owned() }
}

/// 2⁻⁴⁰, the clearance, becomes 2⁻³⁹.
fn further_off(kernel: &'static Kernel) -> Vec<u32> {
    let bits = [40, 39].map(|exponent| (127 - exponent) << 23);
    let change = |word: u32| if kernel.purpose == Purpose::Bounce && word == bits[0] { bits[1] } else { word };
    kernel.spirv().into_iter().map(change).collect()
}

/// What devices with wrong kernels would make is found out, and the host makes the rays.
pub(crate) fn of_a_wrong_kernel_are_the_hosts((name, _): Backend) -> Result<(), Failed> {
    let devices: Vec<Arc<dyn GpuDevice>> = if name == "vulkan" {
        // SAFETY: one constant of floating-point arithmetic is another: what is accessed does not depend on it.
        let kernels = unsafe { backend_vulkan::Replacement::new(further_off) };
        let options = backend_vulkan::Options { kernels: Some(kernels), ..Default::default() };
        vec![Arc::new(first(VulkanDevice::enumerate(options)?)?)]
    } else {
        let wrong: [fn(&'static Kernel) -> String; WRONG.len()] =
            [changed::<0>, changed::<1>, changed::<2>, changed::<3>, changed::<4>, changed::<5>, changed::<6>];
        let mut devices: Vec<Arc<dyn GpuDevice>> = Vec::new();
        for kernels in wrong {
            let options = backend_wgpu::Options { kernels: Some(kernels), ..Default::default() };
            devices.push(Arc::new(first(WgpuDevice::enumerate(options)?)?));
        }
        devices
    };
    let streams = bounced()?;
    let (made, explicit, spec) = &streams[1];
    for (i, device) in devices.iter().enumerate() {
        if device.fault_of_bounces(&bounce::trials())?.is_none() {
            return Err(format!("change {i} of the kernel is not found out").into());
        }
        let mut tracer = device.tracer(car()?.0, clock)?;
        tracer.load_rays(RaySource::Bounce(Arc::clone(made)), *spec)?;
        let found = launch(&mut *tracer, &tasks_of(made.len(), 1000), None)?;
        if device.counters().made() != 0 {
            return Err("a device that makes other rays than the host made some".into());
        }
        let (hits, counts) = tree::trace(&car()?.0, *spec, explicit);
        compare("made by the host", &found, &hits, &counts)?;
    }
    // A triangle that there is not.
    let strange = Departure { primitive: u32::MAX - 1, ..made.departures[0] };
    let invalid = BounceRays { departures: [strange].into(), ..(**made).clone() };
    let mut tracer = devices[0].tracer(car()?.0, clock)?;
    tracer.load_rays(RaySource::Bounce(Arc::new(invalid)), *spec)?;
    match launch(&mut *tracer, &tasks_of(1, 1), None)?.hits[0].is_hit() {
        false => Ok(()),
        true => Err("a ray from no triangle hits".into()),
    }
}
