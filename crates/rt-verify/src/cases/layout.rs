//! Every box of a tree holds what is below it.

use super::built;
use crate::report::Row;
use crate::suite::Stopped;
use crate::tally::Tally;
use crate::trial::{OWN_TREES, Trial};
use crate::{Promise, shapes, tree};
use glam::Vec3;
use rt_bvh::{Builder, WideTree};
use rt_core::{Aabb, Child, Node, Triangle};

pub(super) const NAME: &str = "containment";

pub(super) fn run(trial: &Trial<'_>, rows: &mut Vec<Row>) -> Result<(), Stopped> {
    if !trial.walks_our_trees {
        let mut tally = Tally::new(NAME, "boxes of the two-wide tree", Promise::Containment);
        tally.note(OWN_TREES);
        rows.push(tally.row());
        return Ok(());
    }
    let options = trial.options();
    let far = Vec3::new(1e6, -1e6, 1e6);
    let mut meshes: Vec<(String, Vec<Triangle>)> = vec![
        ("soup".to_owned(), shapes::soup(5_000, 0.3, options.seed)),
        ("needles".to_owned(), shapes::needles(2_000, 1e-6, options.seed)),
        ("mixed scales".to_owned(), shapes::mixed_scales(2_000, options.seed)),
        ("far away".to_owned(), shapes::moved(&shapes::icosphere(4), far)),
    ];
    for model in &trial.suite.models {
        let triangles = (0..model.indices.len() as u32).filter_map(|i| model.triangle(i)).collect();
        meshes.push((model.source.clone(), triangles));
    }
    let mut tally = Tally::new(NAME, "boxes of the two-wide tree", Promise::Containment);
    let mut quantised = Tally::new(NAME, "quantised boxes of the eight-wide tree", Promise::Containment);
    for (i, (name, triangles)) in meshes.iter().enumerate() {
        // Scenes of a hundred thousand triangles by the builder asked for, small meshes by all.
        let builders = if triangles.len() > 10_000 { vec![options.builder] } else { Builder::ALL.to_vec() };
        for builder in builders {
            trial.advance(i as f64 / meshes.len() as f64)?;
            if let Some(scene) = built(tree::build(triangles, builder), &mut tally) {
                boxes(scene.nodes(), scene.triangles(), &format!("{name}, {builder}"), &mut tally);
                // Its own check decodes every box as the kernels do, in exact arithmetic.
                match WideTree::new(&scene).check() {
                    Ok(boxes) => quantised.held(boxes),
                    Err(error) => quantised.check(false, || format!("{name}, {builder}: {error}")),
                }
            }
        }
    }
    rows.extend([tally.row(), quantised.row()]);
    Ok(())
}

/// Compares every child's box with what lies below it, apart from the check that [`rt_core::Scene::new`] makes itself.
fn boxes(nodes: &[Node], triangles: &[Triangle], name: &str, tally: &mut Tally) {
    // Children come after their parents, so what is below is known when walking backwards.
    let mut below = vec![Aabb::EMPTY; nodes.len()];
    for (index, node) in nodes.iter().enumerate().rev() {
        for side in 0..2 {
            let content = match node.child(side) {
                Child::Absent => continue,
                Child::Inner(child) => below[child as usize],
                Child::Leaf { first, count } => triangles[first as usize..][..count as usize]
                    .iter()
                    .map(Triangle::bounds)
                    .fold(Aabb::EMPTY, Aabb::union),
            };
            tally.check(node.bounds[side].contains(&content), || {
                format!("{name}: node {index}, side {side}: {:?} holds {content:?}", node.bounds[side])
            });
            below[index] = below[index].union(content);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Verdict;

    // Fails when only leaves are looked at, or only one side.
    #[test]
    fn a_box_that_is_a_step_too_small_is_found() {
        let scene = tree::build(&shapes::soup(200, 0.3, 1), Builder::Sah).expect("a good mesh");
        let verdict = |nodes: &[Node]| {
            let mut tally = Tally::new(NAME, "", Promise::Containment);
            boxes(nodes, scene.triangles(), "", &mut tally);
            tally.row().verdict
        };
        assert_eq!(verdict(scene.nodes()), Verdict::Pass);
        for (index, side) in [(0, 0), (0, 1), (scene.nodes().len() - 1, 1)] {
            let mut nodes = scene.nodes().to_vec();
            nodes[index].bounds[side].max.y = nodes[index].bounds[side].max.y.next_down();
            assert_eq!(verdict(&nodes), Verdict::Fail, "node {index}, side {side}");
        }
    }
}
