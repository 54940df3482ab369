//! Hits and counts, bit for bit.

use crate::{Found, LIMIT};
use libtest_mimic::Failed;
use rayon::prelude::*;
use rt_bvh::Builder;
use rt_core::{
    Device, Hit, Launch, Query, Ray, RaySource, ReducedWalk, Scene, StreamSpec, TestCounts, Tracer, Triangle, Walk,
    random, tasks_of,
};
use rt_report::print::note;
use rt_scene::Model;
use rt_tests::scenes;
use rt_verify::clock;
use rt_verify::rays::{Aim, RayMaker};
use rt_verify::{shapes, tree};
use std::sync::Arc;

/// Rays of each kind of query on each scene.
const RAYS: u32 = 6_000;

/// Rays that must not leak, for all devices of a backend together. `raybalance verify --full --case watertight` tries
/// 10⁸.
const LEAK_RAYS: u32 = 1_000_000;

/// Of those, rays loaded at once: what every device binds.
const LEAK_BATCH: usize = 500_000;

/// Share of random rays that may be left to the host. Measured on ordinary scenes: below a thousandth.
const ON_HOST: f64 = 0.01;

fn bits(hit: &Hit) -> [u32; 4] {
    [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive]
}

/// A tracer with rays loaded.
fn load(
    device: &dyn Device,
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
pub(crate) fn trace(
    device: &dyn Device,
    scene: &Arc<Scene>,
    rays: &[(Ray, u32)],
    spec: StreamSpec,
) -> Result<Launch, Failed> {
    let mut tracer = load(device, scene, rays, spec)?;
    let ticket = tracer.submit(&tasks_of(rays.len() as u32, u32::MAX), None)?;
    let mut launch = Launch::default();
    tracer.wait(ticket, LIMIT, &mut launch)?;
    Ok(launch)
}

/// Hits and counts of full and reduced traversal are those of `rt_bvh`. Fails when the kernel rounds a distance without
/// looking whether the reference rounds it alike, or pads boxes with another constant.
pub(crate) fn compare(device: &dyn Device, model: &Model) -> Result<(), Failed> {
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
    compare_rays(device, &scene, &rays)?;
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

/// Hits and counts of rays are those of `rt_bvh`, and so are the hits alone, for which devices may walk another tree.
pub(crate) fn compare_rays(device: &dyn Device, scene: &Arc<Scene>, rays: &[(Ray, u32)]) -> Result<(), Failed> {
    for (query, counted) in [(Query::Closest, true), (Query::Any, true), (Query::Closest, false), (Query::Any, false)] {
        let spec = StreamSpec { query, counts: counted, ..StreamSpec::default() };
        let launch = trace(device, scene, rays, spec)?;
        let (hits, counts) = tree::trace(scene, spec, rays);
        // Which of several hits any-hit rays find depends on the tree.
        let same = |i: usize| match (query, counted) {
            (Query::Any, false) => launch.hits[i].is_hit() == hits[i].is_hit(),
            _ => bits(&launch.hits[i]) == bits(&hits[i]),
        };
        if let Some(i) = (0..rays.len()).find(|&i| !same(i)) {
            return Err(format!("{query:?}, ray {i} {:?}: {:?}, not {:?}", rays[i], launch.hits[i], hits[i]).into());
        }
        if let Some(i) = (0..rays.len()).find(|&i| counted && launch.counts[i] != counts[i]) {
            return Err(format!("{query:?}, ray {i} {:?}: {:?}, not {:?}", rays[i], launch.counts[i], counts[i]).into());
        }
    }
    Ok(())
}

/// From inside a closed mesh every ray hits, also those aimed at edges and vertices and along the axes. The rays are
/// shared out among the `devices` of a backend.
pub(crate) fn closed_meshes_do_not_leak(found: &Found, devices: usize) -> Result<(), Failed> {
    let each = LEAK_RAYS.div_ceil(devices as u32).div_ceil(3);
    // Every device has rays of its own.
    let first = each * found.position as u32;
    let offsets = [glam::Vec3::ZERO, glam::Vec3::new(1e3, -2e3, 7.0), glam::Vec3::new(1e6, -1e6, 1e6)];
    let (mut leaks, mut traced) = (0, 0);
    for offset in offsets {
        let triangles = shapes::moved(&shapes::icosphere(5), offset);
        let scene = tree::build(&triangles, Builder::Sah)?;
        let query = if offset.x == 1e3 { Query::Any } else { Query::Closest };
        let indices: Vec<u32> = (first..first + each).collect();
        for batch in indices.chunks(LEAK_BATCH) {
            let rays: Vec<(Ray, u32)> = batch.par_iter().map(|&i| inner_ray(&triangles, offset, i)).collect();
            let launch = trace(&*found.device, &scene, &rays, StreamSpec { query, ..StreamSpec::default() })?;
            leaks += launch.hits.iter().filter(|hit| !hit.is_hit()).count();
            traced += rays.len();
        }
    }
    note(format_args!("{leaks} leaks in {traced} rays"));
    if leaks == 0 { Ok(()) } else { Err(format!("{leaks} of {traced} rays leak out of a closed mesh").into()) }
}

/// A ray from near the centre of a sphere at an edge, a vertex, along an axis, or anywhere.
pub(crate) fn inner_ray(triangles: &[Triangle], centre: glam::Vec3, index: u32) -> (Ray, u32) {
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

pub(crate) fn few_random_rays_are_left_to_the_host(found: &Found) -> Result<(), Failed> {
    // Opened anew: other tests that run beside this one add to their device's counters.
    let device = found.again()?;
    for (name, triangles) in
        [("terrain", shapes::grid(60, 0.2, 1)), ("soup", shapes::soup(5_000, 0.1, 2)), ("sphere", shapes::icosphere(5))]
    {
        let scene = tree::build(&triangles, Builder::Sah)?;
        let maker = RayMaker::new(&triangles, 21);
        let aims = [Aim::Random, Aim::Interior, Aim::Diffuse];
        let rays: Vec<_> = (0..30_000).map(|i| maker.ray(aims[i as usize % 3], i)).collect();
        let before = device.counters().on_host();
        trace(&*device, &scene, &rays, StreamSpec::default())?;
        let share = (device.counters().on_host() - before) as f64 / rays.len() as f64;
        note(format_args!("{name}: {share:.5} of the rays on the host"));
        if share > ON_HOST {
            return Err(format!("{name}: the host had to trace {share:.4} of the rays").into());
        }
    }
    Ok(())
}

/// Rays that end exactly where they hit, on a triangle so small and so close that a kernel's products are denormal.
pub(crate) fn tiny_triangles_close_by(device: &dyn Device) -> Result<(), Failed> {
    let power = |exponent: i32| 2.0_f32.powi(exponent);
    // Local units are half as long as given ones, since the scene reaches to 1. So this is 2⁻³⁵ across, just above the
    // kernels' SMALLEST, and thin, so that edge functions are about 2⁻⁸⁰.
    let [width, height] = [power(-35), power(-43)];
    let corners = [[-1.0, -1.0], [1.0, -1.0], [0.0, 1.0]].map(|[x, y]| glam::Vec3::new(x * width, y * height, 0.0));
    let tiny = Triangle::new(corners[0], corners[1], corners[2]);
    // Keeps the scene's unit of length at about 1.
    let far = Triangle::new(glam::Vec3::NEG_ONE, glam::Vec3::new(-1.0, -1.0, -0.5), glam::Vec3::new(-1.0, -0.5, -1.0));
    let scene = tree::build(&[tiny, far], Builder::Sah)?;
    let ray = |i: u32| {
        let [x, y] = random::pair(4, i, 0);
        let [z, w] = random::pair(4, i, 1);
        let backward = glam::Vec3::new(x - 0.5, y - 0.5, 1.0);
        // Local distances from 2⁻²³, twice the kernels' NEAREST.
        let distance = power(-22) * (1.0 + z * z * 8.0);
        let target = glam::Vec3::new((w - 0.5) * width * 0.5, -0.5 * height, 0.0);
        let ray = Ray::new(target + backward * distance, -backward * (1.0 + w));
        let (hits, _) = tree::trace(&scene, StreamSpec::default(), &[(ray, u32::MAX)]);
        (if hits[0].is_hit() { ray.with_range(0.0, hits[0].t) } else { ray }, u32::MAX)
    };
    let rays: Vec<_> = (0..20_000).map(ray).collect();
    let met = rays.iter().filter(|(ray, _)| ray.tmax.is_finite()).count();
    if met < rays.len() / 2 {
        return Err(format!("only {met} of {} rays meet the triangle", rays.len()).into());
    }
    compare_rays(device, &scene, &rays)
}
