//! Kernels without wgpu's checks, kernels that fail, and a device that goes away.

use crate::{Found, LIMIT, hits};
use backend_wgpu::{Options, WgpuDevice, wgpu};
use libtest_mimic::{Failed, Trial};
use rt_bvh::Builder;
use rt_core::{Device, DeviceError, DeviceErrorKind, Launch, RaySource, StreamSpec, tasks_of};
use rt_shaders::{Kernel, Purpose};
use rt_verify::clock;
use rt_verify::rays::RayMaker;
use rt_verify::{shapes, tree};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

pub(crate) fn trials(found: &Found) -> Vec<Trial> {
    vec![
        found.trial("trusted_kernels_find_what_checked_ones_find", trusted_kernels_find_what_checked_ones_find),
        found.trial("a_device_of_the_callers_traces", a_device_of_the_callers_traces),
        found.trial("a_kernel_that_does_not_compile_is_unsupported", a_kernel_that_does_not_compile_is_unsupported),
        found.trial("a_poisoned_kernel_changes_hits", a_poisoned_kernel_changes_hits),
        found.trial("a_lost_device_is_an_error_and_no_end", a_lost_device_is_an_error_and_no_end),
        found.trial("a_launch_that_takes_too_long_is_hung", a_launch_that_takes_too_long_is_hung),
    ]
}

fn open(found: &Found, options: Options) -> Result<WgpuDevice, Failed> {
    let devices = WgpuDevice::enumerate(options)?;
    Ok(devices.into_iter().nth(found.position).ok_or("the device is gone")??)
}

/// Both give the processor's hits and counts. Fails when an unchecked kernel reads beyond a buffer's end and uses it.
fn trusted_kernels_find_what_checked_ones_find(found: &Found) -> Result<(), Failed> {
    let device = open(found, Options { trusted: true, ..Options::default() })?;
    for triangles in [shapes::soup(3_000, 0.1, 7), shapes::soup(1, 1.0, 7), Vec::new()] {
        let scene = tree::build(&triangles, Builder::Sah)?;
        let rays = RayMaker::new(&triangles, 4).mixed(5_000);
        hits::compare_rays(&device, &scene, &rays)?;
        hits::compare_rays(&*found.device, &scene, &rays)?;
    }
    Ok(())
}

/// Hits are the processor's, and the caller's handler of errors hears of nothing. One that allows too few buffers is
/// refused before anything is done with it.
fn a_device_of_the_callers_traces(found: &Found) -> Result<(), Failed> {
    let backends = wgpu::Backends::VULKAN;
    // Without names of objects, as in `WgpuDevice::enumerate`.
    let flags = wgpu::InstanceFlags::empty();
    let none = wgpu::InstanceDescriptor::new_without_display_handle();
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor { backends, flags, ..none });
    let adapters = pollster::block_on(instance.enumerate_adapters(backends));
    let adapter = adapters.get(found.position).ok_or("the device is gone")?;
    let request = |required_limits| {
        let wanted = wgpu::DeviceDescriptor { required_limits, ..Default::default() };
        pollster::block_on(adapter.request_device(&wanted))
    };
    let (device, queue) = request(adapter.limits())?;
    let heard = Arc::new(AtomicBool::new(false));
    let ours = Arc::clone(&heard);
    device.on_uncaptured_error(Arc::new(move |_| ours.store(true, Ordering::Relaxed)));
    let device = WgpuDevice::of(device, queue, Options::default())?;
    let triangles = shapes::soup(3_000, 0.1, 7);
    let scene = tree::build(&triangles, Builder::Sah)?;
    hits::compare_rays(&device, &scene, &RayMaker::new(&triangles, 4).mixed(5_000))?;
    let one = WgpuDevice::open(adapter, Options::default())?;
    hits::compare_rays(&one, &scene, &RayMaker::new(&triangles, 5).mixed(500))?;

    let few = wgpu::Limits { max_storage_buffers_per_shader_stage: 4, ..adapter.limits() };
    let (device, queue) = request(few)?;
    match WgpuDevice::of(device, queue, Options::default()) {
        Err(error) if error.to_string().contains("may use 4 buffers") => {}
        other => return Err(format!("not refused: {other:?}").into()),
    }
    if heard.load(Ordering::Relaxed) { Err("an error reached the caller's handler".into()) } else { Ok(()) }
}

/// One ray at one triangle; the error of whatever call fails first.
fn trace_one(device: &WgpuDevice, limit: Duration) -> Result<Launch, DeviceError> {
    let triangles = shapes::grid(1, 0.0, 0);
    let scene = tree::build(&triangles, Builder::Sah).map_err(|e| DeviceError::new(DeviceErrorKind::Lost, e))?;
    let mut tracer = device.tracer(scene, clock)?;
    let rays: Arc<[_]> = RayMaker::new(&triangles, 1).mixed(64).into_iter().map(|(ray, _)| ray).collect();
    tracer.load_rays(RaySource::Explicit { rays, origins: None }, StreamSpec::default())?;
    let ticket = tracer.submit(&tasks_of(64, u32::MAX), None)?;
    let mut launch = Launch::default();
    tracer.wait(ticket, limit, &mut launch).map(|()| launch)
}

