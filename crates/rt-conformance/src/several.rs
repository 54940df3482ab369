//! Cases about several hits of a ray, and about primitives that a mask hides.

use crate::Case;
use crate::counts::{first_difference, never_more, trees};
use crate::fixtures::{self, Fixture};
use crate::need::{Need, has};
use crate::session::{Session, ensure, same_hits};
use rt_core::{
    Device, DeviceErrorKind, Hit, Precision, Query, Ray, RayMask, RaySource, ReducedWalk, Scene, StreamSpec, Walk,
    random, tasks_of,
};
use rt_verify::brute;
use std::num::NonZero;
use std::sync::Arc;

pub(crate) const CASES: &[Case] = &[
    Case {
        name: "several_hits_are_those_of_every_triangle",
        needs: &[Need::AllHits, Need::DefinedBits],
        run: several_hits_are_those_of_every_triangle,
    },
    Case {
        name: "hidden_primitives_are_passed_by",
        needs: &[Need::Masks, Need::DefinedBits],
        run: hidden_primitives_are_passed_by,
    },
    Case {
        name: "walks_of_several_hits_count_what_launches_do",
        needs: &[Need::AllHits, Need::DefinedBits, Need::Counts],
        run: walks_of_several_hits_count_what_launches_do,
    },
    Case {
        name: "walks_pass_by_hidden_primitives",
        needs: &[Need::Masks, Need::DefinedBits, Need::Counts],
        run: walks_pass_by_hidden_primitives,
    },
    Case { name: "what_it_does_not_say_it_can_it_refuses", needs: &[], run: what_it_does_not_say_it_can_it_refuses },
];

/// Places of a ray: only the nearest, fewer than many rays have hits, and more than any.
const PLACES: [u32; 3] = [1, 3, 700];

fn spec(query: Query, mask: u32) -> StreamSpec {
    StreamSpec { mask, ..StreamSpec::new(query, Precision::Robust, false) }
}

fn all(most: u32) -> Query {
    Query::All { most: NonZero::new(most).unwrap_or(NonZero::<u32>::MIN) }
}

/// All hits of each ray, by a test of every triangle.
fn hits_of(fixture: &Fixture) -> Vec<Vec<Hit>> {
    fixture.rays.iter().map(|(ray, origin)| brute::all(&fixture.triangles, ray, *origin, |_| true)).collect()
}

/// What there is for each ray in so many places, of the triangles that are shown.
fn expected(hits: &[Vec<Hit>], places: usize, shows: impl Fn(u32) -> bool) -> Vec<Hit> {
    let of = |hits: &Vec<Hit>| {
        let mut shown: Vec<Hit> = hits.iter().filter(|hit| shows(hit.primitive)).copied().collect();
        shown.resize(places, Hit::MISS);
        shown
    };
    hits.iter().flat_map(of).collect()
}

fn several_hits_are_those_of_every_triangle(device: &dyn Device) -> Result<(), String> {
    for fixture in fixtures::all()? {
        let hits = hits_of(fixture);
        for most in PLACES {
            let what = format!("{}, at most {most} hits", fixture.name);
            let expected = expected(&hits, most as usize, |_| true);
            let mut session = Session::open(device, &fixture.scene)?;
            session.load(&fixture.rays, spec(all(most), u32::MAX))?;
            let launch = session.trace(&session.all(), None)?;
            same_hits(&what, &launch.hits, &expected)?;

            // In small tasks, without every third ray.
            let mut done = RayMask::new(fixture.rays.len() as u32);
            (0..fixture.rays.len() as u32).step_by(3).for_each(|ray| done.insert(ray));
            let rest: Vec<Hit> = expected
                .chunks(most as usize)
                .enumerate()
                .flat_map(|(ray, hits)| if ray % 3 == 0 { vec![Hit::MISS; hits.len()] } else { hits.to_vec() })
                .collect();
            let tasks = tasks_of(fixture.rays.len() as u32, 7);
            let launch = session.trace(&tasks, Some(&Arc::new(done)))?;
            same_hits(&format!("{what}, in tasks of 7, some rays done"), &launch.hits, &rest)?;
        }
        if has(device, Need::Counts) {
            let counted = StreamSpec { counts: true, ..spec(all(3), u32::MAX) };
            let launch = Session::whole(device, &fixture.scene, &fixture.rays, counted)?;
            let is_hit = |hits: &[Hit]| hits.first().is_some_and(Hit::is_hit);
            let uncounted = launch
                .hits
                .chunks(3)
                .zip(&launch.counts)
                .find(|(hits, count)| is_hit(hits) && (count.triangles == 0 || count.boxes == 0));
            ensure!(uncounted.is_none(), "{}: {uncounted:?}: hits that took no test", fixture.name);
        }
    }
    Ok(())
}

/// Several hits and masks are refused by devices that lack them, and others go on as before.
fn what_it_does_not_say_it_can_it_refuses(device: &dyn Device) -> Result<(), String> {
    let fixture = fixtures::plain()?;
    let (rays, origins) = fixture.rays.iter().copied().unzip::<_, _, Vec<Ray>, Vec<u32>>();
    let source = || RaySource::Explicit { rays: rays.as_slice().into(), origins: Some(origins.as_slice().into()) };
    let (plain, masked) = (Arc::clone(&fixture.scene), masked(fixture)?);
    let asked = [(Need::AllHits, plain, spec(all(2), u32::MAX)), (Need::Masks, masked, spec(Query::Closest, u32::MAX))];
    for (_, scene, spec) in asked.into_iter().filter(|(need, ..)| !has(device, *need)) {
        let mut session = Session::open(device, &scene)?;
        match session.tracer().load_rays(source(), spec) {
            Err(error) if error.kind() == DeviceErrorKind::Unsupported => {}
            Err(error) => return Err(format!("{spec:?}: {:?} ({error}), not Unsupported", error.kind())),
            Ok(()) => return Err(format!("{spec:?}: accepted by a device that does not say it can")),
        }
        if scene.masks().is_none() {
            session.load(&fixture.rays, StreamSpec::default())?;
            session.trace(&session.all(), None)?;
        }
    }
    Ok(())
}

