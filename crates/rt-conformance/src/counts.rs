//! Cases about counted tests: they are device-independent, so they must be `rt_bvh`'s own.

use crate::Case;
use crate::fixtures;
use crate::need::{Need, had};
use crate::session::{Session, ensure, same_hits};
use rt_core::{Device, Hit, Precision, Query, ReducedWalk, StreamSpec, TestCounts, Walk};
use rt_verify::tree;

pub(crate) const CASES: &[Case] = &[
    Case {
        name: "counts_are_the_trees_own",
        needs: &[Need::SceneTree, Need::DefinedBits],
        run: counts_are_the_trees_own,
    },
    Case { name: "full_walks_agree_with_launches", needs: &[Need::Counts], run: full_walks_agree_with_launches },
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
            let spec = StreamSpec::new(query, Precision::Robust, true);
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
        for precision in had(device, [Precision::Robust, Precision::Double]) {
            let mut session = Session::open(device, &fixture.scene)?;
            session.load(&fixture.rays, StreamSpec::new(Query::Closest, precision, true))?;
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
        let spec = StreamSpec::default();
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
        let more = tests[0].iter().zip(&tests[1]).position(|(a, b)| a.boxes > b.boxes || a.triangles > b.triangles);
        ensure!(more.is_none(), "{}: ray {more:?} makes more tests when it is cut", fixture.name);
    }
    Ok(())
}

fn first_difference(name: &str, found: &[TestCounts], expected: &[TestCounts]) -> Result<(), String> {
    ensure!(found.len() == expected.len(), "{name}: {} counts, not {}", found.len(), expected.len());
    match found.iter().zip(expected).position(|(a, b)| a != b) {
        Some(i) => Err(format!("{name}, ray {i}: {:?}, not {:?}", found[i], expected[i])),
        None => Ok(()),
    }
}
