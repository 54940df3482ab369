//! Cases about counted tests: those of the scene's tree must be `rt_bvh`'s own, and any must be the ray's alone.

use crate::Case;
use crate::fixtures;
use crate::need::{Need, had};
use crate::session::{Session, ensure, same_hits};
use rt_core::{CountedTree, Device, Hit, Precision, Query, ReducedWalk, StreamSpec, TestCounts, Walk};
use rt_verify::tree;

pub(crate) const CASES: &[Case] = &[
    Case {
        name: "counts_are_the_trees_own",
        needs: &[Need::SceneTree, Need::DefinedBits],
        run: counts_are_the_trees_own,
    },
    Case { name: "full_walks_agree_with_launches", needs: &[Need::Counts], run: full_walks_agree_with_launches },
    Case {
        name: "counts_do_not_depend_on_company",
        needs: &[Need::Counts, Need::ReducedWalk(ReducedWalk::LeafAsHit), Need::ReducedWalk(ReducedWalk::Unshortened)],
        run: counts_do_not_depend_on_company,
    },
    Case {
        name: "reduced_walks_count_as_the_tree_does",
        needs: &[
            Need::SceneTree,
            Need::ReducedWalk(ReducedWalk::LeafAsHit),
            Need::ReducedWalk(ReducedWalk::Unshortened),
        ],
        run: reduced_walks_count_as_the_tree_does,
    },
];

fn counts_are_the_trees_own(device: &dyn Device) -> Result<(), String> {
    for fixture in fixtures::all()? {
        for query in [Query::Closest, Query::Any] {
            let spec = StreamSpec { counted: CountedTree::Scene, ..StreamSpec::new(query, Precision::Robust, true) };
            let launch = Session::whole(device, &fixture.scene, &fixture.rays, spec)?;
            let (hits, counts) = tree::trace(&fixture.scene, spec, &fixture.rays);
            same_hits(&format!("{}, {query:?}", fixture.name), &launch.hits, &hits)?;
            first_difference(fixture.name, &launch.counts, &counts)?;
            // Counting must not change what is found.
            let plain = Session::whole(device, &fixture.scene, &fixture.rays, StreamSpec { counts: false, ..spec })?;
            if query == Query::Closest {
                same_hits(&format!("{}, not counted", fixture.name), &plain.hits, &hits)?;
            } else {
                // Where nothing is counted another layout may be traced, which may meet another of the candidates
                // first.
                candidates(fixture, &plain.hits, &hits)?;
            }
        }
    }
    Ok(())
}

/// That there is a hit where there is one, and that each is one.
fn candidates(fixture: &fixtures::Fixture, found: &[Hit], expected: &[Hit]) -> Result<(), String> {
    for (i, ((ray, origin), hit)) in fixture.rays.iter().zip(found).enumerate() {
        let sound = match fixture.triangles.get(hit.primitive as usize) {
            None => !expected[i].is_hit(),
            Some(triangle) => {
                let defined = rt_core::intersect::hit(ray, triangle, hit.primitive);
                expected[i].is_hit() && hit.primitive != *origin && defined == Some(*hit)
            }
        };
        ensure!(sound, "{}, any, not counted, ray {i}: {hit:?}; {:?} is right", fixture.name, expected[i]);
    }
    Ok(())
}

fn full_walks_agree_with_launches(device: &dyn Device) -> Result<(), String> {
    for fixture in [fixtures::plain()?, fixtures::named("needles")?] {
        let precisions = had(device, [Precision::Robust, Precision::Double]);
        for (precision, counted) in precisions.flat_map(|p| trees(device).map(move |counted| (p, counted))) {
            let mut session = Session::open(device, &fixture.scene)?;
            session.load(&fixture.rays, StreamSpec { counted, ..StreamSpec::new(Query::Closest, precision, true) })?;
            let launch = session.trace(&session.all(), None)?;
            // Scattered, backwards, and one of them twice.
            let mut rays: Vec<u32> = (0..fixture.rays.len() as u32).rev().step_by(3).collect();
            rays.push(rays[4]);
            let (counts, hits) = session.walk(&rays, Walk::Full)?;
            let of = |i: &u32| (launch.counts[*i as usize], launch.hits[*i as usize]);
            let (expected_counts, expected_hits): (Vec<_>, Vec<_>) = rays.iter().map(of).unzip();
            same_hits(fixture.name, &hits, &expected_hits)?;
            first_difference(fixture.name, &counts, &expected_counts)?;
            // The same without hits.
            let mut again = vec![TestCounts::default(); rays.len()];
            let walked = session.tracer().walk(&rays, Walk::Full, &mut again, None);
            walked.map_err(|e| format!("walk without hits: {e}"))?;
            first_difference(fixture.name, &again, &expected_counts)?;
        }
    }
    Ok(())
}

