//! Vulkan devices: the conformance suite, bit for bit the processor's hits and counts on real scenes, closed meshes that
//! do not leak, and how many rays are left to the host.
//!
//! Every device that Vulkan lists is tried, with the validation layer where it is installed. Without a device the tests
//! are ignored with the reason, unless `RT_REQUIRE` names `vulkan`: then device and layer must be there.

use backend_vulkan::{OpenError, Options, VulkanDevice};
use libtest_mimic::{Arguments, Completion, Failed, Trial, run};
use rt_bvh::Builder;
use rt_core::{
    Device, Hit, Launch, Query, Ray, RaySource, ReducedWalk, Scene, StreamSpec, Task, TestCounts, Tracer, Walk, random,
    tasks_of,
};
use rt_scene::{Model, builtin};
use rt_tests::conformance::{Subject, clock, trials};
use rt_tests::rays::{Aim, RayMaker};
use rt_tests::{scenes, shapes, tree};
use std::sync::Arc;
use std::time::Duration;

/// The longest a launch may take; a software rasteriser on a loaded machine is slow.
const LIMIT: Duration = Duration::from_secs(120);

/// Rays of each kind of query on each scene.
const RAYS: u32 = 6_000;

/// Rays that must not leak, for each device: `RAYBALANCE_LEAK_RAYS`, or this many.
const LEAK_RAYS: u32 = 1_000_000;

/// Of those, rays loaded at once: what every device binds.
const LEAK_BATCH: usize = 500_000;

/// Share of random rays that may be left to the host. Measured on ordinary scenes: below a thousandth.
const ON_HOST: f64 = 0.01;

fn main() {
    let arguments = Arguments::from_args();
    let (devices, mut subjects) = find();
    subjects.extend(devices.iter().map(|(label, device)| {
        let device: Arc<dyn Device> = device.clone();
        Subject::new("vulkan", label, Ok(device))
    }));
    let mut all = trials(subjects);
    for (index, (label, device)) in devices.into_iter().enumerate() {
        let trial = |name: &str, test: fn(&VulkanDevice) -> Result<(), Failed>| {
            let device = Arc::clone(&device);
            Trial::test(name, move || test(&device)).with_kind(format!("vulkan/{label}"))
        };
        all.push(trial("closed_meshes_do_not_leak", closed_meshes_do_not_leak));
        let test = move || few_random_rays_are_left_to_the_host(index);
        all.push(Trial::test("few_random_rays_are_left_to_the_host", test).with_kind(format!("vulkan/{label}")));
        all.push(trial("too_many_rays_are_refused_with_their_size", too_many_rays_are_refused_with_their_size));
        let test = move || the_validation_layer_is_at_work(index);
        all.push(Trial::ignorable_test("the_validation_layer_is_at_work", test).with_kind(format!("vulkan/{label}")));
        all.push(trial("builtin_yard_is_the_processors", |device| compare(device, &builtin::yard())));
        all.push(trial("builtin_car_is_the_processors", |device| compare(device, &builtin::car())));
        match scenes::find() {
            Ok(scenes) => all.extend(scenes.into_iter().map(|scene| {
                let device = Arc::clone(&device);
                let name = format!("{}_is_the_processors", scene.name);
                let test = move || {
                    let mut model = scene.load()?;
                    model.view = scene.view;
                    compare(&device, &model)
                };
                Trial::test(name, test).with_kind(format!("vulkan/{label}"))
            })),
            Err(reason) => {
                let test = move || Ok(Completion::ignored_with(reason.clone()));
                all.push(Trial::ignorable_test("real_scenes", test).with_kind(format!("vulkan/{label}")));
            }
        }
    }
    run(&arguments, all).exit();
}

/// Devices with their labels; and in place of missing ones, subjects that say why.
fn find() -> (Vec<(String, Arc<VulkanDevice>)>, Vec<Subject>) {
    let found = match VulkanDevice::enumerate(Options { validation: true, ..Options::default() }) {
        Err(OpenError::NoValidation) if !is_required() => {
            println!("vulkan: the validation layer is not installed: calls are not checked");
            VulkanDevice::enumerate(Options::default())
        }
        found => found,
    };
    let missing = |reason: String| (Vec::new(), vec![Subject::new("vulkan", "none", Err(reason))]);
    let found = match found {
        Ok(found) => found,
        Err(e) => return missing(e.to_string()),
    };
    let (mut devices, mut reasons) = (Vec::new(), Vec::new());
    for device in found {
        match device {
            Ok(device) => {
                let name = device.info().name.to_lowercase();
                let label = format!("{}/{}", name.split_whitespace().next().unwrap_or("device"), devices.len());
                println!("vulkan: {label}: {} ({})", device.info().name, device.driver());
                devices.push((label, Arc::new(device)));
            }
            Err(e) => reasons.push(e.to_string()),
        }
    }
    if devices.is_empty() {
        return missing(reasons.join("; "));
    }
    reasons.iter().for_each(|reason| println!("vulkan: {reason}"));
    (devices, Vec::new())
}

