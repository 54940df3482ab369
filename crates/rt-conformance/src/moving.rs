//! Cases about scenes that move.

use crate::Case;
use crate::fixtures::{self, Fixture};
use crate::need::{Need, has};
use crate::session::{Session, ensure, same_hits};
use glam::Vec3;
use rt_bvh::Builder;
use rt_core::{
    Aabb, CountedTree, Device, DeviceError, DeviceErrorKind, Launch, Precision, Query, StreamSpec, Task, Triangle,
};
use rt_verify::{shapes, tree};

pub(crate) const CASES: &[Case] = &[
    Case {
        name: "a_scene_that_moved_is_traced_as_if_made_for_it",
        needs: &[Need::DefinedBits],
        run: a_scene_that_moved_is_traced_as_if_made_for_it,
    },
    Case {
        name: "a_scene_does_not_move_under_launches",
        needs: &[Need::DefinedBits],
        run: a_scene_does_not_move_under_launches,
    },
];

/// A third of the triangles a little elsewhere; all of them far away and larger; and back.
fn moves(fixture: &Fixture) -> [Vec<Triangle>; 3] {
    let given = &fixture.triangles;
    let bounds = given.iter().fold(Aabb::EMPTY, |all, triangle| all.union(triangle.bounds()));
    let step = 0.03 * (bounds.max - bounds.min).max_element() * Vec3::new(0.4, -0.3, 1.0);
    let mut partly = given.clone();
    for triangle in partly.iter_mut().step_by(3) {
        *triangle = shapes::moved(std::slice::from_ref(triangle), step)[0];
    }
    let larger = shapes::moved(given, 2.0 * step).iter().map(|triangle| triangle.scaled(4.0)).collect();
    [partly, larger, given.clone()]
}

fn a_scene_that_moved_is_traced_as_if_made_for_it(device: &dyn Device) -> Result<(), String> {
    let plain = StreamSpec::default();
    let counted =
        StreamSpec { counted: CountedTree::Scene, ..StreamSpec::new(Query::Closest, Precision::Robust, true) };
    for fixture in fixtures::all()? {
        let mut session = Session::open(device, &fixture.scene)?;
        session.load(&fixture.rays, plain)?;
        let mut last = session.trace(&session.all(), None)?;
        for (number, triangles) in moves(fixture).iter().enumerate() {
            let what = format!("{}, moved {} times", fixture.name, number + 1);
            // A triangle may lose its area: then there is nothing to follow.
            let Some(scene) = tree::refit(&fixture.scene, triangles)? else { continue };
            match session.tracer().move_scene(scene.clone()) {
                Ok(()) => {}
                Err(error) if error.kind() == DeviceErrorKind::Unsupported => {
                    // It is as it was, its rays among it.
                    let again = session.trace(&session.all(), None)?;
                    return same_hits(&format!("{what}, which it does not follow"), &again.hits, &last.hits);
                }
                Err(error) => return Err(format!("{what}: move_scene: {error}")),
            }
            session.load(&fixture.rays, plain)?;
            last = session.trace(&session.all(), None)?;
            let anew = tree::build(triangles, Builder::Sah)?;
            same_hits(&what, &last.hits, &tree::trace(&anew, plain, &fixture.rays).0)?;
            if has(device, Need::SceneTree) {
                session.load(&fixture.rays, counted)?;
                let launch = session.trace(&session.all(), None)?;
                let (hits, counts) = tree::trace(&scene, counted, &fixture.rays);
                same_hits(&format!("{what}, counted"), &launch.hits, &hits)?;
                ensure!(launch.counts == counts, "{what}: other counts than those of the scene's tree");
            }
        }
    }
    Ok(())
}

fn a_scene_does_not_move_under_launches(device: &dyn Device) -> Result<(), String> {
    let fixture = fixtures::plain()?;
    let mut session = Session::open(device, &fixture.scene)?;
    session.load(&fixture.rays, StreamSpec::default())?;
    let whole: Launch = session.trace(&session.all(), None)?;
    let task = Task { first: 0, rays: fixture.rays.len() as u32 };
    let ticket = session.submit(&[task], None)?;
    let [partly, ..] = moves(fixture);
    let scene = tree::refit(&fixture.scene, &partly)?.ok_or("the terrain keeps its triangles")?;
    let moved: Result<(), DeviceError> = session.tracer().move_scene(scene);
    match moved.as_ref().map_err(DeviceError::kind) {
        Err(DeviceErrorKind::InvalidArgument | DeviceErrorKind::Unsupported) => {}
        _ => return Err(format!("move_scene with a launch in flight: {moved:?}, not InvalidArgument")),
    }
    let launch = session.wait(ticket, &[task])?;
    same_hits("after a move that was refused", &launch.hits, &whole.hits)
}
