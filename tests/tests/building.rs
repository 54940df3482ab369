//! Trees do not depend on how many threads build them.

use rt_bvh::{BuildOptions, Builder, Mesh, build};
use rt_core::{Scene, Triangle};
use rt_verify::shapes;
use std::sync::Arc;

/// More triangles than builders give to one thread, some of them twice: where there is nothing to choose by, whoever
/// comes first could win.
fn triangles() -> Vec<Triangle> {
    let mut all = shapes::soup(50_000, 0.02, 1);
    let doubled: Vec<_> = all[..10_000].iter().map(|t| Triangle::new(t.b, t.c, t.a)).collect();
    all.extend(doubled);
    all
}

fn built_by(threads: usize, triangles: &[Triangle], builder: Builder) -> Arc<Scene> {
    let positions: Vec<_> = triangles.iter().flat_map(|t| t.vertices()).collect();
    let indices: Vec<_> = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a few threads");
    let mesh = Mesh { positions: &positions, indices: &indices };
    let built = pool.install(|| build(mesh, &BuildOptions { builder, ..BuildOptions::default() })).expect("valid");
    assert_eq!(built.report.threads, threads, "the builders' feature `parallel` is on");
    built.scene
}

/// Fails when subtrees come in the order in which threads end; a sum of costs is taken in an order that depends on the
/// threads; equal entries are sorted without their numbers; a work item is as large as there are threads.
#[test]
fn trees_are_the_same_bits_whatever_the_number_of_threads() {
    let triangles = triangles();
    for &builder in Builder::ALL {
        let one = built_by(1, &triangles, builder);
        for threads in [2, 3] {
            let many = built_by(threads, &triangles, builder);
            let same = |a: &[u8], b: &[u8], what: &str| assert!(a == b, "{builder}, {threads} threads: {what} differ");
            same(bytemuck::cast_slice(one.nodes()), bytemuck::cast_slice(many.nodes()), "nodes");
            same(bytemuck::cast_slice(one.triangles()), bytemuck::cast_slice(many.triangles()), "triangles");
            let ids = |scene: &Scene| (0..triangles.len()).map(|i| scene.primitives().get(i)).collect::<Vec<_>>();
            assert_eq!(ids(&one), ids(&many), "{builder}, {threads} threads: ids");
        }
    }
}