/// Whether `RT_REQUIRE` names Vulkan.
fn is_required() -> bool {
    std::env::var("RT_REQUIRE").is_ok_and(|list| list.split(',').any(|name| name.trim() == "vulkan"))
}

fn bits(hit: &Hit) -> [u32; 4] {
    [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive]
}

/// A tracer with rays loaded.
fn load(
    device: &VulkanDevice,
    scene: &Arc<Scene>,
    rays: &[(Ray, u32)],
    spec: StreamSpec,
) -> Result<Box<dyn Tracer>, Failed> {
    let mut tracer = device.tracer(Arc::clone(scene), clock)?;
    let (rays, origins): (Vec<Ray>, Vec<u32>) = rays.iter().copied().unzip();
    tracer.load_rays(RaySource::Explicit { rays: rays.into(), origins: Some(origins.into()) }, spec)?;
    Ok(tracer)
}

/// All rays in one launch.
fn trace(device: &VulkanDevice, scene: &Arc<Scene>, rays: &[(Ray, u32)], spec: StreamSpec) -> Result<Launch, Failed> {
    let mut tracer = load(device, scene, rays, spec)?;
    let ticket = tracer.submit(&tasks_of(rays.len() as u32, u32::MAX), None)?;
    let mut launch = Launch::default();
    tracer.wait(ticket, LIMIT, &mut launch)?;
    Ok(launch)
}

/// Hits and counts of full and reduced traversal are those of `rt_bvh`. Fails when the kernel rounds a distance without
/// looking whether the reference rounds it alike, or pads boxes with another constant.
fn compare(device: &VulkanDevice, model: &Model) -> Result<(), Failed> {
    let triangles = scenes::triangles(model);
    let scene = tree::build(&triangles, Builder::Sah)?;
    let maker = RayMaker::new(&triangles, 3);
    let mut rays = maker.mixed(RAYS / 2);
    if let Some(camera) = model.view.map(|view| view.camera()).transpose()? {
        let aimed = |i| {
            let [x, y] = random::pair(8, i, 0);
            (camera.ray(x, y, 1.6), u32::MAX)
        };
        rays.extend((0..RAYS / 2).map(aimed));
    }
    for query in [Query::Closest, Query::Any] {
        let spec = StreamSpec { query, counts: true, ..StreamSpec::default() };
        let launch = trace(device, &scene, &rays, spec)?;
        let (hits, counts) = tree::trace(&scene, spec, &rays);
        if let Some(i) = (0..rays.len()).find(|&i| bits(&launch.hits[i]) != bits(&hits[i])) {
            return Err(format!("{query:?}, ray {i} {:?}: {:?}, not {:?}", rays[i], launch.hits[i], hits[i]).into());
        }
        if let Some(i) = (0..rays.len()).find(|&i| launch.counts[i] != counts[i]) {
            return Err(format!("{query:?}, ray {i} {:?}: {:?}, not {:?}", rays[i], launch.counts[i], counts[i]).into());
        }
    }
    let mut tracer = load(device, &scene, &rays, StreamSpec::default())?;
    let indices: Vec<u32> = (0..rays.len() as u32).collect();
    for kind in [ReducedWalk::LeafAsHit, ReducedWalk::Unshortened] {
        let mut counts = vec![TestCounts::default(); rays.len()];
        tracer.walk(&indices, Walk::Reduced(kind), &mut counts, None)?;
        let (_, expected) = tree::walk(&scene, Walk::Reduced(kind), StreamSpec::default(), &rays);
        if counts != expected {
            return Err(format!("{kind:?}: other counts").into());
        }
    }
    Ok(())
}

/// From inside a closed mesh every ray hits, also those aimed at edges and vertices and along the axes.
fn closed_meshes_do_not_leak(device: &VulkanDevice) -> Result<(), Failed> {
    let wanted = std::env::var("RAYBALANCE_LEAK_RAYS").ok().and_then(|n| n.parse().ok()).unwrap_or(LEAK_RAYS);
    let offsets = [glam::Vec3::ZERO, glam::Vec3::new(1e3, -2e3, 7.0), glam::Vec3::new(1e6, -1e6, 1e6)];
    let (mut leaks, mut traced) = (0, 0);
    for offset in offsets {
        let triangles = shapes::moved(&shapes::icosphere(5), offset);
        let scene = tree::build(&triangles, Builder::Sah)?;
        let query = if offset.x == 1e3 { Query::Any } else { Query::Closest };
        let indices: Vec<u32> = (0..wanted.div_ceil(3)).collect();
        for batch in indices.chunks(LEAK_BATCH) {
            let rays: Vec<(Ray, u32)> = batch.iter().map(|&i| inner_ray(&triangles, offset, i)).collect();
            let launch = trace(device, &scene, &rays, StreamSpec { query, ..StreamSpec::default() })?;
            leaks += launch.hits.iter().filter(|hit| !hit.is_hit()).count();
            traced += rays.len();
        }
    }
    println!("{leaks} leaks in {traced} rays");
    if leaks == 0 { Ok(()) } else { Err(format!("{leaks} of {traced} rays leak out of a closed mesh").into()) }
}

