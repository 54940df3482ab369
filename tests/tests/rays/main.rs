//! Rays on graphics devices: made there from the camera and from hits, in several buffers, by persistent threads;
//! always the hits and counts of the processor.
//!
//! The first device of each backend is tried, Vulkan's with the validation layer where it is installed. Without one the
//! tests are ignored with the reason, unless `RT_REQUIRE` names the backend.

mod bounces;

use backend_vulkan::{OpenError, VulkanDevice};
use backend_wgpu::WgpuDevice;
use libtest_mimic::{Arguments, Completion, Failed, Trial, run};
use rt_bvh::Builder;
use rt_core::{
    CameraRays, Hit, Launch, Query, Ray, RayMask, RaySource, ReducedWalk, Scene, StreamSpec, Task, TestCounts, Tracer,
    Walk, morton, random, tasks_of,
};
use rt_gpu::{GpuDevice, Tuning};
use rt_report::print::note;
use rt_scene::{View, builtin};
use rt_tests::scenes;
use rt_verify::clock;
use rt_verify::tree;
use std::fmt::Display;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// The longest a launch may take; a software rasteriser on a loaded machine is slow.
const LIMIT: Duration = Duration::from_secs(120);

/// A device as a test wants it.
struct Opened {
    device: Arc<dyn GpuDevice>,
    makes_rays: bool,
}

