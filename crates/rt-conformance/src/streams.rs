//! Cases about streams, tasks and masks: results do not depend on how a stream is cut.

use crate::Case;
use crate::fixtures;
use crate::need::{Need, counted, had, has};
use crate::session::{Session, ensure, same_hits};
use glam::Vec3;
use rt_core::bounce::{Aim, Departure, Scatter, Surfaces, basis};
use rt_core::{
    BounceRays, Camera, CameraRays, Device, Hit, Node, Precision, Query, Ray, RayMask, RaySource, ReducedWalk, Scene,
    SceneParts, StreamSpec, Task, TestCounts, Walk, morton, random, tasks_of,
};
use std::sync::Arc;

pub(crate) const CASES: &[Case] = &[
    Case { name: "any_split_gives_the_same_bits", needs: &[], run: any_split_gives_the_same_bits },
    Case { name: "only_asked_tasks_come_back", needs: &[], run: only_asked_tasks_come_back },
    Case { name: "masked_rays_are_left_out", needs: &[], run: masked_rays_are_left_out },
    Case { name: "rays_can_be_replaced", needs: &[], run: rays_can_be_replaced },
    Case { name: "camera_rays_equal_explicit_rays", needs: &[], run: camera_rays_equal_explicit_rays },
    Case { name: "getting_ready_changes_nothing", needs: &[], run: getting_ready_changes_nothing },
    Case { name: "bounce_rays_equal_explicit_rays", needs: &[], run: bounce_rays_equal_explicit_rays },
    Case { name: "nothing_is_an_answer_to_nothing", needs: &[], run: nothing_is_an_answer_to_nothing },
];

fn any_split_gives_the_same_bits(device: &dyn Device) -> Result<(), String> {
    let fixture = fixtures::plain()?;
    let mut session = Session::open(device, &fixture.scene)?;
    session.load(&fixture.rays, counted(device))?;
    let rays = fixture.rays.len() as u32;
    let whole = session.trace(&session.all(), None)?;
    for (seed, task_size) in [(0, 1), (1, 7), (2, 64), (3, 100), (4, rays)] {
        let mut tasks = tasks_of(rays, task_size);
        // Some order, and launches of one to five tasks.
        tasks.sort_by_key(|task| random::pcg3d([task.first, seed, 0]));
        let mut hits = vec![Hit::MISS; rays as usize];
        let mut counts = vec![TestCounts::default(); whole.counts.len()];
        let mut open = &tasks[..];
        while !open.is_empty() {
            let (now, later) = open.split_at(open.len().min(1 + random::below(5, seed, open.len() as u32, 1) as usize));
            open = later;
            let launch = session.trace(now, None)?;
            let indices = || now.iter().flat_map(Task::range).map(|index| index as usize);
            indices().zip(&launch.hits).for_each(|(index, hit)| hits[index] = *hit);
            indices().zip(&launch.counts).for_each(|(index, count)| counts[index] = *count);
        }
        same_hits(&format!("tasks of {task_size} rays"), &hits, &whole.hits)?;
        ensure!(counts == whole.counts, "tasks of {task_size} rays: other counts than in one launch");
    }
    Ok(())
}

fn only_asked_tasks_come_back(device: &dyn Device) -> Result<(), String> {
    let fixture = fixtures::plain()?;
    let mut session = Session::open(device, &fixture.scene)?;
    session.load(&fixture.rays, counted(device))?;
    let whole = session.trace(&session.all(), None)?;
    let slice = |task: &Task| whole.hits[task.first as usize..][..task.rays as usize].to_vec();
    // Out of order, with a gap, an empty one, and one named twice.
    let [a, b, c] = [(130, 31), (10, 5), (200, 0)].map(|(first, rays)| Task { first, rays });
    for tasks in [&[a, b][..], &[b, a], &[b], &[c, b], &[b, a, b]] {
        let launch = session.trace(tasks, None)?;
        let expected: Vec<Hit> = tasks.iter().flat_map(slice).collect();
        same_hits(&format!("{tasks:?}"), &launch.hits, &expected)?;
    }
    Ok(())
}

