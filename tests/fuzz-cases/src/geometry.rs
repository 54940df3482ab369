//! Meshes and rays of any bits: building and tracing.

use crate::bytes::Bytes;
use glam::Vec3;
use rt_bvh::{BuildOptions, Builder, InvalidTriangles, Mesh, PlocQuality, Stack, build};
use rt_core::{
    Hit, MAX_DEPTH, Precision, Query, Ray, ReducedWalk, Scene, StreamSpec, TestCounts, Triangle, Walk, intersect,
};

/// Most triangles and rays of an input: more find nothing new and slow the search down.
const MOST: usize = 256;

/// Builds a mesh with two builders and traces rays: every hit is one, both trees and all careful kernels agree bit for
/// bit, counts do not depend on what else is asked, and no tree is deeper than a stack.
pub fn geometry(data: &[u8]) {
    let mut bytes = Bytes(data);
    let positions: Vec<Vec3> = (0..1 + usize::from(bytes.byte())).map(|_| bytes.point()).collect();
    let vertex = |bytes: &mut Bytes<'_>| u32::from(bytes.byte()) % positions.len() as u32;
    let count = usize::from(bytes.byte());
    let indices: Vec<[u32; 3]> = (0..count).map(|_| [0; 3].map(|_| vertex(&mut bytes))).collect();
    let max_leaf = u32::from(bytes.byte() % 9);
    let mesh = Mesh { positions: &positions, indices: &indices };
    let scenes = [Builder::Sah, Builder::Ploc(PlocQuality::Medium)].map(|builder| {
        let options = BuildOptions { builder, invalid: InvalidTriangles::Drop, max_leaf };
        // What is left once invalid triangles are dropped can always be built.
        build(mesh, &options).expect("indices are in range").scene
    });
    let rays: Vec<(Ray, u32)> = rays(&mut bytes);
    let [sah, ploc] = scenes.each_ref().map(|scene| {
        assert!(scene.depth() <= MAX_DEPTH);
        check(scene, &rays, &positions, &indices)
    });
    assert_eq!(bits(&sah), bits(&ploc), "hits depend on the tree");
}

fn rays(bytes: &mut Bytes<'_>) -> Vec<(Ray, u32)> {
    let mut rays = Vec::new();
    while !bytes.is_empty() && rays.len() < MOST {
        let kind = bytes.byte();
        let (origin, direction) =
            if kind & 1 == 0 { (bytes.point(), bytes.point()) } else { (bytes.vector(), bytes.vector()) };
        let mut ray = Ray::new(origin, direction);
        if kind & 2 != 0 {
            ray = ray.with_range(bytes.float(), bytes.float());
        }
        let from = if kind & 4 != 0 { u32::from(bytes.byte()) } else { u32::MAX };
        rays.push((ray, from));
    }
    rays
}

/// Traces the rays in every way and returns the nearest hits.
fn check(scene: &Scene, rays: &[(Ray, u32)], positions: &[Vec3], indices: &[[u32; 3]]) -> Vec<Hit> {
    let (closest, counts) = trace(scene, rays, Query::Closest, Precision::Robust);
    let (double, _) = trace(scene, rays, Query::Closest, Precision::Double);
    let (any, _) = trace(scene, rays, Query::Any, Precision::Robust);
    let _ = trace(scene, rays, Query::Closest, Precision::Fast);
    assert_eq!(bits(&closest), bits(&double), "robust and f64 differ");
    for (((ray, from), hit), any) in rays.iter().zip(&closest).zip(&any) {
        assert_eq!(hit.is_hit(), any.is_hit(), "{ray:?}: nearest {hit:?}, any {any:?}");
        for found in [hit, any].into_iter().filter(|found| found.is_hit()) {
            assert_ne!(found.primitive, *from, "a ray hit where it starts");
            let [a, b, c] = indices[found.primitive as usize].map(|i| positions[i as usize]);
            let again = intersect::hit(ray, &Triangle::new(a, b, c), found.primitive);
            assert_eq!(again.map(|h| bits(&[h])), Some(bits(&[*found])), "{ray:?} does not hit that triangle");
        }
    }
    let mut stack = Stack::for_scene(scene);
    for kind in [ReducedWalk::LeafAsHit, ReducedWalk::Unshortened] {
        rt_bvh::count(scene, &mut stack, Walk::Reduced(kind), Precision::Robust, rays.iter().copied(), |_, _| ());
    }
    let mut again = Vec::new();
    rt_bvh::count(scene, &mut stack, Walk::Full, Precision::Robust, rays.iter().copied(), |_, c| again.push(c));
    assert_eq!(counts, again);
    closest
}

fn trace(scene: &Scene, rays: &[(Ray, u32)], query: Query, precision: Precision) -> (Vec<Hit>, Vec<TestCounts>) {
    let spec = StreamSpec::new(query, precision, true);
    let (mut hits, mut counts) = (Vec::new(), Vec::new());
    rt_bvh::trace(scene, &mut Stack::for_scene(scene), spec, rays.iter().copied(), |hit, count| {
        hits.push(hit);
        counts.push(count);
    });
    assert_eq!(hits.len(), rays.len());
    (hits, counts)
}

fn bits(hits: &[Hit]) -> Vec<[u32; 4]> {
    bytemuck::cast_slice(hits).to_vec()
}
