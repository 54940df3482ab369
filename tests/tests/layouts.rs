//! The layout of trees that is not a Vulkan device's usual one, and counts over the wide one.
//!
//! The conformance suite on the first device with its other layout; hits and counts of the kernels over the wide layout
//! against `rt_bvh`'s over the same, bit for bit, on troublesome shapes, the built-in scenes and real ones; closed
//! meshes that do not leak. Without a device the tests are ignored with the reason, unless `RT_REQUIRE` names `vulkan`.

use backend_vulkan::{GpuDevice, Layout, Layouts, Options, VulkanDevice};
use glam::Vec3;
use libtest_mimic::{Arguments, Completion, Failed, Trial, run};
use rayon::prelude::*;
use rt_bvh::{Builder, Stack, WideTree, count_wide, trace_wide};
use rt_conformance::{Subject, trials};
use rt_core::{
    Device, Hit, Launch, Precision, Query, Ray, RaySource, ReducedWalk, StreamSpec, TestCounts, Tracer, Triangle, Walk,
    random, tasks_of,
};
use rt_report::print::note;
use rt_scene::builtin;
use rt_tests::scenes;
use rt_verify::clock;
use rt_verify::rays::RayMaker;
use rt_verify::{shapes, tree};
use std::sync::Arc;
use std::time::Duration;

/// The longest a launch may take; a software rasteriser on a loaded machine is slow.
const LIMIT: Duration = Duration::from_secs(120);

/// Rays of each kind of query on each scene.
const RAYS: u32 = 3_000;

/// Rays that must not leak.
const LEAK_RAYS: u32 = 1_000_000;

/// Of those, rays loaded at once.
const LEAK_BATCH: usize = 500_000;

/// Everything over the wide layout, counts too.
const ALL_WIDE: Layouts = Layouts { trace: Layout::Wide, count: Layout::Wide };

fn main() {
    let arguments = Arguments::from_args();
    let usual = match open(None) {
        Ok(device) => device.layouts(),
        Err(reason) => {
            let must =
                std::env::var("RT_REQUIRE").is_ok_and(|list| list.split(',').any(|name| name.trim() == "vulkan"));
            let test = move || match must {
                true => Err(Failed::from(format!("required by RT_REQUIRE, but missing: {reason}"))),
                false => Ok(Completion::ignored_with(reason)),
            };
            run(&arguments, vec![Trial::ignorable_test("layouts", test).with_kind("vulkan/none")]).exit();
        }
    };
    let (other, label) = match usual.trace {
        Layout::Two => (Layout::Wide, "0/wide"),
        Layout::Wide => (Layout::Two, "0/two"),
    };
    let device = open(Some(Layouts { trace: other, ..usual })).map(|device| Arc::new(device) as Arc<dyn Device>);
    let mut all = trials(vec![Subject::new("vulkan", label, device)]);
    let trial = |name: &str, test: Box<dyn Fn() -> Result<(), Failed> + Send>| {
        Trial::test(name, test).with_kind("vulkan/0/all wide")
    };
    all.push(trial("closed_meshes_do_not_leak", Box::new(closed_meshes_do_not_leak)));
    all.push(trial("shapes_are_the_processors", Box::new(shapes_are_the_processors)));
    for (name, model) in [("yard", builtin::yard as fn() -> _), ("car", builtin::car)] {
        let test = move || compare(name, &scenes::triangles(&model()));
        all.push(trial(&format!("builtin_{name}_is_the_processors"), Box::new(test)));
    }
    match scenes::find() {
        Ok(found) => all.extend(found.into_iter().map(|scene| {
            let name = format!("{}_is_the_processors", scene.name);
            trial(&name, Box::new(move || compare(&scene.name, &scenes::triangles(&scenes::load(&scene)?))))
        })),
        Err(reason) => {
            let test = move || Ok(Completion::ignored_with(reason.clone()));
            all.push(Trial::ignorable_test("real_scenes", test).with_kind("vulkan/0/all wide"));
        }
    }
    run(&arguments, all).exit();
}

/// The first device, with the validation layer where there is one.
fn open(layouts: Option<Layouts>) -> Result<VulkanDevice, String> {
    let found = VulkanDevice::enumerate(Options { validation: true, layouts, ..Options::default() })
        .or_else(|_| VulkanDevice::enumerate(Options { layouts, ..Options::default() }));
    let mut found = found.map_err(|e| e.to_string())?.into_iter();
    found.next().ok_or("there is no device")?.map_err(|e| e.to_string())
}

fn shapes_are_the_processors() -> Result<(), Failed> {
    let scaled = |exponent: i32| -> Vec<Triangle> {
        shapes::soup(200, 0.4, 5).iter().map(|t| t.scaled(2.0_f32.powi(exponent))).collect()
    };
    for (name, triangles) in [
        ("nothing", Vec::new()),
        ("one triangle", shapes::soup(1, 1.0, 6)),
        ("two triangles", shapes::grid(1, 0.1, 7)),
        ("terrain", shapes::grid(60, 0.2, 1)),
        ("sphere", shapes::icosphere(4)),
        ("plane", shapes::grid(12, 0.0, 0)),
        ("needles", shapes::needles(300, 1e-5, 3)),
        ("layers", shapes::layers(5, 40)),
        ("mixed scales", shapes::mixed_scales(300, 4)),
        ("fan", shapes::fan(64)),
        ("far away", shapes::moved(&shapes::icosphere(2), Vec3::new(1e6, -1e6, 1e6))),
        ("tiny", scaled(-100)),
        ("huge", scaled(100)),
    ] {
        compare(name, &triangles)?;
    }
    Ok(())
}

