//! The peers behind our traits: they keep the rules of a tracer, and are asked about the triangles and rays we mean.
//!
//! Embree's tests are ignored with the reason where its library is missing, unless `RT_REQUIRE` names `embree`.

use backend_peers::{EmbreeDevice, EmbreeOptions};
use glam::Vec3;
use libtest_mimic::{Arguments, Completion, Failed, Trial, run};
use rt_bvh::Builder;
use rt_conformance::is_required;
use rt_core::{
    Coherence, Device, DeviceErrorKind, Hit, Launch, Query, Ray, RayMask, RaySource, ReducedWalk, StreamSpec, Task,
    TestCounts, Ticket, Triangle, Walk,
};
use rt_report::print::note;
use rt_tests::judge::{Tally, judge};
use rt_tests::parity::trace_all;
use rt_verify::clock;
use rt_verify::rays::{Aim, RayMaker};
use rt_verify::reference::Reference;
use rt_verify::{shapes, tree};
use std::sync::Arc;
use std::time::Duration;

/// The longest a launch of these few rays may take.
const LIMIT: Duration = Duration::from_secs(60);

/// Rays of each aim on each mesh.
const RAYS: u32 = 500;

/// Share of rays that nothing aims at edges which a peer may answer wrongly. Measured: none.
const ERRORS: f64 = 0.002;

type Opened = Result<Arc<dyn Device>, String>;

type Check = fn(&dyn Device) -> Result<(), Failed>;

fn main() {
    let arguments = Arguments::from_args();
    let checks: [(&str, Check); 3] = [
        ("keeps_the_rules_of_a_tracer", keeps_the_rules_of_a_tracer),
        ("answers_for_the_triangles_and_rays_that_are_meant", answers_for_what_is_meant),
        ("bad_rays_do_no_harm", bad_rays_do_no_harm),
    ];
    let mut peers: Vec<(String, Opened)> = Vec::new();
    for backend in backend_peers::backends() {
        for threads in ["1", "2"] {
            let opened = backend.open(Some(threads)).map_err(|e| e.to_string());
            peers.push((format!("{}:{threads}", backend.name()), opened));
        }
    }
    for packets in [false, true] {
        let device = EmbreeDevice::open(EmbreeOptions { packets, ..EmbreeOptions::default() });
        let opened = device.map(|device| Arc::new(device) as Arc<dyn Device>).map_err(|e| e.to_string());
        peers.push((if packets { "embree/packets" } else { "embree/single" }.to_owned(), opened));
    }
    let mut trials = Vec::new();
    for (label, device) in peers {
        for (name, check) in checks {
            let device = device.clone();
            let test = move || match device {
                Ok(device) => check(&*device).map(|()| Completion::Completed),
                Err(e) if is_required("embree") => Err(format!("required by RT_REQUIRE, but missing: {e}").into()),
                Err(e) => Ok(Completion::ignored_with(e)),
            };
            trials.push(Trial::ignorable_test(name, test).with_kind(label.clone()));
        }
    }
    run(&arguments, trials).exit();
}

fn ensure(holds: bool, message: impl Into<String>) -> Result<(), Failed> {
    if holds { Ok(()) } else { Err(message.into().into()) }
}

fn source(rays: &[(Ray, u32)]) -> RaySource {
    let (rays, origins): (Vec<Ray>, Vec<u32>) = rays.iter().copied().unzip();
    RaySource::Explicit { rays: rays.into(), origins: Some(origins.into()) }
}

fn keeps_the_rules_of_a_tracer(device: &dyn Device) -> Result<(), Failed> {
    let triangles = shapes::grid(12, 0.2, 1);
    let scene = tree::build(&triangles, Builder::Sah)?;
    let rays = RayMaker::new(&triangles, 1).mixed(300);
    let expected = trace_all(device, &scene, &rays, StreamSpec::default())?;
    ensure(expected.iter().filter(|hit| hit.is_hit()).count() > 100, "most rays miss")?;

    let mut tracer = device.tracer(Arc::clone(&scene), clock)?;
    let kind = |answer: Result<(), rt_core::DeviceError>| answer.err().map(|e| e.kind());
    let counted = StreamSpec { counts: true, ..StreamSpec::default() };
    ensure(
        kind(tracer.load_rays(source(&rays), counted)) == Some(DeviceErrorKind::Unsupported),
        "counts are promised",
    )?;
    tracer.load_rays(source(&rays), StreamSpec::default())?;
    let mut counts = vec![TestCounts { boxes: 7, triangles: 7 }; 2];
    let mut hits = vec![Hit::MISS; 2];
    for walk in [Walk::Reduced(ReducedWalk::LeafAsHit), Walk::Full] {
        ensure(!device.info().capabilities.has_walk(walk), "a walk is promised")?;
        let walked = tracer.walk(&[0, 1], walk, &mut counts, Some(&mut hits)).map(drop);
        ensure(kind(walked) == Some(DeviceErrorKind::Unsupported), "a walk is made")?;
    }

    let beyond = tracer.submit(&[Task { first: 299, rays: 2 }], None).map(drop);
    ensure(kind(beyond) == Some(DeviceErrorKind::InvalidArgument), "a task beyond the rays is taken")?;
    let mut launch = Launch::default();
    let unknown = tracer.wait(Ticket(99), LIMIT, &mut launch);
    ensure(kind(unknown) == Some(DeviceErrorKind::InvalidArgument), "an unknown launch is waited for")?;
    let mut mask = RayMask::new(300);
    mask.insert(51);
    let tasks = [Task { first: 200, rays: 10 }, Task { first: 50, rays: 3 }];
    let tickets = [tracer.submit(&tasks, None)?, tracer.submit(&tasks, Some(&Arc::new(mask)))?];
    ensure(kind(tracer.submit(&tasks, None).map(drop)) == Some(DeviceErrorKind::InvalidArgument), "a third is taken")?;
    ensure(kind(tracer.load_rays(source(&rays), StreamSpec::default())).is_some(), "rays are replaced in flight")?;
    for (ticket, masked) in tickets.into_iter().zip([false, true]) {
        tracer.wait(ticket, LIMIT, &mut launch)?;
        let right = tasks.iter().flat_map(Task::range).zip(&launch.hits).all(|(ray, hit)| {
            let left_out = masked && ray == 51;
            *hit == if left_out { Hit::MISS } else { expected[ray as usize] }
        });
        ensure(launch.hits.len() == 13 && right, "tasks, order or mask are not kept")?;
    }

    let empty = tree::build(&[], Builder::Sah)?;
    for query in [Query::Closest, Query::Any] {
        let hits = trace_all(device, &empty, &rays, StreamSpec { query, ..StreamSpec::default() })?;
        ensure(hits.iter().all(|hit| *hit == Hit::MISS), "hits in an empty scene")?;
    }
    Ok(())
}