/// A backend: its name, and its first device that can be used, or why there is none.
type Backend = (&'static str, fn(Tuning) -> Result<Opened, String>);

const BACKENDS: [Backend; 2] = [("vulkan", vulkan), ("wgpu", wgpu)];

type Test = fn(Backend) -> Result<(), Failed>;

const TESTS: [(&str, Test); 8] = [
    ("camera_rays_are_made_there", camera_rays_are_made_there),
    ("bounces_are_made_there", bounces::are_made_there),
    ("bounces_are_the_hosts_to_the_bit", bounces::are_the_hosts_to_the_bit),
    ("bounces_of_a_wrong_kernel_are_the_hosts", bounces::of_a_wrong_kernel_are_the_hosts),
    ("windows_change_nothing", windows_change_nothing),
    ("persistent_threads_change_nothing", persistent_threads_change_nothing),
    ("each_ray_that_is_asked_for_is_traced_once", each_ray_that_is_asked_for_is_traced_once),
    ("more_rays_than_a_buffer_holds", more_rays_than_a_buffer_holds),
];

fn main() {
    let pairs = BACKENDS.into_iter().flat_map(|backend| TESTS.map(|test| (backend, test)));
    let tests = pairs.map(|(backend, (name, test))| {
        let run = move || match backend.1(Tuning::default()) {
            Ok(_) => test(backend).map(|()| Completion::Completed),
            Err(reason) if is_required(backend.0) => Err(reason.into()),
            Err(reason) => Ok(Completion::ignored_with(reason)),
        };
        Trial::ignorable_test(name, run).with_kind(backend.0)
    });
    run(&Arguments::from_args(), tests.collect()).exit();
}

fn vulkan(tuning: Tuning) -> Result<Opened, String> {
    let open = |validation| VulkanDevice::enumerate(backend_vulkan::Options { validation, ..Default::default() });
    let found = match open(true) {
        Err(OpenError::NoValidation) if !is_required("vulkan") => open(false),
        found => found,
    };
    let device = first(found.map_err(|e| e.to_string())?)?.tuned(tuning);
    Ok(Opened { makes_rays: device.makes_rays(), device: Arc::new(device) })
}

fn wgpu(tuning: Tuning) -> Result<Opened, String> {
    let found = WgpuDevice::enumerate(backend_wgpu::Options::default()).map_err(|e| e.to_string())?;
    let device = first(found)?.tuned(tuning);
    Ok(Opened { makes_rays: device.makes_rays(), device: Arc::new(device) })
}

fn first<T, E: Display>(found: Vec<Result<T, E>>) -> Result<T, String> {
    let mut reasons = Vec::new();
    for device in found {
        match device {
            Ok(device) => return Ok(device),
            Err(e) => reasons.push(e.to_string()),
        }
    }
    Err(reasons.join("; "))
}

fn is_required(backend: &str) -> bool {
    std::env::var("RT_REQUIRE").is_ok_and(|list| list.split(',').any(|name| name.trim() == backend))
}

/// The built-in car, which is cheap to build, and the view of it.
fn car() -> Result<(Arc<Scene>, View), Failed> {
    static CAR: OnceLock<(Arc<Scene>, View)> = OnceLock::new();
    if let Some(car) = CAR.get() {
        return Ok(car.clone());
    }
    let model = builtin::car();
    let scene = tree::build(&scenes::triangles(&model), Builder::Sah)?;
    Ok(CAR.get_or_init(|| (scene, model.view.expect("built-in scenes have a view"))).clone())
}

fn camera(view: &View, size: [u32; 2], samples: u32) -> Result<Arc<CameraRays>, Failed> {
    let pixels = morton::pixel_order(size[0], size[1]).into();
    Ok(Arc::new(CameraRays {
        camera: view.camera()?,
        size,
        pixels,
        samples,
        first_sample: 0,
        all_samples: samples,
        seed: 3,
    }))
}

fn load(device: &dyn GpuDevice, rays: &Arc<CameraRays>, spec: StreamSpec) -> Result<Box<dyn Tracer>, Failed> {
    let mut tracer = device.tracer(car()?.0, clock)?;
    tracer.load_rays(RaySource::Camera(Arc::clone(rays)), spec)?;
    Ok(tracer)
}

fn launch(tracer: &mut dyn Tracer, tasks: &[Task], done: Option<&Arc<RayMask>>) -> Result<Launch, Failed> {
    let ticket = tracer.submit(tasks, done)?;
    let mut launch = Launch::default();
    tracer.wait(ticket, LIMIT, &mut launch)?;
    Ok(launch)
}

fn bits(hit: &Hit) -> [u32; 4] {
    [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive]
}

/// The first answer that is not the processor's.
fn compare(what: &str, launch: &Launch, hits: &[Hit], counts: &[TestCounts]) -> Result<(), Failed> {
    let same = |i: &usize| {
        bits(&launch.hits[*i]) == bits(&hits[*i]) && launch.counts.get(*i).is_none_or(|found| *found == counts[*i])
    };
    match (0..hits.len()).find(|i| !same(i)) {
        _ if launch.hits.len() != hits.len() => Err(format!("{what}: {} hits", launch.hits.len()).into()),
        Some(i) => Err(format!("{what}, ray {i}: {:?}, not {:?}", launch.hits[i], hits[i]).into()),
        None => Ok(()),
    }
}

fn on_processor(rays: &CameraRays, spec: StreamSpec) -> Result<(Vec<Hit>, Vec<TestCounts>), Failed> {
    let rays: Vec<(Ray, u32)> = (0..rays.len()).map(|i| (rays.ray(i), u32::MAX)).collect();
    Ok(tree::trace(&car()?.0, spec, &rays))
}

const COUNTED: StreamSpec = StreamSpec::new(Query::Closest, rt_core::Precision::Robust, true);

/// Sizes odd and even, one sample and several, in one window and in small ones that cut pixels in two. Fails when the
/// kernel takes a pixel's samples from the start of its window, or divides by the width.
fn camera_rays_are_made_there((_, open): Backend) -> Result<(), Failed> {
    let Opened { device, makes_rays } = open(Tuning::default())?;
    if device.card().software && !makes_rays {
        return Err("lavapipe rounds as IEEE 754 says, and yet makes other rays than the host".into());
    }
    for (size, samples, window) in [([97, 61], 1, None), ([64, 40], 3, None), ([64, 40], 3, Some(1000))] {
        let Opened { device, .. } = open(Tuning { window, ..Tuning::default() })?;
        let (_, view) = car()?;
        let rays = camera(&view, size, samples)?;
        let mut tracer = load(&*device, &rays, COUNTED)?;
        let tasks = tasks_of(rays.len(), 700);
        // Rays are made when they are first asked for, and not again.
        for (asked, expected) in
            [(&tasks[..0], 0), (&tasks[1..3], 1400), (&tasks[..], rays.len()), (&tasks[2..4], rays.len())]
        {
            launch(&mut *tracer, asked, None)?;
            let expected = if makes_rays { u64::from(expected) } else { 0 };
            if device.counters().made() != expected {
                return Err(format!("{} rays made, not {expected}", device.counters().made()).into());
            }
        }
        let before = device.counters().on_host();
        let found = launch(&mut *tracer, &tasks, None)?;
        let (hits, counts) = on_processor(&rays, COUNTED)?;
        compare(&format!("{size:?}, {samples} samples, {window:?}"), &found, &hits, &counts)?;
        if !hits.iter().any(Hit::is_hit) {
            return Err("the camera looks past the scene".into());
        }
        let share = (device.counters().on_host() - before) as f64 / f64::from(rays.len());
        note(format_args!("{size:?}, {samples} samples: {share:.5} of the rays on the host"));
        // A column and a row of an odd image run along an axis of the camera, not of the scene.
        if share > 0.01 {
            return Err(format!("the host had to trace {share:.4} of the rays").into());
        }
    }
    Ok(())
}

/// Launches, walks and masks over windows. Fails when a list names rays by their number in the stream.
fn windows_change_nothing((_, open): Backend) -> Result<(), Failed> {
    let (scene, view) = car()?;
    let rays = camera(&view, [64, 48], 2)?;
    let count = rays.len();
    let (hits, counts) = on_processor(&rays, COUNTED)?;
    let Opened { device, .. } = open(Tuning { window: Some(1500), ..Tuning::default() })?;
    let explicit: Vec<Ray> = (0..count).map(|i| rays.ray(i)).collect();
    let sources = [RaySource::Camera(Arc::clone(&rays)), RaySource::Explicit { rays: explicit.into(), origins: None }];
    let mut mask = RayMask::new(count);
    (0..count).filter(|&ray| random::below(3, 1, ray, 2) == 0).for_each(|ray| mask.insert(ray));
    let mask = Arc::new(mask);
    for source in sources {
        let mut tracer = device.tracer(Arc::clone(&scene), clock)?;
        tracer.load_rays(source, COUNTED)?;
        let mut tasks = tasks_of(count, 611);
        tasks.reverse();
        let found = launch(&mut *tracer, &tasks, None)?;
        let order = || tasks.iter().flat_map(Task::range).map(|ray| ray as usize);
        let hits_in_order: Vec<Hit> = order().map(|ray| hits[ray]).collect();
        let counts_in_order: Vec<TestCounts> = order().map(|ray| counts[ray]).collect();
        compare("all tasks backwards", &found, &hits_in_order, &counts_in_order)?;

        let found = launch(&mut *tracer, &tasks_of(count, u32::MAX), Some(&mask))?;
        let (mut hits_left, mut counts_left) = (hits.clone(), counts.clone());
        for ray in (0..count).filter(|&ray| mask.contains(ray)) {
            (hits_left[ray as usize], counts_left[ray as usize]) = (Hit::MISS, TestCounts::default());
        }
        compare("a third left out", &found, &hits_left, &counts_left)?;

        let samples: Vec<u32> = (0..count).step_by(7).rev().collect();
        for walk in [Walk::Full, Walk::Reduced(ReducedWalk::LeafAsHit)] {
            let mut walked = vec![TestCounts::default(); samples.len()];
            tracer.walk(&samples, walk, &mut walked, None)?;
            let given: Vec<(Ray, u32)> = samples.iter().map(|&i| (rays.ray(i), u32::MAX)).collect();
            let (_, expected) = tree::walk(&scene, walk, COUNTED, &given);
            if walked != expected {
                return Err(format!("{walk:?}: other counts").into());
            }
        }
    }
    Ok(())
}

/// Fewer lanes than rays, down to one workgroup and to a part of one. Fails when lanes stop after their first ray.
fn persistent_threads_change_nothing((_, open): Backend) -> Result<(), Failed> {
    let (_, view) = car()?;
    let rays = camera(&view, [48, 32], 2)?;
    for query in [Query::Closest, Query::Any] {
        let spec = StreamSpec { query, ..COUNTED };
        let (hits, counts) = on_processor(&rays, spec)?;
        for (lanes, window) in [(64, None), (17, None), (1024, Some(1100)), (1 << 30, None)] {
            let tuning = Tuning { persistent_lanes: Some(lanes), window, ..Tuning::default() };
            let Opened { device, .. } = open(tuning)?;
            let mut tracer = load(&*device, &rays, spec)?;
            for _ in 0..2 {
                let found = launch(&mut *tracer, &tasks_of(rays.len(), 100), None)?;
                compare(&format!("{query:?}, {lanes} lanes"), &found, &hits, &counts)?;
            }
            if device.counters().rays() != 2 * u64::from(rays.len()) {
                return Err(format!("{lanes} lanes traced {} rays", device.counters().rays()).into());
            }
        }
    }
    Ok(())
}

/// What is not in a launch is neither traced nor written.
fn each_ray_that_is_asked_for_is_traced_once((_, open): Backend) -> Result<(), Failed> {
    let (_, view) = car()?;
    let rays = camera(&view, [64, 64], 1)?;
    let Opened { device, .. } = open(Tuning::default())?;
    let mut tracer = load(&*device, &rays, StreamSpec::default())?;
    let (hits, counts) = on_processor(&rays, StreamSpec::default())?;
    let tasks = [Task { first: 3000, rays: 500 }, Task { first: 100, rays: 900 }];
    let mut mask = RayMask::new(rays.len());
    (100..200).for_each(|ray| mask.insert(ray));
    // As if a launch before had left something there.
    let mut found = Launch { hits: vec![hits[0]; 10_000], ..Launch::default() };
    let ticket = tracer.submit(&tasks, Some(&Arc::new(mask)))?;
    tracer.wait(ticket, LIMIT, &mut found)?;
    let mut expected: Vec<Hit> = tasks.iter().flat_map(Task::range).map(|ray| hits[ray as usize]).collect();
    expected[500..600].fill(Hit::MISS);
    compare("two tasks", &found, &expected, &counts)?;
    match device.counters().rays() {
        1300 => Ok(()),
        other => Err(format!("{other} rays traced, not 1300").into()),
    }
}

/// A stream for which one buffer is too small: 2²¹ rays on lavapipe, which binds 128 MiB.
fn more_rays_than_a_buffer_holds((_, open): Backend) -> Result<(), Failed> {
    let Opened { device, .. } = open(Tuning::default())?;
    if !device.card().software {
        // Real cards bind 4 GiB: windows of other sizes are tried above.
        return Ok(());
    }
    let (scene, view) = car()?;
    let rays = camera(&view, [64, 32], 1100)?;
    let mut tracer = load(&*device, &rays, StreamSpec::default())?;
    let tasks = [
        Task { first: 0, rays: 500 },
        Task { first: (1 << 21) - 300, rays: 600 },
        Task { first: rays.len() - 700, rays: 700 },
    ];
    let found = launch(&mut *tracer, &tasks, None)?;
    let given: Vec<(Ray, u32)> = tasks.iter().flat_map(Task::range).map(|i| (rays.ray(i), u32::MAX)).collect();
    let (hits, counts) = tree::trace(&scene, StreamSpec::default(), &given);
    compare("three places", &found, &hits, &counts)
}
