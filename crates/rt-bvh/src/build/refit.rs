//! Fitting a tree to triangles that have moved.

use super::gather::{Survey, corners, is_kept, normalised};
use super::{BuildError, CHUNK, faulty, fit, parts, reserved, zeroed};
use crate::parallel::each;
use crate::{BuildOptions, Mesh};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicBool, Ordering};
use rt_core::{MovedParts, Scene, Triangle};

/// The scene of a mesh whose triangles have moved since `scene` was built of it: the same tree with boxes that fit
/// ([`Scene::has_tree_of`]). Hits are those of a tree built anew; how long they take depends on how far neighbours
/// stayed together ([`TreeStats::sah_cost`](crate::TreeStats)). With the feature `parallel` all cores work on it.
///
/// `None` if the mesh cannot have that tree: another number of triangles, or one that could not be hit and now can, or
/// the other way round.
///
/// # Errors
/// As for [`build`](crate::build).
pub fn refit(scene: &Scene, mesh: Mesh<'_>, options: &BuildOptions) -> Result<Option<Arc<Scene>>, BuildError> {
    let _environment = rt_fenv::Environment::enter();
    let survey = Survey::of(mesh, options.invalid)?;
    let Some(triangles) = moved(scene, mesh, &survey)? else { return Ok(None) };
    let mut nodes = zeroed(scene.nodes().len(), "the nodes of the tree")?;
    let copies = nodes.chunks_mut(CHUNK).zip(scene.nodes().chunks(CHUNK));
    each(copies.collect(), |(to, from)| to.copy_from_slice(from));
    fit(&mut nodes, &triangles);
    let fitted = MovedParts { nodes, triangles, scale_exponent: survey.scale_exponent };
    let scene = scene.moved(fitted, &|count, check| each(parts(count), check).into_iter().collect());
    Ok(Some(Arc::new(scene.map_err(faulty)?)))
}

/// The triangles of a tree's leaves where they are now; `None` if they are others.
fn moved(scene: &Scene, mesh: Mesh<'_>, survey: &Survey) -> Result<Option<Vec<Triangle>>, BuildError> {
    let ids = scene.primitives();
    if survey.primitive_count != scene.primitive_count() || survey.kept() != ids.len() {
        return Ok(None);
    }
    let mut seen = reserved(survey.primitive_count as usize, "the triangles that were found")?;
    seen.resize_with(survey.primitive_count as usize, || AtomicBool::new(false));
    let mut triangles = zeroed(ids.len(), "the triangles in the tree's order")?;
    let places = triangles.chunks_mut(CHUNK).zip((0..).step_by(CHUNK));
    let same = each(places.collect(), |(places, first)| {
        (first..).zip(places).all(|(slot, place)| {
            let id = ids.get(slot) as usize;
            let triangle = corners(mesh.positions, &mesh.indices[id]);
            *place = normalised(&triangle, survey.scale_exponent);
            // As many ids as triangles that can be hit: if no two are alike, one that has none is one too many here.
            is_kept(&triangle) && !seen[id].swap(true, Ordering::Relaxed)
        })
    });
    Ok(same.into_iter().all(|same| same).then_some(triangles))
}