fn must_be(kind: DeviceErrorKind, answer: Result<Launch, DeviceError>) -> Result<(), Failed> {
    match answer {
        Err(error) if error.kind() == kind => Ok(()),
        other => Err(format!("not {kind:?}, but {other:?}").into()),
    }
}

fn a_kernel_that_does_not_compile_is_unsupported(found: &Found) -> Result<(), Failed> {
    let broken = |kernel: &'static Kernel| match kernel.purpose {
        Purpose::Arithmetic => kernel.wgsl.to_owned(),
        _ => kernel.wgsl.replacen("fn trace(", "fn trace(nobody: Heard,", 1),
    };
    let device = open(found, Options { kernels: Some(broken), ..Options::default() })?;
    must_be(DeviceErrorKind::Unsupported, trace_one(&device, LIMIT))?;
    let wrong_bindings = |kernel: &'static Kernel| match kernel.purpose {
        Purpose::Arithmetic => kernel.wgsl.to_owned(),
        _ => kernel
            .wgsl
            .replace("@group(0) @binding(7)", "@group(0) @binding(9)")
            .replace("COUNT: bool = false", "COUNT: bool = true"),
    };
    let device = open(found, Options { kernels: Some(wrong_bindings), ..Options::default() })?;
    must_be(DeviceErrorKind::Unsupported, trace_one(&device, LIMIT))?;
    // Nothing of that reaches the device that the other tests use.
    let scene = tree::build(&shapes::grid(1, 0.0, 0), Builder::Sah)?;
    hits::compare_rays(&*found.device, &scene, &RayMaker::new(&shapes::grid(1, 0.0, 0), 1).mixed(100))
}

/// The device traces, not the host: with a kernel that finds nothing, nothing is found.
fn a_poisoned_kernel_changes_hits(found: &Found) -> Result<(), Failed> {
    let poisoned = |kernel: &'static Kernel| kernel.wgsl.replace("found[item] = nearest.slot;", "found[item] = MISS;");
    let device = open(found, Options { kernels: Some(poisoned), ..Options::default() })?;
    let launch = trace_one(&device, LIMIT)?;
    let honest = trace_one(&open(found, Options::default())?, LIMIT)?;
    let hits = |launch: &Launch| launch.hits.iter().filter(|hit| hit.is_hit()).count();
    if hits(&launch) == 0 && hits(&honest) > 5 {
        Ok(())
    } else {
        Err(format!("{} hits with a poisoned kernel, {} with an honest one", hits(&launch), hits(&honest)).into())
    }
}

fn a_lost_device_is_an_error_and_no_end(found: &Found) -> Result<(), Failed> {
    let device = open(found, Options::default())?;
    let scene = tree::build(&shapes::grid(1, 0.0, 0), Builder::Sah)?;
    let mut tracer = device.tracer(Arc::clone(&scene), clock)?;
    let rays: Arc<[_]> = RayMaker::new(&shapes::grid(1, 0.0, 0), 1).mixed(8).into_iter().map(|(ray, _)| ray).collect();
    let source = RaySource::Explicit { rays, origins: None };
    tracer.load_rays(source.clone(), StreamSpec::default())?;
    device.provoke_loss();
    let submitted = tracer.submit(&tasks_of(8, u32::MAX), None);
    must_be(DeviceErrorKind::Lost, submitted.map(|_| Launch::default()))?;
    must_be(DeviceErrorKind::Lost, tracer.load_rays(source, StreamSpec::default()).map(|()| Launch::default()))?;
    must_be(DeviceErrorKind::Lost, trace_one(&device, LIMIT))?;
    // The same card, opened anew, is as good as before.
    trace_one(&open(found, Options::default())?, LIMIT).map(drop).map_err(Failed::from)
}

/// A kernel that counts to a large number first, and a wait of no time at all.
fn a_launch_that_takes_too_long_is_hung(found: &Found) -> Result<(), Failed> {
    let slow = |kernel: &'static Kernel| match kernel.purpose {
        Purpose::Arithmetic => kernel.wgsl.to_owned(),
        _ => {
            let wait = "var round = list.count;\n    while round != 1u { round = select(round * 3u + 1u, round / 2u, \
                        round % 2u == 0u); }\n    for (var i = 0u; i < 20000000u * round; i += 1u) { found[item] = i ^ list.count; }\n    \
                        found[item] = nearest.slot;";
            kernel.wgsl.replacen("found[item] = nearest.slot;", wait, 1)
        }
    };
    let device = open(found, Options { kernels: Some(slow), ..Options::default() })?;
    must_be(DeviceErrorKind::Hung, trace_one(&device, Duration::ZERO))?;
    must_be(DeviceErrorKind::Lost, trace_one(&device, LIMIT))
}