/// Before rays are loaded and after, for this stream and others, for walks that the device has or not. Fails when a
/// kernel that only gets ready writes where results go, or the loaded rays are lost.
fn getting_ready_changes_nothing(device: &dyn Device) -> Result<(), String> {
    let fixture = fixtures::plain()?;
    let whole = Session::whole(device, &fixture.scene, &fixture.rays, counted(device))?;
    let walks = [
        None,
        Some(Walk::Full),
        Some(Walk::Reduced(ReducedWalk::LeafAsHit)),
        Some(Walk::Reduced(ReducedWalk::Unshortened)),
    ];
    let other = RaySource::Explicit { rays: [Ray::new(Vec3::ZERO, Vec3::X)].into(), origins: None };
    let mut session = Session::open(device, &fixture.scene)?;
    let prepare = |session: &mut Session| {
        for (walk, query) in walks.into_iter().flat_map(|walk| [(walk, Query::Closest), (walk, Query::Any)]) {
            session.tracer().prepare(&other, StreamSpec { query, ..counted(device) }, walk);
        }
    };
    prepare(&mut session);
    session.load(&fixture.rays, counted(device))?;
    prepare(&mut session);
    let found = session.trace(&session.all(), None)?;
    same_hits("after getting ready", &found.hits, &whole.hits)?;
    ensure!(found.counts == whole.counts, "after getting ready: other counts");
    Ok(())
}

fn masked_rays_are_left_out(device: &dyn Device) -> Result<(), String> {
    let fixture = fixtures::plain()?;
    let mut session = Session::open(device, &fixture.scene)?;
    session.load(&fixture.rays, counted(device))?;
    let rays = fixture.rays.len() as u32;
    let whole = session.trace(&session.all(), None)?;
    let tasks = [Task { first: 100, rays: 90 }, Task { first: 3, rays: 65 }];
    let none = |_| false;
    let all = |_| true;
    let some = |i: u32| i.is_multiple_of(3) || (60..70).contains(&i);
    for (name, masked) in [("none", &none as &dyn Fn(u32) -> bool), ("some", &some), ("all", &all)] {
        let mut mask = RayMask::new(rays);
        (0..rays).filter(|&i| masked(i)).for_each(|i| mask.insert(i));
        let launch = session.trace(&tasks, Some(&Arc::new(mask)))?;
        let indices: Vec<u32> = tasks.iter().flat_map(Task::range).collect();
        let of = |i: &u32| if masked(*i) { Hit::MISS } else { whole.hits[*i as usize] };
        same_hits(&format!("{name} masked"), &launch.hits, &indices.iter().map(of).collect::<Vec<_>>())?;
        let traced = |(i, count): (&u32, &TestCounts)| masked(*i) && *count != TestCounts::default();
        ensure!(!indices.iter().zip(&launch.counts).any(traced), "{name} masked: a masked ray was traced");
    }
    // A mask shorter than the stream masks nothing beyond its end.
    let launch = session.trace(&session.all(), Some(&Arc::new(RayMask::new(10))))?;
    same_hits("short mask", &launch.hits, &whole.hits)
}

fn rays_can_be_replaced(device: &dyn Device) -> Result<(), String> {
    let fixture = fixtures::plain()?;
    let mut session = Session::open(device, &fixture.scene)?;
    let [few, many] = [&fixture.rays[..50], &fixture.rays[20..]];
    for (rays, spec) in [
        (few, counted(device)),
        (many, counted(device)),
        (few, StreamSpec { counts: false, ..counted(device) }),
        (many, StreamSpec { query: Query::Any, ..counted(device) }),
        (&[][..], counted(device)),
        (few, counted(device)),
    ] {
        session.load(rays, spec)?;
        let again = session.trace(&session.all(), None)?;
        let fresh = Session::whole(device, &fixture.scene, rays, spec)?;
        same_hits(&format!("{} rays, {spec:?}", rays.len()), &again.hits, &fresh.hits)?;
        ensure!(again.counts == fresh.counts, "{} rays, {spec:?}: other counts than on a new tracer", rays.len());
    }
    Ok(())
}