fn reduced_walks_count_as_the_tree_does(device: &dyn Device) -> Result<(), String> {
    for fixture in fixtures::all()? {
        let mut session = Session::open(device, &fixture.scene)?;
        let spec = StreamSpec { counted: CountedTree::Scene, ..StreamSpec::default() };
        session.load(&fixture.rays, spec)?;
        let rays: Vec<u32> = (0..fixture.rays.len() as u32).collect();
        let mut tests = Vec::new();
        for kind in [ReducedWalk::LeafAsHit, ReducedWalk::Unshortened] {
            let walk = Walk::Reduced(kind);
            let (counts, hits) = session.walk(&rays, walk)?;
            ensure!(hits.iter().all(|h| *h == Hit::MISS), "{}: a reduced walk reports a hit", fixture.name);
            let (_, expected) = tree::walk(&fixture.scene, walk, spec, &fixture.rays);
            first_difference(fixture.name, &counts, &expected)?;
            tests.push(counts);
        }
        never_more(fixture.name, "cut", &tests[0], &tests[1])?;
    }
    Ok(())
}

/// A ray walks alone, beside its neighbours, and beside rays that go elsewhere. Fails when what a packet visits is put
/// down to all of its rays, when an order of rays is undone wrongly, and when a walk reports a hit that is none.
fn counts_do_not_depend_on_company(device: &dyn Device) -> Result<(), String> {
    for fixture in [fixtures::plain()?, fixtures::named("sphere")?, fixtures::named("soup")?] {
        for counted in trees(device) {
            let mut session = Session::open(device, &fixture.scene)?;
            session.load(&fixture.rays, StreamSpec { counted, ..StreamSpec::default() })?;
            let all: Vec<u32> = (0..fixture.rays.len() as u32).collect();
            let mut tests = Vec::new();
            for walk in [Walk::Full, Walk::Reduced(ReducedWalk::LeafAsHit), Walk::Reduced(ReducedWalk::Unshortened)] {
                let what = format!("{}, {counted:?}, {walk:?}", fixture.name);
                let (counts, hits) = session.walk(&all, walk)?;
                let missed = hits.iter().all(|hit| *hit == Hit::MISS);
                ensure!(walk == Walk::Full || missed, "{what}: a reduced walk reports a hit");
                for (first, step) in [(0, 3), (1, 17), (5, 64)] {
                    let some: Vec<u32> = all.iter().copied().skip(first).step_by(step).rev().collect();
                    let (own_counts, own_hits) = session.walk(&some, walk)?;
                    let of = |i: &u32| (counts[*i as usize], hits[*i as usize]);
                    let (expected_counts, expected_hits): (Vec<_>, Vec<_>) = some.iter().map(of).unzip();
                    first_difference(&what, &own_counts, &expected_counts)?;
                    same_hits(&what, &own_hits, &expected_hits)?;
                }
                for i in all.iter().copied().step_by(29) {
                    first_difference(&what, &session.walk(&[i], walk)?.0, &counts[i as usize..][..1])?;
                }
                tests.push(counts);
            }
            never_more(fixture.name, "cut", &tests[1], &tests[2])?;
            never_more(fixture.name, "walked in full", &tests[0], &tests[2])?;
        }
    }
    Ok(())
}

/// Whose tests a device can count.
pub(crate) fn trees(device: &dyn Device) -> impl Iterator<Item = CountedTree> + Clone {
    let scene = device.info().capabilities.counts_scene_tree();
    core::iter::once(CountedTree::Own).chain(scene.then_some(CountedTree::Scene))
}

/// That no ray makes more tests than the same ray that is never shortened.
pub(crate) fn never_more(name: &str, how: &str, fewer: &[TestCounts], most: &[TestCounts]) -> Result<(), String> {
    let more = fewer.iter().zip(most).position(|(a, b)| a.boxes > b.boxes || a.triangles > b.triangles);
    ensure!(more.is_none(), "{name}: ray {more:?} makes more tests when it is {how}");
    Ok(())
}

pub(crate) fn first_difference(name: &str, found: &[TestCounts], expected: &[TestCounts]) -> Result<(), String> {
    ensure!(found.len() == expected.len(), "{name}: {} counts, not {}", found.len(), expected.len());
    match found.iter().zip(expected).position(|(a, b)| a != b) {
        Some(i) => Err(format!("{name}, ray {i}: {:?}, not {:?}", found[i], expected[i])),
        None => Ok(()),
    }
}