/// Hits and counts over the wide layout are those of `rt_bvh` over it, and hits those over the two-wide one. Fails when
/// the kernel takes a leaf's bytes for a node's, visits slots in another order, or pads with another constant.
fn compare(name: &str, triangles: &[Triangle]) -> Result<(), Failed> {
    let device = open(Some(ALL_WIDE))?;
    let scene = tree::build(triangles, Builder::Sah)?;
    let wide = WideTree::new(&scene);
    wide.check().map_err(|e| format!("{name}: {e}"))?;
    let rays = RayMaker::new(triangles, 3).mixed(RAYS);
    let (given, origins): (Vec<Ray>, Vec<u32>) = rays.iter().copied().unzip();
    let source = RaySource::Explicit { rays: given.into(), origins: Some(origins.into()) };
    let mut tracer = device.tracer(Arc::clone(&scene), clock)?;
    for query in [Query::Closest, Query::Any] {
        let spec = StreamSpec { query, counts: true, ..StreamSpec::default() };
        let launch = launch(&mut *tracer, &source, spec)?;
        let mut expected = Vec::new();
        trace_wide(&wide, &mut Stack::default(), spec, rays.iter().copied(), |hit, counts| {
            expected.push((hit, counts))
        });
        for (i, (hit, counts)) in expected.into_iter().enumerate() {
            if (bits(&launch.hits[i]), launch.counts[i]) != (bits(&hit), counts) {
                let found = (launch.hits[i], launch.counts[i]);
                return Err(
                    format!("{name}, {query:?}, ray {i} {:?}: {found:?}, not {hit:?}, {counts:?}", rays[i]).into()
                );
            }
        }
        if query == Query::Closest {
            let plain = self::launch(&mut *tracer, &source, StreamSpec { counts: false, ..spec })?;
            let (two, _) = tree::trace(&scene, spec, &rays);
            if let Some(i) = (0..rays.len()).find(|&i| bits(&plain.hits[i]) != bits(&two[i])) {
                return Err(format!("{name}, ray {i} {:?}: {:?}, not {:?}", rays[i], plain.hits[i], two[i]).into());
            }
        }
    }
    let indices: Vec<u32> = (0..rays.len() as u32).collect();
    for kind in [ReducedWalk::LeafAsHit, ReducedWalk::Unshortened] {
        let walk = Walk::Reduced(kind);
        let mut counts = vec![TestCounts::default(); rays.len()];
        tracer.walk(&indices, walk, &mut counts, None)?;
        let mut expected = Vec::new();
        let sink = |_, counts| expected.push(counts);
        count_wide(&wide, &mut Stack::default(), walk, Precision::Robust, rays.iter().copied(), sink);
        if let Some(i) = (0..rays.len()).find(|&i| counts[i] != expected[i]) {
            return Err(
                format!("{name}, {kind:?}, ray {i} {:?}: {:?}, not {:?}", rays[i], counts[i], expected[i]).into()
            );
        }
    }
    Ok(())
}

fn bits(hit: &Hit) -> [u32; 4] {
    [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive]
}

/// All rays in one launch.
fn launch(tracer: &mut dyn Tracer, source: &RaySource, spec: StreamSpec) -> Result<Launch, Failed> {
    tracer.load_rays(source.clone(), spec)?;
    let ticket = tracer.submit(&tasks_of(source.len(), u32::MAX), None)?;
    let mut launch = Launch::default();
    tracer.wait(ticket, LIMIT, &mut launch)?;
    Ok(launch)
}

/// From inside a closed mesh every ray hits, also those aimed at edges and vertices and along the axes. Fails when the
/// kernel does not pad wide boxes.
fn closed_meshes_do_not_leak() -> Result<(), Failed> {
    let device = open(Some(ALL_WIDE))?;
    let indices: Vec<u32> = (0..LEAK_RAYS.div_ceil(2)).collect();
    let (mut leaks, mut traced) = (0, 0);
    for offset in [Vec3::ZERO, Vec3::new(1e6, -1e6, 1e6)] {
        let triangles = shapes::moved(&shapes::icosphere(5), offset);
        let mut tracer = device.tracer(tree::build(&triangles, Builder::Sah)?, clock)?;
        for batch in indices.chunks(LEAK_BATCH) {
            let rays: Vec<Ray> = batch.par_iter().map(|&i| inner_ray(&triangles, offset, i)).collect();
            traced += rays.len();
            let source = RaySource::Explicit { rays: rays.into(), origins: None };
            let launch = launch(&mut *tracer, &source, StreamSpec::default())?;
            leaks += launch.hits.iter().filter(|hit| !hit.is_hit()).count();
        }
    }
    note(format_args!("{leaks} leaks in {traced} rays"));
    if leaks == 0 { Ok(()) } else { Err(format!("{leaks} of {traced} rays leak out of a closed mesh").into()) }
}

/// A ray from near the centre of a sphere at a point of an edge, at a vertex, or along an axis.
fn inner_ray(triangles: &[Triangle], centre: Vec3, index: u32) -> Ray {
    let triangle = triangles[random::below(triangles.len() as u32, 6, index, 0) as usize];
    let [x, y] = random::pair(6, index, 1);
    let [z, w] = random::pair(6, index, 2);
    // Every other ray starts exactly at the centre.
    let from = centre + if index & 1 == 0 { Vec3::ZERO } else { (Vec3::new(x, y, z) - 0.5) * 0.25 };
    let to = match index / 2 % 3 {
        0 => triangle.a + (triangle.b - triangle.a) * w,
        1 => triangle.b,
        _ => from + [Vec3::X, Vec3::NEG_Y, Vec3::Z][index as usize % 3],
    };
    Ray::new(from, to - from)
}