/// A ray from near the centre of a sphere at an edge, a vertex, along an axis, or anywhere.
fn inner_ray(triangles: &[rt_core::Triangle], centre: glam::Vec3, index: u32) -> (Ray, u32) {
    let triangle = triangles[random::below(triangles.len() as u32, 5, index, 0) as usize];
    let [x, y] = random::pair(5, index, 1);
    let [z, w] = random::pair(5, index, 2);
    // Every other ray starts exactly at the centre.
    let from = centre + if index & 1 == 0 { glam::Vec3::ZERO } else { (glam::Vec3::new(x, y, z) - 0.5) * 0.25 };
    let to = match index / 2 % 4 {
        0 => triangle.a + (triangle.b - triangle.a) * w,
        1 => triangle.b,
        2 => from + [glam::Vec3::X, glam::Vec3::NEG_Y, glam::Vec3::Z][index as usize % 3],
        _ => triangle.a + (triangle.b - triangle.a) * (0.5 * w) + (triangle.c - triangle.a) * (0.5 * x),
    };
    (Ray::new(from, to - from), u32::MAX)
}

fn few_random_rays_are_left_to_the_host(index: usize) -> Result<(), Failed> {
    // Opened anew: other tests that run beside this one add to their device's tally.
    let mut devices = VulkanDevice::enumerate(Options::default())?.into_iter().flatten();
    let device = &devices.nth(index).ok_or("the device is gone")?;
    for (name, triangles) in
        [("terrain", shapes::grid(60, 0.2, 1)), ("soup", shapes::soup(5_000, 0.1, 2)), ("sphere", shapes::icosphere(5))]
    {
        let scene = tree::build(&triangles, Builder::Sah)?;
        let maker = RayMaker::new(&triangles, 21);
        let aims = [Aim::Random, Aim::Interior, Aim::Diffuse];
        let rays: Vec<_> = (0..30_000).map(|i| maker.ray(aims[i as usize % 3], i)).collect();
        let before = device.tally().on_host();
        trace(device, &scene, &rays, StreamSpec::default())?;
        let share = (device.tally().on_host() - before) as f64 / rays.len() as f64;
        println!("{name}: {share:.5} of the rays on the host");
        if share > ON_HOST {
            return Err(format!("{name}: the host had to trace {share:.4} of the rays").into());
        }
    }
    Ok(())
}

/// A wrong call is objected to: else no message in the other tests would mean nothing.
fn the_validation_layer_is_at_work(index: usize) -> Result<Completion, Failed> {
    // Opened anew, so that the message does not reach the other tests.
    let devices = match VulkanDevice::enumerate(Options { validation: true, ..Options::default() }) {
        Err(e @ OpenError::NoValidation) if !is_required() => return Ok(Completion::ignored_with(e.to_string())),
        devices => devices?,
    };
    let device = devices.into_iter().flatten().nth(index).ok_or("the device is gone")?;
    match device.provoke_validation() {
        Err(e) if e.to_string().contains("VUID") => Ok(Completion::Completed),
        other => Err(format!("a wrong copy was not objected to: {other:?}").into()),
    }
}

/// More rays than the device binds at once, without a byte of host memory for them: one camera pixel, many samples.
fn too_many_rays_are_refused_with_their_size(device: &VulkanDevice) -> Result<(), Failed> {
    if !device.is_software() {
        // Real cards bind 4 GiB, for which preparing rays would take long.
        return Ok(());
    }
    let scene = tree::build(&shapes::grid(2, 0.0, 0), Builder::Sah)?;
    let mut tracer = device.tracer(Arc::clone(&scene), clock)?;
    let camera = rt_core::Camera::look_at(glam::Vec3::Y, glam::Vec3::ZERO, glam::Vec3::X, 40.0)?;
    let rays = |samples| {
        RaySource::Camera(Arc::new(rt_core::CameraRays { camera, size: [1, 1], pixels: [0].into(), samples, seed: 1 }))
    };
    let error = tracer.load_rays(rays(1 << 30), StreamSpec::default());
    let refused = error.is_err_and(|e| {
        e.kind() == rt_core::DeviceErrorKind::OutOfMemory && e.to_string().contains(&(64_u64 << 30).to_string())
    });
    if !refused {
        return Err("2^30 rays were not refused with their size".into());
    }
    tracer.load_rays(rays(4), StreamSpec::default())?;
    let ticket = tracer.submit(&[Task { first: 0, rays: 4 }], None)?;
    Ok(tracer.wait(ticket, LIMIT, &mut Launch::default())?)
}