/// Fails when ids are positions in the leaf order, coordinates those of the normalised tree, or when limits or the
/// primitives that rays start on are not handed on, of single rays, packets or a thread's chunk: each makes a tenth of
/// the answers wrong at least.
fn answers_for_what_is_meant(device: &dyn Device) -> Result<(), Failed> {
    let mut meshes = [shapes::soup(400, 0.3, 2), shapes::grid(14, 0.2, 1), shapes::icosphere(3)];
    meshes[0].iter_mut().for_each(|t| *t = t.scaled(0.01));
    meshes[1].iter_mut().for_each(|t| *t = t.scaled(1024.0));
    // Without area, so that ids are not positions among the triangles that are traced.
    meshes[2].insert(5, Triangle::new(Vec3::ZERO, Vec3::ONE, Vec3::ONE));
    let aims = [Aim::Random, Aim::Interior, Aim::Diffuse, Aim::Shadow];
    for triangles in &meshes {
        let scene = tree::build(triangles, Builder::Sah)?;
        let maker = RayMaker::new(triangles, 9);
        let mut rays: Vec<(Ray, u32)> =
            aims.iter().flat_map(|&aim| (0..RAYS).map(move |i| maker.ray(aim, i))).collect();
        for (i, (ray, _)) in rays.iter_mut().enumerate() {
            // Segments that end before or begin behind what the ray is aimed at.
            (ray.tmin, ray.tmax) = [(0.0, ray.tmax), (0.0, 0.9), (1.1, f32::INFINITY)][i % 3];
        }
        let verdicts = Reference::new(triangles).resolve_all(&rays);
        let coherences = [Coherence::Coherent, Coherence::Incoherent];
        for (query, coherence) in [Query::Closest, Query::Any].into_iter().flat_map(|q| coherences.map(|c| (q, c))) {
            let hits = trace_all(device, &scene, &rays, StreamSpec { query, coherence, ..StreamSpec::default() })?;
            let mut tally = Tally::new();
            for ((hit, verdict), (ray, origin)) in hits.iter().zip(&verdicts).zip(&rays) {
                let finding = judge(triangles, ray, *origin, query, verdict, hit);
                tally.add(finding, || format!("{ray:?}, from {origin}: {hit:?}, {finding:?}, but {verdict:?}"));
            }
            note(format_args!("{}, {query:?}, {coherence:?}: {tally}", device.info().name));
            if tally.errors() as f64 > ERRORS * tally.rays as f64 {
                return Err(format!("{query:?}: {tally}; the first: {:?}", tally.first).into());
            }
        }
    }
    Ok(())
}

/// No crash; that they miss is our promise, not a peer's.
fn bad_rays_do_no_harm(device: &dyn Device) -> Result<(), Failed> {
    let triangles = shapes::icosphere(2);
    let scene = tree::build(&triangles, Builder::Sah)?;
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, 1e-45];
    let inside = Ray::new(Vec3::ZERO, Vec3::new(0.3, 0.5, 0.7));
    let mut rays = vec![(inside, 7), (inside, 1 << 30)];
    for value in bad {
        for place in 0..8 {
            let mut numbers: [f32; 8] = bytemuck::cast(inside);
            numbers[place] = value;
            rays.push((bytemuck::cast(numbers), u32::MAX));
        }
    }
    for query in [Query::Closest, Query::Any] {
        let coherence = Coherence::Coherent;
        let hits = trace_all(device, &scene, &rays, StreamSpec { query, coherence, ..StreamSpec::default() })?;
        let exists = |hit: &Hit| !hit.is_hit() || (hit.primitive as usize) < triangles.len();
        ensure(hits.len() == rays.len() && hits.iter().all(exists), "a triangle that does not exist is hit")?;
        ensure(hits[1].is_hit(), "a primitive that does not exist hides others")?;
    }
    Ok(())
}