/// Masks of four kinds of primitives, told apart by two bits; one in five has none.
fn masked(fixture: &Fixture) -> Result<Arc<Scene>, String> {
    let mask = |id: u32| [0b0001, 0b0010, 0b0100, 0b0110, 0][random::below(5, id, 3, 0) as usize];
    let masks = (0..fixture.scene.primitive_count()).map(mask).collect();
    let scene = Scene::clone(&fixture.scene).with_masks(masks).map_err(|error| error.to_string())?;
    Ok(Arc::new(scene))
}

fn hidden_primitives_are_passed_by(device: &dyn Device) -> Result<(), String> {
    for fixture in fixtures::all()? {
        let (scene, hits) = (masked(fixture)?, hits_of(fixture));
        for mask in [0b0001, 0b0110, 0b1000, u32::MAX, 0] {
            let what = format!("{}, mask {mask:#b}", fixture.name);
            let shows = |id: u32| scene.shows(id, mask);
            let closest = Session::whole(device, &scene, &fixture.rays, spec(Query::Closest, mask))?;
            same_hits(&what, &closest.hits, &expected(&hits, 1, shows))?;
            let any = Session::whole(device, &scene, &fixture.rays, spec(Query::Any, mask))?;
            for (ray, (hit, nearest)) in any.hits.iter().zip(&closest.hits).enumerate() {
                let is_shown = !hit.is_hit() || shows(hit.primitive);
                ensure!(hit.is_hit() == nearest.is_hit() && is_shown, "{what}, any hit, ray {ray}: {hit:?}");
            }
            if has(device, Need::AllHits) {
                let several = Session::whole(device, &scene, &fixture.rays, spec(all(4), mask))?;
                same_hits(&format!("{what}, at most 4 hits"), &several.hits, &expected(&hits, 4, shows))?;
            }
        }
    }
    Ok(())
}

/// Estimates of such streams are made of walks, so these must cost what the stream does.
fn walks_of_several_hits_count_what_launches_do(device: &dyn Device) -> Result<(), String> {
    for fixture in [fixtures::plain()?, fixtures::named("soup")?, fixtures::named("layers")?] {
        let nearest = expected(&hits_of(fixture), 1, |_| true);
        for most in PLACES {
            let what = format!("{}, at most {most} hits", fixture.name);
            walks_are_the_streams(device, &what, fixture, &fixture.scene, spec(all(most), u32::MAX), &nearest)?;
        }
    }
    Ok(())
}

fn walks_pass_by_hidden_primitives(device: &dyn Device) -> Result<(), String> {
    for fixture in [fixtures::plain()?, fixtures::named("soup")?, fixtures::named("layers")?] {
        let (scene, hits) = (masked(fixture)?, hits_of(fixture));
        for mask in [0b0001, 0b0110, 0b1000, u32::MAX] {
            let nearest = expected(&hits, 1, |id| scene.shows(id, mask));
            let several = has(device, Need::AllHits).then(|| all(4));
            for query in [Some(Query::Closest), several].into_iter().flatten() {
                let what = format!("{}, mask {mask:#b}, {query:?}", fixture.name);
                walks_are_the_streams(device, &what, fixture, &scene, spec(query, mask), &nearest)?;
            }
        }
    }
    Ok(())
}

/// That full walks count what launches of the stream count, whoever else walks, and find the `nearest` hits; and that
/// reduced walks find nothing, and make no fewer tests where no hit cuts a ray.
fn walks_are_the_streams(
    device: &dyn Device,
    what: &str,
    fixture: &Fixture,
    scene: &Arc<Scene>,
    spec: StreamSpec,
    nearest: &[Hit],
) -> Result<(), String> {
    for counted in trees(device) {
        let what = format!("{what}, {counted:?}");
        let mut session = Session::open(device, scene)?;
        session.load(&fixture.rays, StreamSpec { counts: true, counted, ..spec })?;
        let launch = session.trace(&session.all(), None)?;
        // All; some of them backwards, and one of them twice; each of a few alone.
        let every: Vec<u32> = (0..fixture.rays.len() as u32).collect();
        let mut some: Vec<u32> = every.iter().copied().rev().step_by(3).collect();
        some.push(some[4]);
        let alone = every.iter().step_by(41).map(|&ray| vec![ray]);
        for rays in [every.clone(), some].into_iter().chain(alone) {
            let (counts, hits) = session.walk(&rays, Walk::Full)?;
            let of = |&ray: &u32| (launch.counts[ray as usize], nearest[ray as usize]);
            let (expected_counts, expected_hits): (Vec<_>, Vec<_>) = rays.iter().map(of).unzip();
            first_difference(&what, &counts, &expected_counts)?;
            same_hits(&what, &hits, &expected_hits)?;
        }
        for kind in [ReducedWalk::LeafAsHit, ReducedWalk::Unshortened] {
            if has(device, Need::ReducedWalk(kind)) {
                let (counts, hits) = session.walk(&every, Walk::Reduced(kind))?;
                ensure!(hits.iter().all(|hit| *hit == Hit::MISS), "{what}: a reduced walk reports a hit");
                if kind == ReducedWalk::Unshortened {
                    never_more(&what, "walked in full", &launch.counts, &counts)?;
                }
            }
        }
    }
    Ok(())
}
