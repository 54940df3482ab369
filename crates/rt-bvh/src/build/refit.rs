//! Fitting a tree to triangles that have moved.

use super::{BuildError, Tree, filled, finish, gather, reserved};
use crate::{BuildOptions, Mesh};
use alloc::sync::Arc;
use alloc::vec::Vec;
use rt_core::Scene;

/// The scene of a mesh whose triangles have moved since `scene` was built of it: the same tree with boxes that fit.
/// Hits are those of a tree built anew; how long they take depends on how far neighbours stayed together
/// ([`TreeStats::sah_cost`](crate::TreeStats)).
///
/// `None` if the mesh cannot have that tree: another number of triangles, or one that could not be hit and now can, or
/// the other way round.
///
/// # Errors
/// As for [`build`](crate::build).
pub fn refit(scene: &Scene, mesh: Mesh<'_>, options: &BuildOptions) -> Result<Option<Arc<Scene>>, BuildError> {
    let _environment = rt_fenv::Environment::enter();
    let mut gathered = gather::gather(mesh, options.invalid)?;
    // Its boxes are to come from the triangles.
    gathered.exact_references = false;
    let Some(order) = order_in(scene, &gathered)? else { return Ok(None) };
    let mut nodes = reserved(scene.nodes().len(), "the nodes of the tree")?;
    nodes.extend_from_slice(scene.nodes());
    finish(&gathered, Tree { nodes, order }).map(|scene| Some(Arc::new(scene)))
}

/// Where the triangles of a tree's leaves are among those gathered; `None` if they are others.
fn order_in(scene: &Scene, gathered: &gather::Gathered) -> Result<Option<Vec<u32>>, BuildError> {
    let ids = scene.primitives();
    if gathered.primitive_count != scene.primitive_count() || gathered.primitives.len() != ids.len() {
        return Ok(None);
    }
    let mut places = filled(u32::MAX, scene.primitive_count() as usize, "the places of triangles")?;
    for (place, &id) in (0..).zip(&gathered.primitives) {
        places[id as usize] = place;
    }
    let mut order = reserved(ids.len(), "the order of triangles")?;
    order.extend((0..ids.len()).map(|slot| places[ids.get(slot) as usize]));
    // As many as there are places, and no two alike: one without a place is one too many elsewhere.
    Ok((!order.contains(&u32::MAX)).then_some(order))
}
