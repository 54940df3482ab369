//! Several meshes as one scene.

use super::{BuildError, Built, build, faulty, reserved};
use crate::{BuildOptions, Mesh};
use alloc::sync::Arc;
use alloc::vec::Vec;
use glam::Vec3;

/// Builds one scene of several meshes, which are its geometries: [`Scene::geometry_of`](rt_core::Scene::geometry_of)
/// tells mesh and triangle of a hit. Primitive ids count the triangles of one mesh after the other, also in errors
/// about coordinates. Vertices and indices are copied once.
///
/// # Errors
/// As for [`build`], and [`BuildError::IndexInMesh`] when an index is not below the number of its mesh's positions.
pub fn build_meshes(meshes: &[Mesh<'_>], options: &BuildOptions) -> Result<Built, BuildError> {
    let sum = |count: fn(&Mesh<'_>) -> usize| meshes.iter().map(count).sum::<usize>();
    let triangles = sum(|mesh| mesh.indices.len());
    if u32::try_from(triangles).is_err() || u32::try_from(sum(|mesh| mesh.positions.len())).is_err() {
        return Err(BuildError::TooManyTriangles { triangles });
    }
    let mut positions: Vec<Vec3> = reserved(sum(|mesh| mesh.positions.len()), "the vertices of all meshes")?;
    let mut indices: Vec<[u32; 3]> = reserved(triangles, "the indices of all meshes")?;
    let mut firsts = reserved(meshes.len(), "the first primitives of meshes")?;
    for (mesh, &Mesh { positions: own, indices: corners }) in (0..).zip(meshes) {
        let (offset, first) = (positions.len() as u32, indices.len());
        let vertices = own.len();
        for (triangle, corners) in (0..).zip(corners) {
            if let Some(&index) = corners.iter().find(|&&index| index as usize >= vertices) {
                return Err(BuildError::IndexInMesh { mesh, triangle, index, vertices });
            }
            // Below the number of all vertices.
            indices.push(corners.map(|index| index + offset));
        }
        positions.extend_from_slice(own);
        firsts.push(first as u32);
    }
    let Built { scene, report } = build(Mesh { positions: &positions, indices: &indices }, options)?;
    // Nobody else has it yet, so nothing is copied.
    let scene = Arc::unwrap_or_clone(scene).with_geometries(firsts).map_err(faulty)?;
    Ok(Built { scene: Arc::new(scene), report })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Stack;
    use rt_core::{Hit, Ray, StreamSpec};

    /// Mutants: indices without the vertices of the meshes before; geometries counted by vertices; an index that only
    /// another mesh has.
    #[test]
    fn hits_name_mesh_and_triangle() {
        let wall = |z: f32| [[0.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.0, z], [0.0, 1.0, z]];
        let (near, far) = (wall(1.0), wall(2.0));
        let quad = [[0, 1, 2], [0, 2, 3]];
        let meshes = [Mesh::of_arrays(&far, &quad), Mesh::default(), Mesh::of_arrays(&near, &quad[1..])];
        let scene = build_meshes(&meshes, &BuildOptions::default()).expect("valid").scene;
        let hit = |x: f32, y: f32| {
            let mut hit = Hit::MISS;
            let ray = Ray::new(Vec3::new(x, y, 0.0), Vec3::Z);
            let mut stack = Stack::for_scene(&scene);
            let spec = StreamSpec::default();
            crate::trace(&scene, &mut stack, spec, core::iter::once((ray, u32::MAX)), |found, _| hit = found);
            (hit.t, scene.geometry_of(hit.primitive))
        };
        assert_eq!(hit(0.9, 0.1), (2.0, Some((0, 0))));
        assert_eq!(hit(0.1, 0.9), (1.0, Some((2, 0))));
        assert_eq!(hit(2.0, 2.0), (f32::INFINITY, None));
        let beyond = [[0, 1, 4]];
        let wrong = build_meshes(&[meshes[0], Mesh::of_arrays(&near, &beyond)], &BuildOptions::default());
        assert_eq!(wrong.err(), Some(BuildError::IndexInMesh { mesh: 1, triangle: 0, index: 4, vertices: 4 }));
        let none = build_meshes(&[], &BuildOptions::default()).expect("an empty scene").scene;
        assert_eq!((none.geometries().next(), none.geometries().len()), (Some(0..0), 1));
    }
}