fn camera_rays_equal_explicit_rays(device: &dyn Device) -> Result<(), String> {
    let fixture = fixtures::plain()?;
    let camera = Camera::look_at(Vec3::new(0.3, 1.1, 1.7), Vec3::new(0.5, 0.1, 0.4), Vec3::Y, 55.0);
    let camera = camera.map_err(|e| e.to_string())?;
    for (samples, part) in [(1, 0..384), (3, 40..301)] {
        let pixels: Arc<[u32]> = morton::pixel_order(24, 16)[part].into();
        let made = Arc::new(CameraRays {
            camera,
            size: [24, 16],
            pixels,
            samples,
            first_sample: 0,
            all_samples: samples,
            seed: 5,
        });
        let rays: Vec<(Ray, u32)> = (0..made.len()).map(|i| (made.ray(i), u32::MAX)).collect();
        let explicit = Session::whole(device, &fixture.scene, &rays, counted(device))?;
        ensure!(explicit.hits.iter().any(Hit::is_hit), "the camera looks past the scene");
        let mut session = Session::open(device, &fixture.scene)?;
        session.load_source(RaySource::Camera(made), counted(device))?;
        for task_size in [u32::MAX, 100] {
            let launch = session.trace(&tasks_of(rays.len() as u32, task_size), None)?;
            same_hits(&format!("{samples} samples"), &launch.hits, &explicit.hits)?;
            ensure!(launch.counts == explicit.counts, "{samples} samples: other counts than for explicit rays");
        }
    }
    Ok(())
}

fn bounce_rays_equal_explicit_rays(device: &dyn Device) -> Result<(), String> {
    let mut hit = false;
    for name in ["terrain", "soup", "sphere", "plane", "needles", "mixed scales", "far away", "tiny", "huge"] {
        let fixture = fixtures::named(name)?;
        let surfaces = Arc::new(Surfaces::new(Arc::clone(&fixture.scene)));
        let middle = Vec3::new(0.48, 0.6, 0.64);
        let (tangent, bitangent) = basis(middle);
        let sun = Aim::Disc { middle, radii: [tangent * 0.1, bitangent * 0.1] };
        // A triangle that there is not, among others.
        let number = |i: usize| if i == 7 { u32::MAX - 1 } else { i as u32 % fixture.triangles.len() as u32 };
        let behind = |i: usize| i.is_multiple_of(3);
        let hit_at = |i: usize| Hit { t: 1.0, u: 0.25, v: i as f32 / 400.0, primitive: number(i) };
        let departures: Arc<[Departure]> =
            (0..200).filter_map(|i| Departure::new(&hit_at(i), behind(i), 2 * i as u32)).collect();
        for aim in [Aim::Cosine, sun] {
            let scatter = Scatter { aim, seed: 4, samples: 3, first_group: 50, bounce: 1 };
            let made = BounceRays { surfaces: Arc::clone(&surfaces), departures: Arc::clone(&departures), scatter };
            let rays: Vec<(Ray, u32)> = (0..made.len()).map(|i| made.ray(i)).collect();
            let explicit = Session::whole(device, &fixture.scene, &rays, counted(device))?;
            hit |= explicit.hits.iter().any(Hit::is_hit);
            let mut session = Session::open(device, &fixture.scene)?;
            session.load_source(RaySource::Bounce(Arc::new(made)), counted(device))?;
            let launch = session.trace(&tasks_of(rays.len() as u32, 90), None)?;
            same_hits(name, &launch.hits, &explicit.hits)?;
            ensure!(launch.counts == explicit.counts, "{name}: other counts than for explicit rays");
        }
    }
    ensure!(hit, "no ray hits anything");
    Ok(())
}

fn nothing_is_an_answer_to_nothing(device: &dyn Device) -> Result<(), String> {
    let parts = SceneParts { nodes: vec![Node::EMPTY], ..SceneParts::default() };
    let empty = Arc::new(Scene::new(parts).map_err(|e| e.to_string())?);
    let fixture = fixtures::plain()?;
    for query in [Query::Closest, Query::Any] {
        for precision in had(device, Precision::ALL) {
            let spec = StreamSpec { query, precision, ..counted(device) };
            let launch = Session::whole(device, &empty, &fixture.rays, spec)?;
            ensure!(launch.hits.iter().all(|h| *h == Hit::MISS), "{query:?}, {precision:?}: hits in an empty scene");
        }
    }
    for scene in [&empty, &fixture.scene] {
        let mut session = Session::open(device, scene)?;
        // Before any rays were loaded, with none, and with some.
        session.trace(&[], None)?;
        session.load(&[], counted(device))?;
        session.trace(&[], None)?;
        session.trace(&[Task { first: 0, rays: 0 }], None)?;
        if has(device, Need::Counts) {
            session.walk(&[], Walk::Full)?;
        }
        session.load(&fixture.rays, counted(device))?;
        session.trace(&[], None)?;
        session.trace(&[Task { first: fixture.rays.len() as u32, rays: 0 }], None)?;
    }
    Ok(())
}
